//! A calibration from any text is read or refused, and what is read can be worked with.

#![no_main]

use libfuzzer_sys::fuzz_target;
use parfocal::imaging::{Calibration, MosaicFrame, PatchArea, Reconstructor};

fuzz_target!(|text: &str| {
    let Ok(calibration) = Calibration::from_toml(text) else { return };
    let Ok(mosaic) = MosaicFrame::new(128, 128, vec![500; 128 * 128]) else { return };
    let Ok(area) = PatchArea::central(32, 32, None) else { return };
    let patch = Reconstructor::new(&calibration).gray_patch(&mosaic, area);
    assert!(patch.0.iter().all(|value| (0.0..=255.0).contains(value)), "gray is on its scale");
});
