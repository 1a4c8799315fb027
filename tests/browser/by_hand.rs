//! The operator focuses by hand: the lens ends where the slider was let go, however slow the network.

use serde_json::json;

use crate::support::Server;
use crate::theatre::operator;
use crate::webdriver::Driver;

#[tokio::test(flavor = "multi_thread")]
async fn the_lens_ends_where_the_slider_was_let_go() {
    let driver = Driver::start().await;
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10"]);
    let operator = operator(&driver, &server).await;
    operator.sees("#focus-now", "focal power").await;
    let drag = "const sent = window.fetch;
                const held = new Promise((done) => (window.release = done));
                window.asked = [];
                window.fetch = async (path, request) => {
                    if (path.endsWith('/focus')) {
                        window.asked.push(JSON.parse(request.body).focal_power);
                        await held;
                    }
                    return sent(path, request);
                };
                const slider = document.getElementById('focal-power');
                for (const value of [0.1, 0.2, 0.3]) {
                    slider.value = value;
                    slider.dispatchEvent(new Event('input'));
                }
                slider.dispatchEvent(new Event('change'));
                return slider.value";
    assert_eq!(operator.run(drag, json!([])).await, "0.3");
    operator.run("window.release()", json!([])).await;
    operator.sees("#focus-now", "focal power 0.300").await;
    let told = operator.run("return [window.asked, document.getElementById('focal-power').value]", json!([])).await;
    assert_eq!(told, json!([[0.1, 0.3], "0.3"]), "one at a time, what was overtaken left out");
}
