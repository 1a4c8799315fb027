//! The operator focuses by hand: the lens ends where the slider was released, however slow the network is.

use super::driver::Driver;
use super::theatre::operator;
use crate::support::Server;

#[tokio::test(flavor = "multi_thread")]
async fn the_lens_ends_where_the_slider_was_let_go() {
    let driver = Driver::start();
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10"]);
    let operator = operator(&driver, &server).await;
    operator.sees("#focus-now", "focal power").await;
    operator.hold("/focus").await;
    assert_eq!(operator.drag_slider("#focal-power", &[0.1, 0.2, 0.3]).await, "0.3");
    operator.release().await;
    operator.sees("#focus-now", "focal power 0.300").await;
    let asked: Vec<_> = operator.held().await.iter().map(|order| order["focal_power"].clone()).collect();
    assert_eq!(asked, [0.1, 0.3], "one at a time, what was overtaken left out");
    assert_eq!(operator.value("#focal-power").await, "0.3");
}
