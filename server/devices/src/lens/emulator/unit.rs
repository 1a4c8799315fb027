//! The emulated unit's properties and faults.

use std::str::FromStr;
use std::time::Duration;

use crate::lens::{LensDynamics, named};

/// Range of the emulated lens, in dioptres.
pub const LENS_DIOPTRES: (f64, f64) = (5.0, 10.0);
const GLASS: LensDynamics = LensDynamics { delay: Duration::from_millis(1), settling: Duration::from_millis(15) };
/// Half of a hysteresis of 0.04 dioptres, as a share of the lens's 5 dioptres.
const PLAY: f64 = 0.004;

/// A fault of the emulated driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fault {
    /// No fault.
    #[default]
    None,
    /// Every reply is noise.
    Garbage,
    /// Every reply has a wrong checksum.
    WrongChecksum,
    /// The driver answers nothing and does nothing.
    Silent,
    /// The driver answers every request with an error, and carries none out.
    Errors,
    /// Every reply that contains the focal power has a wrong checksum.
    WrongReadBack,
    /// Focal power commands are ignored.
    DropsCommands,
    /// Another kind of device, which answers everything with a message of its own.
    Stranger,
    /// Every third reply has a [`Glitch`], each kind in turn.
    NoisyLine,
}

/// A fault of a single reply on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Glitch {
    /// A few bytes of noise arrive before the reply.
    Noise,
    /// The reply's checksum is wrong.
    Checksum,
    /// The reply comes 200 ms late.
    Late,
}

impl Glitch {
    /// Every kind.
    pub(super) const ALL: [Self; 3] = [Self::Noise, Self::Checksum, Self::Late];
}

impl FromStr for Glitch {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        named("glitch", &[("noise", Self::Noise), ("checksum", Self::Checksum), ("late", Self::Late)], name)
    }
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = [
            ("none", Self::None),
            ("garbage", Self::Garbage),
            ("wrong-checksum", Self::WrongChecksum),
            ("wrong-read-back", Self::WrongReadBack),
            ("silent", Self::Silent),
            ("errors", Self::Errors),
            ("drops-commands", Self::DropsCommands),
            ("stranger", Self::Stranger),
            ("noisy-line", Self::NoisyLine),
        ];
        named("fault", &known, name)
    }
}

/// The properties in which units differ.
#[derive(Debug, Clone)]
pub struct Model {
    /// Serial number, eight characters.
    pub serial: [u8; 8],
    /// Type of firmware, `A` to `F`.
    pub firmware: u8,
    /// Time that the unit takes to answer a request.
    pub latency: Duration,
    /// Whether error numbers are sent as ASCII digits instead of bytes.
    pub ascii_errors: bool,
    /// Whether the unit answers a wrong checksum with `N`, like old firmware.
    pub old: bool,
    /// Dynamics of the lens.
    pub glass: LensDynamics,
    /// Half-width of the lens's hysteresis, as a share of its range.
    pub play: f64,
}

impl Model {
    /// [`Model::play`] for a hysteresis in dioptres between the way up and the way down; `None` outside 0 to the whole
    /// range.
    pub fn play_of(hysteresis: f64) -> Option<f64> {
        let range = LENS_DIOPTRES.1 - LENS_DIOPTRES.0;
        (0.0..=range).contains(&hysteresis).then_some(hysteresis / 2.0 / range)
    }
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
            play: PLAY,
        }
    }
}
