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

use std::fmt::Display;
use std::io::{self, Read, Write};

use serde::Serialize;

use super::fleet::{Action, Begin, Fleet};
use parfocal_base::SOFTWARE;
use parfocal_imaging::PATCH_SIDE;

/// What the environments say first.
#[derive(Debug, Serialize)]
struct Greeting {
    protocol: &'static str,
    version: u32,
    software: &'static str,
    environments: usize,
    /// Patches of a frame, and values along each side of a patch.
    patches: usize,
    side: usize,
}

/// Why a conversation ended before the other program closed its pipe.
#[derive(Debug, thiserror::Error)]
pub enum ProtocolError {
    /// A pipe failed.
    #[error("the pipe to the training program failed: {0}")]
    Pipe(#[from] io::Error),
    /// Something came that is no request.
    #[error("the training program sent {0}")]
    Request(String),
}

impl ProtocolError {
    /// `value` was sent as `what` of `environment` (from 0), which must be `expected`.
    fn value(value: impl Display, what: &str, environment: usize, expected: &str) -> Self {
        Self::Request(format!("{value} as {what} of environment {environment}, which must be {expected}"))
    }
}

/// Serves `fleet` until the other program closes its pipe.
///
/// # Errors
/// If a pipe fails, or something comes that is no request.
pub fn serve(fleet: &mut Fleet, mut requests: impl Read, mut answers: impl Write) -> Result<(), ProtocolError> {
    let greeting = Greeting {
        protocol: "parfocal-environment",
        version: 1,
        software: SOFTWARE,
        environments: fleet.count(),
        patches: fleet.shows().patches(),
        side: PATCH_SIDE,
    };
    writeln!(answers, "{}", serde_json::to_string(&greeting).map_err(io::Error::from)?)?;
    answers.flush()?;

    let mut answer = Vec::new();
    let mut letter = [0];
    while requests.read(&mut letter)? == 1 {
        match letter[0] {
            b'R' => fleet.reset(&begins(&mut requests, fleet.count())?),
            b'M' => fleet.step(&moves(&mut requests, fleet.count())?),
            b'T' => fleet.step(&targets(&mut requests, fleet.count())?),
            other => {
                return Err(ProtocolError::Request(format!(
                    "the byte {other} where a request (R, M or T) begins; is something else printing to this pipe?"
                )));
            }
        }

        fleet.observe(&mut answer);
        answers.write_all(&answer)?;
        answers.flush()?;
    }

    Ok(())
}

/// A value of so many bytes for each of `count` environments.
fn values<const BYTES: usize>(requests: &mut impl Read, count: usize) -> io::Result<Vec<[u8; BYTES]>> {
    let mut values = vec![[0; BYTES]; count];
    requests.read_exact(values.as_flattened_mut())?;
    Ok(values)
}

fn begins(requests: &mut impl Read, count: usize) -> Result<Vec<Begin>, ProtocolError> {
    let kinds = values::<1>(requests, count)?;
    let seeds = values::<8>(requests, count)?;

    let begin = |(environment, ([kind], seed)): (usize, ([u8; 1], [u8; 8]))| match kind {
        0 => Ok(Begin::Not),
        1 => Ok(Begin::Next),
        2 => Ok(Begin::Seeded(u64::from_le_bytes(seed))),
        _ => Err(ProtocolError::value(kind, "the beginning", environment, "0, 1 or 2")),
    };
    kinds.into_iter().zip(seeds).enumerate().map(begin).collect()
}

fn moves(requests: &mut impl Read, count: usize) -> Result<Vec<Action>, ProtocolError> {
    let action = |(environment, byte): (usize, [u8; 1])| {
        let steps = i8::from_le_bytes(byte);
        if (-1..=1).contains(&steps) {
            return Ok(Action::Steps(steps));
        }
        Err(ProtocolError::value(steps, "the steps", environment, "-1, 0 or 1"))
    };
    values(requests, count)?.into_iter().enumerate().map(action).collect()
}

fn targets(requests: &mut impl Read, count: usize) -> Result<Vec<Action>, ProtocolError> {
    let action = |(environment, bytes): (usize, [u8; 8])| {
        let target = f64::from_le_bytes(bytes);
        if (0.0..=1.0).contains(&target) {
            return Ok(Action::Target(target));
        }
        Err(ProtocolError::value(target, "the focal power", environment, "from 0 to 1"))
    };
    values(requests, count)?.into_iter().enumerate().map(action).collect()
}
