//! The driver's status bits and modes of control, in words.

/// Meaning of the status bits, lowest first.
const CONDITIONS: [&str; 8] = [
    "no lens is connected",
    "the lens's memory is missing or faulty",
    "no temperature limits are set",
    "the focal power cannot be reached",
    "focal power is inverted",
    "outside the temperatures the lens is made for",
    "outside the range in which focal power is guaranteed",
    "outside the temperature limits set",
];

/// The driver's report on itself and its lens, one bit per condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Status(pub u32);

impl Status {
    const LENS_MISSING: u32 = 1;
    const MEMORY_FAULTY: u32 = 1 << 1;
    const NO_LIMITS: u32 = 1 << 2;
    const UNREACHABLE: u32 = 1 << 3;
    const PRODUCT_TEMPERATURE: u32 = 1 << 5;
    const GUARANTEED_RANGE: u32 = 1 << 6;
    const USER_TEMPERATURE: u32 = 1 << 7;

    /// Whether no usable lens is plugged in.
    pub const fn without_lens(self) -> bool {
        self.0 & (Self::LENS_MISSING | Self::MEMORY_FAULTY) != 0
    }

    /// Whether the driver lost its temperature limits, as it does when it restarts.
    pub const fn restarted(self) -> bool {
        self.0 & Self::NO_LIMITS != 0
    }

    /// Whether the lens follows commands, but its focal power is unreliable: it is too hot or too cold, or does not
    /// reach as far.
    pub const fn doubtful(self) -> bool {
        const TEMPERATURE: u32 = Status::PRODUCT_TEMPERATURE | Status::GUARANTEED_RANGE | Status::USER_TEMPERATURE;
        self.0 & (TEMPERATURE | Self::UNREACHABLE) != 0
    }

    /// All conditions that are set, in words.
    pub fn words(self) -> Vec<String> {
        let known = CONDITIONS.iter().enumerate().filter(|(bit, _)| self.0 >> bit & 1 == 1);
        known.map(|(_, words)| (*words).to_owned()).collect()
    }
}

/// Name of the mode of control with the driver's number `number`.
pub const fn mode_name(number: u8) -> &'static str {
    match number {
        1 => "current",
        2 => "sine",
        3 => "triangle",
        4 => "square",
        5 => "focal power",
        6 => "analog",
        7 => "position",
        _ => "unknown",
    }
}

/// Number of the mode that controls focal power.
pub const FOCAL_POWER_MODE: u8 = 5;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_count_from_the_lowest() {
        assert_eq!(Status(0b1000_0001).words(), ["no lens is connected", "outside the temperature limits set"]);
        assert!(Status(1).without_lens() && Status(4).restarted() && Status(0x80).doubtful());
        assert!(Status(0).words().is_empty());
    }
}
