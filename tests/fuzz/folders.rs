//! Parsers that read files and folders: each thread has its own folder, in which the input replaces one file at a time.
//! For a folder of several files, the input's first byte says which.

use std::cell::LazyCell;
use std::fs;
use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_dashboard::http::keys::Keys;
use parfocal_dashboard::tls::Certificates;
use parfocal_devices::camera::calibration::tables;
use parfocal_imaging::{Calibration, MosaicFrame};
use parfocal_recording::{
    CapturedFrame, Ended, FORMAT, Header, PatchRow, Recorder, Recording, VERSION, VIEW_FORMAT, VIEW_VERSION,
    ViewHeader, ViewRecording, ViewWriter, Writer, of_session,
};
use parfocal_records::store::export::verify::verify;
use tempfile::TempDir;

use super::ROOT;

/// A folder in which one file at a time is replaced.
pub struct Folder {
    root: TempDir,
    /// The files below it, in order, and their contents.
    files: Vec<(PathBuf, Vec<u8>)>,
}

impl Folder {
    /// A folder with the files that `fill` writes.
    pub fn made_by(fill: impl FnOnce(&Path)) -> Self {
        let root = tempfile::tempdir().unwrap();
        fill(root.path());
        let mut files = Vec::new();
        collect(root.path(), &mut files);
        files.sort();
        Self { root, files }
    }

    /// The file that is replaced by an input whose first byte is `which`.
    pub fn file(&self, which: u8) -> &Path {
        &self.files[usize::from(which) % self.files.len()].0
    }

    /// Calls `look` on the folder while `input` replaces one of its files.
    pub fn with(&self, input: &[u8], look: impl FnOnce(&Path)) {
        let Some((&which, content)) = input.split_first() else { return };
        let (file, before) = &self.files[usize::from(which) % self.files.len()];
        fs::write(file, content).unwrap();
        look(self.root.path());
        fs::write(file, before).unwrap();
    }

    /// Each file as an input.
    pub fn seeds(&self) -> Vec<Vec<u8>> {
        assert!(self.files.len() <= 256, "a byte says which file");
        let numbered = self.files.iter().enumerate();
        numbered.map(|(number, (_, content))| [&[number as u8], content.as_slice()].concat()).collect()
    }
}

fn collect(folder: &Path, files: &mut Vec<(PathBuf, Vec<u8>)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            let content = fs::read(&path).unwrap();
            files.push((path, content));
        }
    }
}

thread_local! {
    static EXPORT: LazyCell<Folder> = LazyCell::new(|| Folder::made_by(|folder| {
        let template = Path::new(ROOT).join("tests/vectors/export");
        for entry in fs::read_dir(template).unwrap() {
            let file = entry.unwrap().path();
            fs::copy(&file, folder.join(file.file_name().unwrap())).unwrap();
        }
    }));
    static RECORDING: LazyCell<Folder> = LazyCell::new(|| Folder::made_by(make_recording));
    static VIEW: LazyCell<Folder> = LazyCell::new(|| Folder::made_by(make_view));
    static AUTHORITY: LazyCell<Folder> = LazyCell::new(|| Folder::made_by(make_authority));
    static CERTIFICATE: LazyCell<Folder> = LazyCell::new(|| Folder::made_by(make_certificate));
    static ALONE: LazyCell<TempDir> = LazyCell::new(|| tempfile::tempdir().unwrap());
}

/// An export that is verified, with one of its files replaced.
pub fn export(bytes: &[u8]) {
    EXPORT.with(|export| export.with(bytes, |folder| assert!(!verify(folder, None).is_empty())));
}

/// The files of an export.
pub fn export_files() -> Vec<Vec<u8>> {
    EXPORT.with(|export| export.seeds())
}

/// A recording that is opened and read, with one of its files replaced.
pub fn recording(bytes: &[u8]) {
    RECORDING.with(|recording| {
        recording.with(bytes, |folder| {
            let Ok(recording) = Recording::open(&folder.join("recording")) else { return };
            let _ = (recording.rate(), recording.seconds(), recording.missing(), recording.bytes());
            for frame in 0..recording.rows().len().min(3) {
                let _ = recording.frame(frame);
            }
        });
    });
}

/// The files of a recording.
pub fn recording_files() -> Vec<Vec<u8>> {
    RECORDING.with(|recording| recording.seeds())
}

/// A recording of the view that is opened and read, with one of its files replaced.
pub fn view(bytes: &[u8]) {
    VIEW.with(|view| {
        view.with(bytes, |folder| {
            let Ok(view) = ViewRecording::open(&folder.join("view")) else { return };
            let _ = (view.bytes(), view.check());
            let _ = of_session(folder, "00000000-0000-4000-8000-000000000002");
        });
    });
}

/// The files of a recording of the view.
pub fn view_files() -> Vec<Vec<u8>> {
    VIEW.with(|view| view.seeds())
}

/// The stored local authority, with one of its files replaced.
pub fn authority(bytes: &[u8]) {
    AUTHORITY.with(|authority| {
        authority.with(bytes, |folder| {
            let _ = Certificates::local(folder, IpAddr::V4(Ipv4Addr::LOCALHOST), now());
        });
    });
}

/// The stored files of a local authority.
pub fn authorities() -> Vec<Vec<u8>> {
    AUTHORITY.with(|authority| authority.seeds())
}

/// A certificate and its key, with one of the two replaced.
pub fn certificate(bytes: &[u8]) {
    CERTIFICATE.with(|certificate| {
        certificate.with(bytes, |folder| {
            let _ = Certificates::given(folder.join("certificate.pem"), folder.join("key.pem"), now());
        });
    });
}

/// The files of the certificate and of its key.
pub fn certificates() -> Vec<Vec<u8>> {
    CERTIFICATE.with(|certificate| certificate.seeds())
}

/// The file of the roles' keys.
pub fn keys(bytes: &[u8]) {
    ALONE.with(|folder| {
        fs::write(folder.path().join("keys.toml"), bytes).unwrap();
        let _ = Keys::load_or_create(folder.path());
    });
}

/// A maker's tables of a sensor.
pub fn calibration_table(bytes: &[u8]) {
    ALONE.with(|folder| {
        let file = folder.path().join("table.csv");
        fs::write(&file, bytes).unwrap();
        let _ = tables::bands(&file, &(460.0..=600.0));
        let _ = tables::correction(&file);
    });
}

/// A recording of three frames of 8 x 8 samples.
fn make_recording(folder: &Path) {
    const SIZE: usize = 8;
    let calibration = Calibration::default();
    let header = Header {
        format: FORMAT.to_owned(),
        version: VERSION,
        software: "a test".to_owned(),
        started: "2026-03-01T12:00:00Z".parse().unwrap(),
        camera: "a test's".to_owned(),
        lens: "a test's".to_owned(),
        simulated: true,
        calibration: calibration.title(),
        camera_settings: [("gain".to_owned(), 2.5)].into(),
        session: None,
        run: None,
        monotonic_ns: None,
        frames_lost: 0,
        ended: None,
    };

    let writer = Writer::create(&folder.join("recording"), header, (SIZE, SIZE), &calibration).unwrap();
    let recorder = Recorder::start(writer, Moment::default()).unwrap();
    for number in 0..3 {
        recorder.intake().offer(CapturedFrame {
            number,
            exposed_at: Moment::from_nanos(number * 20_000_000),
            exposure: Duration::from_millis(2),
            asked: FocalPower::MIDDLE,
            measured: None,
            optimal: None,
            patch: PatchRow { corner: (0, 0), jumps: 0 },
            mosaic: Arc::new(MosaicFrame::new(SIZE, SIZE, vec![number as u16; SIZE * SIZE]).unwrap()),
        });
    }
    assert_eq!(recorder.stop().lost, 0);
}

/// A recording of the view of three pictures.
fn make_view(folder: &Path) {
    let header = ViewHeader {
        format: VIEW_FORMAT.to_owned(),
        version: VIEW_VERSION,
        software: "a test".to_owned(),
        started: "2026-03-01T12:00:00Z".parse().unwrap(),
        camera: "a test's".to_owned(),
        session: Some("00000000-0000-4000-8000-000000000002".to_owned()),
        run: Some(1),
        monotonic_ns: Some(0),
        ended: None,
    };
    let mut writer = ViewWriter::create(&folder.join("view"), header).unwrap();
    for number in 0..3 {
        writer.add(number, number * 20_000_000, (8, 8), b"\xFF\xD8 a picture \xFF\xD9").unwrap();
    }
    writer.finish(Ended::Stopped).unwrap();
}

/// The moment at which certificates are looked at.
fn now() -> Timestamp {
    "2026-06-01T00:00:00Z".parse().unwrap()
}

/// The files of a local authority.
fn make_authority(folder: &Path) {
    Certificates::local(folder, IpAddr::V4(Ipv4Addr::LOCALHOST), now()).unwrap();
}

/// A certificate that it signed itself, and its key.
fn make_certificate(folder: &Path) {
    let key = rcgen::KeyPair::generate().unwrap();
    let certificate =
        rcgen::CertificateParams::new(["parfocal.example".to_owned()]).unwrap().self_signed(&key).unwrap();
    fs::write(folder.join("certificate.pem"), certificate.pem()).unwrap();
    fs::write(folder.join("key.pem"), key.serialize_pem()).unwrap();
}
