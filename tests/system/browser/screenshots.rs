//! Screenshots of every page and state, at tablet and laptop size, for people to look at. Whatever is worth looking at
//! must also be usable by everyone.

use std::path::Path;

use serde_json::json;

use super::accessible;
use super::driver::Browser;

const SIZES: [(u32, u32); 3] = [(1180, 820), (820, 1180), (1440, 900)];

/// Takes `name` at each size into `target/screenshots/`, and checks whether everyone can use what it shows.
pub async fn shoot(browser: &Browser, name: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/screenshots");
    std::fs::create_dir_all(&folder).unwrap();
    for (width, height) in SIZES {
        resize(browser, width, height).await;
        let png = browser.screenshot().await;
        std::fs::write(folder.join(format!("{name}-{width}x{height}.png")), png).unwrap();
        accessible::check_targets(browser, name).await;
    }

    let (width, height) = SIZES[0];
    resize(browser, width, height).await;
    accessible::check(browser, name).await;
}

/// Gives the page this size, as a turned tablet or its keyboard does, and waits until it is drawn.
pub async fn resize(browser: &Browser, width: u32, height: u32) {
    set_screen(browser, width, height, 1).await;
}

/// The same on a screen of `density` pixels per CSS pixel.
pub async fn set_screen(browser: &Browser, width: u32, height: u32, density: u32) {
    let size = json!({ "width": width, "height": height, "deviceScaleFactor": density, "mobile": false });
    browser.tools("Emulation.setDeviceMetricsOverride", size).await;
    // Two frames: one in which the page lays itself out anew, one in which what watches its size has drawn.
    let drawn = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))";
    browser.tools("Runtime.evaluate", json!({ "expression": drawn, "awaitPromise": true })).await;
}
