//! Recordings of the view: what they hold, and what can be read of one that was cut short or damaged.

use std::fs::{File, OpenOptions};
use std::io::Write;

use parfocal_recording::{Ended, VIEW_FORMAT, VIEW_VERSION, ViewHeader, ViewRecording, ViewWriter};

use super::*;

/// A JPEG picture, one gray level throughout.
fn picture(width: u32, height: u32, level: u8) -> Vec<u8> {
    let mut jpeg = std::io::Cursor::new(Vec::new());
    let gray = image::GrayImage::from_pixel(width, height, image::Luma([level]));
    gray.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    jpeg.into_inner()
}

/// A recording of ten pictures at 20 a second, the camera's third frame missing, the last four larger; not ended.
fn view(folder: &TempDir) -> (PathBuf, ViewWriter) {
    let path = folder.path().join("view");
    let header = ViewHeader {
        format: VIEW_FORMAT.to_owned(),
        version: VIEW_VERSION,
        software: "a test".to_owned(),
        started: "2026-03-01T12:00:00Z".parse().unwrap(),
        camera: "a test's".to_owned(),
        session: Some("a session".to_owned()),
        run: Some(4),
        monotonic_ns: Some(7),
        ended: None,
    };

    let mut writer = ViewWriter::create(&path, header).unwrap();
    for place in 0..10 {
        let number = if place < 2 { place } else { place + 1 };
        let (width, height) = if place < 6 { (64, 32) } else { (128, 64) };
        let jpeg = picture(width, height, 10 * place as u8);
        writer.add(number, number * 50_000_000, (width as usize, height as usize), &jpeg).unwrap();
    }
    (path, writer)
}

#[test]
fn info_tells_of_a_recording_of_the_view() {
    let folder = TempDir::new().unwrap();
    let (path, writer) = view(&folder);
    assert!(done(&["recording", "info", text(&path)]).contains("cut short, or still being recorded"));
    writer.finish(Ended::Stopped).unwrap();

    let told = info(&path);
    assert_eq!((&told["frames"], &told["frames_missing"]), (&10.into(), &1.into()));
    assert!(
        (told["seconds"].as_f64().unwrap() - 0.5).abs() < 1e-9 && (told["fps"].as_f64().unwrap() - 18.0).abs() < 1e-9
    );
    let sizes = serde_json::json!([
        {"width": 64, "height": 32, "frames": 6},
        {"width": 128, "height": 64, "frames": 4},
    ]);
    assert_eq!(told["sizes"], sizes);
    assert_eq!(told["bytes"], fs::metadata(path.join("view.mjpeg")).unwrap().len());
    assert_eq!((&told["session"], &told["run"]), (&"a session".into(), &4.into()));
    assert_eq!((&told["ended"]["why"], &told["damaged"]), (&"stopped".into(), &serde_json::json!([])));

    let words = done(&["recording", "info", text(&path)]);
    for part in ["pictures of the view", "10 over 0.5 s", "4 of 128x64", "every picture is whole"] {
        assert!(words.contains(part), "{part}: {words}");
    }

    // It has no mosaics, which other commands need.
    let cube = folder.path().join("cube.hdr");
    let refused = parfocal(&["recording", "cube", text(&path), "--frame", "0", "--out", text(&cube)]);
    assert!(complaint(&refused).contains("holds pictures of the view and no mosaics"));
}

#[test]
fn what_a_power_cut_left_of_the_view_is_read_up_to_the_last_whole_picture() {
    let folder = TempDir::new().unwrap();
    let (path, writer) = view(&folder);
    drop(writer);
    let mut index = OpenOptions::new().append(true).open(path.join("view.csv")).unwrap();
    index.write_all(b"11,5500").unwrap();
    assert_eq!(ViewRecording::open(&path).unwrap().rows().len(), 10, "without the line half written");

    // The disk got the index, but not all of the pictures.
    let pictures = path.join("view.mjpeg");
    let length = fs::metadata(&pictures).unwrap().len();
    File::options().write(true).open(&pictures).unwrap().set_len(length - 1).unwrap();
    let told = info(&path);
    assert_eq!((&told["frames"], &told["damaged"]), (&9.into(), &serde_json::json!([])));
}

#[test]
fn a_damaged_picture_is_named_and_the_others_are_read() {
    let folder = TempDir::new().unwrap();
    let (path, writer) = view(&folder);
    writer.finish(Ended::Stopped).unwrap();
    let opened = ViewRecording::open(&path).unwrap();
    let mut pictures = fs::read(path.join("view.mjpeg")).unwrap();
    pictures[opened.rows()[3].offset as usize] = 0;
    fs::write(path.join("view.mjpeg"), pictures).unwrap();

    let told = complaint(&parfocal(&["recording", "info", text(&path)]));
    assert!(told.contains("picture 3 is cut off, or is not a JPEG picture") && !told.contains("more)"), "{told}");
    assert!(opened.picture(3).is_err() && opened.picture(4).unwrap() == picture(64, 32, 40));
}

#[test]
fn a_copy_that_lacks_the_end_of_a_file_is_not_called_whole() {
    let folder = TempDir::new().unwrap();
    let (path, writer) = view(&folder);
    writer.finish(Ended::Stopped).unwrap();

    for (name, lacks) in [("view.mjpeg", "it lacks 5 of 10 pictures"), ("view.csv", "the places of the last pictures")]
    {
        let file = path.join(name);
        let whole = fs::read(&file).unwrap();
        let cut = if name == "view.mjpeg" {
            ViewRecording::open(&path).unwrap().rows()[5].offset as usize + 9
        } else {
            whole.len() / 2
        };
        fs::write(&file, &whole[..cut]).unwrap();
        let told = complaint(&parfocal(&["recording", "info", text(&path)]));
        assert!(told.contains(&format!("{name} is cut off")) && told.contains(lacks), "{told}");
        fs::write(&file, whole).unwrap();
    }
    assert_eq!(info(&path)["damaged"], serde_json::json!([]));
}
