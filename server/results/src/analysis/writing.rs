//! The analysis as a folder or a ZIP file: tables with their data dictionary, the whole analysis as JSON, figures,
//! checksums.

use std::path::Path;

use serde_json::json;

use super::comparison::Comparison;
use super::error::AnalysisError;
use super::figures::figure;
use super::report::{Analysis, ProtocolAnalysis};
use super::tables::rows;
use parfocal_base::boxed;
use parfocal_records::store::export::{Folder, TEXTS_IN_CSV, ZipStream};

/// What the folder contains, for its description.
const ABOUT: &str = "The analysis of an unblinded study, as parfocal computed it: docs/analysis.md of its sources \
    explains each figure. analysis.json contains everything; the tables contain the same as rows; analysis_values.csv \
    contains every value, so that other programs can repeat the computation.";

impl Analysis {
    /// Writes the folder `out`, which must be new or empty. It appears complete or not at all. Returns the names of its
    /// files.
    ///
    /// # Errors
    /// If it cannot be written.
    pub async fn into_folder(&self, out: &Path) -> Result<Vec<String>, AnalysisError> {
        self.write(Folder::beside(out)?).await
    }

    /// Writes the same files into `zip`.
    ///
    /// # Errors
    /// If the receiver stops reading.
    pub async fn into_zip(&self, zip: ZipStream) -> Result<(), AnalysisError> {
        self.write(Folder::zipped(zip)).await.map(|_| ())
    }

    /// Name for a folder or file, without an extension.
    pub fn folder_name(study: &str) -> String {
        format!("parfocal-{study}-analysis")
    }

    #[boxed]
    async fn write(&self, mut folder: Folder) -> Result<Vec<String>, AnalysisError> {
        folder.table(&rows(self, ProtocolAnalysis::session_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::policy_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::site_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::test_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::pair_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::whole_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::words_rows)).await?;
        folder.table(&rows(self, ProtocolAnalysis::value_rows)).await?;

        for protocol in &self.protocols {
            figures(&mut folder, &protocol.protocol, "", &protocol.outcomes).await?;
            for site in &protocol.by_site {
                figures(&mut folder, &protocol.protocol, &format!("-at-{}", site.site), &site.outcomes).await?;
            }
        }

        folder.json("analysis.json", &json!(self)).await?;
        folder.describe(&self.package()).await?;
        Ok(folder.finish().await?)
    }

    fn package(&self) -> serde_json::Value {
        json!({
            "profile": "tabular-data-package",
            "name": Self::folder_name(&self.study),
            "title": format!("{}: analysis", self.title),
            "description": format!("{ABOUT} {TEXTS_IN_CSV}"),
            "parfocal": {
                "version": env!("CARGO_PKG_VERSION"),
                "study": self.study,
                "sites": self.sites,
                "missing_sites": self.missing_sites,
                "study_definition_sha256": self.definition_sha256,
                "unblinded": self.unblinded,
                "notes": self.notes,
            },
        })
    }
}

/// Writes a figure of each outcome that has values. The names of the files end in `end`.
async fn figures(folder: &mut Folder, protocol: &str, end: &str, outcomes: &[Comparison]) -> Result<(), AnalysisError> {
    for compared in outcomes {
        let Some(svg) = figure(compared) else { continue };
        let outcome = compared.outcome.outcome.replace('/', "-");
        folder.file(&format!("figure-{protocol}-{outcome}{end}.svg"), svg.as_bytes()).await?;
    }
    Ok(())
}
