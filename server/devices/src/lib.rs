//! The devices between the tissue and the control loop: cameras, lenses, and the simulation that stands in for both.
//!
//! [`camera`] has the `Camera` trait and everything that answers to it: GigE and USB3 Vision (feature `aravis`),
//! footage, recorded scans, recordings, and the phantom. [`lens`] has the `Lens` trait, the Optotune driver with its
//! emulator, and the simulated lens. [`simulation`] draws the phantom, its sensor and the walks of a hand. Nothing here
//! knows a policy.

pub mod camera;
pub mod lens;
pub mod simulation;
