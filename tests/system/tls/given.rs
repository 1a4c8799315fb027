//! A certificate that the site provides: used, renewed while the server runs, and refused with a sentence.

use std::path::{Path, PathBuf};

use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_dashboard::tls::{Certificates, Names};
use rcgen::{CertificateParams, KeyPair};
use serde_json::Value;
use time::OffsetDateTime;

use super::client::{get_as, http2_trusting, text};
use super::trust::Trust;
use crate::support::{Server, refused};

const DAY: i64 = 24;

/// A folder with a self-signed certificate and its key.
struct Site {
    folder: tempfile::TempDir,
}

impl Site {
    fn new() -> Self {
        let site = Self { folder: tempfile::tempdir().unwrap() };
        site.renew(&["localhost", "127.0.0.1"], -DAY, 30 * DAY);
        site
    }

    /// Writes a new certificate and key for these names. `from` and `until` are hours from now.
    fn renew(&self, names: &[&str], from: i64, until: i64) {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        let mut params = CertificateParams::new(names).unwrap();
        let hours = |hours| SystemClock.wall() + SignedDuration::from_hours(hours);
        params.not_before = date(hours(from));
        params.not_after = date(hours(until));

        let key = KeyPair::generate().unwrap();
        std::fs::write(self.certificate(), params.self_signed(&key).unwrap().pem()).unwrap();
        std::fs::write(self.key(), key.serialize_pem()).unwrap();
    }

    fn certificate(&self) -> PathBuf {
        self.folder.path().join("server.crt")
    }

    fn key(&self) -> PathBuf {
        self.folder.path().join("server.key")
    }

    fn arguments(&self) -> Vec<String> {
        let path = |path: PathBuf| path.to_str().unwrap().to_owned();
        let mut arguments = ["--bind", "127.0.0.1:0", "--tls", "--tls-certificate"].map(str::to_owned).to_vec();
        arguments.extend([path(self.certificate()), "--tls-key".to_owned(), path(self.key())]);
        arguments
    }

    /// The message of a server that refuses this certificate.
    fn refusal(&self) -> String {
        let data = tempfile::tempdir().unwrap();
        let arguments = self.arguments();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let (code, said) = refused(data.path(), &arguments);
        assert_eq!(code, Some(1), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        said
    }
}

fn date(timestamp: Timestamp) -> OffsetDateTime {
    OffsetDateTime::from_unix_timestamp(timestamp.as_second()).unwrap()
}

#[tokio::test]
async fn a_given_certificate_is_shown_and_no_authority_is_made() {
    let site = Site::new();
    let arguments = site.arguments();
    let server = Server::with(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let trust = Trust::in_authority(&site.certificate(), &["h2"]);
    assert!(trust.connect(server.address, "localhost").await.is_ok());

    assert!(!server.data.path().join("tls").exists());
    assert!(!server.said.contains("trust this server"), "{}", server.said);
    let answer = super::client::plain(&server, "GET", "/trust").await;
    assert_eq!(answer.status(), 404, "there is nothing to trust");
}

#[tokio::test]
async fn files_renewed_while_the_server_runs_are_used_and_bad_ones_are_not() {
    let site = Site::new();
    let now = SystemClock.wall();
    let certificates = Certificates::given(site.certificate(), site.key(), now).unwrap();
    let until = certificates.until();
    assert!(!certificates.refresh(now, Names::of_machine).unwrap());

    site.renew(&["localhost"], -DAY, -1);
    let error = certificates.refresh(now, Names::of_machine).unwrap_err().to_string();
    assert!(error.contains("ended on"), "{error}");
    assert_eq!(certificates.until(), until, "the present one is kept");
    assert!(!certificates.refresh(now, Names::of_machine).unwrap(), "told of once");

    site.renew(&["localhost"], -DAY, 300 * DAY);
    assert!(certificates.refresh(now, Names::of_machine).unwrap());
    assert!(certificates.until() > until);
}

#[tokio::test]
async fn a_certificate_that_ends_while_the_server_runs_is_shown_until_its_files_are_renewed() {
    let site = Site::new();
    let now = SystemClock.wall();
    let certificates = Certificates::given(site.certificate(), site.key(), now).unwrap();
    let afterwards = now + SignedDuration::from_hours(31 * DAY);
    assert!(certificates.until() < afterwards);
    assert!(!certificates.refresh(afterwards, Names::of_machine).unwrap(), "the server goes on");

    site.renew(&["localhost"], 30 * DAY, 300 * DAY);
    assert!(certificates.refresh(afterwards, Names::of_machine).unwrap(), "and needs no restart");
    assert!(certificates.until() > afterwards);
}

#[tokio::test]
async fn the_operator_reads_when_the_certificate_ends() {
    let site = Site::new();
    site.renew(&["localhost", "127.0.0.1"], -DAY, 10 * DAY);
    let arguments = site.arguments();
    let server = Server::with(&arguments.iter().map(String::as_str).collect::<Vec<_>>());

    let trust = Trust::in_authority(&site.certificate(), &["h2"]);
    let request = get_as(&server, "operator", "/api/operator/checks");
    let answer = http2_trusting(&trust, &server).await.send_request(request).await.unwrap();
    let told: Value = serde_json::from_str(&text(answer).await).unwrap();
    let findings = told["findings"].as_array().unwrap();
    let finding = findings.iter().find(|finding| finding["subject"] == "certificate").unwrap();

    let day = (SystemClock.wall() + SignedDuration::from_hours(10 * DAY)).to_zoned(TimeZone::system()).date();
    assert_eq!(finding["verdict"], "advice");
    assert!(finding["found"].as_str().unwrap().contains(&format!("ends on {day}")), "{finding}");
    assert!(finding["advice"].as_str().unwrap().contains("within a minute"), "{finding}");
}

#[test]
fn each_bad_file_is_refused_in_a_sentence() {
    let site = Site::new();
    let refuses = |words: &str| {
        let said = site.refusal();
        assert!(said.contains(words), "{words}: {said}");
    };

    site.renew(&["localhost"], -2 * DAY, -1);
    refuses("ended on");
    site.renew(&["localhost"], 2, DAY);
    refuses("set the clock");
    site.renew(&[], -DAY, DAY);
    refuses("names no host");

    site.renew(&["localhost"], -DAY, DAY);
    std::fs::write(site.key(), KeyPair::generate().unwrap().serialize_pem()).unwrap();
    refuses("does not belong to the certificate");
    std::fs::write(site.key(), "-----BEGIN ENCRYPTED PRIVATE KEY-----\nAAAA\n-----END ENCRYPTED PRIVATE KEY-----\n")
        .unwrap();
    refuses("passphrase");
    std::fs::write(site.key(), "nonsense").unwrap();
    refuses("holds no private key");
    std::fs::remove_file(site.key()).unwrap();
    refuses("server.key: No such file");

    std::fs::write(site.certificate(), "nonsense").unwrap();
    std::fs::write(site.key(), "nonsense").unwrap();
    refuses("holds no certificate");
    std::fs::remove_file(site.certificate()).unwrap();
    refuses("server.crt: No such file");
}

#[test]
fn options_that_do_not_fit_are_wrong_usage() {
    let data = tempfile::tempdir().unwrap();
    let code = |arguments: &[&str]| refused(data.path(), arguments).0;
    let file = Path::new("server.crt").to_str().unwrap();
    assert_eq!(code(&["--tls", "--tls-certificate", file]), Some(2));
    assert_eq!(code(&["--tls", "--tls-key", file]), Some(2));
    assert_eq!(code(&["--tls-certificate", file, "--tls-key", file]), Some(2));
    assert_eq!(code(&["--tls", "--insecure"]), Some(2));
}
