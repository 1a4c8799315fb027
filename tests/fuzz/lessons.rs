//! Files that training and evaluation read: weights of a network, recorded scans, focal stacks, and parts of an
//! evaluation.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use parfocal_autofocus::weights;
use parfocal_base::FocalPower;
use parfocal_devices::camera::recorded::{Header, PictureOrder, ScanFolder, ScanRecording, TakenPose};
use parfocal_imaging::{GrayImage, PatchArea};
use parfocal_learning::evaluation::shard::{Shard, merge};
use parfocal_learning::scans::recorded::{Kept, RecordedScan, evenly_spread};
use parfocal_learning::scans::recording::{self, Imported};
use parfocal_learning::scans::stack::{FocalStack, check};
use parfocal_learning::training::run::checkpoint::{self, Checkpoint};
use tch::{Device, nn};

use super::folders::Folder;

/// Side of the pictures in pixels: the least for a scan.
const SIDE: usize = 64;
/// Number of pictures of a pose and of a stack: the least for a stack.
const PICTURES: usize = 5;
/// Name of the file with the positions of the stack's pictures.
const LIST: &str = "positions.csv";

thread_local! {
    static SCAN: Folder = Folder::made_by(make_scan);
    static STACK: Folder = Folder::made_by(make_stack);
    static IMPORTED: Folder = Folder::made_by(make_pictures);
    static CHECKPOINT: Folder = Folder::made_by(make_checkpoint);
    static NETWORK: nn::VarStore = network();
}

/// Weights of a small network from any bytes.
pub fn network_weights(bytes: &[u8]) {
    NETWORK.with(|network| {
        let _ = weights::load(network, bytes);
    });
}

/// Weights of the same network.
pub fn whole_weights() -> Vec<Vec<u8>> {
    vec![weights::save(&network(), "a test").unwrap()]
}

/// The results of an evaluation on a part of its scans, as another machine sends them. They are merged alone and with
/// the other part.
pub fn shard(bytes: &[u8]) {
    let Ok(shard) = serde_json::from_slice::<Shard>(bytes) else { return };
    let seed = serde_json::from_slice::<Shard>(include_bytes!("../../fuzz/corpus/shard/seed-2-of-2.json")).unwrap();
    for shards in [vec![shard.clone()], vec![shard, seed]] {
        let named = shards.into_iter().enumerate().map(|(number, shard)| (number.to_string(), shard)).collect();
        if let Ok((report, _)) = merge(named) {
            let _ = report.markdown();
        }
    }
}

/// A recorded scan, with one of its files replaced, is read whole or refused.
pub fn scan(bytes: &[u8]) {
    SCAN.with(|scan| {
        scan.with(bytes, |folder| {
            let Ok(scan) = ScanFolder::open(folder) else { return };
            let _ = scan.missing();
            if let Ok(whole) = scan.whole() {
                let _ = RecordedScan::read(&whole, Kept::Patches, &|| {});
            }
        });
    });
}

/// The files of a scan.
pub fn scan_files() -> Vec<Vec<u8>> {
    SCAN.with(Folder::seeds)
}

/// A focal stack and its list of positions, one file replaced.
pub fn stack(bytes: &[u8]) {
    STACK.with(|stack| {
        stack.with(bytes, |folder| {
            for list in [None, Some(folder.join(LIST))] {
                let Ok(stack) = FocalStack::load(&folder.join("pictures"), list.as_deref(), 1, None, None) else {
                    continue;
                };
                let _ = check::check(&stack);
                let _ = stack.even();
            }
        });
    });
}

/// The files of a stack.
pub fn stack_files() -> Vec<Vec<u8>> {
    STACK.with(Folder::seeds)
}

/// Pictures from another program that become a scan, one of them replaced.
pub fn import(bytes: &[u8]) {
    IMPORTED.with(|pictures| {
        pictures.with(bytes, |folder| {
            let out = tempfile::tempdir().unwrap();
            let imported = Imported::look(folder, None, None).unwrap();
            let _ = recording::import(&imported, "a test's", &out.path().join("scan"), &|| {});
        });
    });
}

/// The files of such pictures.
pub fn import_files() -> Vec<Vec<u8>> {
    IMPORTED.with(Folder::seeds)
}

/// A checkpoint, from which a training resumes.
pub fn checkpoint(bytes: &[u8]) {
    CHECKPOINT.with(|checkpoint| {
        checkpoint.with(bytes, |folder| {
            let path = folder.join(checkpoint::CHECKPOINT);
            let _ = Checkpoint::read_notes(&path).map(|notes| notes.number::<u64>("updates").ok());
            if let Ok(mut whole) = Checkpoint::read(&path) {
                let _ = whole.floats("loss");
                let _ = whole.take_bytes("patches");
                let _ = NETWORK.with(|network| whole.fill_store("network", network));
            }
        });
    });
}

/// The file of an intact checkpoint.
pub fn checkpoints() -> Vec<Vec<u8>> {
    CHECKPOINT.with(Folder::seeds)
}

fn network() -> nn::VarStore {
    let store = nn::VarStore::new(Device::Cpu);
    let _ = nn::linear(store.root() / "layer", 3, 2, nn::LinearConfig::default());
    store
}

/// Stripes. Their contrast falls with the distance of `focal_power` from the middle.
fn picture(focal_power: FocalPower) -> GrayImage {
    let contrast = 100.0 * (1.0 - (focal_power.get() - FocalPower::MIDDLE.get()).abs());
    let is_bright = |place: usize| (place / 4).is_multiple_of(2);
    let level = |place: usize| if is_bright(place) { 128.0 + contrast } else { 128.0 - contrast };
    let data = (0..SIDE * SIDE).map(|place| level(place) as f32).collect();
    GrayImage::new(SIDE, SIDE, data).unwrap()
}

/// A scan of one pose.
fn make_scan(folder: &Path) {
    let focal_powers = evenly_spread(PICTURES);
    let header = Header { order: PictureOrder::Random, ..Header::new("a test's", 1, 1, focal_powers.clone()) };

    let mut recording = ScanRecording::open(folder, &header).unwrap();
    let images = focal_powers.iter().map(|&power| (power, picture(power))).collect();
    let patch = PatchArea::central(SIDE, SIDE, None).unwrap();
    recording.store(&TakenPose { pose: 1, images, patch, optimum: FocalPower::MIDDLE, truth: None }).unwrap();
}

/// The pictures of one pose, named as `scan import` expects them.
fn make_pictures(folder: &Path) {
    for power in evenly_spread(PICTURES) {
        save(&picture(power), &folder.join(format!("pose001_f{:.3}.png", power.get())));
    }
}

fn make_checkpoint(folder: &Path) {
    let mut checkpoint = Checkpoint::default();
    checkpoint.put_bytes("patches", vec![7; 13]);
    checkpoint.put_floats("loss", [0.5, 0.25]);
    checkpoint.put_store("network", &network());
    checkpoint.notes.insert("updates".to_owned(), "3".to_owned());
    checkpoint.write(&folder.join(checkpoint::CHECKPOINT)).unwrap();
}

fn save(picture: &GrayImage, path: &Path) {
    let gray = picture.data.iter().map(|&level| level as u8).collect();
    image::GrayImage::from_raw(SIDE as u32, SIDE as u32, gray).unwrap().save(path).unwrap();
}

/// A stack's pictures, and a list with the position of each.
fn make_stack(folder: &Path) {
    let pictures = folder.join("pictures");
    fs::create_dir(&pictures).unwrap();

    let mut list = "file,position\n".to_owned();
    for (number, power) in evenly_spread(PICTURES).into_iter().enumerate() {
        let name = format!("plane{number}.png");
        save(&picture(power), &pictures.join(&name));
        writeln!(list, "{name},{number}").unwrap();
    }
    fs::write(folder.join(LIST), list).unwrap();
}
