//! Whether a page may stay connected: its link is valid, and its sign-in has not ended.

use futures_util::FutureExt;
use futures_util::future::BoxFuture;

use crate::http::AppState;
use crate::http::credentials::Pass;
use crate::http::error::Error;
use crate::http::tablets::{admit, no_longer_admitted};
use parfocal_records::accounts::Token;

/// By what a page was let in.
pub(super) struct Admission {
    /// The link of a surgeon's page.
    pass: Option<Pass>,
    /// The sign-in of a page that holds its role only by a personal account.
    pub(super) token: Option<Token>,
    /// Resolves when a surgeon's page is no longer admitted; never for a page without a pass.
    pub(super) over: BoxFuture<'static, Error>,
}

impl Admission {
    pub(super) fn new(app: &AppState, pass: Option<Pass>, token: Option<Token>) -> Self {
        let app = AppState::clone(app);
        let over = match pass {
            Some(pass) => async move { no_longer_admitted(&app, pass).await }.boxed(),
            None => std::future::pending().boxed(),
        };
        Self { pass, token, over }
    }

    /// Whether the page may see the session on the screens. If not, its connection is about to be closed.
    pub(super) fn may_see_session(&self, app: &AppState) -> bool {
        self.pass.is_none_or(|pass| admit(app, pass).is_ok())
    }
}
