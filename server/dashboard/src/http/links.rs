//! The surgeon's link, as text and as a QR code for a tablet's camera.

use axum::http::HeaderMap;
use axum::http::header::HOST;
use qrcode::QrCode;
use qrcode::render::svg;

use super::App;
use super::error::Error;
use super::security::is_loopback_name;
use parfocal_trial::role::Role;

/// The link that lets a browser in as the surgeon. It has the host name that the operator's browser used, unless a
/// tablet cannot reach the server by that name.
///
/// In a session of a study the link is valid only for that session, and only somebody who is `signed_in` gets it.
pub fn surgeon_link(app: &App, headers: &HeaderMap, signed_in: bool) -> String {
    let host = tablets_host(app, headers);
    let key = match app.linked_session() {
        Some(session) if signed_in => app.keys.of_session(session),
        _ => app.keys.of(Role::Surgeon).to_owned(),
    };
    app.address.link_by(&host, &key)
}

/// Address of the page that helps a tablet to trust the server; `None` if it need not.
pub(super) fn trust_page(app: &App, headers: &HeaderMap) -> Option<String> {
    app.address.trust_page_by(&tablets_host(app, headers))
}

/// The host name that the request was sent to.
pub(super) fn asked_host(headers: &HeaderMap) -> Option<&str> {
    headers.get(HOST).and_then(|host| host.to_str().ok())
}

/// The host name that the request was sent to, or one by which a tablet can reach the server if that is a loopback
/// name.
fn tablets_host(app: &App, headers: &HeaderMap) -> String {
    let asked = asked_host(headers).filter(|host| !is_loopback_name(host));
    asked.map_or_else(|| app.address.host(), str::to_owned)
}

/// `link` as a QR code, for embedding in a page: an `<svg>` element.
///
/// # Errors
/// If the link is too long for a QR code.
pub fn qr_svg(link: &str) -> Result<String, Error> {
    let code = QrCode::new(link).map_err(|_| Error::Internal)?;
    let picture = code.render::<svg::Color<'_>>().quiet_zone(false).min_dimensions(132, 132).build();
    // Whatever precedes the element is needed only in a file.
    Ok(picture.find("<svg").map_or_else(String::new, |start| picture[start..].to_owned()))
}
