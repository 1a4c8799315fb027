//! Whether a page may see the session on the screens as the surgeon, and until when a page or a stream may stay.

use std::time::Duration;

use tokio::time::sleep;

use super::credentials::Pass;
use super::error::Error;
use super::{App, AppState};
use parfocal_records::accounts::Token;

/// Time between two looks at whether a sign-in has ended.
const SIGN_IN_CHECK: Duration = Duration::from_secs(5);

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

/// Why a page or a stream may no longer stay.
pub(super) enum Over {
    /// The surgeon's link is no longer valid.
    Link,
    /// The sign-in has ended.
    SignIn,
}

/// Waits until a page may no longer stay that was let in by the surgeon's link `pass`, or else by the sign-in with
/// `token`. One that was let in by neither may stay.
pub(super) async fn over(app: AppState, pass: Option<Pass>, token: Option<Token>) -> Over {
    match (pass, token) {
        (Some(pass), _) => no_longer_admitted(&app, pass).await,
        (None, Some(token)) => signed_out(&app, &token).await,
        (None, None) => std::future::pending().await,
    }
}

async fn no_longer_admitted(app: &App, pass: Pass) -> Over {
    let mut views = app.operator_view.clone();
    while admit(app, pass).is_ok() {
        if views.changed().await.is_err() {
            return std::future::pending().await;
        }
    }
    Over::Link
}

async fn signed_out(app: &App, token: &Token) -> Over {
    while !matches!(app.accounts.has_ended(token).await, Ok(true)) {
        sleep(SIGN_IN_CHECK).await;
    }
    Over::SignIn
}
