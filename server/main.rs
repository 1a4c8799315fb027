//! The `parfocal` program: hands its arguments to [`parfocal::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    parfocal::cli::main()
}
