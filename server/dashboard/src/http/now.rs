//! One line at the top of each of the researcher's pages: what to do now. It depends only on what the page shows
//! anyway.

use parfocal_trial::phase::SessionStatus;
use parfocal_trial::study::stage::Stage;

/// The line on the list of sessions. `some`: whether there are any sessions.
pub(super) const fn on_sessions(some: bool, under_way: bool) -> &'static str {
    match (some, under_way) {
        (_, true) => "A session is under way. Export it when it has ended.",
        (true, false) => "Open a session to read, correct and export it.",
        (false, false) => "Nothing to do yet. The operator prepares the first session.",
    }
}

/// The state of a session on which the line on its page depends.
#[derive(Clone, Copy)]
pub(super) struct Session {
    /// Whether the session is under way, completed or aborted.
    pub(super) status: SessionStatus,
    /// Whether the participant withdrew.
    pub(super) withdrawn: bool,
    /// Whether the session is unblinded.
    pub(super) unblinded: bool,
    /// Whether its study was locked; `None` outside studies.
    pub(super) study_locked: Option<bool>,
}

/// The line on the page of a session.
pub(super) const fn on_session(session: Session) -> &'static str {
    match session {
        Session { withdrawn: true, .. } => {
            "The participant withdrew, so the session’s data are hidden. Erase its words if the participant asked for that."
        }
        Session { status: SessionStatus::UnderWay, .. } => {
            "Wait until the session has ended. Then correct and export it."
        }
        Session { unblinded: true, .. } => "Export it unblinded, or look at what the policies did.",
        Session { study_locked: Some(true), .. } => {
            "The study is locked, so only notes can be added. It is unblinded as a whole."
        }
        Session { study_locked: Some(false), .. } => {
            "Correct what was recorded wrongly. The study is unblinded as a whole."
        }
        Session { .. } => "Correct what was recorded wrongly and export it blinded. Unblind when the trial is over.",
    }
}

/// The line on the page of accounts. `waiting`: whether somebody was given a passphrase and has not signed in with it
/// yet.
pub(super) const fn on_people(waiting: bool) -> &'static str {
    if waiting {
        "Tell each new person the passphrase for the first sign-in. Then plan the study."
    } else {
        "Make an account for everybody but the surgeons. Then plan the study."
    }
}

/// The line on the list of studies.
pub(super) const fn on_studies(has_accounts: bool, signed_in: bool) -> &'static str {
    match (has_accounts, signed_in) {
        (false, _) => "For a study, make an account first: “parfocal account add” on the server.",
        (true, false) => "Sign in to plan a study or to open one.",
        (true, true) => "Open a study, or plan one.",
    }
}

/// The line on the page of a study. `leads`: whether the reader is a lead.
pub(super) const fn on_study(stage: Stage, leads: bool) -> &'static str {
    match (stage, leads) {
        (Stage::Planned, _) => "Read the plan. If it is right, draw the orders and open the study.",
        (Stage::Open, _) => {
            "Publish the commitment before the first session. Close the study when all sessions are done."
        }
        (Stage::Closed, true) => "Check and correct the sessions. Then lock the study.",
        (Stage::Closed, false) => "Check and correct the sessions. A lead then locks the study.",
        (Stage::Locked, true) => "Unblind the study when all tablets have sent everything.",
        (Stage::Locked, false) => "Wait until a lead unblinds the study.",
        (Stage::Unblinded, _) => "Read the analysis, and export the sessions.",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_is_corrected_exported_and_unblinded_in_that_order() {
        let ended =
            Session { status: SessionStatus::Completed, withdrawn: false, unblinded: false, study_locked: None };
        assert!(on_session(ended).contains("export it blinded"));
        assert!(on_session(Session { unblinded: true, ..ended }).contains("unblinded"));

        let under_way = Session { status: SessionStatus::UnderWay, ..ended };
        assert!(on_session(under_way).starts_with("Wait"));
        assert!(on_session(Session { withdrawn: true, ..under_way }).starts_with("The participant withdrew"));
        assert!(
            !on_session(Session { study_locked: Some(false), ..ended }).contains("Unblind when"),
            "only its study is unblinded"
        );
        assert!(on_session(Session { study_locked: Some(true), ..ended }).starts_with("The study is locked"));
    }

    #[test]
    fn only_a_lead_is_asked_to_lock_and_unblind() {
        for stage in [Stage::Closed, Stage::Locked] {
            assert_ne!(on_study(stage, true), on_study(stage, false));
        }
        assert!(on_study(Stage::Locked, false).starts_with("Wait"));
    }
}
