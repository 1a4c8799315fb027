//! Spoken comments in a real browser, whose microphone receives a tone: hold the button, speak, release; recordings
//! kept while the server is away and over a reload; refused microphones; and what the researcher hears.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use super::theatre::{Theatre, kill, start_again};
use super::wait::until;

/// Options of a browser that lets every page use a microphone, which receives `tone`.
fn hears(tone: &Path) -> Vec<String> {
    vec![
        "--use-fake-device-for-media-stream".to_owned(),
        "--use-fake-ui-for-media-stream".to_owned(),
        format!("--use-file-for-fake-audio-capture={}", tone.display()),
    ]
}

/// Frequency of the tone, in hertz.
const TONE: f64 = 440.0;

/// Ten seconds of a tone as a WAV file: 48 kHz, 16 bit, one channel.
fn write_tone(path: &Path) {
    const RATE: u32 = 48_000;
    let count = RATE * 10;
    let mut wav = Vec::new();
    wav.extend(b"RIFF");
    wav.extend((36 + count * 2).to_le_bytes());
    wav.extend(b"WAVEfmt ");
    wav.extend(16_u32.to_le_bytes());
    wav.extend(1_u16.to_le_bytes());
    wav.extend(1_u16.to_le_bytes());
    wav.extend(RATE.to_le_bytes());
    wav.extend((RATE * 2).to_le_bytes());
    wav.extend(2_u16.to_le_bytes());
    wav.extend(16_u16.to_le_bytes());
    wav.extend(b"data");
    wav.extend((count * 2).to_le_bytes());
    for sample in 0..count {
        let phase = f64::from(sample) / f64::from(RATE) * TONE * std::f64::consts::TAU;
        wav.extend(((phase.sin() * 12_000.0) as i16).to_le_bytes());
    }
    std::fs::write(path, wav).unwrap();
}

/// A theatre with a microphone, in the first setting of a session that accepts voice.
async fn speaking(driver: &Driver, folder: &TempDir) -> Theatre {
    let tone = folder.path().join("tone.wav");
    write_tone(&tone);
    let theatre = Theatre::heard(driver, Arc::new(tempfile::tempdir().unwrap()), &hears(&tone)).await;
    theatre.begin("S-09", "spoken").await;
    theatre.tap_notice(1).await;
    theatre.surgeon.sees("#talk-label", "Hold to talk").await;
    theatre
}

/// Puts a finger on the talk button, or lifts it.
async fn finger(page: &Browser, kind: &str) {
    let there = page.area("#talk").await;
    let x = there.left + there.width / 2.0;
    let y = there.top + there.height / 2.0;
    let mouse = json!({"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1});
    page.tools("Input.dispatchMouseEvent", mouse).await;
}

async fn hold(page: &Browser) {
    finger(page, "mousePressed").await;
}

async fn let_go(page: &Browser) {
    finger(page, "mouseReleased").await;
}

/// Presses a key, repeats it as a held key does, or releases it.
async fn key(page: &Browser, kind: &str, key: &str, repeat: bool) {
    let event = json!({"type": kind, "key": key, "code": key, "autoRepeat": repeat});
    page.tools("Input.dispatchKeyEvent", event).await;
}

/// The recordings in the database: the numbers of their pieces, the number of pieces, whether the end is there, and the
/// length in milliseconds.
async fn recorded(theatre: &Theatre) -> Vec<(String, i64, bool, i64)> {
    let pool = theatre.server.database().await;
    let rows = sqlx::query_as(
        "SELECT group_concat(piece, ' '), count(*), max(ended IS NOT NULL), max(through_ms)
         FROM (SELECT * FROM voice_pieces ORDER BY comment, piece) GROUP BY comment ORDER BY min(number)",
    );
    let rows = rows.fetch_all(&pool).await.unwrap();
    pool.close().await;
    rows
}

async fn until_recorded(theatre: &Theatre, recordings: usize) {
    until("every recording to have its end", || async {
        let kept = recorded(theatre).await;
        kept.len() == recordings && kept.iter().all(|(.., ended, _)| *ended)
    })
    .await;
}

async fn all_pieces(theatre: &Theatre) {
    for (pieces, count, ..) in recorded(theatre).await {
        let expected: Vec<String> = (1..=count).map(|piece| piece.to_string()).collect();
        assert_eq!(pieces, expected.join(" "), "each once");
    }
}

/// The operator ends the session, and the researcher opens it. Returns its id.
async fn open_session(theatre: &Theatre) -> String {
    let page = &theatre.operator;
    page.click_labelled("#session-actions", "Abort").await;
    theatre.give_reason("enough").await;
    page.sees("#phase", "Aborted").await;
    page.open(&theatre.server.link("researcher")).await;
    page.click("td a.button").await;
    page.sees("#comment-list", "Voice comment").await;
    page.attribute("#session", "data-session").await.unwrap()
}

/// Decodes the first recording in the page's browser: its length in seconds, and the frequency of its tone in hertz.
async fn decoded(page: &Browser) -> (f64, f64) {
    let decode = "const { src } = document.querySelector('.voice audio');
        return (async () => {
            const bytes = await (await fetch(src)).arrayBuffer();
            const sound = await new OfflineAudioContext(1, 1, 48000).decodeAudioData(bytes);
            const samples = sound.getChannelData(0);
            let crossings = 0;
            // Amid the recording, where the microphone has opened and not yet closed.
            const from = Math.floor(samples.length * 0.4);
            const to = Math.floor(samples.length * 0.8);
            for (let at = from + 1; at < to; at++) if (samples[at - 1] < 0 && samples[at] >= 0) crossings++;
            return [sound.duration, crossings / ((to - from) / sound.sampleRate)];
        })()";
    let found = page.run(decode, &[]).await;
    (found[0].as_f64().unwrap(), found[1].as_f64().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_comment_is_held_spoken_let_go_played_and_typed_out() {
    let folder = tempfile::tempdir().unwrap();
    let driver = Driver::start();
    let theatre = speaking(&driver, &folder).await;
    let page = &theatre.surgeon;
    shoot(page, "surgeon-voice-1-idle").await;

    hold(page).await;
    page.sees("#talk-label", "Recording 0:02").await;
    page.sees("#voice-state", "Saved as you speak").await;
    until("the meter to show the tone", || async {
        let scale = page.style("#talk-level", "transform").await;
        let level = scale.trim_start_matches("matrix(").split(',').next().and_then(|text| text.parse::<f64>().ok());
        level.is_some_and(|level| level > 0.3)
    })
    .await;
    shoot(page, "surgeon-voice-2-talking").await;
    page.sees("#talk-label", "Recording 0:0").await;
    let_go(page).await;
    page.sees("#talk-label", "Hold to talk").await;
    theatre.sees_saved(1).await;
    until_recorded(&theatre, 1).await;

    // A pedal: its key is held, so the browser repeats it. It works wherever the focus is.
    page.click("#comment").await;
    key(page, "keyDown", "F13", false).await;
    key(page, "keyDown", "F13", true).await;
    page.sees("#talk-label", "Recording 0:01").await;
    key(page, "keyDown", "F13", true).await;
    key(page, "keyUp", "F13", false).await;
    theatre.sees_saved(2).await;
    until_recorded(&theatre, 2).await;

    // In the comment box a space is only a space.
    page.insert("it").await;
    key(page, "keyDown", " ", false).await;
    key(page, "keyUp", " ", false).await;
    assert_eq!(page.text("#talk-label").await, "Hold to talk");
    page.clear("#comment").await;
    page.run("document.activeElement.blur()", &[]).await;
    key(page, "keyDown", " ", false).await;
    page.sees("#talk-label", "Recording").await;
    key(page, "keyUp", " ", false).await;
    theatre.sees_saved(3).await;
    until_recorded(&theatre, 3).await;
    all_pieces(&theatre).await;

    let length = recorded(&theatre).await[0].3 as f64 / 1000.0;
    let session = open_session(&theatre).await;
    let researcher = &theatre.operator;
    let (seconds, tone) = decoded(researcher).await;
    assert!((seconds - length).abs() < 0.5 && length >= 2.0, "{seconds} s decoded of {length} s");
    assert!((tone - TONE).abs() < 10.0, "{tone} Hz");
    is_opus(researcher, &session, &folder, seconds).await;

    researcher.run("document.querySelector('.voice audio').play()", &[]).await;
    until("the recording to play", || async {
        let played = "return document.querySelector('.voice audio').currentTime > 0.3";
        researcher.run(played, &[]).await == Value::Bool(true)
    })
    .await;

    researcher.click_labelled("#comment-list .beside", "Transcribe").await;
    researcher.sees("#correct-heading", "Transcribe the comment").await;
    assert_eq!(researcher.count("#correct-dialog audio").await, 1, "it can be heard while it is typed");
    researcher.type_into("#correct-new", "It follows my hand").await;
    shoot(researcher, "researcher-voice-1-typing").await;
    researcher.click("#correct-dialog [type=submit]").await;
    researcher.sees("#comment-list", "It follows my hand").await;
    shoot(researcher, "researcher-voice-2-typed").await;

    let export = format!("/api/researcher/sessions/{session}/export.zip");
    assert_eq!(researcher.start_of(&export).await, "200 PK");
    for page in [researcher, page] {
        assert_eq!(page.complaints().await, [""; 0]);
    }
}

/// Another program than the browser identifies the recording.
async fn is_opus(page: &Browser, session: &str, folder: &TempDir, seconds: f64) {
    let fetch = "const { src } = document.querySelector('.voice audio');
        return fetch(src).then((answer) => answer.arrayBuffer()).then((bytes) => Array.from(new Uint8Array(bytes)))";
    let bytes = page.run(fetch, &[]).await;
    let bytes: Vec<u8> = bytes.as_array().unwrap().iter().map(|byte| byte.as_u64().unwrap() as u8).collect();
    let file = folder.path().join(format!("{session}.webm"));
    std::fs::write(&file, bytes).unwrap();

    let probe = |arguments: &[&str]| {
        let output = Command::new("ffprobe").args(["-v", "error"]).args(arguments).arg(&file).output();
        let output = output.expect("ffprobe; on Debian: apt-get install ffmpeg");
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(probe(&["-show_entries", "stream=codec_name", "-of", "csv=p=0"]).trim(), "opus");
    let times = probe(&["-show_entries", "packet=pts_time", "-of", "csv=p=0"]);
    let last: f64 = times.lines().last().unwrap().trim_end_matches(',').parse().unwrap();
    assert!((last - seconds).abs() < 0.5, "{last} s of {seconds} s");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_said_while_the_server_is_dead_is_kept_here_and_lands_once() {
    let folder = tempfile::tempdir().unwrap();
    let driver = Driver::start();
    let mut theatre = speaking(&driver, &folder).await;
    hold(&theatre.surgeon).await;
    theatre.surgeon.sees("#talk-label", "Recording 0:02").await;
    kill(&mut theatre.server);
    theatre.surgeon.sees("#comment-state", "Saved here: 1 recording.").await;
    theatre.surgeon.sees("#talk-label", "Recording 0:0").await;
    shoot(&theatre.surgeon, "surgeon-voice-3-no-server").await;

    start_again(&mut theatre.server);
    theatre.surgeon.sees("#voice-state", "Saved as you speak").await;
    let_go(&theatre.surgeon).await;
    until_recorded(&theatre, 1).await;
    all_pieces(&theatre).await;
    theatre.sees_saved(1).await;
    let kept = recorded(&theatre).await;
    assert!(kept[0].1 >= 4, "{kept:?}");

    // The end of a session takes the microphone away. The next participant reads nothing of it.
    hold(&theatre.surgeon).await;
    theatre.surgeon.sees("#talk-label", "Recording 0:01").await;
    theatre.abort("an emergency").await;
    theatre.surgeon.sees("#voice-trouble", "The microphone was taken away").await;
    let_go(&theatre.surgeon).await;
    theatre.operator.click_labelled("#session-actions", "Close and prepare").await;
    theatre.surgeon.sees_panel("No trial").await;
    assert_eq!(theatre.surgeon.text("#voice-trouble").await, "");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_loaded_again_while_the_server_is_dead_still_holds_what_was_said() {
    let folder = tempfile::tempdir().unwrap();
    let driver = Driver::start();
    let mut theatre = speaking(&driver, &folder).await;
    theatre.surgeon.keeps_page().await;
    hold(&theatre.surgeon).await;
    theatre.surgeon.sees("#talk-label", "Recording 0:02").await;
    kill(&mut theatre.server);
    theatre.surgeon.sees("#talk-label", "Recording 0:04").await;
    let_go(&theatre.surgeon).await;
    // The browser ends a recording a moment after the finger has left. A page that closes before then loses the end.
    theatre.surgeon.sees("#talk-label", "Hold to talk").await;
    theatre.surgeon.sees("#comment-state", "Saved here: 1 recording.").await;

    theatre.surgeon.reload().await;
    theatre.surgeon.sees("#now", "No server since").await;
    theatre.surgeon.sees("#comment-state", "Saved here: 1 recording.").await;
    assert!(!theatre.surgeon.is("#talk", "disabled").await, "the page may still use the microphone");

    start_again(&mut theatre.server);
    until_recorded(&theatre, 1).await;
    all_pieces(&theatre).await;
    theatre.sees_saved(1).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reload_while_speaking_keeps_all_but_the_last_moment() {
    let folder = tempfile::tempdir().unwrap();
    let driver = Driver::start();
    let theatre = speaking(&driver, &folder).await;
    let page = &theatre.surgeon;

    // Nothing reaches the server before the reload; everything is only on the device.
    page.cut_all().await;
    hold(page).await;
    page.sees("#talk-label", "Recording 0:04").await;
    assert_eq!(recorded(&theatre).await, []);
    page.reload().await;

    theatre.sees_saved(1).await;
    until("the pieces of the first three seconds", || async {
        let kept = recorded(&theatre).await;
        kept.first().is_some_and(|(_, count, ..)| *count >= 3)
    })
    .await;
    all_pieces(&theatre).await;
    let kept = recorded(&theatre).await;
    assert_eq!(kept.len(), 1, "{kept:?}");
    assert!(kept[0].3 >= 2500, "of four seconds no more than two are lost: {kept:?}");

    open_session(&theatre).await;
    let (seconds, tone) = decoded(&theatre.operator).await;
    assert!(seconds >= 2.0 && (tone - TONE).abs() < 10.0, "what came can be played: {seconds} s, {tone} Hz");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tablet_that_loses_its_power_in_the_middle_of_a_word_has_all_but_the_last_moment_on_its_disk() {
    let folder = tempfile::tempdir().unwrap();
    let driver = Driver::start();
    let mut theatre = speaking(&driver, &folder).await;
    let page = &theatre.surgeon;

    // There is no network either, so that everything is only on the tablet.
    page.cut_all().await;
    key(page, "keyDown", "F13", false).await;
    page.sees("#talk-label", "Recording 0:04").await;
    theatre.write("sharper on the left").await;
    page.type_into("#comment", "\u{e007}").await;
    page.sees("#comment-state", "Saved here: 1 comment, 1 recording.").await;
    assert_eq!(recorded(&theatre).await, []);

    let tone = folder.path().join("tone.wav");
    theatre.surgeon = driver.after_power_cut(&theatre.surgeon, &hears(&tone)).await;
    let link = format!("http://{}/enter?key={}", theatre.proxy.address, theatre.server.key("surgeon"));
    theatre.surgeon.open(&link).await;
    theatre.sees_saved(2).await;
    until("the pieces of the first three seconds", || async {
        let kept = recorded(&theatre).await;
        kept.first().is_some_and(|(_, count, ..)| *count >= 3)
    })
    .await;
    all_pieces(&theatre).await;
    assert!(recorded(&theatre).await[0].3 >= 2500, "of four seconds no more than two are lost");

    open_session(&theatre).await;
    theatre.operator.sees("#comment-list", "sharper on the left").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refused_or_missing_microphone_is_reported_and_typing_still_works() {
    let driver = Driver::start();
    let device = ["--use-fake-device-for-media-stream".to_owned()];
    let theatre = Theatre::heard(&driver, Arc::new(tempfile::tempdir().unwrap()), &device).await;
    theatre.begin("S-09", "spoken").await;
    theatre.tap_notice(1).await;
    let page = &theatre.surgeon;
    let permission = json!({"permission": {"name": "microphone"}, "setting": "denied"});
    page.tools("Browser.setPermission", permission).await;

    hold(page).await;
    page.sees("#voice-trouble", "The microphone is blocked for this page.").await;
    let_go(page).await;
    shoot(page, "surgeon-voice-4-refused").await;
    theatre.say("typed instead", 1).await;

    // A page without encryption cannot ask for a microphone.
    page.before_each_page("Object.defineProperty(window, 'isSecureContext', { value: false });").await;
    page.reload().await;
    page.sees("#voice-why", "Voice needs an encrypted connection (https)").await;
    assert!(page.is("#talk", "disabled").await);
    shoot(page, "surgeon-voice-5-insecure").await;
    theatre.say("and again", 2).await;
    assert_eq!(recorded(&theatre).await, []);
}
