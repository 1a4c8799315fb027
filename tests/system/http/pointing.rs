//! Pointing at what is to be in focus, over HTTP: every page sees the same place, which says nothing of a policy.

use std::collections::BTreeSet;

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::blinding::{Session, TELLING, form, without_header_names};
use super::live::{Heard, Page};
use crate::support::{BRAIN, Server};

/// A server that knows the protocol "pointing".
pub fn server() -> Server {
    let protocols = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/system/browser");
    Server::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN, "--fps", "20", "--protocols", protocols])
}

/// The middle of a header's patch, in cells.
fn middle(header: &Value) -> (f64, f64) {
    let of = |name: &str| header["patch"][name].as_f64().unwrap() + 16.0;
    (of("x"), of("y"))
}

async fn point(server: &Server, role: &str, body: Value) -> (StatusCode, String) {
    let session = Session::of(server);
    session.ask(role, Method::POST, &format!("/api/{role}/patch"), &body).await
}

#[tokio::test]
async fn outside_sessions_both_tablets_and_the_operator_see_the_place_that_was_chosen_last() {
    let server = server();
    let mut one = Page::open(&server, "surgeon").await;
    let mut other = Page::open(&server, "surgeon").await;
    let mut operator = Page::open(&server, "operator").await;
    let before = one.watch_until(|header| header["area"].is_object()).await.header;
    let area = &before["area"];
    let centre = (area["x"].as_f64().unwrap(), area["y"].as_f64().unwrap());
    assert_eq!((&before["pointed"], &before["choices"]), (&json!(false), &json!(0)));

    // Two tablets at once: the last one counts.
    for (across, down) in [(-40.0, 10.0), (30.0, -20.0)] {
        let at = json!({"x": centre.0 + across, "y": centre.1 + down});
        let (status, said) = point(&server, "surgeon", json!({"session": null, "frame": 1, "at": at})).await;
        assert_eq!(status, StatusCode::NO_CONTENT, "{said}");
    }
    for page in [&mut one, &mut other, &mut operator] {
        let seen = page.watch_until(|header| header["choices"] == 2).await.header;
        let (x, y) = middle(&seen);
        assert!((x - centre.0 - 30.0).abs() < 3.0 && (y - centre.1 + 20.0).abs() < 3.0, "{seen}");
        assert_eq!(seen["pointed"], true);
    }

    let (status, _) = point(&server, "operator", json!({"session": null, "frame": 9, "at": null})).await;
    assert_eq!(status, StatusCode::NO_CONTENT);
    let back = one.watch_until(|header| header["choices"] == 3).await.header;
    assert_eq!(back["pointed"], false);

    for at in [json!({"x": -3, "y": 5}), json!({"x": 9e9, "y": 5})] {
        let (status, said) = point(&server, "surgeon", json!({"session": null, "frame": 1, "at": at})).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(said.contains("the place lies outside the picture"), "{said}");
    }
    // Only the operator decides whether a place follows the tissue.
    let follows = json!({"frame": 1, "at": {"x": centre.0 + 30.0, "y": centre.1}, "follows": true});
    let (status, said) = point(&server, "surgeon", follows.clone()).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(said.contains("only the operator decides"), "{said}");
    let (status, said) = point(&server, "operator", follows).await;
    assert_eq!(status, StatusCode::NO_CONTENT, "{said}");
    operator.watch_until(|header| header["choices"] == 4).await;

    let session = Session::of(&server);
    let (status, _) = session.ask("researcher", Method::POST, "/api/operator/patch", &json!({"frame": 1})).await;
    assert_eq!(status, StatusCode::FORBIDDEN);
}

/// What a page can see of the place in a frame: where it is, and whether it was chosen.
fn seen_of(header: &Value) -> String {
    let area = &header["area"];
    let (x, y) = middle(header);
    let across = ((x - area["x"].as_f64().unwrap_or_default()) / 10.0).round() as i64;
    let down = ((y - area["y"].as_f64().unwrap_or_default()) / 10.0).round() as i64;
    format!("{across} {down} {}", header["pointed"])
}

#[tokio::test]
async fn ring_and_corners_are_the_same_under_every_policy() {
    let server = server();
    let mut session = Session::of(&server);
    let mut page = Page::open(&server, "surgeon").await;
    session.operator("/api/operator/participants", json!({"code": "S01"})).await;
    session.operator("/api/operator/sessions", json!({"participant": "S01", "protocol": "pointing"})).await;
    let id = session.view().await["session"].clone();
    session.operator("/api/operator/actions", json!({"session": id, "action": "start"})).await;

    let mut courses = Vec::new();
    for _ in 0..3 {
        let view = session.view().await;
        let act = |action: &str| json!({"session": id, "action": action, "segment": view["segment"]});
        let notice = json!({"session": id, "frame": 1, "at": {"x": 250, "y": 130}});
        let (status, _) = session.ask("surgeon", Method::POST, "/api/surgeon/patch", &notice).await;
        assert_eq!(status, StatusCode::CONFLICT, "nobody points during a notice");
        let follows = json!({"session": id, "frame": 1, "at": {"x": 250, "y": 130}, "follows": true});
        let (status, said) = session.ask("operator", Method::POST, "/api/operator/patch", &follows).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(said.contains("only outside sessions"), "{said}");

        session.surgeon("/api/surgeon/actions", act("acknowledge")).await;
        let begun = page.heard.len();
        let header = page.watch_until(|header| header["area"].is_object()).await.header;
        let (x, y) = (header["area"]["x"].as_f64().unwrap(), header["area"]["y"].as_f64().unwrap());
        let touch = |across: f64, down: f64| {
            let at = json!({"x": x + across, "y": y + down});
            json!({"session": id, "frame": header["frame"], "at": at})
        };

        let mut choices = header["choices"].as_u64().unwrap();
        for body in [touch(-40.0, 20.0), touch(30.0, 0.0), json!({"session": id, "frame": 1})] {
            session.surgeon("/api/surgeon/patch", body).await;
            choices += 1;
            page.watch_until(|header| header["choices"] == choices).await;
            page.watch(5).await;
        }
        session.surgeon("/api/surgeon/actions", act("hold-focus")).await;
        page.watch(3).await;
        session.surgeon("/api/surgeon/actions", act("release-focus")).await;
        session.surgeon("/api/surgeon/patch", touch(20.0, 20.0)).await;
        page.watch_until(|header| header["choices"] == choices + 1).await;
        session.surgeon("/api/surgeon/actions", act("finish-segment")).await;
        page.watch_until(|header| header["pointed"] == false).await;

        let headers = page.heard[begun..].iter().filter_map(|heard| match heard {
            Heard::Frame(header) if header["area"].is_object() => Some(header),
            _ => None,
        });
        let mut course: Vec<String> = headers.map(seen_of).collect();
        course.dedup();
        courses.push(course);
    }

    let expected = ["0 0 false", "-4 2 true", "3 0 true", "0 0 false", "2 2 true", "0 0 false"];
    assert!(courses.iter().all(|course| *course == expected), "{courses:#?}");

    let mut forms = BTreeSet::new();
    for heard in page.heard {
        match heard {
            Heard::Text(text) => session.heard.push(text),
            Heard::Frame(header) => {
                forms.insert(form(&header));
                session.heard.push(header.to_string());
            }
        }
    }
    assert!(forms.len() <= 2, "with and without a bright circle; nothing else may vary: {forms:?}");
    for heard in &session.heard {
        let heard = without_header_names(heard);
        assert!(TELLING.iter().all(|telling| !heard.contains(telling)), "{heard}");
    }
}
