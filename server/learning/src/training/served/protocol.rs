//! What a training in another program and its environments say to each other, over a pipe in each direction.
//!
//! The environments begin with a line of JSON, [`Greeting`]. Then each request gets an answer. A request is a letter
//! and values, one for each environment; all numbers are little-endian.
//!
//! | letter | values | asks |
//! |---|---|---|
//! | `R` | a byte: 0 go on, 1 begin another scan, 2 begin one with the seed; then a seed (u64) | to begin scans |
//! | `M` | an i8: -1, 0 or 1 of the paper's steps | to move |
//! | `T` | an f64, 0 to 1 | to move to focal powers |
//!
//! An answer holds, one after another, for all environments: their patches (u8), focal powers (f32), optimal focal
//! powers (f32), and whether the scan has ended (u8).

use std::io::{self, Read, Write};

use serde::Serialize;

use super::answer::Answer;
use super::fleet::{Action, Begin, Fleet};
use parfocal_imaging::PATCH_SIDE;

/// Name of the protocol.
pub const PROTOCOL: &str = "parfocal-environment";
/// Its version.
pub const VERSION: u32 = 1;

/// What the environments say first.
#[derive(Debug, Serialize)]
pub struct Greeting {
    protocol: &'static str,
    version: u32,
    software: String,
    environments: usize,
    /// Patches of a frame, and values along each side of a patch.
    patches: usize,
    side: usize,
}

impl Greeting {
    /// The greeting of `fleet`.
    #[must_use]
    pub fn of(fleet: &Fleet) -> Self {
        Self {
            protocol: PROTOCOL,
            version: VERSION,
            software: concat!("parfocal ", env!("CARGO_PKG_VERSION")).to_owned(),
            environments: fleet.count(),
            patches: fleet.shows().patches(),
            side: PATCH_SIDE,
        }
    }
}

/// Why a conversation ended before the other program closed its pipe.
#[derive(Debug, thiserror::Error)]
pub enum ProtocolError {
    /// A pipe failed.
    #[error("the pipe to the training program failed: {0}")]
    Pipe(#[from] io::Error),
    /// Something else than a request.
    #[error(
        "the training program sent the byte {0} where a request (R, M or T) begins; is something else printing to this pipe?"
    )]
    Request(u8),
    /// A value that a request may not have.
    #[error("the training program sent {value} as {what} of environment {environment}, which must be {expected}")]
    Value {
        /// What it sent.
        value: String,
        /// What it stands for.
        what: &'static str,
        /// Number of the environment, from 0.
        environment: usize,
        /// What would have been right.
        expected: &'static str,
    },
}

/// Serves `fleet` until the other program closes its pipe.
///
/// # Errors
/// If a pipe fails, or something comes that is no request.
pub fn serve(fleet: &mut Fleet, mut requests: impl Read, mut answers: impl Write) -> Result<(), ProtocolError> {
    let greeting = serde_json::to_string(&Greeting::of(fleet)).map_err(io::Error::from)?;
    writeln!(answers, "{greeting}")?;
    answers.flush()?;

    let mut answer = Answer::default();
    let mut letter = [0];
    while requests.read(&mut letter)? == 1 {
        match letter[0] {
            b'R' => {
                let begins = begins(&mut requests, fleet.count())?;
                fleet.reset(&begins);
            }
            b'M' => {
                let actions = moves(&mut requests, fleet.count())?;
                fleet.step(&actions);
            }
            b'T' => {
                let actions = targets(&mut requests, fleet.count())?;
                fleet.step(&actions);
            }
            other => return Err(ProtocolError::Request(other)),
        }

        fleet.observe(&mut answer);
        answers.write_all(answer.bytes())?;
        answers.flush()?;
    }

    Ok(())
}

fn begins(requests: &mut impl Read, count: usize) -> Result<Vec<Begin>, ProtocolError> {
    let mut kinds = vec![0; count];
    requests.read_exact(&mut kinds)?;
    let mut seeds = vec![0; 8 * count];
    requests.read_exact(&mut seeds)?;

    let seeds = seeds.as_chunks::<8>().0.iter().map(|&seed| u64::from_le_bytes(seed));
    let begin = |(environment, (kind, seed)): (usize, (u8, u64))| match kind {
        0 => Ok(Begin::Not),
        1 => Ok(Begin::Next),
        2 => Ok(Begin::Seeded(seed)),
        _ => Err(ProtocolError::Value {
            value: kind.to_string(),
            what: "the beginning",
            environment,
            expected: "0, 1 or 2",
        }),
    };
    kinds.into_iter().zip(seeds).enumerate().map(begin).collect()
}

fn moves(requests: &mut impl Read, count: usize) -> Result<Vec<Action>, ProtocolError> {
    let mut bytes = vec![0; count];
    requests.read_exact(&mut bytes)?;

    let action = |(environment, byte): (usize, u8)| {
        let steps = byte.cast_signed();
        if (-1..=1).contains(&steps) {
            return Ok(Action::Steps(steps));
        }
        let value = steps.to_string();
        Err(ProtocolError::Value { value, what: "the steps", environment, expected: "-1, 0 or 1" })
    };
    bytes.into_iter().enumerate().map(action).collect()
}

fn targets(requests: &mut impl Read, count: usize) -> Result<Vec<Action>, ProtocolError> {
    let mut bytes = vec![0; 8 * count];
    requests.read_exact(&mut bytes)?;

    let action = |(environment, &bytes): (usize, &[u8; 8])| {
        let target = f64::from_le_bytes(bytes);
        if (0.0..=1.0).contains(&target) {
            return Ok(Action::Target(target));
        }
        let value = target.to_string();
        Err(ProtocolError::Value { value, what: "the focal power", environment, expected: "from 0 to 1" })
    };
    bytes.as_chunks::<8>().0.iter().enumerate().map(action).collect()
}
