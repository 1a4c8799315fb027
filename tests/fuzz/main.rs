//! Every parser of bytes from outside must cope with any input: it reads or refuses it, and never panics.
//!
//! The inputs are the seeds of `fuzz/corpus/`, mutated. An ordinary run of the tests takes some of them. To run a
//! million each: `make fuzz`, or `cargo test --release --test fuzz -- --ignored --nocapture`.
//!
//! The same targets can be run by libFuzzer, which follows the code that an input reaches: see `fuzz/`.

#[path = "../trial/app.rs"]
mod app;
mod backup;
#[path = "../trial/fixture.rs"]
#[allow(dead_code, reason = "the trial's tests use more of it")]
mod fixture;
mod folders;
mod http2;
mod lessons;
mod mutation;
mod packages;
mod server;
mod targets;
#[path = "../system/tls/trust.rs"]
mod trust;

use std::fs;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use mutation::Mutator;
use rayon::prelude::*;
use targets::{TARGETS, Target};

/// The project's folder.
const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// Inputs of each target in an ordinary run of the tests.
const FEW: u64 = 200;
/// Inputs of each target in a full run.
const MANY: u64 = 1_000_000;
/// Inputs that one thread makes at a time.
const PART: u64 = 1000;

/// The seeds of `target`, in order of their files' names.
fn seeds(target: &Target) -> Vec<Vec<u8>> {
    let folder = Path::new(ROOT).join("fuzz/corpus").join(target.name);
    let mut files: Vec<_> = fs::read_dir(&folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    files.sort();

    let mut seeds: Vec<_> = files.iter().map(|file| fs::read(file).unwrap()).collect();
    seeds.extend((target.more_seeds)());
    assert!(!seeds.is_empty(), "{} has no seed in {}", target.name, folder.display());
    seeds
}

/// Gives `target` the seeds themselves and the mutated inputs with these `numbers`. The first number must be the first
/// of a part. Returns a message for each input on which the target panics, in order.
fn run(target: &Target, numbers: &Range<u64>) -> Vec<String> {
    let seeds = seeds(target);
    let mut failures: Vec<_> = seeds.iter().filter_map(|seed| failure(target, seed)).collect();

    let parts = numbers.start / PART..numbers.end.div_ceil(PART);
    let found = parts.into_par_iter().flat_map_iter(|part| {
        let mut mutator = Mutator::new(part, &seeds);
        let inputs = PART.min(numbers.end - part * PART);
        (0..inputs).filter_map(|_| failure(target, &mutator.next_input())).collect::<Vec<_>>()
    });
    failures.extend(found.collect::<Vec<_>>());
    failures
}

/// A message if `target` panics on `input`.
fn failure(target: &Target, input: &[u8]) -> Option<String> {
    let panic = catch_unwind(AssertUnwindSafe(|| (target.take)(input))).err()?;
    let words = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    Some(format!("{}: {} on {}", target.name, words.unwrap_or("a panic"), input.escape_ascii()))
}

fn run_all(numbers: &Range<u64>) {
    // The variable names the one target to run. Without it, all run.
    let only = std::env::var("PARFOCAL_FUZZ").ok();
    let mut failures = Vec::new();
    for target in TARGETS.iter().filter(|target| only.as_deref().is_none_or(|only| only == target.name)) {
        let found = run(target, numbers);
        println!("{:20} {} inputs, {} panics", target.name, numbers.end - numbers.start, found.len());
        failures.extend(found.into_iter().take(3));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn every_parser_takes_some_mutated_inputs() {
    run_all(&(0..FEW));
}

#[test]
#[ignore = "takes minutes to hours: a million inputs each"]
fn every_parser_takes_a_million_mutated_inputs() {
    let first = number("PARFOCAL_FUZZ_FIRST").unwrap_or(0);
    assert!(first.is_multiple_of(PART), "PARFOCAL_FUZZ_FIRST must be a multiple of {PART}");
    run_all(&(first..first + number("PARFOCAL_FUZZ_INPUTS").unwrap_or(MANY)));
}

/// The number in this variable, if it is set.
fn number(variable: &str) -> Option<u64> {
    let told = std::env::var(variable).ok()?;
    Some(told.parse().unwrap_or_else(|_| panic!("{variable} must be a whole number, not '{told}'")))
}

#[test]
fn the_harness_sees_a_panic() {
    fn take(input: &[u8]) {
        assert!(!input.contains(&b'!'), "an exclamation mark");
    }
    let target = Target { name: "made up", take, more_seeds: || vec![b"hello".to_vec()] };
    let found = run(&target, &(0..20_000));
    assert!(!found.is_empty() && found[0].contains("an exclamation mark"), "{found:?}");
}
