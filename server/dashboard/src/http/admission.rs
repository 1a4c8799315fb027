//! Whether a page may see the session on the screens as the surgeon, and until when a page or a stream may stay.

use std::time::Duration;

use tokio::time::sleep;

use super::credentials::Pass;
use super::error::Error;
use super::{App, AppState};
use parfocal_records::accounts::Token;
use parfocal_trial::role::Role;

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
    /// The sign-in has ended, or no longer gives the role.
    SignIn,
}

/// What lets a page or a stream stay only for a time. A role's key or cookie lets it stay as long as it likes.
#[derive(Clone)]
pub(super) enum Ground {
    /// The surgeon's link.
    Link(Pass),
    /// The sign-in with this token, to an account that may act as this role.
    SignIn(Token, Role),
}

/// Waits until a page may no longer stay that was let in on this `ground`.
pub(super) async fn over(app: AppState, ground: Option<Ground>) -> Over {
    match ground {
        Some(Ground::Link(pass)) => no_longer_admitted(&app, pass).await,
        Some(Ground::SignIn(token, role)) => signed_out(&app, &token, role).await,
        None => std::future::pending().await,
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

async fn signed_out(app: &App, token: &Token, role: Role) -> Over {
    while !matches!(app.accounts.has_ended(token, role).await, Ok(true)) {
        sleep(SIGN_IN_CHECK).await;
    }
    Over::SignIn
}
