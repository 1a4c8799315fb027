//! Checkpoints: everything a training needs to go on exactly as if it had never stopped, in one safetensors file that is
//! replaced whole or not at all.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use tch::{Kind, Tensor, nn};

use crate::autofocus::weights::floats;

/// Why a checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("cannot use the checkpoint {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The content is damaged or of another training.
    #[error(
        "the checkpoint does not fit: {0}; start anew in another folder, or resume with the recipe it was made with"
    )]
    Unfit(String),
}

/// Named arrays and notes.
#[derive(Debug, Default)]
pub struct Checkpoint {
    arrays: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
    /// Short texts by name.
    pub notes: BTreeMap<String, String>,
}

impl Checkpoint {
    /// Adds floats.
    pub fn put_floats(&mut self, name: &str, values: impl IntoIterator<Item = f32>) {
        let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
        self.arrays.insert(name.to_owned(), (Dtype::F32, vec![bytes.len() / 4], bytes));
    }

    /// Adds bytes.
    pub fn put_bytes(&mut self, name: &str, bytes: Vec<u8>) {
        self.arrays.insert(name.to_owned(), (Dtype::U8, vec![bytes.len()], bytes));
    }

    /// Adds a tensor's values; its shape is known to whoever takes it back.
    pub fn put_tensor(&mut self, name: &str, tensor: &Tensor) {
        self.put_floats(name, floats(tensor));
    }

    /// Adds all variables of `store` under `prefix`.
    pub fn put_store(&mut self, prefix: &str, store: &nn::VarStore) {
        for (name, tensor) in store.variables() {
            self.put_tensor(&format!("{prefix}.{name}"), &tensor);
        }
    }

    /// Floats by name.
    ///
    /// # Errors
    /// When there are none of that name.
    pub fn floats(&self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        let bytes = self.bytes(name)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect())
    }

    /// Bytes by name.
    ///
    /// # Errors
    /// When there are none of that name.
    pub fn bytes(&self, name: &str) -> Result<&[u8], CheckpointError> {
        let array = self.arrays.get(name).ok_or_else(|| CheckpointError::Unfit(format!("'{name}' is missing")))?;
        Ok(&array.2)
    }

    /// Fills `tensor` with the values of that name.
    ///
    /// # Errors
    /// When there are none, or not as many as the tensor holds.
    pub fn fill(&self, name: &str, tensor: &mut Tensor) -> Result<(), CheckpointError> {
        let values = self.floats(name)?;
        if values.len() != tensor.numel() {
            return Err(CheckpointError::Unfit(format!("'{name}' has {} values", values.len())));
        }
        let saved = Tensor::from_slice(&values).to_kind(Kind::Float).view_as(tensor);
        tch::no_grad(|| tensor.copy_(&saved));
        Ok(())
    }

    /// Fills all variables of `store` from under `prefix`.
    ///
    /// # Errors
    /// When one is missing or does not fit.
    pub fn fill_store(&self, prefix: &str, store: &nn::VarStore) -> Result<(), CheckpointError> {
        store
            .variables()
            .into_iter()
            .try_for_each(|(name, mut tensor)| self.fill(&format!("{prefix}.{name}"), &mut tensor))
    }

    /// A number among the notes.
    ///
    /// # Errors
    /// When it is missing or no number.
    pub fn number<N: std::str::FromStr>(&self, name: &str) -> Result<N, CheckpointError> {
        let text = self.notes.get(name).and_then(|text| text.parse().ok());
        text.ok_or_else(|| CheckpointError::Unfit(format!("'{name}' is missing")))
    }

    /// Writes to `path` by way of a file beside it, so that what lies there is always whole.
    ///
    /// # Errors
    /// When the disk is full or the folder cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), CheckpointError> {
        let file = |source| CheckpointError::File { path: path.to_owned(), source };
        let unfit = |error: safetensors::SafeTensorError| CheckpointError::Unfit(error.to_string());
        let mut views = Vec::with_capacity(self.arrays.len());
        for (name, (kind, shape, bytes)) in &self.arrays {
            views.push((name.as_str(), TensorView::new(*kind, shape.clone(), bytes).map_err(unfit)?));
        }
        let notes: HashMap<String, String> = self.notes.clone().into_iter().collect();
        let beside = path.with_extension("partial");
        safetensors::serialize_to_file(views, Some(notes), &beside)
            .map_err(|error| file(std::io::Error::other(error.to_string())))?;
        std::fs::rename(&beside, path).map_err(file)
    }

    /// Reads what [`Checkpoint::write`] wrote.
    ///
    /// # Errors
    /// When the file cannot be read or is damaged.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let file = |source| CheckpointError::File { path: path.to_owned(), source };
        let unfit = |error: safetensors::SafeTensorError| CheckpointError::Unfit(error.to_string());
        let bytes = std::fs::read(path).map_err(file)?;
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(unfit)?;
        let notes = header.metadata().clone().unwrap_or_default().into_iter().collect();
        let content = SafeTensors::deserialize(&bytes).map_err(unfit)?;
        let arrays = content
            .tensors()
            .into_iter()
            .map(|(name, view)| (name, (view.dtype(), view.shape().to_vec(), view.data().to_vec())))
            .collect();
        Ok(Self { arrays, notes })
    }
}
