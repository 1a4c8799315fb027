//! A picture or mosaic from any bytes is read or refused, and its content area looked for.

#![no_main]

use libfuzzer_sys::fuzz_target;
use parfocal::imaging::{GrayImage, Picture, Reconstructor, RgbImage, content_area, decode, decode_raw};

fuzz_target!(|bytes: &[u8]| {
    let _ = decode_raw(bytes);
    for mosaic in [false, true] {
        let gray = match decode(bytes, mosaic) {
            Ok(Picture::Rgb(_, gray) | Picture::Gray(gray)) => gray,
            Ok(Picture::Mosaic(frame)) => {
                let mut rgb = RgbImage::default();
                let mut gray = GrayImage::default();
                Reconstructor::new(&parfocal::imaging::Calibration::default()).reconstruct(&frame, &mut rgb, &mut gray);
                gray
            }
            Err(_) => continue,
        };
        assert_eq!(gray.data.len(), gray.width * gray.height);
        let _ = content_area::detect(&gray);
    }
});
