//! Voice over HTTP: pieces are accepted only from a surgeon's tablet and played only to the researcher, in the byte
//! ranges that a browser requests. Only pages that need it may use the microphone or play sound.

use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

use crate::support::Server;

const COMMENT: &str = "00000000-0000-4000-8000-000000000001";
const OPUS: &str = "audio/webm;codecs=opus";

fn server() -> Server {
    let protocols = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/system/browser");
    Server::within_by(Some(Path::new(protocols)))
}

/// Sends a piece. Returns the status, and the error message if it is refused.
async fn send(server: &Server, role: &str, query: &str, media_type: &str, audio: Vec<u8>) -> (u16, String) {
    let path = format!("/api/surgeon/voice/{COMMENT}/{query}");
    let answer = server.post_as(role, &path).header("content-type", media_type).body(audio).send().await.unwrap();
    let status = answer.status().as_u16();
    let text = answer.text().await.unwrap();
    (status, serde_json::from_str::<Value>(&text).unwrap_or_default()["error"].as_str().unwrap_or_default().to_owned())
}

#[tokio::test]
async fn a_recording_comes_in_pieces_from_a_tablet_and_is_played_in_parts_to_the_researcher() {
    let server = server();
    let session = server.prepare("S-05", "spoken").await;
    let first = format!("1?session={session}&through_ms=1000");
    let (status, said) = send(&server, "surgeon", &first, OPUS, b"0123456789".to_vec()).await;
    assert!(status == 404 && said.contains("send the comment first"), "{status} {said}");

    let comment = json!({"key": COMMENT, "session": session, "kind": "voice"});
    server.post("/api/surgeon/comments", comment).await;
    for _ in 0..2 {
        assert_eq!(send(&server, "surgeon", &first, OPUS, b"0123456789".to_vec()).await, (204, String::new()));
    }
    let last = format!("2?session={session}&through_ms=1400&ended=released");
    assert_eq!(send(&server, "surgeon", &last, OPUS, b"abcdef".to_vec()).await.0, 204);

    for role in ["operator", "researcher"] {
        assert_eq!(send(&server, role, &first, OPUS, Vec::new()).await.0, 403, "{role}");
    }
    let other = send(&server, "surgeon", &first, OPUS, b"other".to_vec()).await;
    assert!(other.0 == 409 && other.1.contains("key is already used for something else"), "{other:?}");
    let wrong = send(&server, "surgeon", &format!("3?session={session}&through_ms=1500"), "image/png", vec![1]).await;
    assert!(wrong.0 == 422 && wrong.1.contains("not 'image/png'"), "{wrong:?}");
    let large = format!("3?session={session}&through_ms=1500");
    assert_eq!(send(&server, "surgeon", &large, OPUS, vec![0; 200_000]).await.0, 422);
    assert_eq!(send(&server, "surgeon", &format!("3?session={session}"), OPUS, vec![0]).await.0, 400);

    let path = format!("/api/researcher/sessions/{session}/voice/{COMMENT}");
    let whole = server.get_as("researcher", &path).send().await.unwrap();
    assert_eq!((whole.status().as_u16(), &whole.headers()["content-type"]), (200, &OPUS.parse().unwrap()));
    assert_eq!(whole.headers()["accept-ranges"], "bytes");
    assert_eq!(whole.bytes().await.unwrap().as_ref(), b"0123456789abcdef");

    let part = server.get_as("researcher", &path).header("range", "bytes=8-11").send().await.unwrap();
    assert_eq!((part.status().as_u16(), &part.headers()["content-range"]), (206, &"bytes 8-11/16".parse().unwrap()));
    assert_eq!(part.bytes().await.unwrap().as_ref(), b"89ab");
    let beyond = server.get_as("researcher", &path).header("range", "bytes=16-").send().await.unwrap();
    assert_eq!((beyond.status().as_u16(), &beyond.headers()["content-range"]), (416, &"bytes */16".parse().unwrap()));

    for role in ["surgeon", "operator"] {
        assert_eq!(server.get_as(role, &path).send().await.unwrap().status(), 403, "{role}");
    }
    let nobody = path.replace(COMMENT, "00000000-0000-4000-8000-000000000002");
    assert_eq!(server.get_as("researcher", &nobody).send().await.unwrap().status(), 404);
}

/// Three and a half seconds of a tone as browsers record: the file does not say how long it is. `None` without ffmpeg.
fn as_browsers_record(folder: &Path, name: &str, form: &[&str]) -> Option<Vec<u8>> {
    let file = folder.join(name);
    let tone = ["-v", "error", "-f", "lavfi", "-i", "sine=frequency=440:duration=3.5"];
    let made = Command::new("ffmpeg").args(tone).args(form).arg(&file).status();
    made.is_ok_and(|status| status.success()).then(|| std::fs::read(file).unwrap())
}

/// The length in seconds that the header of a file states; `None` if it states none.
fn stated(file: &Path) -> Option<f64> {
    let asked = ["-v", "error", "-show_entries", "format=duration", "-of", "default=nw=1:nk=1"];
    let output = Command::new("ffprobe").args(asked).arg(file).output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().parse().ok()
}

/// Chrome and Firefox record `WebM` with Opus, Safari MP4 with AAC.
#[tokio::test]
async fn a_recording_of_either_format_tells_its_player_how_long_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let webm = ["-c:a", "libopus", "-b:a", "24k", "-f", "webm", "-live", "1"];
    let mp4 = ["-c:a", "aac", "-b:a", "32k", "-f", "mp4", "-movflags", "empty_moov+default_base_moof+frag_keyframe"];
    let formats = [("live.webm", OPUS, webm.as_slice()), ("live.mp4", "audio/mp4", mp4.as_slice())];
    for (name, media_type, form) in formats {
        let Some(sound) = as_browsers_record(folder.path(), name, form) else {
            println!("skipped: no ffmpeg to make a recording with");
            return;
        };

        let server = server();
        let session = server.prepare("S-05", "spoken").await;
        let comment = json!({"key": COMMENT, "session": session, "kind": "voice"});
        server.post("/api/surgeon/comments", comment).await;
        let half = sound.len() / 2;
        let first = format!("1?session={session}&through_ms=1700");
        assert_eq!(send(&server, "surgeon", &first, media_type, sound[..half].to_vec()).await.0, 204);
        let last = format!("2?session={session}&through_ms=3500&ended=released");
        assert_eq!(send(&server, "surgeon", &last, media_type, sound[half..].to_vec()).await.0, 204);

        let path = format!("/api/researcher/sessions/{session}/voice/{COMMENT}");
        let played = server.get_as("researcher", &path).send().await.unwrap().bytes().await.unwrap();
        let file = folder.path().join(format!("played-{name}"));
        std::fs::write(&file, played).unwrap();
        let seconds = stated(&file);
        assert!(seconds.is_some_and(|seconds| (seconds - 3.5).abs() < 0.1), "{name}: {seconds:?}");
    }
}

#[tokio::test]
async fn only_the_pages_that_need_it_may_use_the_microphone_or_play_sound() {
    let server = server();
    let headers = async |role: &str, path: &str| {
        let answer = server.get_as(role, path).header("accept", "text/html").send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        let header = |name: &str| answer.headers()[name].to_str().unwrap().to_owned();
        (header("permissions-policy").contains("microphone=(self)"), header("content-security-policy"))
    };

    assert!(!headers("surgeon", "/surgeon").await.0, "no session");
    let silent = server.prepare("S-05", "practice").await;
    assert!(!headers("surgeon", "/surgeon").await.0, "a session without voice");
    let abort = json!({"session": silent, "action": "abort", "reason": "enough"});
    server.post("/api/operator/actions", abort).await;

    let session = server.prepare("S-06", "spoken").await;
    let (microphone, policy) = headers("surgeon", "/surgeon").await;
    assert!(microphone && !policy.contains("media-src"), "{policy}");
    assert!(!headers("operator", "/operator").await.0);
    let (microphone, policy) = headers("researcher", &format!("/researcher/sessions/{session}")).await;
    assert!(!microphone && policy.contains("media-src 'self'"), "{policy}");
    assert!(!headers("researcher", "/researcher").await.1.contains("media-src"));
}
