//! `--seed`: what can be predicted by someone who knows it, and what cannot.

use crate::support::Server;

/// The values of a session that might be predictable: its id, the seed of its order, and its settings.
#[derive(Debug, PartialEq)]
struct Drawn {
    session: String,
    seed: String,
    segments: Vec<(String, String)>,
}

/// The values that a fresh server with seed 1 draws for its first session, by `protocol`.
async fn first_of(protocol: &str) -> Drawn {
    let server = Server::with(&["--bind", "127.0.0.1:0", "--seed", "1"]);
    let made = server.prepare("S-05", protocol).await;

    let pool = server.database().await;
    let (session, seed): (String, String) =
        sqlx::query_as("SELECT session, seed FROM sessions").fetch_one(&pool).await.unwrap();
    assert_eq!(made, session);
    let settings = "SELECT segment, policy FROM segments ORDER BY setting";
    let segments = sqlx::query_as(settings).fetch_all(&pool).await.unwrap();
    pool.close().await;
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
