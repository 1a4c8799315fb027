//! Compiles the pages' files in again when one has come or gone; changed ones are noticed anyway.

#[path = "../../build.rs"]
mod libtorch;

fn main() {
    libtorch::main();
    println!("cargo::rerun-if-changed=../../web/static");
}
