//! The local authority: what it signs, that it survives restarts, and when the server's certificate is renewed.

use std::net::{IpAddr, Ipv4Addr};
use std::os::unix::fs::PermissionsExt;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use jiff::SignedDuration;
use parfocal_base::clock::{Clock, ManualClock, SystemClock};
use parfocal_dashboard::tls::{Certificates, Names};
use rustix::process::Signal;
use tokio::net::TcpListener;
use tokio_rustls::TlsAcceptor;

use super::client::{certificate, plain, text};
use super::trust::Trust;
use crate::support::{Server, refused};

const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
const DAY: Duration = Duration::from_hours(24);

/// Output of `openssl x509` with the options `what` for a certificate.
fn openssl(certificate: &[u8], what: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("certificate.der");
    std::fs::write(&file, certificate).unwrap();
    let arguments = ["x509", "-inform", "DER", "-noout", "-in", file.to_str().unwrap()];
    let output = Command::new("openssl").args(arguments).args(what).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The server's certificate, as seen by a client that trusts only the server's own authority.
async fn shown(server: &Server) -> Vec<u8> {
    certificate(&Trust::of(server, &["h2"]).connect(server.address, "127.0.0.1").await.unwrap())
}

#[tokio::test]
async fn the_authority_outlives_a_restart_and_the_certificate_is_new_each_time() {
    let mut first = Server::encrypted();
    let authority = std::fs::read(first.data.path().join("tls/authority.pem")).unwrap();
    let before = shown(&first).await;
    assert!(first.end(Signal::TERM));

    let again = Server::on(Arc::clone(&first.data), &["--bind", "127.0.0.1:0", "--tls"]);
    assert_eq!(std::fs::read(again.data.path().join("tls/authority.pem")).unwrap(), authority);
    assert_ne!(shown(&again).await, before);
}

#[tokio::test]
async fn the_private_key_is_the_owners_alone_and_never_served() {
    let server = Server::encrypted();
    let folder = server.data.path().join("tls");
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&folder), 0o700);
    assert_eq!(mode(&folder.join("authority.pem")), 0o600);

    let private = std::fs::read_to_string(folder.join("authority.pem")).unwrap();
    assert!(private.contains("PRIVATE KEY"));
    let public = std::fs::read_to_string(folder.join("authority.crt")).unwrap();
    assert!(public.contains("BEGIN CERTIFICATE") && !public.contains("KEY"), "{public}");

    for path in ["/trust", "/trust/authority.crt", "/trust/authority.mobileconfig"] {
        let answer = text(plain(&server, "GET", path).await).await;
        assert!(!answer.contains("PRIVATE"), "{path}: {answer}");
    }
    let sent = text(plain(&server, "GET", "/trust/authority.crt").await).await;
    assert_eq!(sent, public);
}

#[tokio::test]
async fn the_certificate_is_what_apples_devices_ask_for() {
    // support.apple.com/en-us/103769: at most 825 days, a name in the alternative names, for servers, and SHA-2.
    let server = Server::encrypted();
    let certificate = shown(&server).await;
    let said = openssl(&certificate, &["-text"]);
    assert!(said.contains("DNS:localhost") && said.contains("IP Address:127.0.0.1"), "{said}");
    assert!(said.contains("TLS Web Server Authentication"), "{said}");
    assert!(said.contains("Signature Algorithm: ecdsa-with-SHA256"), "{said}");

    let in_825_days = (825 * 24 * 3600).to_string();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("certificate.der");
    std::fs::write(&file, &certificate).unwrap();
    let arguments = ["x509", "-inform", "DER", "-noout", "-checkend", &in_825_days, "-in", file.to_str().unwrap()];
    let ends = Command::new("openssl").args(arguments).output().unwrap();
    assert_eq!(ends.status.code(), Some(1), "it ends before");
}

#[tokio::test]
async fn the_fingerprint_printed_is_the_one_that_devices_show() {
    let server = Server::encrypted();
    let file = server.data.path().join("tls/authority.crt");
    let arguments = ["x509", "-noout", "-fingerprint", "-sha256", "-in", file.to_str().unwrap()];
    let output = Command::new("openssl").args(arguments).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    let fingerprint = said.trim().split_once('=').unwrap().1;
    assert!(server.said.contains(fingerprint), "{fingerprint} in {}", server.said);
    assert!(server.said.contains(&format!("http://{}/trust", server.address)), "{}", server.said);
}

/// Shows the certificate of `certificates` to one client, which trusts the authority in `data` and connects to `name`.
async fn handshake(certificates: &Arc<Certificates>, data: &std::path::Path, name: &str) -> std::io::Result<Vec<u8>> {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let acceptor = TlsAcceptor::from(certificates.settings().unwrap());
    let server = tokio::spawn(async move { acceptor.accept(listener.accept().await.unwrap().0).await });

    let trust = Trust::in_authority(&data.join("tls/authority.crt"), &["h2"]);
    let shown = trust.connect(address, name).await.map(|stream| certificate(&stream));
    drop(server.await);
    shown
}

fn names(hosts: &[&str], addresses: &[&str]) -> Names {
    Names {
        hosts: hosts.iter().map(|&host| host.to_owned()).collect(),
        addresses: addresses.iter().map(|address| address.parse().unwrap()).collect(),
    }
}

#[tokio::test]
async fn a_certificate_near_its_end_is_replaced_and_one_that_is_not_stays() {
    let data = tempfile::tempdir().unwrap();
    let clock = ManualClock::new(SystemClock.wall());
    let certificates = Arc::new(Certificates::local(data.path(), LOOPBACK, clock.wall()).unwrap());
    let first = handshake(&certificates, data.path(), "127.0.0.1").await.unwrap();

    // The certificate lasts 90 days and is replaced 30 days before its end.
    clock.advance(59 * DAY);
    assert!(!certificates.refresh(clock.wall(), Names::of_machine).unwrap());
    assert_eq!(handshake(&certificates, data.path(), "127.0.0.1").await.unwrap(), first);

    clock.advance(2 * DAY);
    assert!(certificates.refresh(clock.wall(), Names::of_machine).unwrap());
    assert_eq!(certificates.until().as_second(), (clock.wall() + 90 * DAY).as_second());
    assert!(!certificates.refresh(clock.wall(), Names::of_machine).unwrap(), "once");
}

#[tokio::test]
async fn a_changed_address_gets_a_new_certificate_from_the_same_authority() {
    let data = tempfile::tempdir().unwrap();
    let now = SystemClock.wall();
    let certificates = Arc::new(Certificates::local(data.path(), LOOPBACK, now).unwrap());
    let at = |address: &'static str| handshake(&certificates, data.path(), address);
    assert!(at("10.20.30.40").await.is_err(), "no such address yet");

    let moved = names(&["localhost"], &["10.20.30.40"]);
    assert!(certificates.refresh(now, |_| moved.clone()).unwrap());
    assert!(at("10.20.30.40").await.is_ok());
    assert!(!certificates.refresh(now, |_| moved).unwrap());
}

#[tokio::test]
async fn the_authority_vouches_for_private_networks_and_this_machine_alone() {
    let data = tempfile::tempdir().unwrap();
    let now = SystemClock.wall();
    let certificates = Arc::new(Certificates::local(data.path(), LOOPBACK, now).unwrap());

    // A public address that this machine does not have, and another site's name are left out. The rest stays valid.
    let wanted = names(&["localhost", "renamed.local", "bank.example"], &["192.168.7.7", "203.0.113.9", "fd00::7"]);
    assert!(certificates.refresh(now, |_| wanted).unwrap());
    for good in ["localhost", "renamed.local", "192.168.7.7", "fd00::7"] {
        assert!(handshake(&certificates, data.path(), good).await.is_ok(), "{good}");
    }
    for bad in ["bank.example", "203.0.113.9", "127.0.0.1"] {
        assert!(handshake(&certificates, data.path(), bad).await.is_err(), "{bad}");
    }

    // The limits are in the authority's certificate itself, where devices check them.
    let file = data.path().join("tls/authority.crt");
    let arguments = ["x509", "-noout", "-text", "-in", file.to_str().unwrap()];
    let said = String::from_utf8(Command::new("openssl").args(arguments).output().unwrap().stdout).unwrap();
    assert!(said.contains("X509v3 Name Constraints: critical"), "{said}");
    assert!(said.contains("IP:10.0.0.0/255.0.0.0") && said.contains("CA:TRUE, pathlen:0"), "{said}");
}

#[test]
fn an_authority_that_cannot_be_used_is_refused_in_a_sentence() {
    let data = tempfile::tempdir().unwrap();
    let now = SystemClock.wall();
    Certificates::local(data.path(), LOOPBACK, now).unwrap();
    let file = data.path().join("tls/authority.pem");
    let good = std::fs::read_to_string(&file).unwrap();

    let years = |count: i64| now + SignedDuration::from_hours(count * 365 * 24);
    for wrong in [years(11), years(-1)] {
        let error = Certificates::local(data.path(), LOOPBACK, wrong).unwrap_err().to_string();
        assert!(error.contains("this machine's clock says") && error.contains("authority.pem"), "{error}");
    }

    let key_at = good.find("-----BEGIN PRIVATE KEY").unwrap();
    let other = tempfile::tempdir().unwrap();
    Certificates::local(other.path(), LOOPBACK, now).unwrap();
    let others = std::fs::read_to_string(other.path().join("tls/authority.pem")).unwrap();
    let mixed = format!("{}{}", &good[..key_at], &others[others.find("-----BEGIN PRIVATE KEY").unwrap()..]);
    for damaged in ["", &good[..key_at], &good[key_at..], &mixed] {
        std::fs::write(&file, damaged).unwrap();
        let (code, said) = refused(data.path(), &["--bind", "127.0.0.1:0", "--tls"]);
        assert_eq!(code, Some(1));
        assert!(said.contains("authority.pem is damaged") && said.lines().count() == 1, "{said}");
    }
}
