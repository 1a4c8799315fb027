//! Verification of exports: unchanged exports pass, and changes are found, even with new checksums.

use std::path::{Path, PathBuf};

use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::{Verdict, verify};
use sha2::{Digest, Sha256};

use crate::exports::{failed, json, with_session};

#[tokio::test]
async fn an_export_is_verified_and_changes_in_it_are_found() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    trial.unblind(session).await;

    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();

    let checks = verify(&out, None);
    assert!(checks.iter().all(|check| matches!(check.verdict, Verdict::Passed(_))), "{checks:#?}");

    let change = |file: &str, from: &str, to: &str| {
        let path = out.join(file);
        let before = std::fs::read_to_string(&path).unwrap();
        assert!(before.contains(from), "{file}");
        std::fs::write(&path, before.replacen(from, to, 1)).unwrap();
        let failures: Vec<String> = failed(&verify(&out, None)).into_iter().map(str::to_owned).collect();
        std::fs::write(&path, before).unwrap();
        failures
    };

    assert_eq!(change("comments.csv", "🔬", "!"), ["checksums", "copies", "chain"]);
    assert_eq!(change("telemetry.csv", "0.35", "abc"), ["checksums", "columns", "chain"]);
    assert_eq!(change("protocol.toml", "120", "121"), ["checksums", "protocol", "commitment"]);

    let schedule = json(&out, "allocation.json")["schedule"].clone();
    let first = schedule[0].as_str().unwrap();
    let other = schedule.as_array().unwrap();
    let other = other.iter().map(|name| name.as_str().unwrap()).find(|name| *name != first).unwrap();
    assert_eq!(change("allocation.csv", first, other), ["checksums", "commitment", "schedule"]);

    let seed = json(&out, "allocation.json")["seed"].as_str().unwrap().to_owned();
    assert_eq!(change("allocation.json", &seed, &"0".repeat(64)), ["checksums", "commitment", "schedule"]);

    let third = std::fs::read_to_string(out.join("events.csv")).unwrap().lines().nth(3).unwrap().to_owned() + "\n";
    assert_eq!(change("events.csv", &third, ""), ["checksums", "events", "copies", "chain"]);

    std::fs::write(out.join("more.txt"), "").unwrap();
    assert_eq!(failed(&verify(&out, None)), ["checksums"]);
}

/// Makes new checksums of the files in `folder`, as anyone can.
fn sum_again(folder: &Path) {
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.retain(|path| path.file_name().unwrap() != "SHA256SUMS");
    let line = |path: &PathBuf| {
        let sum = hex::encode(Sha256::digest(std::fs::read(path).unwrap()));
        format!("{sum}  {}\n", path.file_name().unwrap().to_str().unwrap())
    };
    std::fs::write(folder.join("SHA256SUMS"), names.iter().map(line).collect::<String>()).unwrap();
}

/// A CSV file whose first `columns` columns have their rows in reverse order.
fn reversed(text: &str, columns: usize) -> String {
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let (head, rows) = rows.split_first().unwrap();
    let turned = rows.iter().zip(rows.iter().rev()).map(|(row, other)| [&other[..columns], &row[columns..]].concat());
    std::iter::once(head.clone()).chain(turned).map(|row| row.join(",") + "\n").collect()
}

#[tokio::test]
async fn forgeries_are_found_even_with_new_checksums() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    trial.unblind(session).await;

    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();

    let kept: Vec<_> = std::fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.clone(), std::fs::read(path).unwrap()))
        .collect();

    let found = |forge: &dyn Fn()| {
        forge();
        sum_again(&out);
        let found: Vec<String> = failed(&verify(&out, None)).into_iter().map(str::to_owned).collect();
        for (path, bytes) in &kept {
            std::fs::write(path, bytes).unwrap();
        }
        found
    };

    let read = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
    let write = |file: &str, text: String| std::fs::write(out.join(file), text).unwrap();
    let remove = |file: &str| std::fs::remove_file(out.join(file)).unwrap();
    assert_eq!(found(&|| ()), [""; 0], "the same checksums");

    // Assigns policies to other segments.
    assert_eq!(found(&|| write("allocation.csv", reversed(&read("allocation.csv"), 3))), ["commitment", "schedule"]);

    // Removes the draw, first in part and then completely.
    let withheld = read("allocation.json").replace(json(&out, "allocation.json")["seed"].as_str().unwrap(), "");
    let withheld = withheld.replace("\"seed\": \"\"", "\"seed\": null");
    assert_eq!(found(&|| write("allocation.json", withheld.clone())), ["commitment", "schedule"]);
    assert_eq!(found(&|| remove("allocation.json")), ["copies"]);

    // Claims another algorithm.
    let drawn = |file: &str| write(file, read(file).replace("parfocal-shuffle-1", "parfocal-balanced-1"));
    assert_eq!(found(&|| drawn("allocation.json")), ["commitment", "schedule"]);
    assert_eq!(
        found(&|| ["allocation.json", "sessions.csv", "session.json"].into_iter().for_each(drawn)),
        ["commitment", "schedule", "chain"]
    );

    // Removes or changes answers and comments.
    let answers: String =
        read("answers.csv").lines().filter(|line| !line.starts_with("3,")).map(|l| l.to_owned() + "\n").collect();
    assert_eq!(found(&|| write("answers.csv", answers.clone())), ["said", "copies", "chain"]);

    let comments = read("comments.csv");
    let all_but_the_last = comments[..=comments.rfind("\n6,").unwrap()].to_owned();
    assert_eq!(found(&|| write("comments.csv", all_but_the_last.clone())), ["said", "copies", "chain"]);

    assert_eq!(found(&|| write("comments.csv", read("comments.csv").replace('🔬', "!"))), ["copies", "chain"]);
    assert_eq!(found(&|| remove("session.json")), ["copies"]);
    assert_eq!(found(&|| remove("datapackage.json")), ["columns", "copies", "chain"]);

    // Marks an answer that counts as late.
    let late = read("answers.csv").replacen(",false,false,\n", ",true,false,\n", 1);
    assert_eq!(found(&|| write("answers.csv", late.clone())), ["said", "copies", "chain"]);

    // Adds an event without a number.
    let event = read("events.csv").lines().last().unwrap().to_owned();
    let (number, rest) =
        event.split_once(',').map(|(session, rest)| (session, rest.split_once(',').unwrap().1)).unwrap();
    let unnumbered = read("events.csv") + &format!("{number},,{rest}\n");
    assert_eq!(found(&|| write("events.csv", unnumbered.clone())), ["events", "copies", "chain"]);

    // Adds a step of a setting that does not exist.
    let steps =
        read("policy_steps.csv") + &read("policy_steps.csv").lines().nth(1).unwrap().replacen('1', "9", 1) + "\n";
    assert_eq!(found(&|| write("policy_steps.csv", steps.clone())), ["references", "chain"]);

    // Adds a record to one of the copies in session.json, or a table that no export has.
    let copies = json(&out, "session.json");
    for table in copies.as_object().unwrap().keys().map(String::as_str).chain(["more"]) {
        let mut forged = copies.clone();
        match forged[table].as_array_mut() {
            Some(records) => records.push(serde_json::json!({})),
            None => forged[table] = serde_json::json!([]),
        }
        assert_eq!(found(&|| write("session.json", forged.to_string())), ["copies"], "{table}");
    }
}

#[tokio::test]
async fn a_blinded_export_is_verified_as_far_as_it_can_be() {
    let data = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(data.path()).await;
    let out = data.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let checks = verify(&out, None);
    assert_eq!(failed(&checks), [""; 0]);
    let open: Vec<_> = checks.iter().filter(|check| matches!(check.verdict, Verdict::NotChecked(_))).collect();
    assert_eq!(open.iter().map(|check| check.name).collect::<Vec<_>>(), ["commitment", "schedule"]);
}
