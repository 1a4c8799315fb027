//! A study of three surgeons with known answers, run over HTTP up to its unblinding. Its analysis on the page, as JSON,
//! on the command line and as files has the same figures as SciPy (`tests/vectors/analysis.py`).

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use reqwest::StatusCode;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use uuid::Uuid;

use super::live::Page;
use super::studies::{act, take_session_link};
use crate::support::{BRAIN, PASSPHRASE, Server, database};

const PROTOCOL: &str = include_str!("analysed.toml");
/// Name of the study.
pub const STUDY: &str = "focus-2026";
const API: &str = "/api/researcher/studies/focus-2026/analysis";
const PAGE: &str = "/researcher/studies/focus-2026/analysis";

fn definition() -> String {
    let sha256 = hex::encode(Sha256::digest(PROTOCOL));
    format!(
        "name = \"{STUDY}\"\ntitle = \"Three policies in the eyes of three surgeons\"\norder = \"shuffled\"\n\
         aborted = \"next-spare\"\nwithdrawn = \"next-spare\"\nrepeated = \"refuse\"\n\
         when_used_up = \"Call the trial office.\"\nmay_unblind = [\"Trial statistician\"]\n\
         analysis = \"Friedman on sharpness, then Wilcoxon with Holm\"\n\
         [[protocols]]\nname = \"analysed\"\nsha256 = \"{sha256}\"\n\
         [[sites]]\nname = \"leeds\"\ntitle = \"Leeds General Infirmary\"\nsurgeons = 4\nspares = 4\n"
    )
}

/// The surgeons' answers, and SciPy's figures for them.
fn vectors() -> Value {
    let vectors: Value = serde_json::from_str(include_str!("../../vectors/analysis.json")).unwrap();
    vectors["small"].clone()
}

/// A study on a server of its own.
pub struct Study {
    _protocols: TempDir,
    /// Number of keys used so far.
    keys: AtomicU64,
    /// The server that runs the study.
    pub server: Server,
}

impl Study {
    /// Plans and opens the study.
    pub async fn open() -> Self {
        let protocols = tempfile::tempdir().unwrap();
        std::fs::write(protocols.path().join("analysed.toml"), PROTOCOL).unwrap();
        let folder = protocols.path().to_str().unwrap();
        let data = Arc::new(tempfile::tempdir().unwrap());
        // Each setting is watched for twelve pictures.
        let arguments = ["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "25", "--protocols", folder];
        let mut server = Server::on(data, &arguments);
        server.add_account("statistician", "lead", "Trial statistician");
        let token = server.sign_in("statistician").await;
        server.use_key("operator", &token);
        server.use_key("researcher", &token);

        let study = Self { _protocols: protocols, keys: AtomicU64::new(0), server };
        let plan = json!({"definition": definition(), "reason": "ethics approved it"});
        study.server.post("/api/researcher/studies", plan).await;
        study.change("open").await;
        study
    }

    /// Changes the study.
    pub async fn change(&self, change: &str) {
        let mut body = json!({"change": change, "reason": "as planned"});
        if change == "open" {
            body["despite_concerns"] = true.into();
        }
        if change == "lock" {
            body["despite_outstanding"] = true.into();
        }
        if ["lock", "unblind"].contains(&change) {
            body["passphrase"] = PASSPHRASE.into();
        }
        self.server.post(&format!("/api/researcher/studies/{STUDY}/changes"), body).await;
    }

    async fn view(&self) -> Value {
        self.server.read("/api/surgeon/session").await
    }

    /// A key that no other record has.
    fn key(&self) -> Uuid {
        Uuid::from_u64_pair(0x4000, self.keys.fetch_add(1, Ordering::Relaxed) + 1)
    }

    async fn answer(&self, view: &Value, question: &str, value: Value) {
        let key = self.key();
        let body = json!({"key": key, "session": view["session"], "segment": view["segment"], "question": question,
            "value": value});
        self.server.post("/api/surgeon/answers", body).await;
    }

    /// The policies of a session, in order. No page shows them, so they are read from the database.
    async fn order(&self, session: &str) -> Vec<String> {
        let pool = self.server.database().await;
        let sql = "SELECT policy FROM segments WHERE session = ? ORDER BY setting";
        let order = sqlx::query_scalar(sql).bind(session).fetch_all(&pool).await.unwrap();
        pool.close().await;
        order
    }

    async fn prepare(&self, surgeon: &str) -> String {
        self.server.post("/api/operator/participants", json!({"code": surgeon})).await;
        let place = json!({"study": STUDY, "site": "leeds"});
        let new = json!({"participant": surgeon, "protocol": "analysed", "study": place});
        let made = self.server.post("/api/operator/sessions", new).await;
        made["session"].as_str().unwrap().to_owned()
    }

    /// Makes a session of `surgeon` and aborts it before it starts.
    pub async fn aborted(&self, surgeon: &str) {
        let session = self.prepare(surgeon).await;
        act(&self.server, "operator", json!({"session": session, "action": "abort", "reason": "the light failed"}))
            .await;
        self.server.post("/api/operator/dismissals", json!({"session": session})).await;
    }

    /// Runs a session of `surgeon`, who answers for each policy as in `answers`.
    pub async fn session(&mut self, surgeon: &str, answers: &Value) {
        let session = self.prepare(surgeon).await;
        take_session_link(&mut self.server).await;
        let order = self.order(&session).await;
        let mut page = Page::open(&self.server, "surgeon").await;
        act(&self.server, "operator", json!({"session": session, "action": "start"})).await;

        let mut ran: BTreeMap<&str, usize> = BTreeMap::new();
        for policy in &order {
            let repeat = ran.entry(policy).or_default();
            let segment = self.view().await["segment"].clone();
            let tap = |action: &str| json!({"session": session, "action": action, "segment": segment});
            act(&self.server, "surgeon", tap("acknowledge")).await;
            page.watch(12).await;
            let comment = json!({"key": self.key(), "session": session, "segment": segment, "kind": "text",
                "text": format!("{surgeon} sees <{}> for the {}. time", policy.to_uppercase(), *repeat + 1)});
            self.server.post("/api/surgeon/comments", comment).await;
            act(&self.server, "surgeon", tap("finish-segment")).await;

            let view = self.view().await;
            self.answer(&view, "sharp", answers[policy][*repeat].clone()).await;
            // One surgeon skips one question.
            if !(surgeon == "S-02" && policy == "fixed" && *repeat == 0) {
                self.answer(&view, "comfort", json!(40 + *repeat)).await;
            }
            self.answer(&view, "why", json!("because of the haze")).await;
            act(&self.server, "surgeon", tap("finish-questions")).await;
            *repeat += 1;
        }

        // The settings of the last policy are ranked best, those of the first worst.
        let policies = ["mlr-hill-climber", "mgm-hill-climber", "fixed"];
        let settings = |policy: &&str| {
            let own = order.iter().zip(1..).filter(|(ran, _)| ran == policy);
            own.map(|(_, setting)| setting).collect::<Vec<u8>>()
        };
        let ranking: Vec<u8> = policies.iter().flat_map(settings).collect();
        let view = self.view().await;
        self.answer(&view, "preference", json!(ranking)).await;
        self.answer(&view, "usability", json!([4, 2, 3, 1, 4, 3, 2, 2, 4, 2])).await;
        act(&self.server, "surgeon", json!({"session": session, "action": "finish-questions", "segment": null})).await;
        assert_eq!(self.view().await["phase"], "completed");
        self.server.post("/api/operator/dismissals", json!({"session": session})).await;
    }

    /// Runs the whole study: three sessions that count, and an aborted one.
    pub async fn run() -> Self {
        let mut study = Self::open().await;
        for (surgeon, answers) in vectors()["answers"].as_object().unwrap() {
            study.session(surgeon, answers).await;
        }
        study.aborted("S-04").await;
        study.change("close").await;
        study.change("lock").await;
        study
    }
}

fn command(data: &Path, arguments: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.args(["study", "analyse", STUDY, "--data-dir"]).arg(data).args(arguments);
    let output = command.output().unwrap();
    let said = if output.status.success() { output.stdout } else { output.stderr };
    (output.status.success(), String::from_utf8(said).unwrap())
}

fn assert_near(found: &Value, expected: &Value, what: &str) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{what} is {found}"));
    let expected = expected.as_f64().unwrap();
    assert!((found - expected).abs() < 1e-9, "{what}: {found} instead of {expected}");
}

/// Compares each number in `expected` with the field of the same name in `found`.
fn assert_all(found: &Value, expected: &Value, what: &str) {
    for (name, value) in expected.as_object().unwrap() {
        match value {
            Value::Number(_) => assert_near(&found[name], value, &format!("{what}, {name}")),
            other => assert_eq!(&found[name], other, "{what}, {name}"),
        }
    }
}

/// The rows of a CSV file, by column.
fn rows(folder: &Path, name: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(folder.join(name)).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

/// Before unblinding, the answer is a sentence that reveals no policy.
async fn assert_refused_while_blinded(study: &Study) {
    for path in [API.to_owned(), PAGE.to_owned(), format!("{API}.zip")] {
        let (status, said) = study.server.look("researcher", &path).await;
        assert_eq!(status, StatusCode::CONFLICT, "{path}: {said}");
        assert!(
            said.contains("study 'focus-2026' is locked: it can be analysed once all of it is unblinded"),
            "{said}"
        );
        assert!(!said.contains("climber") && !said.contains("fixed"), "{said}");
    }
    let (succeeded, said) = command(study.server.data.path(), &["--json"]);
    assert!(!succeeded && said.contains("is locked") && !said.contains("climber"), "{said}");
    assert_eq!(
        study.server.look("researcher", "/api/researcher/studies/other/analysis").await.0,
        StatusCode::NOT_FOUND
    );
}

fn outcome<'a>(protocol: &'a Value, name: &str) -> &'a Value {
    let outcomes = protocol["outcomes"].as_array().unwrap();
    outcomes.iter().find(|compared| compared["outcome"] == name).unwrap()
}

/// Compares the rating for which the vectors have figures.
fn assert_ratings_are_scipys(protocol: &Value) {
    let expected = vectors();
    let sharp = outcome(protocol, "sharp/point");
    assert_eq!((&sharp["complete"], &sharp["left_out"]), (&json!(3), &json!(0)));
    for part in ["policies", "pairs"] {
        let found = sharp[part].as_array().unwrap();
        let expected = expected[part].as_array().unwrap();
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert_all(found, expected, part);
        }
    }
    assert_all(&sharp["difference"]["friedman"], &expected["friedman"], "Friedman");
    assert_eq!(sharp["difference"]["friedman"]["permutation"], "exact");
    assert_all(&sharp["repeats"]["agreement"], &expected["agreement"], "agreement");
}

/// Checks the figures that can be computed by hand.
fn assert_the_rest_is_as_by_hand(protocol: &Value) {
    assert_eq!(protocol["surgeons"], 3);
    let counted = |session: &&Value| session["counts"] == true;
    assert_eq!(protocol["sessions"].as_array().unwrap().iter().filter(counted).count(), 3);
    assert_eq!(protocol["sessions"][3]["remark"], "aborted");

    // One surgeon skipped one question. The means of the other two are the same for all policies.
    let comfort = outcome(protocol, "comfort/position");
    assert_eq!((&comfort["complete"], &comfort["left_out"]), (&json!(2), &json!(1)));
    let fixed = &comfort["policies"][0];
    assert_eq!((&fixed["n"], &fixed["missing"]), (&json!(5), &json!(1)));
    assert!(comfort["difference"]["said"].as_str().unwrap().starts_with("Each surgeon's means are the same"));

    // The settings of a policy share two neighbouring ranks.
    for (place, mean) in [(0, 5.5), (1, 3.5), (2, 1.5)] {
        assert_eq!(outcome(protocol, "preference/rank")["policies"][place]["mean"], mean);
    }
    // 3+3+2+4+3+2+1+3+3+3 = 27; 27 * 2.5 (Brooke 1996).
    assert_eq!(protocol["whole_sessions"][0]["mean"], 67.5);

    // The phantom knows its optimum. A policy that never moves has no turns.
    let turns = &outcome(protocol, "turns")["policies"];
    assert_eq!((&turns[0]["policy"], &turns[0]["mean"], &turns[0]["n"]), (&json!("fixed"), &json!(0.0), &json!(6)));
    assert!(turns[1]["mean"].as_f64().unwrap() > 0.0);
    assert!(outcome(protocol, "focal-error")["policies"][0]["mean"].as_f64().unwrap() > 0.0);
}

fn assert_page_tells(html: &str, protocol: &Value) {
    let sharp = outcome(protocol, "sharp/point");
    for said in [&sharp["difference"]["said"], &sharp["pairs"][0]["said"], &sharp["repeats"]["said"]] {
        let said = said.as_str().unwrap().replace('\'', "&#39;").replace('<', "&#60;");
        assert!(html.contains(&said), "{said} is not on the page");
    }
    assert!(html.contains("S-01 sees &#60;FIXED&#62; for the 2. time"), "comments are escaped and told");
    assert_eq!(html.matches("<svg").count(), protocol["outcomes"].as_array().unwrap().len());
}

/// Checks the folder that the command writes.
fn assert_folder_tells(folder: &Path, analysis: &Value) {
    let sharp = outcome(&analysis["protocols"][0], "sharp/point");
    let row = rows(folder, "analysis_tests.csv").into_iter().find(|row| row["outcome"] == "sharp/point").unwrap();
    let number = |cell: &String| json!(cell.parse::<f64>().unwrap());
    assert_eq!(number(&row["friedman_chi_square"]), sharp["difference"]["friedman"]["chi_square"]);
    assert_eq!(number(&row["icc"]), sharp["repeats"]["agreement"]["icc"]);
    assert_eq!(number(&rows(folder, "analysis_pairs.csv")[0]["p_holm"]), sharp["pairs"][0]["p_holm"]);

    let values = rows(folder, "analysis_values.csv");
    assert_eq!(values.iter().filter(|row| row["outcome"] == "sharp/point").count(), 18);
    let missing = |row: &&BTreeMap<String, String>| row["outcome"] == "comfort/position" && row["value"].is_empty();
    assert_eq!(values.iter().filter(missing).count(), 1);
    assert_eq!(rows(folder, "analysis_words.csv").len(), 36);
    let whole: Value = serde_json::from_slice(&std::fs::read(folder.join("analysis.json")).unwrap()).unwrap();
    assert_eq!(&whole, analysis);

    let sums = Command::new("sha256sum").args(["--check", "--strict", "SHA256SUMS"]).current_dir(folder).output();
    assert!(sums.unwrap().status.success());
}

/// Number of recorded looks at the analysis.
async fn looks(data: &Path) -> i64 {
    let pool = database(data).await;
    let sql = "SELECT count(*) FROM accesses WHERE kind = 'analysis-viewed' AND role = 'researcher' AND detail = ?";
    let looks = sqlx::query_scalar(sql).bind(STUDY).fetch_one(&pool).await.unwrap();
    pool.close().await;
    looks
}

#[tokio::test(flavor = "multi_thread")]
async fn a_studys_analysis_has_scipys_figures_on_the_page_on_the_command_line_and_in_files() {
    let study = Study::run().await;
    let data = study.server.data.path();
    assert_refused_while_blinded(&study).await;
    study.change("unblind").await;
    study.server.add_account("operator", "operator", "Operator of Leeds");
    let operator = study.server.sign_in("operator").await;
    for key in [study.server.key("surgeon"), &operator] {
        for path in [API, PAGE] {
            let response = study.server.get(path).bearer_auth(key).send().await.unwrap();
            assert_eq!(response.status(), StatusCode::FORBIDDEN, "{path}");
        }
    }

    let (status, said) = study.server.look("researcher", API).await;
    assert_eq!(status, StatusCode::OK, "{said}");
    let analysis: Value = serde_json::from_str(&said).unwrap();
    let protocol = &analysis["protocols"][0];
    assert_ratings_are_scipys(protocol);
    assert_the_rest_is_as_by_hand(protocol);

    let (status, html) = study.server.look("researcher", PAGE).await;
    assert_eq!(status, StatusCode::OK);
    assert_page_tells(&html, protocol);

    let (succeeded, said) = command(data, &["--json"]);
    assert!(succeeded, "{said}");
    assert_eq!(serde_json::from_str::<Value>(&said).unwrap(), analysis);
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("analysis");
    let into_folder = ["--out", folder.to_str().unwrap()];
    let (succeeded, said) = command(data, &into_folder);
    let difference = outcome(protocol, "sharp/point")["difference"]["said"].as_str().unwrap();
    assert!(succeeded && said.contains(difference), "{said}");
    assert_folder_tells(&folder, &analysis);
    let (succeeded, said) = command(data, &into_folder);
    assert!(!succeeded && said.contains("is not empty"), "{said}");

    let zip = study.server.get_as("researcher", &format!("{API}.zip")).send().await.unwrap().bytes().await.unwrap();
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(zip)).unwrap();
    let mut packed = String::new();
    let name = "parfocal-focus-2026-analysis/analysis_tests.csv";
    std::io::Read::read_to_string(&mut zip.by_name(name).unwrap(), &mut packed).unwrap();
    assert_eq!(packed, std::fs::read_to_string(folder.join("analysis_tests.csv")).unwrap());

    // Telemetry included, the package says the same as the database, digit by digit.
    let package = out.path().join("package");
    let mut export = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    export.args(["export", "--study", STUDY, "--unblinded", "--data-dir"]).arg(data).arg("--out").arg(&package);
    assert!(export.output().unwrap().status.success());
    let mut of_package = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    let printed = of_package.args(["study", "analyse", "--json"]).arg(&package).output().unwrap().stdout;
    assert_eq!(serde_json::from_slice::<Value>(&printed).unwrap(), analysis);

    // JSON, page and ZIP file count as a look each. Refused requests do not, and the command only reads.
    assert_eq!(looks(data).await, 3);
}
