// The server makes this module of `web/languages/fr.ftl` (`server/dashboard/src/http/assets.rs`).

/** The language's messages, in Fluent. */
export const text: string;
