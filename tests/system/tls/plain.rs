//! The answers of an encrypted server without encryption: how to trust it, and where the encrypted page is.

use super::client::{plain, text};
use crate::support::Server;

#[tokio::test]
async fn a_browser_that_does_not_encrypt_is_led_to_the_encrypted_page() {
    let server = Server::encrypted();
    for path in ["/", "/surgeon", "/sign-in?next=/researcher", "/live?role=surgeon", "/healthz"] {
        let answer = plain(&server, "GET", path).await;
        assert_eq!(answer.status(), 307, "{path}");
        assert_eq!(answer.headers()["location"], format!("https://{}{path}", server.address));
        assert!(answer.headers().get("set-cookie").is_none());
    }
}

#[tokio::test]
async fn what_changes_something_is_refused_in_the_clear() {
    let server = Server::encrypted();
    let answer = plain(&server, "POST", "/api/sign-in").await;
    assert_eq!(answer.status(), 403);
    let said = text(answer).await;
    assert!(
        said.contains("encrypted requests alone") && said.contains(&format!("https://{}", server.address)),
        "{said}"
    );
}

#[tokio::test]
async fn how_to_trust_the_server_can_be_read_in_the_clear() {
    let server = Server::encrypted();
    let page = plain(&server, "GET", "/trust").await;
    assert_eq!(page.status(), 200);
    let page = text(page).await;
    let fingerprint = server.said.lines().find_map(|line| line.split_once("(SHA-256) there: ")).unwrap().1;
    // It may be broken into two lines.
    assert!(page.replace("<wbr>", "").contains(fingerprint), "{fingerprint}");
    for role in ["surgeon", "operator", "researcher"] {
        assert!(!page.contains(server.key(role)), "a key in the clear");
    }

    let certificate = plain(&server, "GET", "/trust/authority.crt").await;
    assert_eq!(certificate.headers()["content-type"], "application/x-x509-ca-cert");
    let certificate = text(certificate).await;
    let profile = plain(&server, "GET", "/trust/authority.mobileconfig").await;
    assert_eq!(profile.headers()["content-type"], "application/x-apple-aspen-config");
    let profile = text(profile).await;
    let base64: String = certificate.lines().filter(|line| !line.starts_with('-')).collect();
    assert!(profile.contains("com.apple.security.root") && profile.contains(&base64), "{profile}");

    let check = plain(&server, "GET", "/trust/check").await;
    assert_eq!(
        (check.status().as_u16(), &check.headers()["access-control-allow-origin"]),
        (204, &"*".parse().unwrap())
    );
}

#[tokio::test]
async fn a_server_without_tls_has_nothing_to_trust() {
    let server = Server::start();
    let answer = server.get("/trust").send().await.unwrap();
    assert_eq!(answer.status(), 404);
    assert!(answer.text().await.unwrap().contains("start it with --tls"));
}
