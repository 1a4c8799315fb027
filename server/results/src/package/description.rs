//! The package's description: Frictionless, with every table's columns, keys and references.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::source::{LeftOut, PackageSource};
use super::table::JoinedTable;
use parfocal_records::store::export::{Column, FORMAT, TEXTS_IN_CSV, Type};

/// Start of a package's description.
const ABOUT: &str = "A study, joined from the exports of its sessions by parfocal. The complete exports \
    are in sessions/. parfocal verify checks each of them, and that the tables here match them. Wall times are UTC; \
    monotonic times are nanoseconds, comparable within a run of a site. Numbers such as run are counted at each site. \
    telemetry and policy_steps are joined only as Parquet; sessions/ has them as CSV. load.R loads the tables into R, \
    spss/ has them for SPSS, redcap/ has a data dictionary and an import file for REDCap. voice/ has the recordings of \
    voice comments with their duration written into them, for players; the recordings as they arrived, to which the \
    hashes in the tables belong, are in sessions/.";

/// Kind of the package, as in its description.
pub const KIND: &str = "study";

/// `datapackage.json` of a package with `tables`, joined from `sources`.
pub fn describe(sources: &[PackageSource], tables: &[JoinedTable], left_out: &[LeftOut]) -> Value {
    let study = sources.first().map(|source| source.study.as_str()).unwrap_or_default();
    let blinded = sources.first().is_none_or(|source| source.blinded);
    let sites: BTreeSet<&str> = sources.iter().map(|source| source.site.as_str()).collect();

    let csv = tables.iter().filter(|table| !table.long).map(|table| resource(table, "csv"));
    let parquet = tables.iter().map(|table| resource(table, "parquet"));
    json!({
        "profile": "data-package",
        "name": study,
        "title": format!("Study {study}: {} sessions", sources.len()),
        "description": format!("{ABOUT} {TEXTS_IN_CSV}"),
        "parfocal": {
            "version": env!("CARGO_PKG_VERSION"),
            "format": FORMAT,
            "package": KIND,
            "study": study,
            "sites": sites,
            "blinded": blinded,
            "left_out": left_out,
        },
        "resources": csv.chain(parquet).collect::<Vec<Value>>(),
    })
}

fn resource(table: &JoinedTable, format: &str) -> Value {
    let name = table.table.name;
    let mut resource = json!({
        "name": if format == "csv" { name.to_owned() } else { format!("{name}-{format}") },
        "description": table.table.description,
        "path": format!("{name}.{format}"),
        "format": format,
        "schema": schema(table, format),
    });

    if format == "csv" {
        resource["profile"] = "tabular-data-resource".into();
        resource["mediatype"] = "text/csv".into();
        resource["encoding"] = "utf-8".into();
    } else {
        resource["mediatype"] = "application/vnd.apache.parquet".into();
    }
    resource
}

fn schema(table: &JoinedTable, format: &str) -> Value {
    let field = |column: &Column| {
        let mut field = column.field();
        // Readers that go through pandas, such as Frictionless, have "nan" where Parquet has no number.
        if format == "parquet" && matches!(column.kind, Type::Integer | Type::Number) {
            field["missingValues"] = json!(["", "nan"]);
        }
        field
    };
    let fields: Vec<Value> = table.columns().map(field).collect();
    let mut schema = json!({ "fields": fields, "primaryKey": table.key, "missingValues": [""] });
    if table.of_sessions() && table.table.name != "sessions" {
        let of_session = json!(["site", "session"]);
        schema["foreignKeys"] =
            json!([{ "fields": of_session, "reference": { "resource": "sessions", "fields": of_session } }]);
    }
    schema
}
