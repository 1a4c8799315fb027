//! Screenshots of every page and state, at tablet and laptop size, for people to look at.

use std::path::Path;

use serde_json::{Value, json};

use crate::webdriver::Browser;

const SIZES: [(u32, u32); 3] = [(1180, 820), (820, 1180), (1440, 900)];

/// Takes `name` at each size into `target/screenshots/`.
pub async fn shoot(browser: &Browser<'_>, name: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/screenshots");
    std::fs::create_dir_all(&folder).unwrap();
    for (width, height) in SIZES {
        resize(browser, width, height).await;
        let shot = browser.tools("Page.captureScreenshot", json!({ "format": "png" })).await;
        let png = decode_base64(shot["data"].as_str().unwrap());
        std::fs::write(folder.join(format!("{name}-{width}x{height}.png")), png).unwrap();
    }
    let (width, height) = SIZES[0];
    resize(browser, width, height).await;
}

/// Gives the page this size, as a turned tablet or its keyboard does, and waits until it is drawn.
pub async fn resize(browser: &Browser<'_>, width: u32, height: u32) {
    let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
    browser.tools("Emulation.setDeviceMetricsOverride", size).await;
    // Two frames: one in which the page lays itself out anew, one in which what watches its size has drawn.
    let drawn = json!({ "expression": "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))", "awaitPromise": true });
    let _: Value = browser.tools("Runtime.evaluate", drawn).await;
}

/// Base64 as RFC 4648 has it.
fn decode_base64(text: &str) -> Vec<u8> {
    const ALPHABET: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0_u32, 0);
    for sign in text.bytes().take_while(|sign| *sign != b'=') {
        let value = ALPHABET.iter().position(|known| *known == sign).expect("base64");
        bits = bits << 6 | u32::try_from(value).unwrap();
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held & 0xff) as u8);
        }
    }
    bytes
}
