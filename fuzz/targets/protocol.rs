//! A trial protocol from any text is read or refused, and what is read is within the limits that docs/trial.md states.

#![no_main]

use std::sync::LazyLock;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use parfocal::autofocus::{PolicyName, Registry};
use parfocal::trial::protocol::Protocol;

static KNOWN: LazyLock<Vec<PolicyName>> =
    LazyLock::new(|| Registry::standard().entries().into_iter().map(|entry| entry.name).collect());

fuzz_target!(|text: &str| {
    match Protocol::parse(text, "fuzzed.toml", &KNOWN) {
        Ok(protocol) => {
            assert!((1..=24).contains(&protocol.settings()));
            assert!((Duration::from_secs(5)..=Duration::from_secs(3600)).contains(&protocol.segment_limit));
            assert!(protocol.policies.iter().all(|policy| KNOWN.contains(policy)));
        }
        Err(error) => assert!(error.to_string().contains("fuzzed.toml"), "{error}"),
    }
});
