//! Writes a package: next to its final place and under another name until it is complete.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufWriter, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::thread;

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::error::PackageError;
use super::parquet::ParquetFile;
use super::source::{LeftOut, PackageSource, SESSIONS, agree};
use super::table::{JoinedTable, joined_tables};
use super::{description, join, playable, r, redcap, spss};
use parfocal_base::files::{files_below, write_through};
use parfocal_records::store::export::{ExportFiles, NewFolder, SUMS};
use parfocal_trial::voice::MediaType;

/// Summary of the written package.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Folder of the package.
    pub folder: PathBuf,
    /// Name of the study.
    pub study: String,
    /// Names of the sites in the package.
    pub sites: Vec<String>,
    /// Number of sessions in the package.
    pub sessions: usize,
    /// Sessions of the study that are not in the package.
    pub left_out: Vec<LeftOut>,
    /// Whether it contains the policies.
    pub unblinded: bool,
}

/// What happens to the exports that go into a package.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sessions {
    /// They stay where they are, and the package has copies.
    Copied,
    /// They are moved into the package, which must be on the same disk. If writing the package fails, they are lost.
    Moved,
    /// They stay where they are, and the package has symbolic links to them: for a check, which compares the package
    /// and removes it.
    Linked,
}

/// Writes the package of `sources` to the folder `out`, which must be new or empty and appears complete or not at all.
/// Calls `progress` with the number of steps done and the number of all steps.
///
/// # Errors
/// If there is no source, two of them do not belong together, or a file cannot be read or written.
pub fn write(
    sources: &[PackageSource],
    sessions: Sessions,
    left_out: &[LeftOut],
    out: &Path,
    progress: &mut (dyn FnMut(usize, usize) + Send),
) -> Result<Summary, PackageError> {
    // In the order in which `check` finds them again: by the names of their folders.
    let mut sources = sources.to_vec();
    sources.sort_by(|one, other| one.session.cmp(&other.session));
    let sources = sources.as_slice();

    let first = sources.first().ok_or_else(|| PackageError::empty(out))?;
    agree(sources)?;

    let folder = NewFolder::beside(out)?;
    fill(sources, sessions, left_out, folder.path(), progress)?;
    folder.finish()?;

    let sites: BTreeSet<&String> = sources.iter().map(|source| &source.site).collect();
    Ok(Summary {
        folder: out.to_owned(),
        study: first.study.clone(),
        sites: sites.into_iter().cloned().collect(),
        sessions: sources.len(),
        left_out: left_out.to_vec(),
        unblinded: !first.blinded,
    })
}

fn fill(
    sources: &[PackageSource],
    sessions: Sessions,
    left_out: &[LeftOut],
    folder: &Path,
    progress: StepsCallback,
) -> Result<(), PackageError> {
    let tables: Vec<JoinedTable> = joined_tables().filter(|table| join::is_there(table, sources)).collect();
    let steps = Steps::new(sources, sessions, &tables, progress);

    let mut taken = Vec::new();
    for source in sources {
        taken.push(take(source, sessions, folder)?);
        if sessions == Sessions::Copied {
            steps.done();
        }
    }

    join_tables(&tables, &taken, folder, &steps)?;
    beside(&tables, &taken, folder)?;
    recordings(&taken, folder)?;
    let description = description::describe(&taken, &tables, left_out);
    write_file(folder, "datapackage.json", format!("{description:#}\n").as_bytes())?;
    write_file(folder, SUMS, sums(folder)?.as_bytes())?;
    steps.done();
    Ok(())
}

/// Called with the number of steps done and the number of all steps.
type StepsCallback<'a> = &'a mut (dyn FnMut(usize, usize) + Send);

/// Counts the steps of joining from several threads: one for each copied export, one for each table (one per export for
/// a long table), and one for the checksums.
struct Steps<'a> {
    all: usize,
    done: Mutex<(usize, StepsCallback<'a>)>,
}

impl<'a> Steps<'a> {
    fn new(sources: &[PackageSource], sessions: Sessions, tables: &[JoinedTable], progress: StepsCallback<'a>) -> Self {
        let copied = if sessions == Sessions::Copied { sources.len() } else { 0 };
        let joined = tables.iter().map(|table| if table.long { sources.len() } else { 1 });
        let all = copied + joined.sum::<usize>() + 1;
        progress(0, all);
        Self { all, done: Mutex::new((0, progress)) }
    }

    fn done(&self) {
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        done.0 += 1;
        let (count, progress) = &mut *done;
        progress(*count, self.all);
    }
}

/// Joins all tables. The long ones take most of the time; each is joined on a thread of its own beside the others.
fn join_tables(
    tables: &[JoinedTable],
    sources: &[PackageSource],
    folder: &Path,
    steps: &Steps,
) -> Result<(), PackageError> {
    let (long, short): (Vec<&JoinedTable>, Vec<&JoinedTable>) = tables.iter().partition(|table| table.long);
    thread::scope(|scope| {
        let begin = |table| scope.spawn(move || join_long(table, sources, folder, steps));
        let long: Vec<_> = long.into_iter().map(begin).collect();
        for table in short {
            join_short(table, sources, folder)?;
            steps.done();
        }

        for thread in long {
            let broken = || PackageError::unwritable(folder)("a thread ended before its table was whole");
            thread.join().unwrap_or_else(|_| Err(broken()))?;
        }
        Ok(())
    })
}

/// Puts an export into the package `folder`. Returns the export at its new place.
fn take(source: &PackageSource, sessions: Sessions, folder: &Path) -> Result<PackageSource, PackageError> {
    let above = folder.join(SESSIONS);
    fs::create_dir_all(&above).map_err(PackageError::unwritable(&above))?;

    let place = folder.join(source.place());
    match sessions {
        Sessions::Copied => copy_folder(&source.folder, &place)?,
        Sessions::Moved => fs::rename(&source.folder, &place).map_err(PackageError::unwritable(&place))?,
        Sessions::Linked => {
            let whole = fs::canonicalize(&source.folder).map_err(PackageError::unreadable(&source.folder))?;
            symlink(whole, &place).map_err(PackageError::unwritable(&place))?;
        }
    }
    Ok(source.at(place))
}

fn copy_folder(from: &Path, to: &Path) -> Result<(), PackageError> {
    for file in files_below(from).map_err(PackageError::unreadable(from))? {
        let copy = to.join(&file);
        let above = copy.parent().unwrap_or(to);
        fs::create_dir_all(above).map_err(PackageError::unwritable(above))?;
        fs::copy(from.join(&file), &copy).map_err(PackageError::unwritable(&copy))?;
    }
    Ok(())
}

/// Writes a table that has a row for each frame, only as Parquet.
fn join_long(table: &JoinedTable, sources: &[PackageSource], folder: &Path, steps: &Steps) -> Result<(), PackageError> {
    let mut parquet = ParquetFile::create(&folder.join(format!("{}.parquet", table.table.name)), table)?;
    for source in sources {
        join::rows(table, std::slice::from_ref(source), |cells| parquet.row(cells))?;
        steps.done();
    }
    parquet.end()
}

/// Writes any other table as Parquet, as CSV and for SPSS.
fn join_short(table: &JoinedTable, sources: &[PackageSource], folder: &Path) -> Result<(), PackageError> {
    let name = table.table.name;
    let mut parquet = ParquetFile::create(&folder.join(format!("{name}.parquet")), table)?;
    let path = folder.join(table.table.file());
    let file = fs::File::create(&path).map_err(PackageError::unwritable(&path))?;
    let mut csv = csv::Writer::from_writer(BufWriter::new(file));
    csv.write_record(table.columns().map(|column| column.name)).map_err(PackageError::unwritable(&path))?;
    join::rows(table, sources, |cells| {
        csv.write_record(cells).map_err(PackageError::unwritable(&path))?;
        parquet.row(cells)
    })?;

    csv.flush().map_err(PackageError::unwritable(&path))?;
    parquet.end()?;

    let spss = folder.join("spss");
    fs::create_dir_all(&spss).map_err(PackageError::unwritable(&spss))?;
    spss::write(&spss.join(format!("{name}.sav")), table, sources)
}

/// Writes the files for R and REDCap.
fn beside(tables: &[JoinedTable], sources: &[PackageSource], folder: &Path) -> Result<(), PackageError> {
    let short: Vec<JoinedTable> = tables.iter().filter(|table| !table.long).cloned().collect();
    write_file(folder, "load.R", r::script(&short).as_bytes())?;

    let instruments = redcap::instruments(&short);
    let dictionary = redcap::dictionary(&instruments).map_err(PackageError::unwritable("redcap/dictionary.csv"))?;
    fs::create_dir_all(folder.join("redcap")).map_err(PackageError::unwritable(folder.join("redcap")))?;
    write_file(folder, "redcap/dictionary.csv", &dictionary)?;
    write_file(folder, "redcap/import.csv", &redcap::import(&instruments, sources)?)
}

/// Writes the recordings of voice comments as players expect them, under the names that the table `voice` has.
fn recordings(sources: &[PackageSource], folder: &Path) -> Result<(), PackageError> {
    for source in sources {
        let export = ExportFiles::of(&source.folder);
        let column = |name| export.cells("voice.csv", name).map_err(PackageError::unreadable(&source.folder));
        for (file, media_type) in column("file")?.into_iter().zip(column("media_type")?) {
            let Some(media_type) = MediaType::named(&media_type).filter(|_| !file.is_empty()) else { continue };
            let original = source.folder.join(&file);
            let sound = fs::read(&original).map_err(PackageError::unreadable(&original))?;
            let place = folder.join(&file);
            let above = place.parent().unwrap_or(folder);
            fs::create_dir_all(above).map_err(PackageError::unwritable(above))?;
            write_file(folder, &file, &playable::with_duration(media_type, sound))?;
        }
    }
    Ok(())
}

fn write_file(folder: &Path, name: &str, content: &[u8]) -> Result<(), PackageError> {
    let path = folder.join(name);
    write_through(&path, content).map_err(PackageError::unwritable(path))
}

/// The checksums of all files below `folder`, in the form of `sha256sum`, except that of the list itself and of files
/// that operating systems left there.
pub fn sums(folder: &Path) -> Result<String, PackageError> {
    let mut files = files_below(folder).map_err(PackageError::unreadable(folder))?;
    files.retain(|file| file != Path::new(SUMS));

    let mut lines = Vec::new();
    for file in files {
        let mut digest = Digester(Sha256::new());
        let path = folder.join(&file);
        let mut content = fs::File::open(&path).map_err(PackageError::unreadable(&path))?;
        std::io::copy(&mut content, &mut digest).map_err(PackageError::unreadable(&path))?;
        lines.push(format!("{}  {}\n", hex::encode(digest.0.finalize()), file.display()));
    }
    Ok(lines.concat())
}

/// A writer that hashes what is written.
struct Digester(Sha256);

impl Write for Digester {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
