//! Checkpoints: everything a training needs to continue exactly as if it had never stopped, in one safetensors file
//! that is replaced atomically.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, Metadata, TensorInfo};
use tch::{Kind, Tensor, nn};

use crate::LearningError;
use parfocal_autofocus::weights::floats;
use parfocal_base::files;

/// Name of the checkpoint's file in the run folder.
pub const CHECKPOINT: &str = "checkpoint.safetensors";

/// Longest header that is read, in bytes: about a thousand times the usual length.
const MAX_HEADER: u64 = 1 << 28;

/// Named arrays and notes. Arrays to be written may be borrowed, because a replay memory is large.
#[derive(Debug, Default)]
pub struct Checkpoint<'a> {
    arrays: BTreeMap<String, (Dtype, Cow<'a, [u8]>)>,
    /// Short texts by name.
    pub notes: BTreeMap<String, String>,
    /// The file it was read from.
    path: PathBuf,
}

impl<'a> Checkpoint<'a> {
    /// Adds an array of floats.
    pub fn put_floats(&mut self, name: &str, values: impl IntoIterator<Item = f32>) {
        let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
        self.arrays.insert(name.to_owned(), (Dtype::F32, bytes.into()));
    }

    /// Adds an array of bytes.
    pub fn put_bytes(&mut self, name: &str, bytes: impl Into<Cow<'a, [u8]>>) {
        self.arrays.insert(name.to_owned(), (Dtype::U8, bytes.into()));
    }

    /// Adds a tensor's values. Its shape is not stored, since the reader knows it.
    pub fn put_tensor(&mut self, name: &str, tensor: &Tensor) {
        self.put_floats(name, floats(tensor));
    }

    /// Adds all variables of `store` under `prefix`.
    pub fn put_store(&mut self, prefix: &str, store: &nn::VarStore) {
        for (name, tensor) in store.variables() {
            self.put_tensor(&format!("{prefix}.{name}"), &tensor);
        }
    }

    /// The array of floats called `name`.
    ///
    /// # Errors
    /// If there is none.
    pub fn floats(&self, name: &str) -> Result<Vec<f32>, LearningError> {
        let bytes = self.bytes(name)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect())
    }

    /// The array of bytes called `name`.
    ///
    /// # Errors
    /// If there is none.
    pub fn bytes(&self, name: &str) -> Result<&[u8], LearningError> {
        self.arrays.get(name).map(|array| &*array.1).ok_or_else(|| self.damaged(format!("'{name}' is missing")))
    }

    /// Takes the array of bytes called `name` out of the checkpoint, so that a large one is not in memory twice.
    ///
    /// # Errors
    /// If there is none.
    pub fn take_bytes(&mut self, name: &str) -> Result<Vec<u8>, LearningError> {
        let array = self.arrays.remove(name);
        array.map(|array| array.1.into_owned()).ok_or_else(|| self.damaged(format!("'{name}' is missing")))
    }

    /// Fills `tensor` with the array called `name`.
    ///
    /// # Errors
    /// If there is none, or its length is not the tensor's.
    pub fn fill(&self, name: &str, tensor: &mut Tensor) -> Result<(), LearningError> {
        let values = self.floats(name)?;
        if values.len() != tensor.numel() {
            return Err(self.damaged(format!("'{name}' has {} values", values.len())));
        }
        let saved = Tensor::from_slice(&values).to_kind(Kind::Float).view_as(tensor);
        tch::no_grad(|| tensor.copy_(&saved));
        Ok(())
    }

    /// Fills all variables of `store` with the arrays under `prefix`.
    ///
    /// # Errors
    /// If one is missing or does not fit.
    pub fn fill_store(&self, prefix: &str, store: &nn::VarStore) -> Result<(), LearningError> {
        store
            .variables()
            .into_iter()
            .try_for_each(|(name, mut tensor)| self.fill(&format!("{prefix}.{name}"), &mut tensor))
    }

    /// The note called `name`, as a number.
    ///
    /// # Errors
    /// If it is missing or not a number.
    pub fn number<N: std::str::FromStr>(&self, name: &str) -> Result<N, LearningError> {
        let text = self.notes.get(name).and_then(|text| text.parse().ok());
        text.ok_or_else(|| self.damaged(format!("'{name}' is missing")))
    }

    /// The error that this checkpoint is damaged, for `reason`.
    pub fn damaged(&self, reason: impl Display) -> LearningError {
        damaged(&self.path, reason)
    }

    /// Writes a temporary file beside `path` and moves it into place, so that a reader always finds a complete one. The
    /// arrays are written one by one, without a copy.
    ///
    /// # Errors
    /// If the disk is full or the folder cannot be written.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        // Larger types first, as safetensors' own writer does, so that each array is aligned.
        let mut arrays: Vec<_> = self.arrays.iter().collect();
        arrays.sort_by_key(|(_, (kind, _))| std::cmp::Reverse(kind.bitsize()));

        let mut end = 0;
        let info = |&(name, (kind, bytes)): &(&String, &(Dtype, Cow<[u8]>))| {
            let begin = end;
            end += bytes.len();
            let shape = vec![8 * bytes.len() / kind.bitsize()];
            (name.clone(), TensorInfo { dtype: *kind, shape, data_offsets: (begin, end) })
        };

        let infos = arrays.iter().map(info).collect();
        let notes: HashMap<String, String> = self.notes.clone().into_iter().collect();

        // An empty map of notes cannot be written as JSON (safetensors 0.8.0).
        let header = Metadata::new((!notes.is_empty()).then_some(notes), infos).map_err(io::Error::other)?;
        let mut header = serde_json::to_vec(&header)?;
        header.resize(header.len().next_multiple_of(8), b' ');

        files::replace_with(path, |writer| {
            writer.write_all(&(header.len() as u64).to_le_bytes())?;
            writer.write_all(&header)?;
            arrays.iter().try_for_each(|(_, (_, bytes))| writer.write_all(bytes))
        })
    }
}

impl Checkpoint<'static> {
    /// Reads what [`Checkpoint::write`] wrote.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn read(path: &Path) -> Result<Self, LearningError> {
        Self::open(path, true)
    }

    /// Reads only the notes of what [`Checkpoint::write`] wrote, because a replay memory is large.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn read_notes(path: &Path) -> Result<Self, LearningError> {
        Self::open(path, false)
    }

    fn open(path: &Path, with_arrays: bool) -> Result<Self, LearningError> {
        let failed =
            |error: io::Error| LearningError::new(format!("cannot read the checkpoint {}: {error}", path.display()));
        let cut = |error: io::Error| match error.kind() {
            io::ErrorKind::UnexpectedEof => damaged(path, "it is truncated"),
            _ => failed(error),
        };

        let file = File::open(path).map_err(failed)?;
        let size = file.metadata().map_err(failed)?.len();
        let mut file = BufReader::new(file);

        let mut length = [0; 8];
        file.read_exact(&mut length).map_err(cut)?;
        let length = u64::from_le_bytes(length);
        // A damaged length must not make us read more than the longest possible header.
        if length > MAX_HEADER.min(size) {
            return Err(damaged(path, "it is not a safetensors file"));
        }

        let mut header = Vec::new();
        file.by_ref().take(length).read_to_end(&mut header).map_err(failed)?;
        let header: Metadata = serde_json::from_slice(&header).map_err(|error| damaged(path, error))?;

        let data = header.data_len() as u64;
        if size.checked_sub(8 + length) != Some(data) {
            return Err(damaged(path, "it is truncated or has extra bytes at the end"));
        }

        let mut arrays = BTreeMap::new();
        for name in header.offset_keys().into_iter().filter(|_| with_arrays) {
            let Some(info) = header.info(&name) else { continue };
            let mut bytes = vec![0; info.data_offsets.1 - info.data_offsets.0];
            file.read_exact(&mut bytes).map_err(cut)?;
            arrays.insert(name, (info.dtype, bytes.into()));
        }

        let notes = header.metadata().clone().unwrap_or_default().into_iter().collect();
        Ok(Self { arrays, notes, path: path.to_owned() })
    }
}

/// The error that the checkpoint at `path` is damaged, or was written by another program.
fn damaged(path: &Path, reason: impl Display) -> LearningError {
    let path = path.display();
    LearningError::new(format!("the checkpoint {path} is damaged: {reason}; start again in another folder"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_safetensors_and_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.safetensors");
        let patches = vec![7u8; 13];

        let mut checkpoint = Checkpoint::default();
        checkpoint.put_bytes("a", &patches);
        checkpoint.put_floats("b", [0.5, -2.0]);
        checkpoint.notes.insert("updates".to_owned(), "3".to_owned());
        checkpoint.write(&path).unwrap();

        let bytes = std::fs::read(&path).unwrap();
        let seen = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(seen.tensor("a").unwrap().data(), patches);
        assert_eq!(seen.tensor("b").unwrap().shape(), [2]);

        let mut back = Checkpoint::read(&path).unwrap();
        assert_eq!((back.take_bytes("a").unwrap(), back.floats("b").unwrap()), (patches, vec![0.5, -2.0]));
        assert_eq!(back.number::<u64>("updates").unwrap(), 3);

        let notes = Checkpoint::read_notes(&path).unwrap();
        assert_eq!((notes.number::<u64>("updates").unwrap(), notes.floats("b").is_err()), (3, true));

        // The file has the same permissions as any other file in the run folder.
        let mode =
            |path: &Path| std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(path).unwrap().permissions());
        std::fs::write(folder.path().join("b"), "").unwrap();
        assert_eq!(mode(&path), mode(&folder.path().join("b")));
    }

    #[test]
    fn damage_is_reported_with_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.safetensors");
        let mut checkpoint = Checkpoint::default();
        checkpoint.put_floats("b", [0.5, -2.0]);
        checkpoint.write(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for damaged in [
            &whole[..whole.len() - 1],
            &whole[..20],
            &whole[..3],
            b"",
            &[255; 40],
            &[whole.clone(), whole.clone()].concat(),
        ] {
            std::fs::write(&path, damaged).unwrap();
            for read in [Checkpoint::read, Checkpoint::read_notes] {
                let error = read(&path).unwrap_err().to_string();
                assert!(error.contains("a.safetensors is damaged"), "{error}");
            }
        }

        let error = checkpoint.floats("c").unwrap_err().to_string();
        assert!(error.contains("'c' is missing"), "{error}");
    }
}
