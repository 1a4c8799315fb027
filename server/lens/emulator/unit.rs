//! Which unit is emulated, and what is wrong with it.

use std::time::Duration;

use crate::lens::LensDynamics;

const GLASS: LensDynamics = LensDynamics { delay: Duration::from_millis(1), settling: Duration::from_millis(15) };

/// What is wrong with the emulated driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fault {
    /// Nothing.
    #[default]
    None,
    /// Every reply is noise.
    Garbage,
    /// Every reply has a wrong checksum.
    WrongChecksum,
    /// Nothing is answered and nothing done.
    Silent,
    /// Every request is answered with an error, and not carried out.
    Errors,
    /// Focal power commands are ignored.
    DropsCommands,
    /// Some other device that says what it likes.
    Stranger,
}

impl std::str::FromStr for Fault {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "none" => Ok(Self::None),
            "garbage" => Ok(Self::Garbage),
            "wrong-checksum" => Ok(Self::WrongChecksum),
            "silent" => Ok(Self::Silent),
            "errors" => Ok(Self::Errors),
            "drops-commands" => Ok(Self::DropsCommands),
            "stranger" => Ok(Self::Stranger),
            _ => Err(format!(
                "there is no fault '{name}': choose from none, garbage, wrong-checksum, silent, errors, \
                 drops-commands, stranger"
            )),
        }
    }
}

/// What makes one unit differ from another.
#[derive(Debug, Clone)]
pub struct Model {
    /// Serial number, eight characters.
    pub serial: [u8; 8],
    /// Type of firmware, `A` to `F`.
    pub firmware: u8,
    /// Time to answer a request.
    pub latency: Duration,
    /// Whether error numbers are sent as digits rather than bytes.
    pub ascii_errors: bool,
    /// Whether a wrong checksum is answered with `N` as old firmware does.
    pub old: bool,
    /// How its glass moves.
    pub glass: LensDynamics,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            serial: *b"EMUL0001",
            firmware: b'A',
            latency: Duration::from_millis(1),
            ascii_errors: true,
            old: false,
            glass: GLASS,
        }
    }
}
