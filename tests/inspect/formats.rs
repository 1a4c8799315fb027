//! Files of many kinds give the same picture, and what is damaged or left out is said.
//!
//! The pictures were written by `tests/vectors/pictures.py`, with tifffile and Pillow.

use std::io::Cursor;

use super::*;

fn vectors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vectors/pictures")
}

/// What `--json` prints of a picture, without its path and kind.
fn values(path: &Path) -> Value {
    let output = inspect(&["--json"], &[path]);
    assert!(output.status.success(), "{}", complaint(&output));
    assert_eq!(complaint(&output), "", "{}", path.display());
    let mut object = objects(&output).remove(0);
    let fields = object.as_object_mut().unwrap();
    fields.remove("path");
    fields.remove("kind");
    object
}

fn jpeg(picture: &image::GrayImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

/// A picture whose every part differs.
fn uneven(width: u32, height: u32) -> image::GrayImage {
    image::GrayImage::from_fn(width, height, |x, y| image::Luma([((x * x + 3 * y * y) / 7 % 200) as u8]))
}

#[test]
fn every_kind_of_tiff_gives_the_values_of_its_png() {
    let mut count = 0;
    for entry in fs::read_dir(vectors()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let Some((scene, _)) = name.split_once('.').filter(|_| path.extension().is_some_and(|ending| ending == "tif"))
        else {
            continue;
        };
        let reference = vectors().join(format!("{scene}.png"));
        if reference.exists() {
            count += 1;
            let [mut found, mut expected] = [&path, &reference].map(|path| values(path));
            for metric in ["mgm", "mlr"] {
                // A palette's gray is computed from its colours.
                let [found, expected] =
                    [&mut found, &mut expected].map(|object| object[metric].take().as_f64().unwrap());
                assert!((found / expected - 1.0).abs() < 1e-5, "{name}: {metric} {found} instead of {expected}");
            }
            assert_eq!(found, expected, "{name}");
        }
    }
    assert_eq!(count, 17);

    let told = complaint(&inspect(&["--json"], &[&vectors().join("zstd.tif")]));
    assert!(told.contains("cannot read pixels of this kind (compression Zstandard)"), "{told}");
}

#[test]
fn packed_samples_of_twelve_bit_keep_their_values() {
    // Each sample is 16 times that of the gray picture and 9 more, so that 4095 is white.
    let expected = values(&vectors().join("gray.png"))["mgm"].as_f64().unwrap() * 16.0 * 255.0 / 4095.0;
    let found = values(&vectors().join("twelve-bit.tif"))["mgm"].as_f64().unwrap();
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} instead of {expected}");
}

#[test]
fn a_tiff_stored_as_jpeg_is_read_unless_it_is_damaged() {
    let folder = TempDir::new().unwrap();
    let whole = fs::read(vectors().join("jpeg.tif")).unwrap();
    let [found, expected] = ["jpeg.tif", "gray.png"].map(|name| values(&vectors().join(name))["mgm"].as_f64().unwrap());
    assert!((found / expected - 1.0).abs() < 0.05, "{found} instead of about {expected}");

    // The second half of the file is the data of strips.
    let middle = whole.len() * 3 / 4;
    let zeros = [&whole[..middle], &[0; 60], &whole[middle + 60..]].concat();
    let output = inspect(&["--json"], &[&write(&folder, "zeros.tif", &zeros)]);
    let told = complaint(&output);
    assert!(!output.status.success() && told.contains("zeros.tif: damaged or cut short: "), "{told}");
}

#[test]
fn a_tiff_without_a_part_of_its_pixels_is_refused() {
    let folder = TempDir::new().unwrap();
    let whole = fs::read(vectors().join("one-bit.fill-order-1.tif")).unwrap();
    // The field with the length of the only strip: tag 279, a LONG, once.
    let field = b"\x17\x01\x04\0\x01\0\0\0";
    let length = whole.windows(field.len()).position(|bytes| bytes == field).unwrap() + field.len();
    let mut empty = whole.clone();
    empty[length..length + 4].fill(0);
    let output = inspect(&["--json"], &[&write(&folder, "empty.tif", &empty)]);
    let told = complaint(&output);
    assert!(!output.status.success() && told.contains("part 1 of 1 of a page is missing"), "{told}");
}

#[test]
fn pictures_that_are_not_read_are_counted() {
    for (name, pages) in [("pages.tif", 5), ("stack.ome.tif", 6), ("stack.imagej.tif", 6)] {
        let output = inspect(&["--json"], &[&vectors().join(name)]);
        assert!(output.status.success());
        let told = complaint(&output);
        assert!(told.contains(&format!("{name} holds {pages} pictures; only the first is used")), "{told}");
    }
}

#[test]
fn a_jpeg_is_turned_as_its_exif_says() {
    let folder = TempDir::new().unwrap();
    // A disc left of the middle at the top: turned by 90 degrees clockwise it is right of the middle.
    let stored = image::imageops::rotate270(&disc());
    let plain = jpeg(&stored);
    // One directory with one entry: orientation (0x0112), a short, once, 6.
    let exif = b"\xFF\xE1\0\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let turned = write(&folder, "turned.jpg", &[&plain[..2], &exif[..], &plain[2..]].concat());

    let found = values(&turned);
    assert_eq!((&found["width"], &found["height"]), (&400.into(), &300.into()));
    let centre = ["x", "y"].map(|key| found["content_area"][key].as_f64().unwrap());
    assert!((centre[0] - 210.0).abs() < 2.0 && (centre[1] - 140.0).abs() < 2.0, "{centre:?}");
}

#[test]
fn a_jpeg_with_any_damage_is_refused() {
    let folder = TempDir::new().unwrap();
    let whole = jpeg(&uneven(320, 240));
    assert_eq!(values(&write(&folder, "whole.jpg", &whole))["width"], 320);

    let middle = whole.len() / 2;
    let zeros = [&whole[..middle], &[0; 200], &whole[middle + 200..]].concat();
    let noise: Vec<u8> = (0..200_u32).map(|index| (index * 97 + index * index * 13) as u8).collect();
    let noise = [&whole[..middle], &noise, &whole[middle + 200..]].concat();
    let hole = [&whole[..middle], &whole[middle + 1000..]].concat();
    for (name, bytes) in
        [("zeros.jpg", &zeros), ("noise.jpg", &noise), ("hole.jpg", &hole), ("cut.jpg", &whole[..middle].to_vec())]
    {
        let output = inspect(&["--json"], &[&write(&folder, name, bytes)]);
        let told = complaint(&output);
        assert!(!output.status.success() && told.contains(&format!("{name}: damaged or cut short: ")), "{told}");
    }

    // The rest of a scan whose hole was read as too few pixels. libjpeg warns of longer rests only.
    let end = whole.len() - 2;
    let rest = write(&folder, "rest.jpg", &[&whole[..end], b"\x5A\x3C\x71", &whole[end..]].concat());
    let told = complaint(&inspect(&["--json"], &[&rest]));
    assert!(told.contains("rest.jpg: damaged or cut short: it holds more data than its pixels need"), "{told}");

    // A phone's short video may follow the picture; it is not part of it.
    let followed = [&whole[..], b"\0\0\0\x18ftypmp42 and more \xFF\xDA and more"].concat();
    assert_eq!(values(&write(&folder, "followed.jpg", &followed))["width"], 320);
}
