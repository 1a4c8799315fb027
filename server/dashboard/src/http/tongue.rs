//! The language of an answer. A surgeon's pages speak that of the session under way. A tablet remembers it in a cookie
//! that its page sets, so that it also reads in it what comes before and after. All other pages are in English.

use axum::extract::Request;
use axum::http::HeaderMap;

use super::App;
use super::credentials::cookie;
use parfocal_language::Language;

/// The cookie in which a tablet remembers its language (`web/static/surgeon/languages.js`).
const COOKIE: &str = "parfocal-language";

/// Beginnings of the paths that a surgeon's tablet asks for.
const OF_TABLETS: [&str; 4] = ["/surgeon", "/api/surgeon", "/tablet", "/enter"];

/// The language in which the tablet last showed a session.
fn remembered(headers: &HeaderMap) -> Option<Language> {
    cookie(headers, COOKIE).and_then(Language::from_code)
}

/// The language of an answer to `request`: the one that its tablet remembers; English if it is no tablet's.
pub(super) fn of_tablet(request: &Request) -> Language {
    let path = request.uri().path();
    let is_tablets = path == "/" || OF_TABLETS.iter().any(|beginning| path.starts_with(beginning));
    if is_tablets { remembered(request.headers()).unwrap_or_default() } else { Language::default() }
}

/// The language of a page for surgeons: that of the session under way; without one, the one that the tablet remembers.
pub(super) fn of_page(app: &App, headers: &HeaderMap) -> Language {
    let of_session = app.surgeon_view.borrow().as_ref().map(|view| view.language);
    of_session.or_else(|| remembered(headers)).unwrap_or_default()
}

/// The language of the page for a tablet that is no longer let in: its own, whatever session is under way by now.
pub(super) fn of_former_tablet(app: &App, headers: &HeaderMap) -> Language {
    remembered(headers).unwrap_or_else(|| of_page(app, headers))
}
