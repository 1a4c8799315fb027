//! Which tablets may see the session on the screens as the surgeon.

use super::App;
use super::credentials::Pass;
use super::error::Error;

/// Whether a tablet with `pass` may see the session on the screens. The link to a session lasts until the operator has
/// closed it, so that the tablet can say that it has ended; nobody new is let in by then.
///
/// # Errors
/// When the session that the pass is for is over, or the one on the screens has a link of its own.
pub(super) fn admit(app: &App, pass: Pass) -> Result<(), Error> {
    match (pass, app.study_session()) {
        (Pass::Shared, None) => Ok(()),
        (Pass::Shared, Some(_)) => Err(Error::NeedsSessionLink),
        (Pass::Session(own), Some(shown)) if own == shown => Ok(()),
        (Pass::Session(_), _) => Err(Error::SessionOver),
    }
}

/// Waits until a tablet with `pass` may see the screens no more: why.
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
