//! Policies of other people, as TorchScript files: `file:PATH` instead of a policy's name.
//!
//! The module's `forward` takes the latest eight frames, oldest first, as two float tensors: gray patches `[8, 32, 32]`
//! (0..=255) and the focal powers at which they were exposed, `[8]` (0..=1). It returns the values of the three
//! actions, `[3]`: a step down, none, a step up. Before there are eight frames, the first fills the places of those
//! missing. Each instance has its own module, in evaluation mode.

use std::fs;
use std::path::Path;

use tch::{CModule, Kind, Tensor};

use super::learned::{History, action_step, best_action};
use super::networks::{ACTIONS, HISTORY};
use super::{Decision, FieldOfView, Observation, Policy, Registry};
use parfocal_base::PolicyName;
use parfocal_imaging::PATCH_SIDE;

/// Prefix of the name of a policy that is a file.
pub const PREFIX: &str = "file:";
const SIDE: i64 = PATCH_SIDE as i64;

/// Adds the policy in a file to `registry`, if `name` begins with [`PREFIX`]. A file that cannot be used is listed as
/// unavailable, with the reason.
pub fn with_file(registry: Registry, name: &PolicyName) -> Registry {
    const SUMMARY: &str = "action values from a TorchScript file";
    let Some(path) = name.as_str().strip_prefix(PREFIX) else { return registry };

    match load(Path::new(path)) {
        Ok(bytes) => registry.made_of_weights(name.as_str(), SUMMARY, bytes.into(), build),
        Err(reason) => registry.without(name.as_str(), SUMMARY, &reason),
    }
}

/// Reads the file, and tries the module on flat patches and on textured ones.
fn load(path: &Path) -> Result<Vec<u8>, String> {
    let bytes = fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let module = parse(&bytes).map_err(|reason| format!("{} is not TorchScript: {reason}", path.display()))?;

    let textured = |index: usize| f32::from((index * 7919 + index * index * 31) as u8);
    let probes: [&dyn Fn(usize) -> f32; 2] = [&|_| 128.0, &textured];

    for probe in probes {
        let patches: Vec<f32> = (0..HISTORY * PATCH_SIDE * PATCH_SIDE).map(probe).collect();
        values(&module, &patches, &[0.5; HISTORY]).map_err(|reason| {
            let signature =
                format!("forward(patches [{HISTORY}, {SIDE}, {SIDE}], focal_powers [{HISTORY}]) -> values [{ACTIONS}]");
            format!("{} is not a policy: {reason}; it must have {signature}, all float32", path.display())
        })?;
    }

    Ok(bytes)
}

/// Loads the module in `bytes` in evaluation mode. In training mode, layers such as dropout would act randomly.
fn parse(bytes: &[u8]) -> Result<CModule, String> {
    let module = CModule::load_data(&mut &*bytes).and_then(|mut module| module.f_set_eval().map(|()| module));
    module.map_err(|error| first_line(&error.to_string()))
}

/// The three action values. The inputs are flat lists, oldest frame first.
fn values(module: &CModule, patches: &[f32], focal_powers: &[f32]) -> Result<[f32; ACTIONS], String> {
    let inputs = [Tensor::from_slice(patches).view([-1, SIDE, SIDE]), Tensor::from_slice(focal_powers)];
    let output = tch::no_grad(|| module.forward_ts(&inputs)).map_err(|error| first_line(&error.to_string()))?;

    if output.kind() != Kind::Float || output.size() != [ACTIONS as i64] {
        return Err(format!("it returned {:?} of shape {:?}", output.kind(), output.size()));
    }

    let mut values = [0.0f32; ACTIONS];
    output.copy_data(&mut values, ACTIONS);
    if values.iter().all(|value| value.is_finite()) { Ok(values) } else { Err("it returned no numbers".to_owned()) }
}

/// The first line of libtorch's message; a stack trace follows it.
fn first_line(message: &str) -> String {
    message.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("it gave no reason").to_owned()
}

/// A policy by the module in `bytes`.
fn build(bytes: &[u8]) -> Result<Box<dyn Policy>, String> {
    Ok(Box::new(Scripted { module: parse(bytes)?, history: History::default() }))
}

/// A module with its memory of eight frames.
struct Scripted {
    module: CModule,
    history: History,
}

impl Policy for Scripted {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        self.history.push(&seen.view.patch.0, seen.focal_power.get() as f32);
        match values(&self.module, &self.history.frames, &self.history.focal_powers) {
            Ok(values) => {
                let target = seen.focal_power.moved(action_step(best_action(&values))).get();
                Decision { target, metric: None, belief: None }
            }
            // The module worked when it was loaded, and fails on these frames. The live loop's watchdog rejects the
            // invalid target and takes over; an evaluation ends.
            Err(_) => Decision { target: f64::NAN, metric: None, belief: None },
        }
    }

    fn forget(&mut self) {
        self.history = History::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_base::FocalPower;
    use parfocal_imaging::Patch;

    fn registered(file: &str) -> (Registry, PolicyName) {
        let name = PolicyName::new(&format!("file:{}/../../tests/vectors/{file}", env!("CARGO_MANIFEST_DIR")));
        (with_file(Registry::default(), &name), name)
    }

    fn policy(file: &str) -> Result<Box<dyn Policy>, String> {
        let (registry, name) = registered(file);
        registry.build(&name).map_err(|error| error.to_string())
    }

    /// Vertical stripes that differ by `height` gray levels.
    fn stripes(height: f32) -> Patch {
        Patch(std::array::from_fn(|index| if index % 2 == 0 { 100.0 } else { 100.0 + height }))
    }

    #[test]
    fn a_script_made_by_pytorch_sees_the_latest_frames_in_order() {
        let mut policy = policy("steepest-frame.pt").unwrap();
        let focal_power = FocalPower::new(0.5).unwrap();
        let mut step = |height| policy.step(&Observation { view: &stripes(height).into(), focal_power }).target;
        // It steps up if the latest frame is steeper than the one before, and down if it is less steep. At first it
        // stands still.
        for (height, expected) in [(10.0, 0.5), (20.0, 0.55), (5.0, 0.45), (6.0, 0.55), (6.0, 0.5)] {
            let target = step(height);
            assert!((target - expected).abs() < 1e-9, "{height}: {target}");
        }

        for height in 0..20u8 {
            let target = step(f32::from(50 - height));
            assert!(height == 0 || (target - 0.45).abs() < 1e-9);
        }
    }

    #[test]
    fn each_instance_remembers_nothing_of_another_and_is_not_in_training() {
        let focal_power = FocalPower::MIDDLE;
        let (registry, name) = registered("first-frame.pt");
        for _ in 0..2 {
            let mut policy = registry.build(&name).unwrap();
            let targets =
                [(); 2].map(|()| policy.step(&Observation { view: &stripes(9.0).into(), focal_power }).target);
            assert!((targets[0] - 0.55).abs() < 1e-9 && (targets[1] - 0.45).abs() < 1e-9, "{targets:?}");
        }
    }

    #[test]
    fn a_file_that_is_not_a_policy_is_rejected_with_the_reason() {
        let error = |file| policy(file).err().unwrap();
        assert!(
            error("wrong-shape.pt")
                .contains("it returned Float of shape [8]; it must have forward(patches [8, 32, 32]")
        );

        assert!(error("flat-only.pt").contains("it returned no numbers"), "with texture in view");
        assert!(error("pytorch.json").contains("is not TorchScript"));
        assert!(error("nothing.pt").contains("cannot read"));
    }
}
