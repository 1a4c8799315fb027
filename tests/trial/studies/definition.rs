//! A study's definition: an error in any field is reported with its line and key.

use parfocal_trial::study::definition::{Definition, Site};
use sha2::{Digest, Sha256};

use super::program::done;
use super::{PROTOCOL, STUDY, a_trial, definition, detail, plan, protocol};

/// The error from reading the definition with `from` replaced by `to`; empty if there is none.
fn said(from: &str, to: &str) -> String {
    let text = definition();
    assert!(text.contains(from), "{from}");
    match Definition::parse(&text.replacen(from, to, 1), "study.toml", &[protocol()]) {
        Ok(_) => String::new(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_definition_is_read_and_has_the_hash_of_its_file() {
    let text = definition();
    let read = Definition::parse(&text, "study.toml", &[protocol()]).unwrap();
    assert_eq!(read.name.as_str(), "scope-2026");
    assert_eq!(read.sites.iter().map(Site::places).collect::<Vec<_>>(), [4, 3]);
    assert_eq!(read.sha256(), hex::encode(Sha256::digest(text.as_bytes())));
    assert_eq!(&*read.source, text);
}

#[tokio::test]
async fn a_file_from_windows_keeps_its_bytes_and_has_the_same_hash_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let trial = a_trial(folder.path()).await;
    let text = format!("\u{feff}{}", definition().replace('\n', "\r\n"));
    let on_page = plan(&trial, text.clone()).await;
    assert_eq!(on_page.unwrap(), STUDY);
    let expected = hex::encode(Sha256::digest(text.as_bytes()));
    let on_page = detail(&trial).await;
    assert_eq!(on_page.definition_sha256, expected);
    assert!(!on_page.concerns.is_empty());
    trial.store.close().await;
    drop(trial);

    let elsewhere = folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    a_trial(&elsewhere).await.store.close().await;
    let file = elsewhere.join("study.toml");
    std::fs::write(&file, &text).unwrap();
    let run = |arguments: &[&str]| done(&[arguments, &["--data-dir", elsewhere.to_str().unwrap()]].concat());
    let protocols = folder.path().to_str().unwrap();
    let signed = ["--by", "Dr Lead", "--reason", "ethics approved it", "--protocols", protocols];
    run(&[&["study", "new", file.to_str().unwrap()][..], &signed].concat());
    let shown: serde_json::Value = serde_json::from_str(&run(&["study", "show", STUDY, "--json"])).unwrap();
    assert_eq!(shown["definition_sha256"], expected);
    assert_eq!(shown["concerns"], serde_json::json!(on_page.concerns));
}

#[test]
fn every_field_wrong_in_turn_is_named() {
    let long = "x".repeat(300);
    let wrong = [
        ("name = \"scope-2026\"", "name = \"Scope 2026\"", "line 1: key 'name': 'Scope 2026' must be 1 to 40 lower"),
        ("name = \"scope-2026\"\n", "", "key 'name': missing field `name`"),
        ("name = \"scope-2026\"", "name = 7", "line 1: key 'name'"),
        ("title = \"Two hill", "title = \"\"\nextra = \"Two hill", "unknown field `extra`"),
        ("title = \"Two hill-climbers in the eyes of five surgeons\"", "title = \" \"", "line 2: key 'title'"),
        ("order = \"balanced\"", "order = \"sorted\"", "line 3: key 'order'"),
        ("order = \"balanced\"", "order = \"shuffled\"", "line 3: key 'order': protocol 'pair' has another order"),
        ("aborted = \"next-spare\"", "aborted = \"as we like\"", "line 4: key 'aborted'"),
        ("withdrawn = \"next-spare\"", "withdrawn = \"\"", "line 5: key 'withdrawn'"),
        ("repeated = \"refuse\"", "repeated = \"same-place\"", "line 6: key 'repeated'"),
        ("when_used_up = \"Call the trial office.\"", "when_used_up = \"\"", "line 7: key 'when_used_up'"),
        ("may_unblind = [", "may_unblind = [] #", "line 8: key 'may_unblind': name at least one person"),
        ("may_unblind = [", "may_unblind = [\"A\", \"A\", ", "line 8: key 'may_unblind': 'A' is listed twice"),
        ("may_unblind = [", "may_unblind = [\"\", ", "line 8: key 'may_unblind': must be 1 to 200 characters"),
        ("analysis = \"Wilcoxon", "analysis = 1 # \"Wilcoxon", "line 9: key 'analysis'"),
        (
            "[[protocols]]\nname = \"pair\"",
            "[[protocols]]\nname = \"tripel\"",
            "there is no protocol 'tripel'; there are: pair",
        ),
        ("sha256 = \"", "sha256 = \"00", "key 'sha256': protocol 'pair' is here in another version"),
        ("[[sites]]\nname = \"london\"", "[[sites]]\nname = \"leeds\"", "key 'name': site 'leeds' is listed twice"),
        ("[[sites]]\nname = \"london\"", "[[sites]]\nname = \"\"", "key 'name'"),
        ("surgeons = 2", "surgeons = 0", "key 'surgeons': must be from 1 to 500 surgeons, not 0"),
        ("surgeons = 2", "surgeons = -2", "key 'surgeons'"),
        ("spares = 2", "spares = 501", "key 'spares': must be from 0 to 500 places, not 501"),
        ("spares = 2\n", "", "missing field `spares`"),
    ];

    for (from, to, expected) in wrong {
        let said = said(from, to);
        assert!(said.starts_with("study.toml, line ") && said.contains(expected), "{to}: {said}");
    }

    let too_long = said("Leeds General Infirmary", &long);
    assert!(too_long.contains("key 'title': must be 1 to 200 characters, not 300"), "{too_long}");
    assert!(said("[[sites]]", "[[sites").contains("line 15"), "what is no TOML names its line");
}

#[test]
fn a_missing_hash_is_printed_so_that_it_can_be_written() {
    let hash = hex::encode(protocol().sha256());
    let said = said(&format!("sha256 = \"{hash}\"\n"), "");
    assert!(said.contains("key 'sha256': is missing") && said.contains(&hash), "{said}");
}

#[test]
fn practice_and_a_protocol_listed_twice_are_refused() {
    let practice = PROTOCOL.replace("repeats = 1", "repeats = 1\npractice = true");
    let practice = parfocal_trial::protocol::Protocol::parse(&practice, "pair.toml", &crate::fixture::known()).unwrap();
    let hash = hex::encode(protocol().sha256());

    let text = definition().replace(&hash, &hex::encode(practice.sha256()));
    let said = Definition::parse(&text, "study.toml", &[practice]).unwrap_err().to_string();
    assert!(said.contains("'pair' is practice, which stays outside studies"), "{said}");

    let twice = definition() + &format!("\n[[protocols]]\nname = \"pair\"\nsha256 = \"{hash}\"\n");
    let said = Definition::parse(&twice, "study.toml", &[protocol()]).unwrap_err().to_string();
    assert!(said.contains("protocol 'pair' is listed twice"), "{said}");
}
