//! The control loop from outside: with a camera, a lens and policies that fail on request.

mod fakes;
mod phantom;
mod stepper;
mod threads;
