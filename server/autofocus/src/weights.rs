//! Weights of networks as safetensors. Files are not trusted: a damaged one is an error, never a crash.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use tch::{Kind, Tensor, nn};

/// Why weights could not be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WeightsError {
    /// Not safetensors, truncated, or with values that are not finite.
    #[error("the weights are damaged: {0}")]
    Damaged(String),
    /// A tensor is missing, unknown to the network, or has another shape.
    #[error("the weights belong to another network: {0}")]
    Mismatch(String),
}

/// Fills every variable of `store` from safetensors `bytes`.
///
/// # Errors
/// If the bytes are damaged, or hold a different set of tensors than the network has.
pub fn load(store: &nn::VarStore, bytes: &[u8]) -> Result<(), WeightsError> {
    let file = SafeTensors::deserialize(bytes).map_err(|error| WeightsError::Damaged(error.to_string()))?;

    let variables = store.variables();
    if let Some(name) = file.names().into_iter().find(|name| !variables.contains_key(*name)) {
        return Err(WeightsError::Mismatch(format!("the network has no tensor '{name}'")));
    }

    for (name, mut variable) in variables {
        let view = file.tensor(&name).map_err(|_| WeightsError::Mismatch(format!("tensor '{name}' is missing")))?;

        let shape: Vec<i64> = view.shape().iter().map(|&side| i64::try_from(side).unwrap_or(i64::MAX)).collect();
        let size = variable.size();
        if view.dtype() != Dtype::F32 || shape != size {
            return Err(WeightsError::Mismatch(format!("tensor '{name}' has shape {shape:?}, not {size:?}")));
        }

        let tensor = Tensor::f_from_data_size(view.data(), &shape, Kind::Float)
            .map_err(|error| WeightsError::Damaged(error.to_string()))?;
        if !bool::try_from(tensor.isfinite().all()).unwrap_or(false) {
            return Err(WeightsError::Damaged(format!("tensor '{name}' contains values that are not finite")));
        }

        tch::no_grad(|| variable.copy_(&tensor));
    }

    Ok(())
}

/// The variables of `store` as safetensors. The file's metadata has one entry, `made`, which says how they were made.
/// It is a single entry because the order of entries in the file is random, and the same training must give the same
/// file.
///
/// # Errors
/// If the tensors cannot be laid out, which does not happen with this program's networks.
pub fn save(store: &nn::VarStore, made: &str) -> Result<Vec<u8>, WeightsError> {
    let data: BTreeMap<String, (Vec<usize>, Vec<u8>)> =
        store.variables().into_iter().map(|(name, tensor)| (name, raw(&tensor))).collect();

    let mut views = Vec::with_capacity(data.len());
    for (name, (shape, bytes)) in &data {
        let view = TensorView::new(Dtype::F32, shape.clone(), bytes)
            .map_err(|error| WeightsError::Damaged(error.to_string()))?;
        views.push((name.as_str(), view));
    }

    let notes = HashMap::from([("made".to_owned(), made.to_owned())]);
    safetensors::serialize(views, Some(notes)).map_err(|error| WeightsError::Damaged(error.to_string()))
}

/// Shape and little-endian bytes of a float tensor.
fn raw(tensor: &Tensor) -> (Vec<usize>, Vec<u8>) {
    let shape = tensor.size().iter().map(|&side| usize::try_from(side).unwrap_or(0)).collect();
    (shape, floats(tensor).iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// The values of a float tensor on any device, row by row.
pub fn floats(tensor: &Tensor) -> Vec<f32> {
    let mut values = vec![0.0f32; tensor.numel()];
    tensor.to_device(tch::Device::Cpu).contiguous().view([-1]).copy_data(&mut values, tensor.numel());
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use tch::Device;

    fn store(width: i64) -> nn::VarStore {
        let store = nn::VarStore::new(Device::Cpu);
        let _ = nn::linear(store.root() / "layer", width, 2, nn::LinearConfig::default());
        store
    }

    #[test]
    fn weights_survive_the_way_out_and_in() {
        let from = store(3);
        let to = store(3);
        load(&to, &save(&from, "a test").unwrap()).unwrap();
        assert_eq!(from.variables()["layer.weight"], to.variables()["layer.weight"]);
    }

    #[test]
    fn damaged_and_foreign_weights_are_refused() {
        let bytes = save(&store(3), "a test").unwrap();
        assert!(matches!(load(&store(3), &bytes[..bytes.len() - 1]), Err(WeightsError::Damaged(_))));
        assert!(matches!(load(&store(3), b"not weights"), Err(WeightsError::Damaged(_))));
        assert!(matches!(load(&store(4), &bytes), Err(WeightsError::Mismatch(_))));
    }
}
