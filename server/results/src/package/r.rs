//! `load.R`: a script in plain R that loads every joined table, with types and labels.

use std::fmt::Write;

use super::table::{JoinedTable, label};
use parfocal_records::store::export::Type;

/// Start of the script: how cells of each type are read.
const BEGIN: &str = r#"# Loads the tables of this package into the list `study`, one data frame a table:
#
#   source("load.R", chdir = TRUE)
#   attr(study$comments$text, "label")
#
# Needs nothing but R. Columns that may have several values only (policies, kinds) are factors; times are POSIXct in
# UTC; numbers that count nanoseconds are doubles.

# A text that a spreadsheet would run has an apostrophe before it in the CSV files: taken away here.
parfocal_text <- function(cells) {
  sub("^'('*[=+@\t\r\n\uFF1D\uFF0B\uFF0D\uFF20-])", "\\1", cells, perl = TRUE)
}

parfocal_column <- function(cells, type, label) {
  column <- switch(
    type,
    string = parfocal_text(cells),
    factor = factor(parfocal_text(cells)),
    integer = as.numeric(cells),
    number = as.numeric(cells),
    boolean = cells == "true",
    datetime = as.POSIXct(sub("Z$", "", cells), format = "%Y-%m-%dT%H:%M:%OS", tz = "UTC")
  )
  attr(column, "label") <- label
  column
}

parfocal_table <- function(name, types, labels) {
  table <- read.csv(
    paste0(name, ".csv"),
    colClasses = "character", na.strings = "", check.names = FALSE, encoding = "UTF-8", strip.white = FALSE
  )
  stopifnot(identical(names(table), names(types)))
  for (column in names(types)) {
    table[[column]] <- parfocal_column(table[[column]], types[[column]], labels[[column]])
  }
  table
}

study <- list()
"#;

/// Columns with few distinct texts, which become factors.
const FACTORS: [&str; 10] =
    ["site", "participant", "protocol", "policy", "kind", "status", "question", "measure", "role", "stage"];

/// The script for `tables`, each a CSV file beside it.
pub fn script(tables: &[JoinedTable]) -> String {
    let mut script = BEGIN.to_owned();
    for table in tables {
        let name = table.table.name;
        let entries = |value: &dyn Fn(&parfocal_records::store::export::Column) -> String| {
            let entries: Vec<String> =
                table.columns().map(|column| format!("    {} = {}", column.name, quoted(&value(column)))).collect();
            entries.join(",\n")
        };
        let types = entries(&|column| kind(column.name, column.kind).to_owned());
        let labels = entries(&|column| label(column));

        // Writing to a string cannot fail.
        let _ = write!(
            script,
            "\n# {}\nstudy${name} <- parfocal_table(\n  {},\n  c(\n{types}\n  ),\n  c(\n{labels}\n  )\n)\n",
            table.table.description.split_whitespace().collect::<Vec<_>>().join(" "),
            quoted(name),
        );
    }
    script
}

fn kind(name: &str, kind: Type) -> &'static str {
    match kind {
        Type::String if FACTORS.contains(&name) => "factor",
        other => other.name(),
    }
}

/// `text` as an R string.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
