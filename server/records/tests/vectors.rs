//! The chain's bytes and the format of exports, held against vectors that are kept as they are. If a test here fails,
//! what earlier databases and exports hold would no longer verify.

use std::path::Path;

use parfocal_records::store::export::verify::{Check, Verdict, verify};
use parfocal_records::store::{MIGRATOR, verify_database};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};

const VECTORS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors");

fn failed(checks: &[Check]) -> Vec<&str> {
    let failed = checks.iter().filter(|check| matches!(check.verdict, Verdict::Failed(_)));
    failed.map(|check| check.name).collect()
}

/// `tests/vectors/chain.py` computes the chain of records of every kind from docs/evidence.md alone.
#[tokio::test]
async fn the_chain_has_the_bytes_of_its_description() {
    let folder = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(folder.path().join("parfocal.db")).create_if_missing(true);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    MIGRATOR.run(&pool).await.unwrap();
    sqlx::raw_sql(include_str!("../../../tests/vectors/chain.sql")).execute(&pool).await.unwrap();

    let head = "43:d19914098e67ae0f2dae43e790800397311c3c712730baac0b828705e3773ea7";
    let chain = async || {
        let checks = verify_database(folder.path(), Some(head.parse().unwrap())).await.unwrap();
        checks.into_iter().find(|check| check.name == "chain").unwrap().verdict
    };
    let said = "43 rows, 43 of them whole; head 43:d19914098e67ae0f2dae43e790800397; 1 have erased words";
    assert_eq!(chain().await, Verdict::Passed(said.to_owned()));

    // A single bit of a column that is hashed with a salt.
    sqlx::raw_sql("DROP TRIGGER consents_no_update; UPDATE consents SET obtained_by = 'KN'")
        .execute(&pool)
        .await
        .unwrap();
    let said = "consents: consent 1 was changed since row 36 of the chain was written";
    assert_eq!(chain().await, Verdict::Failed(said.to_owned()));
    pool.close().await;
}

/// The export was made by the program as it was before the first release, and has its chain from then.
#[test]
fn an_export_that_was_kept_is_verified_and_a_change_in_it_is_found() {
    let kept = Path::new(VECTORS).join("export");
    let head = "41:2688b76cc0a41aeaf4257d9981897aa25c5e8a656e53630b99388a1e85bcacad";
    let checks = verify(&kept, Some(&head.parse().unwrap()));
    assert!(checks.iter().all(|check| matches!(check.verdict, Verdict::Passed(_))), "{checks:#?}");

    let copy = tempfile::tempdir().unwrap();
    for file in std::fs::read_dir(kept).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), copy.path().join(file.file_name())).unwrap();
    }

    let comments = copy.path().join("comments.csv");
    let text = std::fs::read_to_string(&comments).unwrap();
    assert!(text.contains("trembles"));
    std::fs::write(&comments, text.replace("trembles", "tremble")).unwrap();
    assert_eq!(failed(&verify(copy.path(), None)), ["checksums", "copies", "chain"]);

    // Another format is refused by name.
    let description = copy.path().join("datapackage.json");
    let text = std::fs::read_to_string(&description).unwrap();
    std::fs::write(&description, text.replace("\"format\": 1,", "\"format\": 2,")).unwrap();
    let checks = verify(copy.path(), None);
    let columns = checks.iter().find(|check| check.name == "columns").unwrap();
    let said = "another version of parfocal wrote it (format 2); verify it with that version";
    assert_eq!(columns.verdict, Verdict::Failed(said.to_owned()));
}
