//! Tells the session what the surgeon's tablets do.

use std::time::Duration;

use tokio::time::{MissedTickBehavior, interval};

use crate::http::AppState;

/// Interval of the reports to the session.
const REPORT: Duration = Duration::from_millis(250);

/// Reports to the session what the tablets do, a few times a second. Never returns; drop it to stop.
pub(in crate::http) async fn report_tablets(app: AppState) {
    let mut due = interval(REPORT);
    due.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        due.tick().await;
        let report = app.tablets.report(app.clock.now());
        app.conductor.follow_tablets(report).await;
    }
}
