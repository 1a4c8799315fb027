//! An open study on a bad day: the server is killed again and again, mostly while something else fails too. The
//! database has everything that the tablet took, once and in order. The orders stay as they were drawn, the chain is
//! complete, and nothing tells the surgeon which policy runs.
//!
//! The test kills the server 4 times, and 8 times in `make check`, once for each trouble. With `PARFOCAL_KILLS=50` it
//! takes five minutes, `PARFOCAL_KILLS=100` ten.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::emulator::{Emulator, Model};
use serde_json::json;
use sha2::{Digest, Sha256};
use sqlx::{Connection, SqliteConnection};
use tempfile::TempDir;

use super::blinding;
use super::driver::Driver;
use super::proxy::Proxy;
use super::theatre::{Theatre, kill};
use super::wait::until;
use crate::support::disk::SmallDisk;
use crate::support::{PASSPHRASE, Server, parfocal};

/// Comments per setting: two, each interrupted by a kill, so that the day reaches the next setting.
const COMMENTS_A_SETTING: usize = 2;

const SURGEONS: usize = 40;

const PROTOCOL: &str = r#"
name = "bad-day"
title = "Comparison of two focus settings"
researcher_title = "Two policies, once each"
policies = ["fixed", "mgm-hill-climber"]
repeats = 1
order = "balanced"
segment_seconds = 600

[[after_segment]]
id = "sharpness"
text = "With this setting, what I wanted to see was in focus."
kind = "likert"
points = 7
low = "Strongly disagree"
high = "Strongly agree"
"#;

/// What fails while the surgeon speaks.
#[derive(Debug, Clone, Copy)]
enum Trouble {
    Nothing,
    FullDisk,
    LockedDatabase,
    Network,
    Lens,
    Camera,
    Backup,
    /// The network and the lens at once.
    Both,
}

const TROUBLES: [Trouble; 8] = [
    Trouble::Nothing,
    Trouble::FullDisk,
    Trouble::LockedDatabase,
    Trouble::Network,
    Trouble::Lens,
    Trouble::Camera,
    Trouble::Backup,
    Trouble::Both,
];

/// What fails without `PARFOCAL_KILLS`: a whole session of a disk, a database, a camera, a network and a lens in
/// trouble.
const FEW: [Trouble; 4] = [Trouble::FullDisk, Trouble::LockedDatabase, Trouble::Camera, Trouble::Both];

#[tokio::test(flavor = "multi_thread")]
async fn an_open_study_survives_a_bad_day() {
    let many = |text: String| {
        let kills = text.parse().expect("a number of kills");
        TROUBLES.into_iter().cycle().take(kills).collect()
    };
    let troubles: Vec<Trouble> = std::env::var("PARFOCAL_KILLS").map_or_else(|_| FEW.to_vec(), many);

    let driver = Driver::start();
    let mut day = Day::begin(&driver).await;

    for (number, trouble) in troubles.into_iter().enumerate() {
        if number % COMMENTS_A_SETTING == 0 {
            day.next_setting().await;
        }
        day.speak_and_kill(trouble, number).await;
    }
    day.end().await;
}

struct Day {
    theatre: Theatre,
    disk: Option<SmallDisk>,
    lens: Emulator,
    camera: Camera,
    protocols: TempDir,
    /// Folder for backups.
    elsewhere: TempDir,
    /// Token of the lead, who acts as operator and researcher.
    token: String,
    /// The session under way, if any, and how many of its settings have begun.
    session: Option<(String, usize)>,
    /// The surgeon's comments, by session.
    said: BTreeMap<String, Vec<String>>,
    /// The seed of all orders, as drawn.
    seed: String,
}

impl Day {
    /// Plans and opens a study.
    async fn begin(driver: &Driver) -> Self {
        let disk = SmallDisk::of_megabytes(64);
        let folder =
            disk.as_ref().map_or_else(|| Arc::new(tempfile::tempdir().unwrap()), |disk| Arc::clone(&disk.folder));
        let protocols = tempfile::tempdir().unwrap();
        std::fs::write(protocols.path().join("bad-day.toml"), PROTOCOL).unwrap();
        let lens = Emulator::start(Model::default(), Arc::new(SystemClock)).unwrap();
        let camera = Camera::start();

        let mut server = start(folder, "127.0.0.1:0", protocols.path(), &lens, &camera);
        server.add_account("lead", "lead", "Dr Lead");
        let token = server.sign_in("lead").await;
        show(&mut server, &token);
        let definition = definition();
        server.post("/api/researcher/studies", json!({"definition": definition, "reason": "approved"})).await;
        let opening = json!({"change": "open", "reason": "the first surgeon comes"});
        server.post("/api/researcher/studies/bad-day/changes", opening).await;

        let proxy = Proxy::to(server.address).await;
        let (surgeon, operator) = tokio::join!(driver.browser(), driver.browser());
        operator.open(&server.link("operator")).await;
        let theatre = Theatre { server, proxy, surgeon, operator };
        let mut day = Self {
            theatre,
            disk,
            lens,
            camera,
            protocols,
            elsewhere: tempfile::tempdir().unwrap(),
            token,
            session: None,
            said: BTreeMap::new(),
            seed: String::new(),
        };
        day.seed = day.drawn().await;
        day
    }

    fn folder(&self) -> &Path {
        self.theatre.server.data.path()
    }

    /// Begins the next setting; if the session is over, the first setting of the next surgeon's.
    async fn next_setting(&mut self) {
        let mut under_way = self.session.take();
        if let Some((session, begun)) = &under_way {
            self.theatre.finish_setting(4).await;
            if *begun == 2 {
                self.theatre.surgeon.sees("#panel", "Thank you").await;
                self.theatre.server.post("/api/operator/dismissals", json!({"session": session})).await;
                under_way = None;
            }
        }

        let (session, begun) = match under_way {
            Some(under_way) => under_way,
            None => (self.prepare().await, 0),
        };
        self.theatre.tap_notice(begun + 1).await;
        self.session = Some((session, begun + 1));
    }

    /// Prepares and starts a session of the next surgeon; the tablet opens its link.
    async fn prepare(&mut self) -> String {
        let server = &self.theatre.server;
        let participant = format!("S-{:02}", self.said.len() + 1);
        server.post("/api/operator/participants", json!({"code": participant})).await;
        let study = json!({"study": "bad-day", "site": "leeds"});
        let new = json!({"participant": participant, "protocol": "bad-day", "study": study});
        let made = server.post("/api/operator/sessions", new).await;
        let session = made["session"].as_str().unwrap().to_owned();

        let link = server.read("/api/operator/surgeon-link").await;
        let (_, key) = link["link"].as_str().unwrap().split_once("key=").unwrap();
        self.theatre.surgeon.open(&format!("http://{}/enter?key={key}", self.theatre.proxy.address)).await;
        self.theatre.surgeon.sees("#panel", "You will look at 2 settings").await;
        server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;
        self.said.insert(session.clone(), Vec::new());
        session
    }

    /// The surgeon says something during `trouble`, and the server is killed before anybody waits for an answer.
    async fn speak_and_kill(&mut self, trouble: Trouble, number: usize) {
        let (session, _) = self.session.clone().unwrap();
        let mut locked = self.begin_trouble(trouble, number).await;
        let text = format!("comment {number} in {trouble:?}");
        self.theatre.write(&text).await;
        self.theatre.surgeon.type_into("#comment", "\u{e007}").await;
        let said = self.said.get_mut(&session).unwrap();
        said.push(text);
        let total = said.len();

        // The tablet has taken the comment if the box is free again, even if nothing was sent.
        until("the tablet to take the comment", || async { self.theatre.comment_box().await.is_empty() }).await;
        kill(&mut self.theatre.server);
        if let Some(locked) = locked.take() {
            locked.close().await.unwrap();
        }
        self.end_trouble(trouble);
        let data = Arc::clone(&self.theatre.server.data);
        let address = self.theatre.server.address.to_string();
        self.theatre.server = start(data, &address, self.protocols.path(), &self.lens, &self.camera);
        show(&mut self.theatre.server, &self.token);

        // The session is paused where it was.
        let resume = json!({"session": session, "action": "resume"});
        self.theatre.server.post("/api/operator/actions", resume).await;
        self.theatre.sees_saved(total).await;
        self.theatre.surgeon.sees("#remaining", "left").await;
    }

    /// Starts a trouble. Returns the connection that locks the database, for [`Trouble::LockedDatabase`].
    async fn begin_trouble(&mut self, trouble: Trouble, number: usize) -> Option<SqliteConnection> {
        match trouble {
            Trouble::Nothing => {}
            Trouble::FullDisk => {
                if let Some(disk) = &self.disk {
                    disk.fill();
                }
            }
            Trouble::LockedDatabase => return Some(self.theatre.server.lock_database().await),
            Trouble::Network => self.theatre.proxy.break_silently(),
            Trouble::Lens => self.lens.unplug(),
            Trouble::Camera => self.camera.stall(),
            Trouble::Backup => {
                let said =
                    succeeds(&["backup", "--out", self.backup(number).to_str().unwrap(), "--data-dir"], self.folder());
                assert!(said.contains("verified"), "{said}");
            }
            Trouble::Both => {
                self.theatre.proxy.break_silently();
                self.lens.unplug();
            }
        }
        None
    }

    fn end_trouble(&mut self, trouble: Trouble) {
        match trouble {
            Trouble::FullDisk => {
                if let Some(disk) = &self.disk {
                    disk.empty();
                }
            }
            Trouble::Lens | Trouble::Both => self.lens.plug_in().unwrap(),
            Trouble::Camera => self.camera.go_on(),
            Trouble::Nothing | Trouble::LockedDatabase | Trouble::Network | Trouble::Backup => {}
        }
    }

    fn backup(&self, number: usize) -> PathBuf {
        self.elsewhere.path().join(format!("{number}.db"))
    }

    /// The seed from which all orders are drawn.
    async fn drawn(&self) -> String {
        let pool = self.theatre.server.database().await;
        let seed = sqlx::query_scalar("SELECT seed FROM study_seeds").fetch_one(&pool).await.unwrap();
        pool.close().await;
        seed
    }

    /// Ends the day: everything is there, and verifies.
    async fn end(mut self) {
        let (session, _) = self.session.take().unwrap();
        let abort = json!({"session": session, "action": "abort", "reason": "the day is over"});
        self.theatre.server.post("/api/operator/actions", abort).await;
        self.theatre.server.post("/api/operator/dismissals", json!({"session": session})).await;

        let pool = self.theatre.server.database().await;
        for (session, said) in &self.said {
            let kept: Vec<String> = sqlx::query_scalar("SELECT text FROM comments WHERE session = ? ORDER BY number")
                .bind(session)
                .fetch_all(&pool)
                .await
                .unwrap();
            assert_eq!(&kept, said, "each once, in the order said");
        }
        pool.close().await;
        assert_eq!(self.drawn().await, self.seed);

        // Nothing told the surgeon which policy ran.
        let seen = blinding::check(&self.theatre.proxy.recorded());
        assert!(seen.texts > 20 && seen.pictures > 20, "{} texts, {} pictures", seen.texts, seen.pictures);
        for browser in [&self.theatre.surgeon, &self.theatre.operator] {
            assert_eq!(browser.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
        }

        // The chain is complete, and each session had the order that was drawn for its place.
        for change in ["close", "lock", "unblind"] {
            let signed = json!({"change": change, "reason": "it is over", "passphrase": PASSPHRASE, "despite_outstanding": true});
            self.theatre.server.post("/api/researcher/studies/bad-day/changes", signed).await;
        }
        let said = succeeds(&["verify"], self.folder());
        assert!(said.contains("order"), "the orders were looked at: {said}");

        // A backup of the day can be restored into another folder, and verifies.
        let restored = tempfile::tempdir().unwrap();
        if let Some(backup) = std::fs::read_dir(self.elsewhere.path()).unwrap().next() {
            let backup = backup.unwrap().path();
            succeeds(&["restore", backup.to_str().unwrap(), "--data-dir"], restored.path());
            succeeds(&["verify"], restored.path());
        }
    }
}

/// Runs `parfocal` with `arguments` and `folder`, and returns its output.
fn succeeds(arguments: &[&str], folder: &Path) -> String {
    let (succeeded, said) = parfocal(arguments, folder);
    assert!(succeeded, "{arguments:?}: {said}");
    said
}

fn start(data: Arc<TempDir>, address: &str, protocols: &Path, lens: &Emulator, camera: &Camera) -> Server {
    let lens = format!("optotune:{}", lens.path().display());
    let protocols = protocols.to_str().unwrap();
    let mut arguments = vec!["--bind", address, "--fps", "10", "--protocols", protocols, "--lens", &lens];
    arguments.extend(camera.arguments());
    Server::on(data, &arguments)
}

/// Makes requests as operator and researcher use the lead's token.
fn show(server: &mut Server, token: &str) {
    server.use_key("operator", token);
    server.use_key("researcher", token);
}

fn definition() -> String {
    let sha256 = hex::encode(Sha256::digest(PROTOCOL));
    format!(
        "name = \"bad-day\"\ntitle = \"A study on a bad day\"\norder = \"balanced\"\naborted = \"same-place\"\n\
         withdrawn = \"next-spare\"\nrepeated = \"refuse\"\nwhen_used_up = \"Call the trial office.\"\n\
         may_unblind = [\"Dr Lead\"]\nanalysis = \"Wilcoxon signed-rank test on sharpness\"\n\
         [[protocols]]\nname = \"bad-day\"\nsha256 = \"{sha256}\"\n\
         [[sites]]\nname = \"leeds\"\ntitle = \"Leeds General Infirmary\"\nsurgeons = {SURGEONS}\nspares = 2\n"
    )
}

/// A camera that can be switched off, if the fake camera is available.
#[cfg(feature = "aravis")]
struct Camera(Option<crate::support::fake_camera::Fake>);

#[cfg(feature = "aravis")]
impl Camera {
    fn start() -> Self {
        Self(crate::support::fake_camera::Fake::start(&[]))
    }

    const fn arguments(&self) -> &[&'static str] {
        if self.0.is_some() { &["--camera", "gige:Aravis-Fake-TEST?width=512&height=512"] } else { &[] }
    }

    fn stall(&mut self) {
        if let Some(fake) = &mut self.0 {
            fake.kill();
        }
    }

    fn go_on(&mut self) {
        if let Some(fake) = &mut self.0 {
            fake.restart();
        }
    }
}

/// The phantom, which never stalls.
#[cfg(not(feature = "aravis"))]
struct Camera;

#[cfg(not(feature = "aravis"))]
impl Camera {
    const fn start() -> Self {
        Self
    }

    const fn arguments(&self) -> &[&'static str] {
        &[]
    }

    const fn stall(&mut self) {}

    const fn go_on(&mut self) {}
}
