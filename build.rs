//! Records where libtorch lies in the binaries (torch-sys sets no rpath), so that they start without an environment
//! variable. Every crate whose tests reach libtorch runs it.

/// Tells the linker.
pub fn main() {
    println!("cargo::rerun-if-env-changed=DEP_TCH_LIBTORCH_LIB");
    if let Ok(lib) = std::env::var("DEP_TCH_LIBTORCH_LIB") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{lib}");
    }
}
