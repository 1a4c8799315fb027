//! Roles: each gives access to its own pages and no others, links become cookies, other sites get nothing.

use std::net::Ipv4Addr;
use std::sync::Arc;

use reqwest::header::{COOKIE, HOST, LOCATION, ORIGIN, SET_COOKIE};
use reqwest::{Method, Response, StatusCode};
use serde_json::Value;
use tokio_tungstenite::{connect_async, tungstenite};

use super::live::upgrade;
use crate::support::{Server, client};

const ROLES: [&str; 3] = ["surgeon", "operator", "researcher"];

/// Paths that are open to everyone.
const OPEN: [&str; 10] = [
    "/healthz",
    "/enter",
    "/sign-in",
    "/api/sign-in",
    "/api/sign-out",
    "/static/{version}/{folder}/{name}",
    "/trust",
    "/trust/authority.crt",
    "/trust/authority.mobileconfig",
    "/trust/check",
];

/// Arguments of a server that others can reach.
const OPEN_TO_ALL: [&str; 3] = ["--bind", "0.0.0.0:0", "--insecure"];

/// A server that others can reach.
fn open_server() -> Server {
    Server::within_on(Arc::new(tempfile::tempdir().unwrap()), Ipv4Addr::UNSPECIFIED, None)
}

async fn enter(server: &Server, key: &str) -> Response {
    server.get(&format!("/enter?key={key}")).send().await.unwrap()
}

/// The cookie of `role`, obtained by its link.
async fn cookie(server: &Server, role: &str) -> String {
    let response = enter(server, server.key(role)).await;
    sent_back(&response)
}

/// The cookie that `response` sets, as a browser sends it back.
fn sent_back(response: &Response) -> String {
    let cookie = response.cookies().next().expect("a cookie");
    format!("{}={}", cookie.name(), cookie.value())
}

/// Every endpoint: path, method, first tag.
async fn endpoints(server: &Server) -> Vec<(String, Method, String)> {
    let request = server.get("/api/openapi.json").bearer_auth(server.key("operator"));
    let document: Value = request.send().await.unwrap().json().await.unwrap();
    let mut found = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let method = method.to_uppercase().parse().unwrap();
            found.push((path.clone(), method, operation["tags"][0].as_str().unwrap_or_default().to_owned()));
        }
    }

    found
}

async fn ask(server: &Server, path: &str, method: Method, cookie: &str) -> StatusCode {
    // Any name will do, because access is checked before the name is looked up.
    let path = path.split('/').map(|part| if part.starts_with('{') { "nothing" } else { part }).collect::<Vec<_>>();
    let request = client().request(method, server.url(&path.join("/"))).header(COOKIE, cookie);
    request.send().await.unwrap().status()
}

#[tokio::test]
async fn nothing_but_the_door_is_open_without_a_key() {
    // On a loopback address too: a request from there may come through a proxy, which by default sends it to 127.0.0.1
    // under that name, without saying where it comes from.
    // Processes, because the health of a server without a control loop is bad.
    for server in [Server::with(&OPEN_TO_ALL), Server::start()] {
        let endpoints = endpoints(&server).await;
        assert!(endpoints.len() > 8, "{endpoints:?}");
        for (path, method, _) in endpoints.iter().filter(|(path, ..)| !OPEN.contains(&path.as_str())) {
            assert_eq!(ask(&server, path, method.clone(), "").await, StatusCode::FORBIDDEN, "{method} {path}");
            let forged = "parfocal-surgeon=0; parfocal-operator=; parfocal-researcher=x";
            assert_eq!(ask(&server, path, method.clone(), forged).await, StatusCode::FORBIDDEN, "{method} {path}");
        }

        assert_eq!(ask(&server, "/healthz", Method::GET, "").await, StatusCode::OK);
    }
}

#[tokio::test]
async fn a_visitor_without_a_key_learns_where_to_find_one() {
    let server = Server::within();
    for (path, page_words) in [
        ("/", "the server prints all three when it starts"),
        ("/stream.mjpeg", "the server prints all three when it starts"),
        ("/operator", "the operator's link, which the server prints when it starts"),
        ("/surgeon", "the surgeon's link: the operator has it"),
    ] {
        let page = server.get(path).header("accept", "text/html").send().await.unwrap().text().await.unwrap();
        // The page's text has entities instead of apostrophes.
        let page = page.replace("&#39;", "'");
        assert!(page.contains(page_words) && !page.contains("Bearer"), "{path}: {page}");
        let answer: Value = server.get(path).send().await.unwrap().json().await.unwrap();
        let said = answer["error"].as_str().unwrap();
        assert!(said.contains(page_words) && said.contains("'Authorization: Bearer KEY'"), "{path}: {said}");
    }
}

#[tokio::test]
async fn each_role_opens_its_own_endpoints_and_no_others() {
    let server = open_server();
    let endpoints = endpoints(&server).await;
    for role in ROLES {
        let cookie = cookie(&server, role).await;
        for (path, method, tag) in endpoints.iter().filter(|(.., tag)| ROLES.contains(&tag.as_str())) {
            let status = ask(&server, path, method.clone(), &cookie).await;
            // A single study and its analysis are shown only to a person who is signed in.
            let opens = tag == role && !(method == Method::GET && path.contains("/studies/{study}"));
            assert_eq!(status != StatusCode::FORBIDDEN, opens, "{role}: {method} {path} gave {status}");
        }

        let metrics = ask(&server, "/metrics", Method::GET, &cookie).await;
        assert_eq!(metrics == StatusCode::OK, role != "surgeon");
    }
}

#[tokio::test]
async fn a_cookie_is_not_accepted_as_a_key_nor_a_key_as_a_cookie() {
    let server = open_server();
    let cookie = cookie(&server, "operator").await;
    let (_, token) = cookie.split_once('=').unwrap();
    assert_eq!(enter(&server, token).await.status(), StatusCode::FORBIDDEN);
    let forged = format!("parfocal-operator={}", server.key("operator"));
    assert_eq!(ask(&server, "/operator", Method::GET, &forged).await, StatusCode::FORBIDDEN);
    let renamed = cookie.replace("operator", "researcher");
    assert_eq!(ask(&server, "/researcher", Method::GET, &renamed).await, StatusCode::FORBIDDEN);
}

#[tokio::test]
async fn a_link_becomes_a_strict_cookie_and_leaves_the_address() {
    let server = open_server();
    for role in ROLES {
        let response = enter(&server, server.key(role)).await;
        assert_eq!(response.status(), StatusCode::SEE_OTHER);
        assert_eq!(response.headers()[LOCATION], format!("/{role}"));
        let header = response.headers()[SET_COOKIE].to_str().unwrap();
        assert!(response.cookies().all(|cookie| cookie.http_only() && cookie.same_site_strict()), "{header}");
        assert!(!header.contains(server.key(role)));
        let home = server.get("/").header(COOKIE, sent_back(&response)).send().await.unwrap();
        assert_eq!(home.headers()[LOCATION], format!("/{role}"));
    }

    let wrong = server.get("/enter?key=0123456789abcdef0123456789abcdef").header("accept", "text/html");
    let response = wrong.send().await.unwrap();
    assert_eq!(response.status(), StatusCode::FORBIDDEN);
    assert!(response.headers().get(SET_COOKIE).is_none());
    assert!(response.text().await.unwrap().contains("gets the link from the operator"));
}

#[tokio::test]
async fn a_cookie_outlives_a_restart() {
    let mut server = Server::with(&OPEN_TO_ALL);
    let cookie = cookie(&server, "surgeon").await;
    assert!(server.end(rustix::process::Signal::TERM));
    let again = Server::on(server.data.clone(), &OPEN_TO_ALL);
    assert_eq!(ask(&again, "/surgeon", Method::GET, &cookie).await, StatusCode::OK);
}

#[tokio::test]
async fn a_loopback_server_answers_to_its_own_names_alone() {
    let server = Server::within();
    let status = async |host: &str| {
        let request = server.get_as("operator", "/operator").header(HOST, host);
        request.send().await.unwrap().status()
    };

    assert_eq!(status("localhost:1").await, StatusCode::OK);
    assert_eq!(status("127.0.0.1").await, StatusCode::OK);
    assert_eq!(status("evil.example").await, StatusCode::MISDIRECTED_REQUEST);
    let elsewhere = server.get("/healthz").header(HOST, "rebound.example:8080");
    assert_eq!(elsewhere.send().await.unwrap().status(), StatusCode::MISDIRECTED_REQUEST);
}

#[tokio::test]
async fn other_sites_change_nothing_and_hear_nothing() {
    let server = Server::within();
    let post = |name: &'static str, value: String| {
        let request = client().post(server.url("/healthz")).header(name, value);
        async { request.send().await.unwrap().status() }
    };

    let ours = format!("http://{}", server.address);
    assert_eq!(post("origin", "http://evil.example".into()).await, StatusCode::FORBIDDEN);
    assert_eq!(post("origin", "null".into()).await, StatusCode::FORBIDDEN);
    assert_eq!(post("sec-fetch-site", "cross-site".into()).await, StatusCode::FORBIDDEN);
    // These reach the route, which does not accept POST.
    assert_eq!(post("origin", ours.clone()).await, StatusCode::METHOD_NOT_ALLOWED);
    assert_eq!(post("sec-fetch-site", "same-origin".into()).await, StatusCode::METHOD_NOT_ALLOWED);

    let stream = async |origin: &str| {
        let mut request = upgrade(&server, "/live", "operator");
        request.headers_mut().insert(ORIGIN, origin.parse().unwrap());
        match connect_async(request).await {
            Ok((_, response)) => response.status(),
            Err(tungstenite::Error::Http(response)) => response.status(),
            Err(error) => panic!("{error}"),
        }
    };

    assert_eq!(stream("http://evil.example").await, StatusCode::FORBIDDEN);
    assert_eq!(stream(&ours).await, StatusCode::SWITCHING_PROTOCOLS);
}

#[tokio::test]
async fn a_page_opened_from_another_site_is_asked_for_once_more() {
    let server = open_server();
    let page = server.get("/surgeon").header("accept", "text/html");
    let direct = page.try_clone().unwrap().send().await.unwrap().text().await.unwrap();
    assert!(!direct.contains("http-equiv=\"refresh\""));
    let linked = page.header("sec-fetch-site", "cross-site").send().await.unwrap().text().await.unwrap();
    assert!(linked.contains("http-equiv=\"refresh\""));
}

#[tokio::test]
async fn the_start_page_is_that_of_the_link_that_let_one_in() {
    let server = Server::within();
    let start = async |cookie: &str| {
        let response = server.get("/").header(COOKIE, cookie).send().await.unwrap();
        response.headers()[LOCATION].to_str().unwrap().to_owned()
    };

    let surgeon = cookie(&server, "surgeon").await;
    let researcher = cookie(&server, "researcher").await;
    assert_eq!(start(&surgeon).await, "/surgeon");
    assert_eq!(start(&format!("{surgeon}; {researcher}")).await, "/researcher");
}
