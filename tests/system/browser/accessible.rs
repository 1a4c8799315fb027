//! Whether everyone can use a page: the faults that axe-core finds, and whether tap targets are large enough for gloved
//! fingers. Called for every state of every page that gets a screenshot.

use std::path::Path;

use serde_json::{Value, json};

use super::driver::{Browser, Driver};
use super::theatre;

/// Where `.ci/setup test` puts axe-core, by Deque. Only the tests use it; it is not shipped.
const AXE: &str = "web/node_modules/axe-core/axe.min.js";

/// Each violation of a rule, with the elements that break it and what to do.
const VIOLATIONS: &str = "const { violations } = await axe.run(document, { resultTypes: ['violations'] });
    return violations.map(({ id, help, nodes }) => {
        const where = nodes.map(({ target, failureSummary }) => `${target.join(' ')}: ${failureSummary}`);
        return `${id} (${help})\\n    ` + where.join('\\n    ');
    });";

/// Smallest side of a tap target on the surgeon's page, in CSS pixels: large enough for gloves.
const TOUCH: f64 = 48.0;

/// Finds tap targets that are smaller. The label of a box or a point is tapped as a whole.
const SMALL: &str = "const open = document.querySelector('dialog[open]') ?? document;
    const tapped = open.querySelectorAll('button, a, summary, textarea, [role=slider], label:has(input)');
    const small = [];
    for (const element of tapped) {
        if (!element.checkVisibility({ visibilityProperty: true })) continue;
        const { width, height } = element.getBoundingClientRect();
        if (Math.min(width, height) < arguments[0] - 0.01) {
            small.push(`${element.outerHTML.slice(0, 120)}: ${width.toFixed(1)} x ${height.toFixed(1)}`);
        }
    }
    return small;";

/// Finds elements beyond the page's sides, text that its box cuts off, and controls that overlap.
const UNREACHABLE: &str = "const open = document.querySelector('dialog[open]') ?? document.body;
    const shown = (element) => element.checkVisibility({ visibilityProperty: true });
    const name = (element) => element.outerHTML.slice(0, 120);
    const beyond = (element) => {
        const { left, right, width } = element.getBoundingClientRect();
        return width > 1 && (left < -1 || right > innerWidth + 1);
    };
    const cuts = (element) => {
        const { overflowX, overflowY } = getComputedStyle(element);
        const wide = overflowX === 'hidden' && element.scrollWidth > element.clientWidth + 1;
        const high = overflowY === 'hidden' && element.scrollHeight > element.clientHeight + 1;
        return wide || high;
    };
    const drawn = '.view, .view *, .traces, .traces *, .visually-hidden, .scroll *, svg, svg *';
    const elements = [...open.querySelectorAll('*')].filter((one) => shown(one) && !one.matches(drawn));
    const found = [];
    for (const element of elements) {
        if (beyond(element)) found.push('beyond the side: ' + name(element));
        if (cuts(element)) found.push('cut off: ' + name(element));
    }

    const controls = elements.filter((one) => one.matches('button, a, select, textarea, summary, input:not([type=radio])'));
    const apart = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1 || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
    // What stands over the picture scrolls there, so it lies on nothing.
    const scrolled = (one) => one.closest('.panel, .overlay-menu > div');
    controls.forEach((one, index) => {
        for (const other of controls.slice(index + 1)) {
            if (scrolled(one) !== scrolled(other)) continue;
            if (!apart(one.getBoundingClientRect(), other.getBoundingClientRect())) {
                found.push(`on each other: ${name(one)} and ${name(other)}`);
            }
        }
    });
    return found;";

/// Panics if axe-core finds a fault in the page, which shows the state `name`.
pub async fn check(browser: &Browser, name: &str) {
    none(&format!("axe-core finds fault with {name}"), &violations(browser).await);
}

/// Panics if something on the surgeon's page is too small to be tapped in gloves.
pub async fn check_targets(browser: &Browser, name: &str) {
    none(&format!("too small to be tapped in gloves, in {name}"), &small(browser).await);
}

/// Panics if something on the page, which shows the state `name`, cannot be read or reached.
pub async fn check_reach(browser: &Browser, name: &str) {
    none(&format!("not to be read or reached, in {name}"), &unreachable(browser).await);
}

async fn violations(browser: &Browser) -> Vec<String> {
    if browser.run("return typeof axe", &[]).await != "object" {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(AXE);
        let axe = std::fs::read_to_string(&file)
            .unwrap_or_else(|error| panic!("{}: {error}; run .ci/setup test", file.display()));
        browser.run(&axe, &[]).await;
    }
    lines(&browser.run(&format!("return (async () => {{ {VIOLATIONS} }})()"), &[]).await)
}

async fn small(browser: &Browser) -> Vec<String> {
    lines(&browser.run(SMALL, &[json!(TOUCH)]).await)
}

async fn unreachable(browser: &Browser) -> Vec<String> {
    lines(&browser.run(UNREACHABLE, &[]).await)
}

fn lines(value: &Value) -> Vec<String> {
    value.as_array().unwrap().iter().map(|line| line.as_str().unwrap().to_owned()).collect()
}

fn none(what: &str, found: &[String]) {
    assert!(found.is_empty(), "{what}:\n{}", found.join("\n"));
}

#[tokio::test(flavor = "multi_thread")]
async fn elements_that_nobody_can_use_are_found() {
    // A picture without words, a button beyond the side, a small link on another button, and text that is cut off.
    const SPOIL: &str = "const add = (tag, text, style, more = {}) => {
            const element = Object.assign(document.createElement(tag), { textContent: text, ...more });
            Object.assign(element.style, style);
            document.body.append(element);
        };
        const at = (left, top, more) => ({ position: 'fixed', left: `${left}px`, top: `${top}px`, ...more });
        add('img', '', {}, { src: 'data:,' });
        add('button', 'Beyond', at(-9, 300));
        add('button', 'Below', at(90, 400), { id: 'low' });
        add('a', 'On', at(99, 410, { width: '20px', height: '20px' }), { href: '/' });
        add('p', 'Cut off in the middle', { width: '20px', overflow: 'hidden', whiteSpace: 'nowrap' });";

    let driver = Driver::start();
    let server = theatre::server();
    let page = driver.browser().await;
    page.open(&server.link("surgeon")).await;
    page.sees("#panel", "No trial is under way").await;
    assert_eq!((violations(&page).await, small(&page).await), (vec![], vec![]));

    page.run(SPOIL, &[]).await;
    let has = |found: &[String], word: &str| found.iter().any(|line| line.contains(word));
    assert!(has(&violations(&page).await, "image-alt"));
    let small = small(&page).await;
    assert!(has(&small, "20.0 x 20.0") && !has(&small, "Below"), "{small:?}");
    let unreachable = unreachable(&page).await;
    for found in ["beyond the side: <button", "cut off: <p", "on each other: <button id=\"low\""] {
        assert!(has(&unreachable, found), "{found} is not among {unreachable:?}");
    }
}
