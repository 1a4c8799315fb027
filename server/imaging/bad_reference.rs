//! What can be wrong with a reference exposure, in words for the person who takes it.

/// Why an exposure is unfit as a reference.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadReference {
    /// There was no frame.
    #[error("no frame was taken")]
    Nothing,
    /// Frames of different sizes.
    #[error("the picture is {}x{}, but {expected} was taken at {}x{}", found.0, found.1, size.0, size.1)]
    Size {
        /// Width and height of this.
        found: (usize, usize),
        /// The picture it is compared with.
        expected: &'static str,
        /// Width and height of that.
        size: (usize, usize),
    },
    /// Pixels at full scale.
    #[error("{:.1} % of the pixels are at full scale: shorten the exposure or dim the light until none is", 100.0 * .0)]
    Saturated(f64),
    /// Light in a dark exposure.
    #[error(
        "this is not dark: the picture's mean is {:.0} % of full scale; close the lens cap and cover the camera (for \
         the white target, the command is `calibrate white`)", 100.0 * .0
    )]
    DarkTooBright(f64),
    /// Light in a part of a dark exposure.
    #[error("{:.1} % of the pixels see light: close the lens cap and cover the camera", 100.0 * .0)]
    LightLeaks(f64),
    /// A white exposure that sees nothing.
    #[error(
        "nothing is seen: the picture reaches {:.1} % of full scale; take the lens cap off and light the white target \
         (for the dark reference, the command is `calibrate dark`)", 100.0 * .0
    )]
    Blind(f64),
    /// Too little light.
    #[error(
        "the white target is too dark, {:.0} % of full scale: lengthen the exposure or add light until it reaches \
         60 to 90 %", 100.0 * .0
    )]
    WhiteTooDark(f64),
    /// Too little light in one band.
    #[error(
        "band {band} sees the white target only {:.1} % of full scale above dark: add light of its wavelength, or \
         lengthen the exposure", 100.0 * level
    )]
    BandTooDark {
        /// The band, from 0.
        band: usize,
        /// Share of full scale.
        level: f64,
    },
    /// Light that falls off, a shadow, or something in the picture.
    #[error(
        "the white target is uneven: its darkest part has {:.0} % of the light of its brightest; fill the picture with \
         the target, out of focus, and light it evenly", 100.0 * .0
    )]
    Uneven(f64),
    /// Pixels that see no more of white than of dark.
    #[error("{:.1} % of the pixels see the white target no brighter than dark: take both references again", 100.0 * .0)]
    NotAboveDark(f64),
    /// Frames of different brightness.
    #[error(
        "the light is unsteady: frames differ by {:.1} %; use a lamp that does not flicker and switch automatic \
         exposure off", 100.0 * .0
    )]
    Unsteady(f64),
}
