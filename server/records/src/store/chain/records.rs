//! The records of a database as the chain hashes them.

use std::collections::BTreeMap;

use futures_util::TryStreamExt;
use sqlx::sqlite::{SqliteConnection, SqliteRow, SqliteValueRef};
use sqlx::{AssertSqlSafe, Row, TypeInfo, ValueRef};

use super::form::content;
use super::kinds::{RecordKind, kinds};
use crate::store::StoreError;

/// A record, with each column as the CSV files have it.
#[derive(Debug, Clone, Default)]
pub struct Record {
    /// Its session; empty if it has none.
    pub session: String,
    /// Orders it among the records of its kind and session, as they are kept.
    pub order: i64,
    /// Its open columns.
    pub open: Vec<String>,
    /// Its sealed columns; `None` if an export withholds them.
    pub sealed: Option<Vec<String>>,
}

impl Record {
    /// Its hash. `kind` is its kind, and `sealed` the hash of its sealed columns.
    pub fn content(&self, kind: &RecordKind, sealed: &str) -> String {
        content(kind.name, kind.open.iter().copied().zip(self.open.iter().map(String::as_str)), sealed)
    }
}

/// The record of `kind` with this key.
pub async fn one(connection: &mut SqliteConnection, kind: &RecordKind, key: &str) -> Result<Record, StoreError> {
    let mut query = sqlx::query(AssertSqlSafe(format!("{} WHERE {}", kind.select, kind.one)));
    for part in key.split('/') {
        query = query.bind(part);
    }

    let row = query.fetch_optional(connection).await?;
    let row = row.ok_or_else(|| StoreError::Damaged(format!("{} {key} is not there", kind.name)))?;
    Ok(record(kind, &row)?.1)
}

/// Every record except telemetry, by kind and key.
pub async fn all(connection: &mut SqliteConnection) -> Result<BTreeMap<(&'static str, String), Record>, StoreError> {
    let mut found = BTreeMap::new();
    for kind in kinds() {
        let mut rows = sqlx::query(AssertSqlSafe(kind.select.clone())).fetch(&mut *connection);
        while let Some(row) = rows.try_next().await? {
            let (key, record) = record(kind, &row)?;
            found.insert((kind.name, key), record);
        }
    }
    Ok(found)
}

fn record(kind: &RecordKind, row: &SqliteRow) -> Result<(String, Record), StoreError> {
    let columns =
        |names: &[&str]| names.iter().map(|name| cell(row.try_get_raw(*name)?)).collect::<Result<Vec<_>, StoreError>>();

    let record = Record {
        session: cell(row.try_get_raw("chain_session")?)?,
        order: row.try_get("chain_order")?,
        open: columns(&kind.open)?,
        sealed: Some(columns(&kind.sealed)?),
    };
    Ok((row.try_get("chain_key")?, record))
}

/// A value as the CSV files have it. Null and an empty text both become an empty text.
pub fn cell(value: SqliteValueRef<'_>) -> Result<String, StoreError> {
    if value.is_null() {
        return Ok(String::new());
    }

    let decoded = |error: sqlx::error::BoxDynError| StoreError::Damaged(error.to_string());
    let name = value.type_info().name().to_owned();
    match name.as_str() {
        "INTEGER" | "BOOLEAN" => {
            <i64 as sqlx::Decode<sqlx::Sqlite>>::decode(value).map(|number| number.to_string()).map_err(decoded)
        }
        "REAL" => {
            let number = <f64 as sqlx::Decode<sqlx::Sqlite>>::decode(value).map_err(decoded)?;
            Ok(serde_json::json!(number).to_string())
        }
        _ => <String as sqlx::Decode<sqlx::Sqlite>>::decode(value).map_err(decoded),
    }
}
