//! `--seed`: what can be predicted by someone who knows it, and what cannot.

use serde_json::{Value, json};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection};

use crate::support::{Server, client};

/// The values of a session that might be predictable: its id, the seed of its order, and its settings.
#[derive(Debug, PartialEq)]
struct Drawn {
    session: String,
    seed: String,
    segments: Vec<(String, String)>,
}

async fn post(server: &Server, what: &str, body: Value) -> Value {
    let request = client().post(server.url(&format!("/api/operator/{what}"))).bearer_auth(server.key("operator"));
    let answer = request.json(&body).send().await.unwrap().error_for_status().unwrap();
    answer.json().await.unwrap()
}

/// The values that a fresh server with seed 1 draws for its first session, by `protocol`.
async fn first_of(protocol: &str) -> Drawn {
    let server = Server::with(&["--bind", "127.0.0.1:0", "--seed", "1"]);
    post(&server, "participants", json!({"code": "S-05"})).await;
    let made = post(&server, "sessions", json!({"participant": "S-05", "protocol": protocol})).await;

    let file = SqliteConnectOptions::new().filename(server.data.path().join("parfocal.db")).read_only(true);
    let mut database = file.connect().await.unwrap();
    let (session, seed): (String, String) =
        sqlx::query_as("SELECT session, seed FROM sessions").fetch_one(&mut database).await.unwrap();
    assert_eq!(made["session"], session);
    let settings = "SELECT segment, policy FROM segments ORDER BY setting";
    let segments = sqlx::query_as(settings).fetch_all(&mut database).await.unwrap();
    database.close().await.unwrap();
    Drawn { session, seed, segments }
}

#[tokio::test]
async fn a_seed_does_not_foretell_a_real_session() {
    let one = first_of("paper").await;
    let other = first_of("paper").await;
    assert_ne!(one.session, other.session);
    assert_ne!(one.seed, other.seed);
    assert!(one.segments.iter().all(|(segment, _)| other.segments.iter().all(|(known, _)| known != segment)));
}

#[tokio::test]
async fn a_seed_repeats_a_practice_session() {
    assert_eq!(first_of("practice").await, first_of("practice").await);
}
