//! Voice: each piece of a recording is kept once, whenever and in whatever order the pieces arrive. Changes in them are
//! found. They are exported, erased, and kept no longer than the protocol says.

use std::path::Path;
use std::time::Duration;

use parfocal_base::clock::Clock;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_records::store::verify_database;
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::erasure::{Erasable, NewErasure};
use parfocal_trial::remark::CommentContent;
use parfocal_trial::role::Role;
use parfocal_trial::voice::{Ending, LARGEST_PIECE, LARGEST_RECORDING, NewPiece};
use sha2::{Digest, Sha256};

use crate::chain::{after, recomputed, said};
use crate::exports::{failed, json, rows};
use crate::fixture::Trial;
use crate::storage::raw;

const PROTOCOL: &str = include_str!("../system/browser/spoken.toml");

const DAY: Duration = Duration::from_hours(24);

/// Starts a server on `folder` with a protocol that asks for voice.
async fn start(folder: &Path) -> Trial {
    std::fs::write(folder.join("spoken.toml"), PROTOCOL).unwrap();
    Trial::start_with(folder, Some(folder), 7).await
}

/// Lets the surgeon begin to speak, and returns the comment's key.
async fn begin_to_speak(trial: &mut Trial) -> IdempotencyKey {
    let mut comment = trial.comment("");
    comment.said = CommentContent::Voice;
    trial.conductor.comment(comment.clone()).await.unwrap();
    comment.key
}

/// Piece `number` of a recording. Its bytes differ from those of every other piece.
fn piece(session: SessionId, comment: IdempotencyKey, number: u32) -> NewPiece {
    NewPiece {
        comment,
        session,
        piece: number,
        media_type: "audio/webm; codecs=opus".to_owned(),
        through_ms: i64::from(number) * 1000,
        ended: None,
        audio: sound(number),
    }
}

fn sound(number: u32) -> Vec<u8> {
    format!("Frau Mustermann, piece {number};").repeat(100).into_bytes()
}

/// Sends a recording of three pieces and the empty piece that ends it.
async fn speak(trial: &mut Trial) -> IdempotencyKey {
    let session = trial.view().session;
    let comment = begin_to_speak(trial).await;
    for number in 1..=3 {
        trial.conductor.voice_piece(piece(session, comment, number)).await.unwrap();
    }
    let last = NewPiece { ended: Some(Ending::Released), audio: Vec::new(), ..piece(session, comment, 4) };
    trial.conductor.voice_piece(NewPiece { through_ms: 3200, ..last }).await.unwrap();
    comment
}

async fn end(trial: &Trial, session: SessionId) {
    let abort = Action::Abort { reason: "enough".to_owned() };
    trial.conductor.act(Role::Operator, session, abort).await.unwrap();
}

async fn kept_pieces(trial: &Trial, session: SessionId, comment: IdempotencyKey) -> Vec<u32> {
    let recordings = trial.store.reader().voice(session).await.unwrap();
    recordings
        .get(&comment)
        .map(|recorded| recorded.pieces.iter().map(|piece| piece.piece).collect())
        .unwrap_or_default()
}

#[tokio::test]
async fn pieces_are_kept_once_in_whatever_order_they_come_and_after_the_end_and_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("spoken").await;
    let comment = begin_to_speak(&mut trial).await;
    assert_eq!(trial.view().comments, 1);

    let keep = async |trial: &Trial, number| trial.conductor.voice_piece(piece(session, comment, number)).await;
    keep(&trial, 1).await.unwrap();
    keep(&trial, 1).await.unwrap();
    keep(&trial, 3).await.unwrap();
    assert_eq!(kept_pieces(&trial, session, comment).await, [1, 3]);
    let told = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap().comments.remove(0).voice.unwrap();
    assert_eq!((told.missing, told.ended), (1, None), "a gap, and no end yet");

    end(&trial, session).await;
    keep(&trial, 2).await.unwrap();
    drop(trial);
    let trial = start(folder.path()).await;
    let last = NewPiece { ended: Some(Ending::Released), ..piece(session, comment, 4) };
    trial.conductor.voice_piece(last.clone()).await.unwrap();
    trial.conductor.voice_piece(last).await.unwrap();
    assert_eq!(kept_pieces(&trial, session, comment).await, [1, 2, 3, 4]);

    let (media_type, audio) = trial.reports.voice_audio(session, comment).await.unwrap();
    assert_eq!(media_type.name(), "audio/webm;codecs=opus");
    assert!(audio == [sound(1), sound(2), sound(3), sound(4)].concat(), "in order, each once");
    let told = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap().comments.remove(0).voice.unwrap();
    assert_eq!((told.missing, told.ended, told.seconds), (0, Some(Ending::Released), 4.0));
    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");

    let withdraw = Action::Withdraw { reason: "wants no part in it".to_owned() };
    trial.conductor.act(Role::Researcher, session, withdraw).await.unwrap();
    let refused = trial.reports.voice_audio(session, comment).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("withdrew")), "{refused}");
}

#[tokio::test]
async fn a_piece_of_another_recording_is_refused_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let silent = trial.begin("practice").await;
    let mut aloud = trial.comment("");
    aloud.said = CommentContent::Voice;
    let refused = trial.conductor.comment(aloud).await.unwrap_err();
    assert!(refused.to_string().contains("does not record voice"), "{refused}");
    end(&trial, silent).await;

    let session = trial.begin("spoken").await;
    let typed = trial.comment("typed");
    trial.conductor.comment(typed.clone()).await.unwrap();
    let comment = begin_to_speak(&mut trial).await;
    trial.conductor.voice_piece(piece(session, comment, 1)).await.unwrap();

    let nobody = trial.key();
    let other = NewPiece { audio: b"other".to_vec(), ..piece(session, comment, 1) };
    let ended = NewPiece { ended: Some(Ending::Limit), ..piece(session, comment, 1) };
    let kind = NewPiece { media_type: "audio/mp4".to_owned(), ..piece(session, comment, 2) };
    for conflict in [other, ended, kind] {
        let refused = trial.conductor.voice_piece(conflict).await.unwrap_err();
        assert!(matches!(refused, ConductError::Conflict(_)), "{refused}");
    }
    for unknown in [piece(silent, comment, 2), piece(session, nobody, 1), piece(session, typed.key, 1)] {
        let refused = trial.conductor.voice_piece(unknown).await.unwrap_err();
        assert!(
            matches!(&refused, ConductError::NotFound(text) if text.contains("send the comment first")),
            "{refused}"
        );
    }
    let wrong = NewPiece { media_type: "text/html".to_owned(), ..piece(session, comment, 2) };
    let large = NewPiece { audio: vec![0; LARGEST_PIECE + 1], ..piece(session, comment, 2) };
    for invalid in [wrong, large, piece(session, comment, 0), piece(session, comment, 601)] {
        let refused = trial.conductor.voice_piece(invalid).await.unwrap_err();
        assert!(matches!(refused, ConductError::Invalid(_)), "{refused}");
    }
    assert_eq!(kept_pieces(&trial, session, comment).await, [1]);

    // The size of a recording is limited, even if each piece is small enough.
    let whole = u32::try_from(LARGEST_RECORDING / LARGEST_PIECE).unwrap();
    let full = |number| NewPiece { audio: vec![7; LARGEST_PIECE], ..piece(session, comment, number) };
    for number in 2..=whole {
        trial.conductor.voice_piece(full(number)).await.unwrap();
    }
    let refused = trial.conductor.voice_piece(full(whole + 1)).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Invalid(text) if text.contains("begin another one")), "{refused}");
}

/// Makes a database with a recording in an ended session, which no server has open.
async fn a_database(folder: &Path) {
    let mut trial = start(folder).await;
    let session = trial.begin("spoken").await;
    speak(&mut trial).await;
    end(&trial, session).await;
    trial.store.close().await;
}

#[tokio::test]
async fn a_piece_that_was_changed_lost_or_inserted_is_found_in_the_database() {
    let folder = tempfile::tempdir().unwrap();
    a_database(folder.path()).await;
    let database = folder.path().join("parfocal.db");

    let checks = after(&database, "", None).await;
    assert_eq!(said(&checks, "voice").unwrap(), "4 pieces of recordings are as they were sent");
    let erased = "INSERT INTO erasures (session, subject, record, reason, role, run, wall, monotonic_ns)
        SELECT session, 'comment', comment, 'r', 'researcher', run, wall, 1 FROM voice_pieces WHERE piece = 1;";
    let tampered = [
        ("UPDATE voice_pieces SET audio = zeroblob(bytes) WHERE piece = 2", "voice", "piece 2"),
        ("UPDATE voice_pieces SET audio = NULL WHERE piece = 2", "voice", "nobody erased it"),
        ("UPDATE voice_pieces SET sha256 = '00' WHERE piece = 2", "chain", "voice_pieces: voice-piece 2 was changed"),
        ("UPDATE voice_pieces SET ended = NULL WHERE piece = 4", "chain", "voice-piece 4 was changed"),
        ("UPDATE voice_pieces SET through_ms = 9 WHERE piece = 3", "chain", "voice-piece 3 was changed"),
        ("DELETE FROM voice_pieces WHERE piece = 3", "chain", "voice-piece 3 is missing"),
        (
            "INSERT INTO voice_pieces SELECT 9, comment, session, 9, media_type, through_ms, ended, bytes, sha256, audio,
                 run, wall, monotonic_ns FROM voice_pieces WHERE piece = 1",
            "chain",
            "voice-piece 9 was inserted",
        ),
        (
            "UPDATE voice_pieces SET number = 100 WHERE piece = 1; UPDATE voice_pieces SET number = 1 WHERE piece = 2;
             UPDATE voice_pieces SET number = 2 WHERE piece = 1",
            "chain",
            "voice-piece 1 was changed",
        ),
    ];
    for (sql, check, expected) in tampered {
        let wrong = said(&after(&database, sql, None).await, check).unwrap_err();
        assert!(wrong.contains(expected), "{sql}: {wrong}");
    }
    let claimed = format!("UPDATE voice_pieces SET audio = NULL; {erased}");
    let wrong = said(&after(&database, &claimed, None).await, "chain").unwrap_err();
    assert!(wrong.contains("erasure"), "an erasure has a row of its own: {wrong}");

    // Recordings cannot be changed or removed by mistake.
    let pool = raw(folder.path()).await;
    for sql in [
        "UPDATE voice_pieces SET audio = NULL",
        "UPDATE voice_pieces SET audio = x'00'",
        "DELETE FROM voice_pieces",
        "REPLACE INTO voice_pieces SELECT * FROM voice_pieces WHERE piece = 1",
    ] {
        let refused = sqlx::raw_sql(sql).execute(&pool).await.unwrap_err();
        assert!(refused.to_string().contains("append-only"), "{sql}: {refused}");
    }
    pool.close().await;
}

#[tokio::test]
async fn an_export_has_each_recording_as_a_file_and_a_changed_one_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("spoken").await;
    let comment = speak(&mut trial).await;
    let cut = begin_to_speak(&mut trial).await;
    trial.conductor.voice_piece(piece(session, cut, 1)).await.unwrap();
    let nothing = begin_to_speak(&mut trial).await;
    end(&trial, session).await;
    let typed = FieldChange::Note { record: comment, old: String::new(), new: "it wanders".to_owned() };
    let typed = NewCorrection { change: typed, reason: "typed out".to_owned() };
    trial.conductor.correct(Role::Researcher, session, typed).await.unwrap();

    let out = folder.path().join("export");
    let summary = export(&trial.access_log(), session, &out, false).await.unwrap();
    let file = format!("voice/{comment}.webm");
    assert!(summary.files.contains(&file), "{:?}", summary.files);
    let whole = [sound(1), sound(2), sound(3)].concat();
    assert!(std::fs::read(out.join(&file)).unwrap() == whole);

    let table = rows(&out, "voice");
    let told = |row: usize, columns: [&str; 6]| columns.map(|column| table[row][column].clone());
    let columns = ["comment", "file", "seconds", "ended", "complete", "transcript"];
    assert_eq!(told(0, columns), [&comment.to_string(), &file, "3.2", "released", "true", "it wanders"]);
    assert_eq!(told(1, columns), [&cut.to_string(), &format!("voice/{cut}.webm"), "1.0", "", "false", ""]);
    assert_eq!(told(2, columns), [&nothing.to_string(), "", "0.0", "", "false", ""]);
    assert_eq!(table[0]["sha256"], hex::encode(Sha256::digest(&whole)));
    assert_eq!((table[0]["media_type"].as_str(), table[0]["bytes"].as_str()), ("audio/webm;codecs=opus", "7500"));
    let kinds: Vec<_> = rows(&out, "comments").into_iter().map(|row| row["kind"].clone() + &row["text"]).collect();
    assert_eq!(kinds, ["voice"; 3]);
    assert_eq!(json(&out, "datapackage.json")["parfocal"]["format"], 1);

    let checks = verify(&out, None);
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert_eq!(said(&checks, "voice").unwrap(), "5 pieces of recordings are as they were sent");
    let chain = json(&out, "datapackage.json")["parfocal"]["chain"].clone();
    let again = recomputed(&out).unwrap();
    let head = format!("{}:{}", chain["number"], chain["hash"].as_str().unwrap());
    assert_eq!(again["head"], head.as_str(), "another program computes the same chain: {again}");

    // A forger who changes a file and its checksum is found by the hashes in the chain.
    let forged = |name: &str, bytes: &[u8]| {
        let before = std::fs::read(out.join(name)).ok();
        let sums = std::fs::read_to_string(out.join("SHA256SUMS")).unwrap();
        std::fs::write(out.join(name), bytes).unwrap();
        let sum = |bytes: &[u8]| format!("{}  {name}\n", hex::encode(Sha256::digest(bytes)));
        let without = before.as_ref().map_or_else(|| sums.clone(), |before| sums.replace(&sum(before), ""));
        std::fs::write(out.join("SHA256SUMS"), without + &sum(bytes)).unwrap();
        let checks = verify(&out, None);
        match before {
            Some(before) => std::fs::write(out.join(name), before).unwrap(),
            None => std::fs::remove_file(out.join(name)).unwrap(),
        }
        std::fs::write(out.join("SHA256SUMS"), sums).unwrap();
        assert_eq!(failed(&checks), ["voice"], "{checks:?}");
        said(&checks, "voice").unwrap_err()
    };
    let mut changed = whole.clone();
    changed[sound(1).len()] ^= 1;
    assert!(forged(&file, &changed).contains("piece 2 was changed"));
    assert!(forged(&file, &whole[..whole.len() - 1]).contains("piece 3 is missing or cut short"));
    assert!(forged(&file, &[whole.clone(), vec![0]].concat()).contains("1 bytes were added"));
    assert!(forged("voice/other.webm", b"sound").contains("belongs to no comment"));
    std::fs::write(out.join("voice/unlisted.webm"), "").unwrap();
    assert_eq!(failed(&verify(&out, None)), ["checksums", "voice"]);
}

#[tokio::test]
async fn an_erased_recording_is_nowhere_in_the_files_and_its_hashes_stay() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let mut trial = start(&data).await;
    let session = trial.begin("spoken").await;
    let comment = speak(&mut trial).await;
    end(&trial, session).await;
    let holds = |path: &Path| {
        let text = b"Mustermann";
        let files = std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
        files.filter(|file| std::fs::read(file).unwrap().windows(text.len()).any(|window| window == text)).count()
    };
    assert!(holds(&data) > 0, "the test looks where the sound is");

    let erasure =
        NewErasure { subject: Erasable::Comment, record: comment.to_string(), reason: "names a patient".to_owned() };
    trial.conductor.erase(Role::Researcher, session, erasure).await.unwrap();
    assert_eq!(holds(&data), 0);
    assert!(matches!(trial.reports.voice_audio(session, comment).await, Err(ConductError::NotFound(_))));

    // A tablet sends one piece again, and one that it still held. Neither brings the sound back.
    trial.conductor.voice_piece(piece(session, comment, 2)).await.unwrap();
    trial.conductor.voice_piece(piece(session, comment, 5)).await.unwrap();
    assert_eq!(holds(&data), 0);
    assert_eq!(kept_pieces(&trial, session, comment).await, [1, 2, 3, 4, 5]);

    let checks = verify_database(&data, None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert_eq!(said(&checks, "voice").unwrap(), "0 pieces of recordings are as they were sent; 5 were erased");
    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    assert_eq!(failed(&verify(&out, None)), [""; 0], "{:?}", verify(&out, None));
    let row = &rows(&out, "voice")[0];
    assert_eq!((row["file"].as_str(), row["sha256"].as_str(), row["pieces"].as_str()), ("", "", "5"));
    assert!(!row["erased"].is_empty());
    assert_eq!(rows(&out, "voice_pieces")[1]["sha256"], hex::encode(Sha256::digest(sound(2))));
    assert!(!out.join("voice").exists());
}

#[tokio::test]
async fn voice_is_erased_by_itself_once_the_protocols_time_is_over_and_not_during_a_session() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("spoken").await;
    let comment = speak(&mut trial).await;
    trial.say("typed").await;
    end(&trial, session).await;
    let typed = FieldChange::Note { record: comment, old: String::new(), new: "it wanders".to_owned() };
    let typed = NewCorrection { change: typed, reason: "typed out".to_owned() };
    trial.conductor.correct(Role::Researcher, session, typed).await.unwrap();

    trial.clock.advance(29 * DAY);
    assert_eq!(trial.conductor.erase_expired_voice().await.unwrap(), 0);
    trial.clock.advance(DAY);
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    let next = trial.begin("practice").await;
    assert!(matches!(trial.conductor.erase_expired_voice().await, Err(ConductError::Conflict(_))));
    end(&trial, next).await;
    assert_eq!(trial.conductor.erase_expired_voice().await.unwrap(), 1);
    assert_eq!(trial.conductor.erase_expired_voice().await.unwrap(), 0, "once");

    assert!(matches!(trial.reports.voice_audio(session, comment).await, Err(ConductError::NotFound(_))));
    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let spoken = timeline.comments.iter().find(|line| line.key == comment).unwrap();
    assert!(spoken.erased.is_some());
    assert_eq!(spoken.note.as_deref(), Some("it wanders"), "what was typed out stays");
    assert!(timeline.comments.iter().any(|line| line.said == CommentContent::Text("typed".to_owned())));

    let detail = trial.reports.session_detail(session).await.unwrap();
    let line = detail.log.iter().find(|line| line.text.contains("erased")).unwrap();
    assert_eq!((line.by, line.at), (Role::System, trial.clock.wall()));
    assert_eq!(line.text, "Words of a comment erased: the protocol keeps voice for 30 days");
    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
}
