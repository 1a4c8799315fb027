//! A certificate that the site provides: used, renewed while the server runs, and refused with a sentence.

use std::path::{Path, PathBuf};
use std::process::Command;

use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_dashboard::tls::{Certificates, Names};
use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};
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

    /// Lets OpenSSL make a self-signed certificate, with these further arguments.
    fn openssl(&self, arguments: &[&str]) {
        let mut command = Command::new("openssl");
        command.args(["req", "-x509", "-nodes", "-days", "9", "-subj", "/CN=server"]).args(arguments);
        command.args(["-addext", "subjectAltName=DNS:localhost"]);
        let output = command.arg("-keyout").arg(self.key()).arg("-out").arg(self.certificate()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
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
async fn a_renewed_certificate_that_begins_later_is_used_from_then_on() {
    let site = Site::new();
    let now = SystemClock.wall();
    let certificates = Certificates::given(site.certificate(), site.key(), now).unwrap();
    let until = certificates.until();

    site.renew(&["localhost"], DAY, 300 * DAY);
    let error = certificates.refresh(now, Names::of_machine).unwrap_err().to_string();
    assert!(error.contains("begins on"), "{error}");
    assert!(!certificates.refresh(now, Names::of_machine).unwrap(), "told of once");
    assert_eq!(certificates.until(), until, "the present one is kept");

    let begun = now + SignedDuration::from_hours(DAY + 1);
    assert!(certificates.refresh(begun, Names::of_machine).unwrap());
    assert!(certificates.until() > until);
    assert!(!certificates.refresh(begun, Names::of_machine).unwrap(), "once");
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
fn a_key_that_cannot_be_used_and_a_purpose_that_is_not_a_servers_are_named() {
    let site = Site::new();
    let refuses = |arguments: &[&str], words: &[&str]| {
        site.openssl(arguments);
        let said = site.refusal();
        assert!(words.iter().all(|word| said.contains(word)), "{words:?}: {said}");
    };

    refuses(&["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-521"], &["on the curve P-521", "P-256 or P-384"]);
    refuses(&["-newkey", "rsa:1024"], &["its RSA key has 1024 bits", "2048 to 8192 bits"]);
    let p256 = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-addext"];
    refuses(&[&p256[..], &["extendedKeyUsage=clientAuth"]].concat(), &["for clients", "server authentication"]);

    for good in ["extendedKeyUsage=clientAuth,serverAuth", "extendedKeyUsage=anyExtendedKeyUsage", "nsComment=none"] {
        site.openssl(&[&p256[..], &[good]].concat());
        assert!(Certificates::given(site.certificate(), site.key(), SystemClock.wall()).is_ok(), "{good}");
    }
    site.openssl(&["-newkey", "rsa:2048"]);
    assert!(Certificates::given(site.certificate(), site.key(), SystemClock.wall()).is_ok());
}

#[test]
fn a_chain_is_taken_in_its_order_only() {
    let authority = |name: &str| {
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, name);
        params
    };
    let [root_key, middle_key, key] = std::array::from_fn(|_| KeyPair::generate().unwrap());
    let root = authority("root").self_signed(&root_key).unwrap().pem();
    let middle_pem = middle_key.serialize_pem();
    let root_issuer = Issuer::new(authority("root"), root_key);
    let middle = authority("middle").signed_by(&middle_key, &root_issuer).unwrap().pem();
    let leaf = CertificateParams::new(["localhost".to_owned()]).unwrap();
    let leaf = leaf.signed_by(&key, &Issuer::new(authority("middle"), middle_key)).unwrap().pem();

    let site = Site::new();
    std::fs::write(site.key(), key.serialize_pem()).unwrap();
    let given = |chain: &[&str]| {
        std::fs::write(site.certificate(), chain.concat()).unwrap();
        Certificates::given(site.certificate(), site.key(), SystemClock.wall())
            .map(drop)
            .map_err(|error| error.to_string())
    };
    for good in [&[&*leaf][..], &[&leaf, &middle], &[&leaf, &middle, &root]] {
        assert_eq!(given(good), Ok(()));
    }

    let said = given(&[&root, &middle, &leaf]).unwrap_err();
    assert!(said.contains("in the wrong order: the server's own, to which the key belongs, is number 3"), "{said}");
    let said = given(&[&leaf, &root, &middle]).unwrap_err();
    assert!(said.contains("in the wrong order: number 2 did not sign number 1"), "{said}");
    assert!(site.refusal().contains("in the wrong order"));

    // A chain that is in order, with the key of the authority that signed it, or of nobody.
    for other in [middle_pem, KeyPair::generate().unwrap().serialize_pem()] {
        std::fs::write(site.key(), other).unwrap();
        let said = given(&[&leaf, &middle]).unwrap_err();
        assert!(said.contains("server.key does not belong to the certificate in"), "{said}");
    }
}

#[test]
fn a_byte_order_mark_is_named() {
    let site = Site::new();
    for (file, others) in [(site.certificate(), site.key()), (site.key(), site.certificate())] {
        site.renew(&["localhost"], -DAY, DAY);
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, format!("\u{feff}{text}")).unwrap();
        let said = site.refusal();
        assert!(said.contains(file.to_str().unwrap()) && said.contains("byte order mark (BOM)"), "{said}");
        assert!(!said.contains(others.to_str().unwrap()), "{said}");
    }

    site.renew(&["localhost"], -DAY, DAY);
    let text = std::fs::read_to_string(site.certificate()).unwrap();
    let wide: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    std::fs::write(site.certificate(), wide).unwrap();
    assert!(site.refusal().contains("UTF-16"));
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
