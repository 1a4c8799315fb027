//! The way of a frame, from the camera to the lens and to the viewers.
//!
//! [`control`] is the loop: a frame comes, the policy decides, the lens gets its command; it waits for nobody. [`live`]
//! makes each frame once into the pictures that viewers get, and [`openigtlink`] gives them to surgical navigation.
//! [`lens_measurement`] measures with a camera how a lens answers a step.

pub mod control;
pub mod lens_measurement;
pub mod live;
pub mod openigtlink;
