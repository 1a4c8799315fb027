//! Raw mosaics of every pixel format are read as stacks and scans. The tests pack the bytes themselves.

use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_devices::simulation::texture::texture;
use serde_json::json;

use super::*;

const WIDTH: usize = 2048;
const HEIGHT: usize = 1088;
/// Samples along a side of a cell, one for each band.
const CELL: usize = 4;
/// Planes of the stack. The fourth is the sharpest.
const PLANES: u8 = 7;

/// Names of the formats, bits of a count, and bits that it takes in the file.
const FORMATS: [(&str, usize, usize); 6] = [
    ("Mono8", 8, 8),
    ("Mono10", 10, 16),
    ("Mono10p", 10, 10),
    ("Mono12", 12, 16),
    ("Mono12p", 12, 12),
    ("Mono16", 16, 16),
];

/// The stack's mosaics as counts of 8 bit, the same in all bands.
fn mosaics() -> Vec<Vec<u8>> {
    let sharp = texture(8, WIDTH / CELL);
    let mosaic = |plane: u8| {
        let picture = gaussian_blur(&sharp, 0.8 * (f64::from(plane) - 3.0).abs());
        let level = |index: usize| {
            let cell = index / WIDTH / CELL * picture.width + index % WIDTH / CELL;
            picture.data[cell].round() as u8
        };
        (0..WIDTH * HEIGHT).map(level).collect()
    };
    (0..PLANES).map(mosaic).collect()
}

/// The same brightness as a count of 10 bit: the top bits are repeated below, so that white stays white.
fn ten_bit(count: u8) -> u16 {
    u16::from(count) << 2 | u16::from(count) >> 6
}

/// A raw file: counts of `bits` bit as bytes, each in `width` bits without gaps, lowest bits first.
fn packed(mosaic: &[u8], bits: usize, width: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(mosaic.len() * width / 8);
    let mut waiting = 0_u32;
    let mut length = 0;
    for &count in mosaic {
        let count = if bits == 8 { u32::from(count) } else { u32::from(ten_bit(count)) << (bits - 10) };
        waiting |= count << length;
        length += width;
        while length >= 8 {
            bytes.push((waiting & 0xFF) as u8);
            waiting >>= 8;
            length -= 8;
        }
    }
    bytes
}

/// Writes each mosaic in the format; `name` gives the file of a plane.
fn write_raw(folder: &Path, mosaics: &[Vec<u8>], format: (&str, usize, usize), name: impl Fn(usize) -> String) {
    fs::create_dir_all(folder).unwrap();
    for (plane, mosaic) in mosaics.iter().enumerate() {
        fs::write(folder.join(name(plane)), packed(mosaic, format.1, format.2)).unwrap();
    }
}

/// Writes each mosaic as a gray picture of 16 bit that holds counts of 10 bit.
fn write_pictures(folder: &Path, mosaics: &[Vec<u8>], name: impl Fn(usize) -> String) {
    fs::create_dir_all(folder).unwrap();
    for (plane, mosaic) in mosaics.iter().enumerate() {
        let counts = mosaic.iter().map(|&count| ten_bit(count)).collect();
        let picture: image::ImageBuffer<image::Luma<u16>, Vec<u16>> =
            image::ImageBuffer::from_raw(WIDTH as u32, HEIGHT as u32, counts).unwrap();
        picture.save(folder.join(name(plane))).unwrap();
    }
}

/// A scan's files without its header, which names the folder.
fn pictures_of(scan: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    contents(scan).into_iter().filter(|(file, _)| file != Path::new("scan.json")).collect()
}

#[test]
fn a_stack_of_raw_mosaics_is_the_stack_of_the_same_mosaics_as_pictures() {
    let folder = TempDir::new().unwrap();
    let mosaics = mosaics();
    let scan = |pictures: &Path, name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let arguments = ["scan", "from-stack", text(pictures), "--out", text(&out), "--size", "96", "--poses", "2"];
        (parfocal(&[&arguments, more].concat()), out)
    };

    let pictures = folder.path().join("pictures");
    write_pictures(&pictures, &mosaics, |plane| format!("plane {plane}.png"));
    let (output, expected) = scan(&pictures, "expected", &[]);
    assert!(output.status.success(), "{}", complaint(&output));

    for format in FORMATS {
        let (name, bits, width) = format;
        let raw = folder.path().join(name);
        write_raw(&raw, &mosaics, format, |plane| format!("plane {plane}.raw"));
        // An operating system's own file beside them.
        fs::write(raw.join("._plane 3.raw"), "").unwrap();

        let is_packed = width != 16;
        let option = ["--raw", name];
        let ten = name == "Mono10";
        let (output, out) = scan(&raw, &format!("{name} scan"), if is_packed || ten { &[] } else { &option });
        let told = notes(&output);
        let reason = if is_packed || ten { "by their length; --raw says otherwise" } else { "as --raw says" };
        let folder_name = raw.display();
        assert!(told.contains(&format!("the raw mosaics in {folder_name} are read as {name}, {reason}")), "{told}");
        assert_eq!(told.matches("are read as").count(), 1, "once for all files: {told}");
        assert!(pictures_of(&out) == pictures_of(&expected), "{name}: the scans differ");

        if !is_packed && bits > 10 {
            let told = complaint(&scan(&raw, "guessed", &[]).0);
            assert!(told.contains("but Mono10 ends at 1023; give --raw"), "{told}");

            let environment = |more: &[&str]| parfocal(&[&["environment", "--scans", text(&raw)], more].concat());
            let told = complaint(&environment(&[]));
            assert!(told.contains("but Mono10 ends at 1023; give --raw"), "{told}");
            let told = notes(&environment(&option));
            assert!(told.contains(&format!("are read as {name}, as --raw says")), "{told}");
        }
        if is_packed {
            let told = complaint(&scan(&raw, "wrong", &["--raw", "Mono16"]).0);
            assert!(told.contains("plane 0.raw: a raw mosaic is 2048x1088 samples, in Mono16 4456448 bytes"), "{told}");
        }
    }

    // A stack is in one format, and whatever is left out is named.
    let raw = folder.path().join("Mono10p");
    fs::write(raw.join("plane 5.raw"), packed(&mosaics[5], 8, 8)).unwrap();
    let told = complaint(&scan(&raw, "mixed", &[]).0);
    assert!(told.contains("plane 5.raw: a raw mosaic is 2048x1088 samples, in Mono10p 2785280 bytes"), "{told}");
    fs::copy(folder.path().join("Mono8/plane 0.raw"), pictures.join("plane 0.raw")).unwrap();
    let (output, out) = scan(&pictures, "with a raw file", &[]);
    assert!(notes(&output).contains("also holds 1 raw mosaics, which are left out"), "{}", notes(&output));
    assert!(pictures_of(&out) == pictures_of(&expected));
}

#[test]
fn policies_are_evaluated_on_a_stack_of_raw_mosaics() {
    let folder = TempDir::new().unwrap();
    let mosaics = mosaics();
    let pictures = folder.path().join("pictures/stack");
    write_pictures(&pictures, &mosaics, |plane| format!("{plane}.png"));
    let raw = folder.path().join("raw/stack");
    write_raw(&raw, &mosaics, FORMATS[3], |plane| format!("{plane}.bin"));

    let evaluate = |stack: &Path, more: &[&str]| -> Value {
        let arguments = ["evaluate", "--policies", "fixed", "--json", "--stacks", text(stack)];
        let output = parfocal(&[&arguments, more].concat());
        serde_json::from_str(&said(&output)).unwrap_or_else(|error| panic!("{error}: {}", complaint(&output)))
    };
    assert_eq!(evaluate(&raw, &["--raw", "Mono12"]), evaluate(&pictures, &[]));

    let one = raw.join("0.bin");
    let told = complaint(&parfocal(&["evaluate", "--policies", "fixed", "--stacks", text(&one)]));
    assert!(told.contains("0.bin is one raw mosaic; a focal stack is a folder of at least 5"), "{told}");
    let output = parfocal(&["evaluate", "--policies", "fixed", "--stacks", text(&raw), "--raw", "Mono14"]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && told.contains("choose from Mono10p, Mono10"), "{told}");
}

#[test]
fn raw_mosaics_are_imported_as_a_scan() {
    let folder = TempDir::new().unwrap();
    let mosaics = &mosaics()[..4];
    let name = |plane: usize, end: &str| format!("pose{}_f{}.{end}", plane / 2 + 1, plane % 2);
    let import = |pictures: &Path, out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        (parfocal(&[&["scan", "import", text(pictures), "--out", text(&out)], more].concat()), out)
    };

    let pictures = folder.path().join("pictures");
    write_pictures(&pictures, mosaics, |plane| name(plane, "png"));
    let (output, expected) = import(&pictures, "expected", &[]);
    assert!(output.status.success(), "{}", complaint(&output));

    for format in FORMATS {
        let raw = folder.path().join(format.0);
        write_raw(&raw, mosaics, format, |plane| name(plane, "raw"));
        fs::write(raw.join("._pose1_f0.raw"), "").unwrap();
        let is_guessed = ["Mono8", "Mono10", "Mono10p", "Mono12p"].contains(&format.0);
        let option = ["--raw", format.0];
        let (output, out) = import(&raw, &format!("{} scan", format.0), if is_guessed { &[] } else { &option });
        assert!(notes(&output).contains(&format!("are read as {}, ", format.0)), "{}", notes(&output));
        assert!(pictures_of(&out) == pictures_of(&expected), "{}: the scans differ", format.0);
    }

    let info = parfocal(&["scan", "info", text(&expected), "--json"]);
    let info: Value = serde_json::from_str(&said(&info)).unwrap();
    assert_eq!((&info["poses"], &info["width"], &info["height"]), (&json!(2), &json!(512), &json!(272)));

    // All files are checked before anything is written.
    let raw = folder.path().join("Mono12");
    let (output, out) = import(&raw, "guessed", &[]);
    let told = complaint(&output);
    assert!(told.contains("but Mono10 ends at 1023; give --raw Mono12 or Mono16"), "{told}");
    fs::write(raw.join("pose2_f1.raw"), [0; 1000]).unwrap();
    let told = complaint(&import(&raw, "guessed", &["--raw", "Mono12"]).0);
    assert!(told.contains("pose2_f1.raw: a raw mosaic is") && told.contains("this file has 1000 bytes"), "{told}");
    assert!(!out.exists());
}
