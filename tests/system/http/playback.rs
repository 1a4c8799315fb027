//! Playing recordings to the researcher: when, to whom, with which times, and the message if a recording is broken.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use parfocal_devices::camera::calibration;
use parfocal_imaging::{Developer, GrayImage, RgbImage, Size};
use parfocal_recording::{Recording, ViewRecording};
use reqwest::StatusCode;
use serde_json::{Value, json};
use sqlx::AssertSqlSafe;

use super::recordings::{abort, begin, recordings, start, until};
use crate::support::{Server, parfocal};

/// A recorded session by `protocol` that has ended. Returns its id.
async fn recorded(server: &Server, protocol: &str) -> String {
    let session = begin(server, protocol).await;
    until(server, |status| status["frames"].as_u64() >= Some(30)).await;
    abort(server, &session).await;
    until(server, |status| status["recording"].is_null() && status["notice"].is_string()).await;
    session
}

async fn get(server: &Server, role: &str, session: &str, rest: &str) -> (StatusCode, Vec<u8>) {
    let path = format!("/api/researcher/sessions/{session}/{rest}");
    let answer = server.get_as(role, &path).send().await.unwrap();
    (answer.status(), answer.bytes().await.unwrap().to_vec())
}

async fn get_json(server: &Server, session: &str, rest: &str) -> Value {
    let (status, body) = get(server, "researcher", session, rest).await;
    assert_eq!(status, StatusCode::OK, "{rest}: {}", String::from_utf8_lossy(&body));
    serde_json::from_slice(&body).unwrap()
}

async fn refusal(server: &Server, session: &str, rest: &str) -> (StatusCode, String) {
    let (status, body) = get(server, "researcher", session, rest).await;
    (status, String::from_utf8(body).unwrap())
}

async fn unblind(server: &Server, session: &str) {
    let path = format!("/api/researcher/sessions/{session}/unblind");
    let body = json!({"reason": "the study is over", "despite_outstanding": true});
    let answer = server.post_as("researcher", &path).json(&body).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::NO_CONTENT, "{}", answer.text().await.unwrap());
}

/// The number in the only row that `sql` selects from the server's database.
async fn number(server: &Server, sql: &str) -> i64 {
    let pool = server.database().await;
    let number = sqlx::query_scalar(AssertSqlSafe(sql.to_owned())).fetch_one(&pool).await.unwrap();
    pool.close().await;
    number
}

fn frame(name: &str, number: usize, size: &str) -> String {
    format!("recordings/{name}/frames/{number}?size={size}")
}

fn spectrum(name: &str, number: usize, place: &str) -> String {
    format!("recordings/{name}/frames/{number}/spectrum?{place}")
}

/// Compares with `parfocal recording spectrum`, which is compared with Spectral Python.
async fn the_spectrum_is_that_of_the_command(server: &Server, session: &str) {
    let found = get_json(server, session, &spectrum(session, 7, "x=1000.5&y=500&radius=40")).await;
    let folder = recordings(server).join(session);
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.args(["recording", "spectrum", "--at", "1000.5,500", "--radius", "40", "--frames", "7"]).arg(folder);
    let table = command.output().unwrap().stdout;
    let rows = csv::Reader::from_reader(table.as_slice()).into_deserialize::<BTreeMap<String, Option<f64>>>();
    let rows: Vec<_> = rows.map(Result::unwrap).collect();
    assert_eq!(found["bands"], json!(rows));
    assert_eq!(found["bands"].as_array().unwrap().len(), 16);
    assert!(found["cells"].as_u64().unwrap() > 300, "{found}");

    let (status, said) = refusal(server, session, &spectrum(session, 7, "x=2048&y=0")).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(said.contains("the place 2048,0 is outside the picture of 2048x1088 samples"), "{said}");
}

/// Mean absolute difference between a JPEG picture and the developed frame `number` of `recording`.
fn difference(jpeg: &[u8], recording: &Recording, number: usize, size: Size) -> f64 {
    let calibration = calibration::read(&recording.calibration()).unwrap();
    let mut picture = RgbImage::default();
    let mosaic = recording.frame(number).unwrap();
    Developer::new(&calibration).develop(&mosaic, size, &mut picture, &mut GrayImage::default());

    let shown = image::load_from_memory(jpeg).unwrap().into_rgb8();
    assert_eq!((shown.width() as usize, shown.height() as usize), (picture.width, picture.height));
    let apart = shown.as_raw().iter().zip(&picture.data).map(|(a, b)| f64::from(a.abs_diff(*b)));
    apart.sum::<f64>() / picture.data.len() as f64
}

#[tokio::test]
async fn a_recording_is_played_to_the_researcher_alone_and_only_after_unblinding() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = recorded(&server, "recorded").await;
    for rest in ["recordings".to_owned(), frame(&session, 0, "cell"), spectrum(&session, 0, "x=9&y=9")] {
        for role in ["surgeon", "operator"] {
            assert_eq!(get(&server, role, &session, &rest).await.0, StatusCode::FORBIDDEN, "{role} {rest}");
        }
        let (status, said) = refusal(&server, &session, &rest).await;
        assert_eq!(status, StatusCode::CONFLICT, "{rest}");
        assert!(said.contains("only once its session is unblinded"), "{said}");
    }
    let points = |timeline: &Value| timeline["points"].as_array().unwrap().clone();
    let blinded = points(&get_json(&server, &session, "timeline").await);
    assert!(blinded.iter().all(|point| point["metric"].is_null()), "the metric's scale names the policy");

    unblind(&server, &session).await;
    let found = get_json(&server, &session, "recordings").await;
    assert_eq!(found["problems"], json!([]));
    let [played] = found["recordings"].as_array().unwrap().as_slice() else { panic!("{found}") };
    assert_eq!((&played["name"], &played["kind"]), (&session.clone().into(), &"mosaic".into()));
    assert_eq!(played.as_object().unwrap().len(), 4, "pictures and times, and nothing else: {played}");

    // Compare with the telemetry of the same frame, which another part of the server wrote.
    let recording = Recording::open(&recordings(&server).join(&session)).unwrap();
    let rows = recording.rows();
    let times: Vec<i64> = rows.iter().map(|row| (row.time - rows[0].time) / 1_000_000).collect();
    assert_eq!(played["times_ms"], json!(times));
    let exposed = number(&server, &format!("SELECT exposed_ns FROM telemetry WHERE frame = {}", rows[0].number)).await;
    let started = number(&server, "SELECT monotonic_ns FROM events WHERE kind = 'started'").await;
    let expected = (exposed - started) as f64 / 1e9;
    assert!((played["from"].as_f64().unwrap() - expected).abs() < 1e-3, "{} {expected}", played["from"]);

    for (name, size) in [("cell", Size::Cell), ("half", Size::Half)] {
        let (status, jpeg) = get(&server, "researcher", &session, &frame(&session, 7, name)).await;
        assert_eq!(status, StatusCode::OK);
        let apart = difference(&jpeg, &recording, 7, size);
        assert!(apart < 5.0, "{name}: {apart} apart");
    }
    the_spectrum_is_that_of_the_command(&server, &session).await;
    let viewed = "SELECT count(*) FROM accesses WHERE kind = 'recording-viewed' AND role = 'researcher'";
    assert_eq!(number(&server, viewed).await, 1, "the look at it is recorded");

    // A withdrawal ends access, even if the recording is being played.
    let withdraw = format!("/api/researcher/sessions/{session}/withdraw");
    let withdraw = server.post_as("researcher", &withdraw).json(&json!({"reason": "wants no part in it"}));
    assert_eq!(withdraw.send().await.unwrap().status(), StatusCode::NO_CONTENT);
    let places = [frame(&session, 7, "cell"), spectrum(&session, 7, "x=9&y=9")];
    for rest in ["recordings", "timeline", "course"].map(str::to_owned).into_iter().chain(places) {
        let (status, said) = refusal(&server, &session, &rest).await;
        assert!(status == StatusCode::CONFLICT && said.contains("the participant withdrew"), "{rest}: {said}");
    }
}

#[tokio::test]
async fn a_recording_whose_session_has_just_ended_is_not_called_cut_short() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "recorded").await;
    unblind(&server, &session).await;
    until(&server, |status| status["recording"].is_string()).await;
    let young = get_json(&server, &session, "recordings").await;
    let under_way = |said: &Value| said.as_str().unwrap().contains("holds no frame yet. If it is under way");
    assert!(young["problems"].as_array().unwrap().iter().all(under_way), "{young}");

    until(&server, |status| status["frames"].as_u64() >= Some(30)).await;
    abort(&server, &session).await;
    let found = get_json(&server, &session, "recordings").await;
    assert_eq!((found["recordings"].as_array().unwrap().len(), &found["problems"]), (1, &json!([])), "{found}");
}

#[tokio::test]
async fn the_view_is_played_as_it_was_recorded() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = recorded(&server, "viewed").await;
    unblind(&server, &session).await;
    let found = get_json(&server, &session, "recordings").await;
    assert_eq!(found["recordings"][0]["kind"], "view");

    let view = ViewRecording::open(&recordings(&server).join(&session)).unwrap();
    assert_eq!(found["recordings"][0]["times_ms"].as_array().unwrap().len(), view.rows().len());
    let (_, jpeg) = get(&server, "researcher", &session, &frame(&session, 12, "half")).await;
    assert!(jpeg == view.picture(12).unwrap());

    let (status, said) = refusal(&server, &session, &spectrum(&session, 12, "x=9&y=9")).await;
    assert!(status == StatusCode::NOT_FOUND && said.contains("has no spectra, only colours"), "{said}");
}

#[tokio::test]
async fn a_broken_or_missing_recording_is_reported_and_the_timeline_still_works() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = recorded(&server, "recorded").await;
    unblind(&server, &session).await;
    let folder = recordings(&server).join(&session);
    let frames = Recording::open(&folder).unwrap().rows().len();

    // No request can leave the session's own recordings.
    std::fs::create_dir(recordings(&server).join("other")).unwrap();
    for name in ["other", "..", "%2e%2e", "..%2Frecordings%2Fother", ""] {
        assert_eq!(refusal(&server, &session, &frame(name, 0, "cell")).await.0, StatusCode::NOT_FOUND, "{name}");
    }
    let (status, said) = refusal(&server, &session, &frame(&session, frames, "cell")).await;
    assert!(status == StatusCode::NOT_FOUND && said.contains(&format!("there is no frame {frames}")), "{said}");

    std::fs::remove_file(folder.join("mosaic/c/0/0/0")).unwrap();
    let (status, said) = refusal(&server, &session, &frame(&session, 3, "cell")).await;
    assert_eq!(status, StatusCode::INTERNAL_SERVER_ERROR);
    assert!(said.contains("the file is missing, so frames 0 to 24 are lost"), "{said}");
    assert_eq!(get(&server, "researcher", &session, &frame(&session, 27, "cell")).await.0, StatusCode::OK);

    let problem = async || {
        let found = get_json(&server, &session, "recordings").await;
        assert_eq!(found["recordings"], json!([]), "{found}");
        get_json(&server, &session, "timeline").await;
        found["problems"][0].as_str().unwrap().to_owned()
    };
    std::fs::write(folder.join("zarr.json"), "{").unwrap();
    assert!(problem().await.contains("does not describe a recording"));
    std::fs::rename(&folder, server.data.path().join("elsewhere")).unwrap();
    assert!(problem().await.contains("It was moved or removed"));
    assert_eq!(refusal(&server, &session, &frame(&session, 27, "cell")).await.0, StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn a_session_that_asks_for_no_recording_has_nothing_to_play() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "places").await;
    abort(&server, &session).await;
    unblind(&server, &session).await;
    let found = get_json(&server, &session, "recordings").await;
    assert_eq!(found, json!({"recordings": [], "problems": []}));
}

#[tokio::test]
async fn the_export_of_a_session_that_has_just_ended_holds_its_recording_to_the_end() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = begin(&server, "recorded").await;
    until(&server, |status| status["frames"].as_u64() >= Some(30)).await;
    abort(&server, &session).await;

    let (status, export) = get(&server, "researcher", &session, "export.zip").await;
    assert_eq!(status, StatusCode::OK);
    let out = tempfile::tempdir().unwrap();
    zip::ZipArchive::new(Cursor::new(export)).unwrap().extract(out.path()).unwrap();
    let folder = std::fs::read_dir(out.path()).unwrap().next().unwrap().unwrap().path();
    let rows = recording_rows(&folder);
    let frames = Recording::open(&recordings(&server).join(&session)).unwrap().rows().len();
    assert_eq!((rows[0]["ended"].as_str(), &rows[0]["frames"]), ("stopped", &frames.to_string()));
}

/// Exports `session`, checks the export with `parfocal verify`, and returns the rows of its `recordings.csv`.
fn exported(server: &Server, session: &str, out: &Path) -> Vec<BTreeMap<String, String>> {
    let export = ["export", session, "--out", out.to_str().unwrap(), "--data-dir"];
    let (exported, said) = parfocal(&export, server.data.path());
    assert!(exported, "{said}");
    let (verified, said) = parfocal(&["verify"], out);
    assert!(verified, "{said}");

    recording_rows(out)
}

/// The rows of `recordings.csv` in the folder of an export.
fn recording_rows(export: &Path) -> Vec<BTreeMap<String, String>> {
    let mut table = csv::Reader::from_path(export.join("recordings.csv")).unwrap();
    table.deserialize().map(Result::unwrap).collect()
}

#[tokio::test]
async fn an_export_names_the_recordings_and_a_broken_one_keeps_nobody_from_exporting() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let session = recorded(&server, "recorded").await;
    let folder = recordings(&server).join(&session);
    let recording = Recording::open(&folder).unwrap();
    let out = tempfile::tempdir().unwrap();

    let rows = exported(&server, &session, &out.path().join("blinded"));
    let [row] = rows.as_slice() else { panic!("{rows:?}") };
    assert_eq!((row["name"].as_str(), row["kind"].as_str()), (session.as_str(), "mosaic"));
    assert_eq!(row["path"], format!("recordings/{session}"));
    assert_eq!(row["frames"], recording.rows().len().to_string());
    assert_eq!((row["lost"].as_str(), row["ended"].as_str(), row["run"].as_str()), ("0", "stopped", "1"));
    assert_eq!(row["last_ns"], recording.rows().last().unwrap().time.to_string());
    let sum = Command::new("sha256sum").arg(folder.join("zarr.json")).output().unwrap();
    assert!(String::from_utf8(sum.stdout).unwrap().starts_with(&row["description_sha256"]));

    std::fs::write(folder.join("zarr.json"), "{").unwrap();
    let rows = exported(&server, &session, &out.path().join("broken"));
    assert!(rows[0]["problem"].contains("does not describe a recording") && rows[0]["frames"].is_empty(), "{rows:?}");

    // A change to the export is noticed.
    let table = out.path().join("blinded/recordings.csv");
    let text = std::fs::read_to_string(&table).unwrap();
    std::fs::write(&table, text.replace(",stopped,", ",lost,")).unwrap();
    assert!(!parfocal(&["verify"], &out.path().join("blinded")).0);
}
