//! Requests as the pages send them, and what they leave in the database.

use std::path::Path;

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use sqlx::ConnectOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqlitePool};

use super::{Server, client};

impl Server {
    /// Sends a request with the key of `role`. Returns the status and the body.
    pub async fn ask(&self, role: &str, method: Method, path: &str, body: &Value) -> (StatusCode, String) {
        let request = client().request(method, self.url(path)).bearer_auth(self.key(role)).json(body);
        let response = request.send().await.unwrap();
        (response.status(), response.text().await.unwrap())
    }

    /// A GET with the key of `role`. Returns the status and the body.
    pub async fn look(&self, role: &str, path: &str) -> (StatusCode, String) {
        self.ask(role, Method::GET, path, &Value::Null).await
    }

    /// Posts `body` to `path`, which begins with `/api/` and a role, as that role; it must succeed. Returns the answer, or
    /// null if there is none.
    pub async fn post(&self, path: &str, body: Value) -> Value {
        let (status, said) = self.ask(role_of(path), Method::POST, path, &body).await;
        assert!(status.is_success(), "{path} {body}: {status} {said}");
        serde_json::from_str(&said).unwrap_or_default()
    }

    /// What stands at `path`, which begins with `/api/` and a role, for that role.
    pub async fn read(&self, path: &str) -> Value {
        let (status, said) = self.look(role_of(path), path).await;
        assert!(status.is_success(), "{path}: {status} {said}");
        serde_json::from_str(&said).unwrap()
    }

    /// Prepares a session of the new participant `participant` by `protocol`. Returns its id.
    pub async fn prepare(&self, participant: &str, protocol: &str) -> String {
        self.post("/api/operator/participants", json!({"code": participant})).await;
        let new = json!({"participant": participant, "protocol": protocol});
        let made = self.post("/api/operator/sessions", new).await;
        made["session"].as_str().unwrap().to_owned()
    }

    /// Locks the database as another program would, until the connection is closed.
    pub async fn lock_database(&self) -> SqliteConnection {
        let file = SqliteConnectOptions::new().filename(self.data.path().join("parfocal.db"));
        let mut other_program = file.connect().await.unwrap();
        sqlx::query("BEGIN IMMEDIATE").execute(&mut other_program).await.unwrap();
        other_program
    }

    /// The database.
    pub async fn database(&self) -> SqlitePool {
        database(self.data.path()).await
    }
}

/// The database in a server's data folder, opened by another program than the server, which only reads.
pub async fn database(folder: &Path) -> SqlitePool {
    let file = SqliteConnectOptions::new().filename(folder.join("parfocal.db")).read_only(true);
    SqlitePool::connect_with(file).await.unwrap()
}

fn role_of(path: &str) -> &str {
    path.split('/').nth(2).expect("a role")
}
