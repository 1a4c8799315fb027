//! The service: how it starts and ends, the contents of every response, files, errors, and the description of the
//! interface.

use std::collections::BTreeSet;
use std::io::Read;
use std::net::TcpListener;

use flate2::read::GzDecoder;
use reqwest::StatusCode;
use reqwest::header::{
    ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_TYPE, COOKIE, ETAG, IF_NONE_MATCH, VARY,
};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{Server, client, refused};

#[tokio::test]
async fn it_says_where_it_is_and_what_is_simulated() {
    let server = Server::start();
    assert!(server.said.contains("SIMULATED"), "{}", server.said);
    assert!(server.said.contains("--bind 0.0.0.0:8080"));
    assert!(server.said.contains('█') && server.said.contains('▄'), "a code to scan");
    let health: Value = server.get("/healthz").send().await.unwrap().json().await.unwrap();
    assert_eq!(health["status"], "ok");
    assert_eq!(health["simulated"], true);
}

#[tokio::test]
async fn it_ends_well_when_asked_to() {
    for signal in [Signal::TERM, Signal::INT, Signal::HUP] {
        let mut server = Server::start();
        let mut stream = server.get_as("surgeon", "/stream.mjpeg").send().await.unwrap();
        assert!(stream.chunk().await.unwrap().is_some());
        assert!(server.end(signal), "exit code 0");
        while let Ok(Some(_)) = stream.chunk().await {}
    }
}

#[test]
fn what_cannot_be_served_is_refused_in_a_sentence() {
    let data = tempfile::tempdir().unwrap();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let (code, said) = refused(data.path(), &["--bind", &address]);
    assert_eq!(code, Some(1));
    assert!(said.contains(&address) && said.contains("in use") && said.contains("--bind"), "{said}");

    let (code, said) = refused(data.path(), &["--bind", "192.0.2.1:8080", "--insecure"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("this machine does not have the address"), "{said}");

    // This is decided before the server listens or makes anything.
    let (code, said) = refused(data.path(), &["--bind", "0.0.0.0:0"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("not be encrypted") && said.contains("--tls") && said.contains("--insecure"), "{said}");
    assert_eq!(data.path().read_dir().unwrap().count(), 0);

    let (code, _) = refused(data.path(), &["--bind", "nonsense"]);
    assert_eq!(code, Some(2));

    let file = data.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let (code, said) = refused(&file, &["--bind", "127.0.0.1:0"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("data folder"), "{said}");

    std::fs::write(data.path().join("keys.toml"), "surgeon = 1").unwrap();
    let (code, said) = refused(data.path(), &["--bind", "127.0.0.1:0"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("keys.toml") && said.lines().count() == 1, "{said}");
}

#[test]
fn everything_that_is_wrong_is_reported_at_once_and_before_the_port_is_taken() {
    let data = tempfile::tempdir().unwrap();
    let path = |name: &str| data.path().join(name).to_str().unwrap().to_owned();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    std::fs::create_dir(path("protocols")).unwrap();
    std::fs::write(path("protocols/a.toml"), "name = 3\n").unwrap();
    std::fs::create_dir(path("weights")).unwrap();
    std::fs::write(path("calibration.toml"), "nonsense").unwrap();

    let folder = data.path().join("new");
    let (code, said) = refused(
        &folder,
        &[
            ["--bind", &address, "--camera", "footage:/no/such.mp4", "--lens", "emulated?temperature=nan"].as_slice(),
            &["--weights", &path("weights"), "--protocols", &path("protocols")],
            &["--calibration", &path("calibration.toml"), "--lens-dynamics", "/no/such.toml"],
            &["--tls", "--tls-certificate", "/no/such.crt", "--tls-key", "/no/such.key"],
        ]
        .concat(),
    );
    assert_eq!(code, Some(1));
    for words in [
        "8 reasons",
        "there are no weights in",
        "a.toml, line 1",
        "temperature=",
        "/no/such.mp4",
        "calibration.toml",
        "/no/such.toml",
        "/no/such.crt",
        &format!("{address} is in use"),
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert_eq!(said.lines().count(), 9, "{said}");
    assert!(!folder.exists(), "a start that fails makes no data folder");
}

#[test]
fn one_data_folder_has_one_server() {
    let server = Server::start();
    let (code, said) = refused(server.data.path(), &["--bind", "127.0.0.1:0"]);
    assert_eq!(code, Some(1));
    assert!(said.contains(server.data.path().to_str().unwrap()) && said.lines().count() == 1, "{said}");
}

#[tokio::test]
async fn every_page_has_a_nonce_of_its_own_and_strict_headers() {
    let server = Server::within();
    let mut nonces = Vec::new();
    for _ in 0..2 {
        let response = server.get_as("operator", "/operator").send().await.unwrap();
        let headers = response.headers().clone();
        let policy = headers["content-security-policy"].to_str().unwrap();
        assert!(policy.starts_with("default-src 'none'") && policy.contains("frame-ancestors 'none'"), "{policy}");
        assert!(!policy.contains("unsafe"), "{policy}");
        assert_eq!(headers["x-content-type-options"], "nosniff");
        assert_eq!(headers["referrer-policy"], "no-referrer");
        assert_eq!(headers[CACHE_CONTROL], "no-store");
        let nonce = policy.split("'nonce-").nth(1).unwrap().split('\'').next().unwrap().to_owned();
        assert_eq!(nonce.len(), 32);
        let page = response.text().await.unwrap();
        let scripts = page.matches("<script").count();
        assert!(scripts > 0);
        assert_eq!(page.matches(&format!("nonce=\"{nonce}\"")).count(), scripts);
        nonces.push(nonce);
    }

    assert_ne!(nonces[0], nonces[1]);
}

#[tokio::test]
async fn failures_are_pages_for_browsers_and_json_for_programs() {
    let server = Server::within();
    let page = server.get("/nowhere").header("accept", "text/html,*/*").send().await.unwrap();
    assert_eq!(page.status(), StatusCode::NOT_FOUND);
    let text = page.text().await.unwrap();
    assert!(text.contains("<h1>") && text.contains("href=\"/\""), "a way on: {text}");

    let json: Value = server.get("/nowhere").send().await.unwrap().json().await.unwrap();
    assert_eq!(json["error"], "There is nothing at this address.");

    let method = client().post(server.url("/healthz")).send().await.unwrap();
    assert_eq!(method.status(), StatusCode::METHOD_NOT_ALLOWED);
    assert_eq!(method.headers()["allow"], "GET,HEAD");
    assert!(method.json::<Value>().await.unwrap()["error"].is_string());

    let query: Value = server.get("/enter").send().await.unwrap().json().await.unwrap();
    assert!(query["error"].as_str().unwrap().contains("key"), "{query}");

    for (path, words) in [
        ("/enter", "incomplete or misspelled"),
        ("/enter?key=nonsense", "from the operator"),
        ("/surgeon", "the operator has it"),
        ("/researcher/sessions/nonsense", "incomplete or misspelled"),
        ("/researcher/sessions/00000000-0000-4000-8000-000000000000", "There is no such session here."),
    ] {
        let request = server.get(path).header("accept", "text/html");
        let request = if path.contains("sessions") { request.bearer_auth(server.key("researcher")) } else { request };
        let text = request.send().await.unwrap().text().await.unwrap();
        assert!(text.contains(words), "{path}: {text}");
    }
}

#[tokio::test]
async fn static_files_are_kept_for_ever_by_their_hash() {
    let server = Server::within();
    let page = server.get_as("operator", "/operator").send().await.unwrap().text().await.unwrap();
    let address = page.split('"').find(|part| part.starts_with("/static/") && part.ends_with("style.css")).unwrap();
    let file = server.get(address).send().await.unwrap();
    assert_eq!(file.headers()[CONTENT_TYPE], "text/css; charset=utf-8");
    assert!(file.headers()[CACHE_CONTROL].to_str().unwrap().contains("immutable"));
    let known = server.get(address).header(IF_NONE_MATCH, &file.headers()[ETAG]).send().await.unwrap();
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);

    let old = server.get("/static/0123456789abcdef/shared/viewer.js").send().await.unwrap();
    assert_eq!(old.status(), StatusCode::OK);
    assert_eq!(old.headers()[CACHE_CONTROL], "no-cache");
    assert_eq!(old.headers()[CONTENT_TYPE], "text/javascript; charset=utf-8");

    for missing in [
        "/static/0/shared/none.js",
        "/static/0/shared/..%2f..%2f..%2fCargo.toml",
        "/static/0/..%2f..%2fCargo.toml",
        "/static/0/viewer.js",
        "/static/viewer.js",
    ] {
        assert_eq!(server.get(missing).send().await.unwrap().status(), StatusCode::NOT_FOUND, "{missing}");
    }
}

/// The goal of issue 45 for a tablet at the end of a slow link: at most 15 requests to open the surgeon's page. Besides
/// these there are its link, the page, the session, the worker and the page for it, and the live connection.
#[tokio::test]
async fn the_surgeons_page_needs_few_files_and_they_are_small() {
    let server = Server::within();
    for language in ["en", "de", "fr", "es"] {
        let request = server.get_as("surgeon", "/surgeon").header(COOKIE, format!("parfocal-language={language}"));
        let page = request.send().await.unwrap().text().await.unwrap();
        assert!(page.contains(&format!("<html lang=\"{language}\"")), "{page}");
        needs_few_small_files(&server, &page).await;

        // Of the languages it loads its own.
        let loaded: BTreeSet<&str> = page.split('"').filter(|part| part.contains("/languages/")).collect();
        assert!(
            loaded.len() == 1 && loaded.iter().all(|file| file.ends_with(&format!("/{language}.js"))),
            "{loaded:?}"
        );
    }
}

async fn needs_few_small_files(server: &Server, page: &str) {
    const BESIDES: usize = 6;
    let files: BTreeSet<&str> = page.split('"').filter(|part| part.starts_with("/static/")).collect();
    assert!(files.len() + BESIDES <= 15, "{files:?}");

    let mut bytes = 0;
    for file in &files {
        let plain = server.get(file).send().await.unwrap().bytes().await.unwrap();
        let answer = server.get(file).header(ACCEPT_ENCODING, "gzip, deflate, br").send().await.unwrap();
        assert_eq!(answer.headers()[CONTENT_ENCODING], "gzip");
        assert_eq!(answer.headers()[VARY], "accept-encoding");
        let packed = answer.bytes().await.unwrap();
        bytes += packed.len();
        let mut unpacked = Vec::new();
        GzDecoder::new(&*packed).read_to_end(&mut unpacked).unwrap();
        assert!(unpacked == plain, "{file}");

        let text = String::from_utf8_lossy(&plain);
        assert!(!text.lines().any(|line| line.starts_with("import ")), "{file} asks for further files");
    }
    // Half a second at 1 Mbit/s.
    assert!(bytes < 62_500, "{bytes} bytes");
}

#[tokio::test]
async fn every_endpoint_is_described() {
    let server = Server::within();
    let document: Value = server.get_as("operator", "/api/openapi.json").send().await.unwrap().json().await.unwrap();
    let paths = document["paths"].as_object().unwrap();
    for path in
        ["/", "/enter", "/surgeon", "/operator", "/researcher", "/live", "/stream.mjpeg", "/healthz", "/metrics"]
    {
        let operation = &paths[path]["get"];
        assert!(operation["summary"].as_str().is_some_and(|text| !text.is_empty()), "{path}");
        assert!(operation["responses"].as_object().is_some_and(|all| !all.is_empty()), "{path}");
    }
}

#[tokio::test]
async fn what_the_layers_answer_and_what_the_server_refuses_is_described() {
    let server = Server::within();
    let request = server.get_as("operator", "/api/openapi.json");
    let document: Value = request.send().await.unwrap().json().await.unwrap();
    let post = &document["paths"]["/api/operator/participants"]["post"];
    for status in ["200", "400", "403", "408", "413", "415", "421", "422", "500", "503", "507"] {
        assert!(post["responses"][status].is_object(), "{status}");
    }
    assert_eq!(post["security"], serde_json::json!([{"key": []}, {"operator": []}]));
    assert_eq!(document["components"]["securitySchemes"]["operator"]["name"], "parfocal-operator");
    assert!(document["paths"]["/healthz"]["get"]["responses"]["403"].is_null());

    // Each limit is in the schema that it limits.
    let schemas = &document["components"]["schemas"];
    assert_eq!(schemas["Focus"]["oneOf"][0]["properties"]["focal_power"]["type"], "number");
    assert_eq!(schemas["Focus"]["oneOf"][0]["properties"]["focal_power"]["maximum"], 1);
    for either in [0, 1] {
        assert_eq!(schemas["Focus"]["oneOf"][either]["additionalProperties"], false);
    }
    for said in [0, 1] {
        assert_eq!(schemas["CommentContent"]["oneOf"][said]["properties"]["text"]["pattern"], "\\S");
    }
    assert_eq!(schemas["AnswerValue"]["oneOf"][0]["type"], "integer");
    assert_eq!(schemas["AnswerValue"]["oneOf"][1]["items"]["maximum"], 255);
}

#[tokio::test]
async fn a_whole_number_may_be_written_with_a_point() {
    let server = Server::within();
    let unknown = "00000000-0000-4000-8000-000000000000";
    let send = async |frame: &str| {
        let comment = format!(r#"{{"key": "{unknown}", "session": "{unknown}", "frame": {frame}, "kind": "mark"}}"#);
        let request = server.post_as("surgeon", "/api/surgeon/comments").header(CONTENT_TYPE, "application/json");
        request.body(comment).send().await.unwrap().status()
    };

    // There is no such session, but the request was parsed that far.
    assert_eq!(send("7.0").await, StatusCode::NOT_FOUND);
    assert_eq!(send("7.5").await, StatusCode::UNPROCESSABLE_ENTITY);
}

#[tokio::test]
async fn prometheus_gets_the_counters_without_a_policys_name() {
    let server = Server::within();
    let response = server.get_as("operator", "/metrics").send().await.unwrap();
    assert!(response.headers()[CONTENT_TYPE].to_str().unwrap().starts_with("application/openmetrics-text"));
    let text = response.text().await.unwrap();
    assert!(text.ends_with("# EOF\n"));
    for name in [
        "parfocal_steps_total",
        "parfocal_viewers",
        "parfocal_frames_encoded_total",
        "parfocal_jpeg_bytes_total",
        "parfocal_latency_seconds_bucket",
        "parfocal_step_seconds_bucket",
        "parfocal_picture_seconds_bucket{le=\"0.0005\",size=\"half\"}",
        "parfocal_database_write_seconds_count{what=\"records\"}",
    ] {
        assert!(text.lines().any(|line| line.starts_with(name)), "{name} in {text}");
    }

    assert!(!text.contains("policy") && !text.contains("climber"));
}

#[tokio::test]
async fn a_camera_without_settings_offers_none() {
    let server = Server::within();
    let offer: Value = server.get_as("operator", "/api/operator/camera").send().await.unwrap().json().await.unwrap();
    assert_eq!(offer["settings"], serde_json::json!([]));
    let change = serde_json::json!({"setting": "gain", "value": 3});
    let answer = server.post_as("operator", "/api/operator/camera").json(&change).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::CONFLICT);
    assert!(answer.text().await.unwrap().contains("does not offer this setting"));
}

/// The pages' types are generated from this file by `make web-types`, which sets `PARFOCAL_WRITE_DESCRIPTION`.
#[tokio::test]
async fn the_pages_are_checked_against_the_present_description() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/web/types/openapi.json");
    let server = Server::within();
    let document: Value = server.get_as("operator", "/api/openapi.json").send().await.unwrap().json().await.unwrap();

    if std::env::var_os("PARFOCAL_WRITE_DESCRIPTION").is_some() {
        let text = serde_json::to_string_pretty(&document).unwrap();
        std::fs::write(file, text + "\n").unwrap();
    }
    let known: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    assert!(known == document, "the HTTP interface has changed: run `make web-types` and commit what it writes");

    let operations = document["paths"].as_object().unwrap().values().flat_map(|path| path.as_object().unwrap());
    let mut ids: Vec<_> = operations.filter_map(|(_, operation)| operation["operationId"].as_str()).collect();
    ids.sort_unstable();
    assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "two operations share an id: {ids:?}");
}
