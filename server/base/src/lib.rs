//! What every other crate of parfocal stands on: the words that they share, and small tools that belong to no subject.
//!
//! The shared words are [`FocalPower`], [`BlurRate`], [`PolicyName`], the identifiers of a trial ([`ids`]) and the
//! record of one step of the control loop ([`step`]). They live here so that the trial's rules and its database can
//! name a policy or a focal power without the cameras, the lenses and the networks behind it.
//!
//! The tools are the two clocks ([`clock`]), files written whole ([`files`]), device options ([`options`]), messages on
//! standard error ([`notices`]), panics as errors ([`guarded()`]), thread priorities ([`priority`]), the one SVG writer
//! ([`plot`]) and the statistics that evaluations and studies share ([`statistics`]).

mod blur_rate;
pub mod clock;
pub mod files;
mod focal_power;
mod guarded;
pub mod ids;
pub mod notices;
pub mod options;
mod patch_place;
pub mod plot;
mod policy_name;
pub mod priority;
pub mod statistics;
pub mod step;

/// Boxes the future of an async function. Its body is then compiled in its own crate, once. Without this, the body and
/// those of all functions that it awaits are compiled in each crate that awaits it, at that crate's level of
/// optimisation. For functions between crates that await much; the box costs nothing that a disk or a network would not
/// cost more. `#[boxed(?Send)]` is for a future that stays on its thread.
pub use async_recursion::async_recursion as boxed;
pub use blur_rate::BlurRate;
pub use focal_power::{FocalPower, IN_FOCUS, OutOfRange};
pub use guarded::guarded;
pub use patch_place::PatchPlace;
pub use policy_name::PolicyName;

/// The program and its version, as files and pages name what made them.
pub const SOFTWARE: &str = concat!("parfocal ", env!("CARGO_PKG_VERSION"));

/// Returns the error that a sentence says. The sentence is formatted as by `format!`.
#[macro_export]
macro_rules! bail {
    ($($sentence:tt)*) => {
        return Err(format!($($sentence)*).into())
    };
}
