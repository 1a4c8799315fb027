//! Backups by the command, to a file and to standard output; and what `verify` says of files that are no whole database.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::exports::with_session;

fn parfocal(arguments: &[&str], data: Option<&Path>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.args(arguments).stdin(Stdio::null());
    if let Some(data) = data {
        command.arg("--data-dir").arg(data);
    }
    command.output().unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[tokio::test]
async fn a_backup_to_standard_output_is_a_database_that_verifies_and_restores() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let (trial, _) = with_session(&data).await;

    let sent = parfocal(&["backup", "--out", "-", "--json"], Some(&data));
    assert!(sent.status.success(), "{}", told(&sent));
    let summary: serde_json::Value = serde_json::from_str(&told(&sent)).unwrap();
    assert_eq!(summary["bytes"], sent.stdout.len());
    assert!(sent.stdout.starts_with(b"SQLite format 3\0"));
    let left = std::fs::read_dir(&data).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert!(!left.into_iter().any(|name| name.contains("backup")), "nothing is left in the data folder");
    trial.store.close().await;

    let file = folder.path().join("backup.db");
    std::fs::write(&file, &sent.stdout).unwrap();
    let head = summary["head"].as_str().unwrap();
    let verified = parfocal(&["verify", file.to_str().unwrap(), "--head", head], None);
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
    let restored = parfocal(&["restore", file.to_str().unwrap()], Some(&folder.path().join("elsewhere")));
    assert!(restored.status.success(), "{}", told(&restored));
}

#[tokio::test]
async fn a_receiver_whose_disk_is_full_is_told_to_remove_what_arrived() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, _) = with_session(folder.path()).await;
    trial.store.close().await;
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    let command = command.args(["backup", "--out", "-", "--data-dir"]).arg(folder.path()).stdout(full);
    let output = command.stderr(Stdio::piped()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains("remove what arrived of it"), "{}", told(&output));
}

#[tokio::test]
async fn a_restore_for_which_there_is_no_room_names_the_data_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, _) = with_session(&folder.path().join("data")).await;
    trial.store.close().await;
    let backup = folder.path().join("backup.db");
    let made = parfocal(&["backup", "--out", backup.to_str().unwrap()], Some(&folder.path().join("data")));
    assert!(made.status.success(), "{}", told(&made));

    // The shell's limit on the size of a file stands for a disk that is full.
    let script = "trap '' XFSZ; ulimit -f 8; exec \"$0\" restore \"$1\" --data-dir \"$2\"";
    let elsewhere = folder.path().join("elsewhere");
    let mut command = Command::new("sh");
    command.args(["-c", script, env!("CARGO_BIN_EXE_parfocal")]).arg(&backup).arg(&elsewhere);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains(&format!("cannot use {}: ", elsewhere.display())), "{}", told(&output));
    assert!(!elsewhere.join("parfocal.db").exists());
}

#[tokio::test]
async fn what_is_no_whole_database_is_named_and_not_taken_for_the_data_folders() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let (trial, _) = with_session(&data).await;

    // The server runs, and everything is still in the log beside the database.
    let copy = folder.path().join("copy.db");
    std::fs::copy(data.join("parfocal.db"), &copy).unwrap();
    let output = parfocal(&["verify", copy.to_str().unwrap()], None);
    assert_eq!(output.status.code(), Some(1));
    for said in ["has no tables", "ends in -wal", "parfocal backup"] {
        assert!(told(&output).contains(said), "{}", told(&output));
    }
    trial.store.close().await;

    // A copy of a backup that was cut short.
    let cut = folder.path().join("cut.db");
    std::fs::write(&cut, &std::fs::read(data.join("parfocal.db")).unwrap()[..20_000]).unwrap();
    let output = parfocal(&["verify", cut.to_str().unwrap()], None);
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains("cut.db is damaged or cut short"), "{}", told(&output));
    assert!(!told(&output).contains("data folder"), "{}", told(&output));

    let zip = folder.path().join("export.zip");
    std::fs::write(&zip, b"PK\x03\x04 and so on").unwrap();
    let output = parfocal(&["verify", zip.to_str().unwrap()], None);
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains("export.zip is a ZIP file: unpack it"), "{}", told(&output));

    let table = folder.path().join("comments.csv");
    std::fs::write(&table, "session,comment\n".repeat(1000)).unwrap();
    let output = parfocal(&["verify", table.to_str().unwrap()], None);
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains("comments.csv is not a database; name an export's folder"), "{}", told(&output));

    let nothing = folder.path().join("nothing");
    std::fs::create_dir(&nothing).unwrap();
    let output = parfocal(&["verify", nothing.to_str().unwrap()], None);
    assert!(told(&output).contains("nothing is neither an export nor a data folder"), "{}", told(&output));

    // As a pipe leaves it whose sender failed.
    let empty = folder.path().join("empty.db");
    std::fs::write(&empty, "").unwrap();
    for (command, data) in [("verify", None), ("restore", Some(folder.path().join("elsewhere")))] {
        let output = parfocal(&[command, empty.to_str().unwrap()], data.as_deref());
        assert_eq!(output.status.code(), Some(1));
        let told = told(&output);
        assert!(told.contains("empty.db") && told.contains("is empty") && !told.contains("-wal"), "{told}");
    }

    // Nothing is said of a data folder, which may be well.
    let output = parfocal(&["restore", zip.to_str().unwrap()], Some(&folder.path().join("elsewhere")));
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).contains("export.zip does not verify: "), "{}", told(&output));
    assert!(!told(&output).contains("data folder"), "{}", told(&output));
}

#[test]
fn a_restore_that_fails_leaves_no_new_data_folder() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("notes.txt");
    std::fs::write(&text, "no database").unwrap();

    let data = folder.path().join("data");
    for wrong in [folder.path().join("missing.db"), text, folder.path().to_owned()] {
        let output = parfocal(&["restore", wrong.to_str().unwrap()], Some(&data));
        assert_eq!(output.status.code(), Some(1));
        assert!(told(&output).contains(wrong.to_str().unwrap()), "{}", told(&output));
        assert!(!data.exists(), "a server would start there with an empty database");
    }
}
