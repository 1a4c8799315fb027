//! Screenshots of every page and state, at tablet and laptop size, for people to look at. Each state is also checked
//! for accessibility.

use std::path::Path;

use serde_json::json;

use super::accessible;
use super::driver::Browser;

/// Tests go on at the last one.
const SIZES: [(u32, u32); 3] = [(820, 1180), (1440, 900), (1180, 820)];

/// Pictures are taken only if this variable is set: they are for people, and add a minute to a whole run.
const WANTED: &str = "PARFOCAL_SCREENSHOTS";

/// Checks whether everyone can use what the page shows, a surgeon's at each size. Saves it at each size as `name` in
/// `target/screenshots/` if pictures are wanted.
pub async fn shoot(browser: &Browser, name: &str) {
    let is_surgeons = browser.count("body.surgeon").await > 0;
    // To give a page with a picture another size takes longer than the check itself.
    let sizes = if is_surgeons || are_wanted() { &SIZES[..] } else { &SIZES[2..] };
    for &(width, height) in sizes {
        resize(browser, width, height).await;
        if is_surgeons {
            accessible::check_targets(browser, name).await;
        }
        if are_wanted() {
            take(browser, &format!("{name}-{width}x{height}.png")).await;
        }
    }

    accessible::check(browser, name).await;
}

/// Whether pictures are to be taken.
pub fn are_wanted() -> bool {
    std::env::var_os(WANTED).is_some()
}

async fn take(browser: &Browser, file: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/screenshots");
    std::fs::create_dir_all(&folder).unwrap();
    let png = browser.screenshot().await;
    std::fs::write(folder.join(file), png).unwrap();
}

/// Gives the page this size, as turning the tablet or opening its keyboard does, and waits until it is drawn.
pub async fn resize(browser: &Browser, width: u32, height: u32) {
    set_screen(browser, width, height, 1).await;
}

/// The same on a screen of `density` pixels per CSS pixel.
pub async fn set_screen(browser: &Browser, width: u32, height: u32, density: u32) {
    let size = json!({ "width": width, "height": height, "deviceScaleFactor": density, "mobile": false });
    browser.tools("Emulation.setDeviceMetricsOverride", size).await;
    // On a busy machine the page hears of its new size some frames later. Then two frames: in the first it gets its new
    // layout, in the second the observers of its size have drawn.
    let drawn = format!(
        "new Promise((done) => {{
            const sized = () => innerWidth === {width} && innerHeight === {height};
            const drawn = () => requestAnimationFrame(() => requestAnimationFrame(done));
            const wait = () => (sized() ? drawn() : requestAnimationFrame(wait));
            wait();
        }})"
    );
    browser.tools("Runtime.evaluate", json!({ "expression": drawn, "awaitPromise": true })).await;
}
