//! Decides which tablets may see the session on the screens as the surgeon.

use super::App;
use super::credentials::Pass;
use super::error::Error;

/// Checks whether a tablet with `pass` may see the session on the screens. A link to a session works until the operator
/// takes the session off the screens, so that the tablet can show that it has ended. The link lets in no new browser
/// once the session has ended.
///
/// # Errors
/// If the session of the pass is no longer on the screens, or the session on the screens has its own link.
pub(super) fn admit(app: &App, pass: Pass) -> Result<(), Error> {
    match (pass, app.study_session()) {
        (Pass::Shared, None) => Ok(()),
        (Pass::Shared, Some(_)) => Err(Error::NeedsSessionLink),
        (Pass::Session(own), Some(shown)) if own == shown => Ok(()),
        (Pass::Session(_), _) => Err(Error::SessionOver),
    }
}

/// Waits until a tablet with `pass` is no longer admitted; returns the reason.
pub(super) async fn no_longer_admitted(app: &App, pass: Pass) -> Error {
    let mut views = app.operator_view.clone();
    loop {
        if let Err(error) = admit(app, pass) {
            return error;
        }
        if views.changed().await.is_err() {
            return std::future::pending().await;
        }
    }
}
