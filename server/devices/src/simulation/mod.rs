//! Simulation: makes the pictures that a camera would see, from a seed. The brain phantom, textures,
//! defocus, and the walks of a hand.

pub mod blur;
pub mod cover;
pub mod gaussian;
pub mod normal;
pub mod patch_defocus;
pub mod path;
pub mod phantom;
pub mod spots;
pub mod texture;
pub mod unrest;
pub mod walk;
