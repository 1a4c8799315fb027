//! The `parfocal` program: hands its arguments to [`parfocal::cli`].

fn main() {
    parfocal::cli::main()
}
