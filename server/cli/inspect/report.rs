//! The result of `parfocal inspect` for one file, as JSON or as a line of a table.

use std::fmt;

use serde::Serialize;

use parfocal_imaging::{ContentArea, PatchArea};

/// The kind of picture in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    Rgb,
    Gray,
    Mosaic,
}

/// One file's values. Lengths are in pixels of the input, of one band for a mosaic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Report {
    pub path: String,
    pub width: usize,
    pub height: usize,
    pub kind: Kind,
    pub content_area: Option<ContentArea>,
    pub patch: PatchArea,
    pub mgm: f64,
    pub mlr: f64,
    /// Title of the calibration. `None` if the file is not a mosaic or `--calibration` was not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Rgb => "rgb",
            Self::Gray => "gray",
            Self::Mosaic => "mosaic",
        })
    }
}

/// All reports, one line each below a heading; empty if there are none.
pub(super) fn table(reports: &[Report]) -> String {
    if reports.is_empty() {
        return String::new();
    }

    let heading = ["file", "kind", "size", "content area", "confidence", "patch", "mgm", "mlr"].map(str::to_owned);
    let rows: Vec<_> = std::iter::once(heading).chain(reports.iter().map(row)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 8] = std::array::from_fn(width);

    let line = |row: &[String; 8]| {
        let cells: Vec<_> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        cells.join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

fn row(report: &Report) -> [String; 8] {
    let (area, confidence) = report.content_area.map_or(("none".to_owned(), "-".to_owned()), |area| {
        (format!("({:.1}, {:.1}) r {:.1}", area.x, area.y, area.radius), format!("{:.2}", area.confidence))
    });

    [
        report.path.clone(),
        report.kind.to_string(),
        format!("{}x{}", report.width, report.height),
        area,
        confidence,
        format!("({}, {})", report.patch.x, report.patch.y),
        format!("{:.2}", report.mgm),
        format!("{:.4}", report.mlr),
    ]
}
