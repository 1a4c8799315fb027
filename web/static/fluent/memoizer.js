// @ts-nocheck
// From @fluent/bundle 0.19.1, Mozilla Foundation and contributors, Apache License 2.0 (LICENSE-APACHE).
const cache = new Map();
export function getMemoizerForLocale(locales) {
    const stringLocale = Array.isArray(locales) ? locales.join(" ") : locales;
    let memoizer = cache.get(stringLocale);
    if (memoizer === undefined) {
        memoizer = new Map();
        cache.set(stringLocale, memoizer);
    }
    return memoizer;
}
