//! Everything that takes bytes from outside, each as a function of those bytes. The fuzzers of `fuzz/targets/` call the
//! same functions.

use std::fmt::Debug;
use std::path::Path;
use std::sync::LazyLock;
use std::time::Duration;

use parfocal_autofocus::Registry;
use parfocal_base::PolicyName;
use parfocal_base::options::Options;
use parfocal_devices::camera::footage::next_pnm;
use parfocal_devices::lens::MeasuredDynamics;
use parfocal_devices::lens::optotune::codec;
use parfocal_imaging::{
    Calibration, GrayImage, MosaicFrame, PatchArea, Picture, Reconstructor, RgbImage, content_area, decode, decode_raw,
};
use parfocal_learning::training::recipe::Recipe;
use parfocal_trial::action::{Action, Focus};
use parfocal_trial::consent::NewConsent;
use parfocal_trial::correction::NewCorrection;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::remark::{Holding, NewAnswer, NewComment};
use parfocal_trial::study::definition::Definition;

use super::{ROOT, backup, folders, lessons, packages, server};

/// Something that takes bytes from outside.
pub struct Target {
    /// Its name, and that of its folder of seeds.
    pub name: &'static str,
    /// Takes an input. Panics if something is wrong.
    pub take: fn(&[u8]),
    /// Seeds in addition to those of its folder.
    pub more_seeds: fn() -> Vec<Vec<u8>>,
}

/// All targets.
pub static TARGETS: [Target; 30] = [
    Target { name: "authority", take: folders::authority, more_seeds: folders::authorities },
    Target { name: "backup", take: backup::backup, more_seeds: backup::pieces },
    Target { name: "calibration", take: calibration, more_seeds: Vec::new },
    Target { name: "calibration-table", take: folders::calibration_table, more_seeds: Vec::new },
    Target { name: "certificate", take: folders::certificate, more_seeds: folders::certificates },
    Target { name: "checkpoint", take: lessons::checkpoint, more_seeds: lessons::checkpoints },
    Target { name: "door", take: server::door, more_seeds: server::knocks },
    Target { name: "export", take: folders::export, more_seeds: folders::export_files },
    Target { name: "http2", take: server::in_http2, more_seeds: server::http2_requests },
    Target { name: "import", take: lessons::import, more_seeds: lessons::import_files },
    Target { name: "json", take: json, more_seeds: Vec::new },
    Target { name: "keys", take: folders::keys, more_seeds: Vec::new },
    Target { name: "lens-dynamics", take: lens_dynamics, more_seeds: Vec::new },
    Target { name: "live", take: server::live, more_seeds: server::messages },
    Target { name: "options", take: options, more_seeds: Vec::new },
    Target { name: "optotune", take: optotune, more_seeds: Vec::new },
    Target { name: "package", take: packages::package, more_seeds: packages::packages },
    Target { name: "picture", take: picture, more_seeds: Vec::new },
    Target { name: "pipe", take: pipe, more_seeds: piped_pictures },
    Target { name: "protocol", take: protocol, more_seeds: shipped_protocols },
    Target { name: "recipe", take: recipe, more_seeds: shipped_recipes },
    Target { name: "recording", take: folders::recording, more_seeds: folders::recording_files },
    Target { name: "request", take: server::request, more_seeds: server::requests },
    Target { name: "scan", take: lessons::scan, more_seeds: lessons::scan_files },
    Target { name: "shard", take: lessons::shard, more_seeds: Vec::new },
    Target { name: "stack", take: lessons::stack, more_seeds: lessons::stack_files },
    Target { name: "study", take: study, more_seeds: Vec::new },
    Target { name: "view", take: folders::view, more_seeds: folders::view_files },
    Target { name: "voice", take: server::voice, more_seeds: server::voices },
    Target { name: "weights", take: lessons::network_weights, more_seeds: lessons::whole_weights },
];

static KNOWN: LazyLock<Vec<PolicyName>> =
    LazyLock::new(|| Registry::standard().entries().into_iter().map(|entry| entry.name).collect());

/// A calibration from any text is read or refused, and what is read can be worked with.
pub fn calibration(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(calibration) = Calibration::from_toml(text) else { return };
    let Ok(mosaic) = MosaicFrame::new(128, 128, vec![500; 128 * 128]) else { return };
    let Ok(area) = PatchArea::central(32, 32, None) else { return };
    let patch = Reconstructor::new(&calibration).gray_patch(&mosaic, area);
    assert!(patch.0.iter().all(|value| (0.0..=255.0).contains(value)), "gray is on its scale");
}

/// Any bytes from a lens driver's serial line are a reply, an error, or too few to tell. A reply stays the same,
/// whatever follows.
pub fn optotune(bytes: &[u8]) {
    let _ = codec::error_reply(bytes);
    replies(codec::FIRMWARE_TYPE, bytes);
    replies(codec::FIRMWARE_VERSION, bytes);
    replies(codec::SERIAL, bytes);
    replies(codec::MAX_CURRENT, bytes);
    replies(codec::CURRENT, bytes);
    replies(codec::CURRENT_MODE, bytes);
    replies(codec::FOCAL_POWER_MODE, bytes);
    replies(codec::MODE, bytes);
    replies(codec::temperature_limits(640, 320), bytes);
    replies(codec::FOCAL_POWER, bytes);
    replies(codec::TEMPERATURE, bytes);
    replies(codec::STATUS, bytes);
}

fn replies<T: Copy + PartialEq + Debug>(request: codec::Request<T>, bytes: &[u8]) {
    let mut reply = None;
    // As it comes: byte by byte.
    for received in 0..=bytes.len() {
        let now = request.reply(&bytes[..received]).ok().flatten();
        assert!(reply.is_none() || reply == now, "{request:?} was answered {reply:?} and then {now:?}");
        reply = now;
    }
}

/// A picture or mosaic from any bytes is read or refused, and its content area is searched for.
pub fn picture(bytes: &[u8]) {
    let _ = decode_raw(bytes, None);
    for mosaic in [false, true] {
        let gray = match decode(bytes, mosaic) {
            Ok(Picture::Rgb(_, gray) | Picture::Gray(gray)) => gray,
            Ok(Picture::Mosaic(frame)) => {
                let mut rgb = RgbImage::default();
                let mut gray = GrayImage::default();
                Reconstructor::default().reconstruct(&frame, &mut rgb, &mut gray);
                gray
            }
            Err(_) => continue,
        };
        assert_eq!(gray.data.len(), gray.width * gray.height);
        let _ = content_area::detect(&gray);
    }
}

/// What ffmpeg writes to a pipe: pictures one after another, until one is damaged or the stream ends.
pub fn pipe(bytes: &[u8]) {
    let mut stream = bytes;
    while let Ok(Some(picture)) = next_pnm(&mut stream) {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        assert_eq!(picture.into_rgb8().into_raw().len(), 3 * width * height);
    }
}

/// Pictures in colour and in gray, and text pictures, which ffmpeg does not write but the decoder reads.
fn piped_pictures() -> Vec<Vec<u8>> {
    let binary = b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06P5 1 2 255 \x07\x08".to_vec();
    let deep = b"P5\n2 2\n65535\n\x01\x02\x03\x04\x05\x06\x07\x08".to_vec();
    vec![binary, deep, b"P2\n2 2\n255\n1 2 3 4\n".to_vec(), b"P4\n8 1\n\xaa".to_vec()]
}

/// A trial protocol from any text is read or refused, and what is read is within the limits that docs/trial.md states.
pub fn protocol(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match Protocol::parse(text, "fuzzed.toml", &KNOWN) {
        Ok(protocol) => {
            assert!((1..=24).contains(&protocol.settings()));
            assert!((Duration::from_secs(5)..=Duration::from_hours(1)).contains(&protocol.segment_limit));
            assert!(protocol.policies.iter().all(|policy| KNOWN.contains(policy)));
        }
        Err(error) => assert!(error.to_string().contains("fuzzed.toml"), "{error}"),
    }
    let _ = Protocol::parse_kept(text, "fuzzed.toml");
}

/// A study's definition from any text.
pub fn study(bytes: &[u8]) {
    static PROTOCOLS: LazyLock<Vec<Protocol>> = LazyLock::new(|| {
        let texts = shipped_protocols();
        let texts = texts.iter().filter_map(|text| std::str::from_utf8(text).ok());
        texts.filter_map(|text| Protocol::parse(text, "shipped.toml", &KNOWN).ok()).collect()
    });

    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Err(error) = Definition::parse(text, "fuzzed.toml", &PROTOCOLS) {
        assert!(error.to_string().contains("fuzzed.toml"), "{error}");
    }
}

/// A training recipe from any text.
pub fn recipe(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(recipe) = Recipe::parse(text) {
        let _ = recipe.design();
    }
}

/// Measured lens dynamics, from any text.
pub fn lens_dynamics(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(measured) = MeasuredDynamics::from_toml(text) {
        let _ = measured.dynamics();
    }
}

/// The options of a camera or a lens.
pub fn options(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok((_, mut options)) = Options::split(text) else { return };
    let _ = options.take::<f64>("exposure");
    let _ = options.take::<u32>("packet");
    let _ = options.finish();
}

/// The bodies that pages send.
pub fn json(bytes: &[u8]) {
    let _ = serde_json::from_slice::<Action>(bytes);
    let _ = serde_json::from_slice::<Focus>(bytes);
    let _ = serde_json::from_slice::<Holding>(bytes);
    let _ = serde_json::from_slice::<NewAnswer>(bytes);
    let _ = serde_json::from_slice::<NewComment>(bytes);
    let _ = serde_json::from_slice::<NewConsent>(bytes);
    let _ = serde_json::from_slice::<NewCorrection>(bytes);
}

fn shipped_protocols() -> Vec<Vec<u8>> {
    shipped("trial-protocols")
}

fn shipped_recipes() -> Vec<Vec<u8>> {
    shipped("policies")
}

/// The TOML files of a folder that is shipped.
fn shipped(folder: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(ROOT).join(folder);
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}
