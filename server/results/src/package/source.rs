//! A session's export as part of a package: verified, and identified by study, site and chain.

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::error::PackageError;
use parfocal_base::files::is_systems_own;
use parfocal_records::store::export::verify::{Verdict, is_export, verify_files};
use parfocal_records::store::export::{ExportFiles, FORMAT};

/// Folder of a package that contains the exports.
pub const SESSIONS: &str = "sessions";

/// A session of a study that is not in a package.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct LeftOut {
    /// The session.
    pub session: String,
    /// Name of the session's site.
    pub site: String,
    /// Name of the session's protocol.
    pub protocol: String,
    /// Why it is not in the package.
    pub reason: String,
}

/// A verified export of a session of a study.
#[derive(Debug, Clone)]
pub struct PackageSource {
    /// Folder of the export.
    pub folder: PathBuf,
    /// The session.
    pub session: String,
    /// Name of the session's study.
    pub study: String,
    /// Name of the session's site.
    pub site: String,
    /// SHA-256 of the study's definition.
    definition_sha256: String,
    /// Whether the policies are left out.
    pub blinded: bool,
    /// Number and hash of the chain's head at the time of the export.
    head: (u64, String),
}

impl PackageSource {
    /// Verifies the export in `folder`.
    ///
    /// # Errors
    /// If it does not verify, another version wrote it, or its session is outside any study.
    pub fn open(folder: &Path) -> Result<Self, PackageError> {
        if !is_export(folder) {
            return Err(PackageError::not_an_export(folder));
        }

        let unreadable = |reason: String| PackageError::unreadable(folder)(reason);
        let export = ExportFiles::of(folder);
        let format = export.format().map_err(unreadable)?;
        if format != FORMAT {
            let other = format!(
                "has format {format}, and this version of parfocal writes format {FORMAT}: export it again with this \
                 version, so that all sites have the same columns"
            );
            return Err(PackageError::of(folder, other));
        }

        for check in verify_files(&export, None) {
            if let Verdict::Failed(problem) = check.verdict {
                let changed = format!("is not as it was exported: {}: {problem}; export it again", check.name);
                return Err(PackageError::of(folder, changed));
            }
        }

        let package = export.json("datapackage.json").map_err(unreadable)?;
        let described = &package["parfocal"];
        let outside = || PackageError::of(folder, "is of a session outside any study");
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let cell = |file: &str, column: &str| {
            let cells = export.cells(file, column).map_err(unreadable)?;
            cells.into_iter().next().ok_or_else(outside)
        };

        Ok(Self {
            folder: folder.to_owned(),
            session: cell("sessions.csv", "session")?,
            study: text(&described["study"]).ok_or_else(outside)?,
            site: cell("study_sessions.csv", "site")?,
            definition_sha256: text(&described["study_definition_sha256"]).ok_or_else(outside)?,
            blinded: described["blinded"].as_bool().unwrap_or(true),
            head: (
                described["chain"]["number"].as_u64().unwrap_or_default(),
                text(&described["chain"]["hash"]).unwrap_or_default(),
            ),
        })
    }

    /// The export's folder within a package.
    pub fn place(&self) -> String {
        format!("{SESSIONS}/{}", self.session)
    }

    /// The same export after its folder was moved or copied to `folder`.
    pub(super) fn at(&self, folder: PathBuf) -> Self {
        Self { folder, ..self.clone() }
    }

    fn apart(&self, other: &Self, reason: &str) -> PackageError {
        PackageError::apart(&self.folder, &other.folder, reason)
    }
}

/// Fails if `path` is a folder that this account may not read. An export is its owner's alone, and looks to others as
/// if it held nothing.
///
/// # Errors
/// As it says.
pub fn may_read(path: &Path) -> Result<(), PackageError> {
    match std::fs::read_dir(path) {
        Err(error) if error.kind() == ErrorKind::PermissionDenied => Err(PackageError::unreadable(path)(error)),
        _ => Ok(()),
    }
}

/// Fails if `out` lies within `folder`, an export or a package. What is written there would be an added file to whoever
/// verifies it.
///
/// # Errors
/// As it says.
pub fn check_outside(out: &Path, folder: &Path) -> Result<(), PackageError> {
    // `out` may not exist yet.
    let out_or_above = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
    let there = out_or_above.ancestors().find_map(|path| path.canonicalize().ok());
    match (there, folder.canonicalize()) {
        (Some(there), Ok(folder)) if there.starts_with(&folder) => Err(PackageError::of(
            out,
            format_args!("lies within {}, which would not verify any more; name another folder", folder.display()),
        )),
        _ => Ok(()),
    }
}

/// The folders of the exports in `path`: `path` itself if it is an export, or those of a package.
///
/// # Errors
/// If it is neither, or cannot be read.
pub fn exports_of(path: &Path) -> Result<Vec<PathBuf>, PackageError> {
    may_read(path)?;
    let sessions = path.join(SESSIONS);
    if !sessions.is_dir() {
        return if is_export(path) { Ok(vec![path.to_owned()]) } else { Err(PackageError::not_an_export(path)) };
    }

    let mut folders = Vec::new();
    for entry in std::fs::read_dir(&sessions).map_err(PackageError::unreadable(&sessions))? {
        let entry = entry.map_err(PackageError::unreadable(&sessions))?;
        if !is_systems_own(&entry.file_name()) {
            folders.push(entry.path());
        }
    }
    folders.sort();
    Ok(folders)
}

/// The sessions that the package `path` lists as left out; none if `path` is the export of a session.
///
/// # Errors
/// If its description cannot be read, or a file in it was changed since it was written.
pub fn left_out(path: &Path) -> Result<Vec<LeftOut>, PackageError> {
    if !path.join(SESSIONS).is_dir() {
        return Ok(Vec::new());
    }
    let package = ExportFiles::of(path).json("datapackage.json").map_err(PackageError::unreadable(path))?;
    Vec::deserialize(&package["parfocal"]["left_out"]).map_err(PackageError::unreadable(path))
}

/// Checks that `sources` belong together: one study with one definition, all blinded or none, no session twice, and one
/// chain per site.
pub fn agree(sources: &[PackageSource]) -> Result<(), PackageError> {
    let Some(first) = sources.first() else { return Ok(()) };
    let mut seen: BTreeMap<&str, &PackageSource> = BTreeMap::new();
    for source in sources {
        if source.study != first.study {
            let reason = format!("one is of study '{}', the other of '{}'", first.study, source.study);
            return Err(first.apart(source, &reason));
        }
        if source.definition_sha256 != first.definition_sha256 {
            return Err(first.apart(source, "the definition of their study differs"));
        }
        if source.blinded != first.blinded {
            return Err(
                first.apart(source, "one contains the policies, the other does not; export both in the same way")
            );
        }
        if let Some(twin) = seen.insert(&source.session, source) {
            let reason = format!("both have session {}; give each site once", source.session);
            return Err(twin.apart(source, &reason));
        }
    }

    let sites: BTreeSet<&str> = sources.iter().map(|source| source.site.as_str()).collect();
    for site in sites {
        let of_site: Vec<&PackageSource> = sources.iter().filter(|source| source.site == site).collect();
        one_chain(&of_site)?;
    }
    Ok(())
}

/// Checks that the heads of all `sources`, which are of one site, are in the longest chain among them. If one is not, a
/// record was rewritten between two exports, or two databases have the same site name.
fn one_chain(sources: &[&PackageSource]) -> Result<(), PackageError> {
    let Some(longest) = sources.iter().max_by_key(|source| source.head.0) else { return Ok(()) };
    let export = ExportFiles::of(&longest.folder);
    let column =
        |name| export.cells("chain.csv", name).map_err(PackageError::unreadable(longest.folder.join("chain.csv")));
    let rows: BTreeMap<String, String> = column("number")?.into_iter().zip(column("hash")?).collect();

    for source in sources {
        if rows.get(&source.head.0.to_string()) != Some(&source.head.1) {
            let reason =
                format!("both say that they are of site '{}', but their chains of records differ", source.site);
            return Err(source.apart(longest, &reason));
        }
    }
    Ok(())
}
