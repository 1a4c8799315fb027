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
        /// Width and height of this picture.
        found: (usize, usize),
        /// The picture it is compared with.
        expected: &'static str,
        /// Width and height of that picture.
        size: (usize, usize),
    },
    /// Too many pixels are at full scale; holds their share.
    #[error("{:.1} % of the pixels are at full scale: shorten the exposure or dim the light until none is", 100.0 * .0)]
    Saturated(f64),
    /// A dark exposure is too bright; holds its mean as a share of full scale.
    #[error(
        "this is not dark: the picture's mean is {:.0} % of full scale; close the lens cap and cover the camera (for \
         the white target, the command is `calibrate white`)", 100.0 * .0
    )]
    DarkTooBright(f64),
    /// Part of a dark exposure is lit; holds the share of lit pixels.
    #[error("{:.1} % of the pixels see light: close the lens cap and cover the camera", 100.0 * .0)]
    LightLeaks(f64),
    /// A white exposure is black; holds the level of its brightest band as a share of full scale.
    #[error(
        "nothing is seen: the picture reaches {:.1} % of full scale; take the lens cap off and light the white target \
         (for the dark reference, the command is `calibrate dark`)", 100.0 * .0
    )]
    Blind(f64),
    /// Too little light; holds the level of the brightest band as a share of full scale.
    #[error(
        "the white target is too dark, {:.0} % of full scale: lengthen the exposure or add light until it reaches \
         60 to 90 %", 100.0 * .0
    )]
    WhiteTooDark(f64),
    /// Too little light in one band.
    #[error(
        "band {band} is only {:.1} % of full scale above dark on the white target: add light of its wavelength, or \
         lengthen the exposure", 100.0 * level
    )]
    BandTooDark {
        /// The band, from 0.
        band: usize,
        /// Its level above dark, as a share of full scale.
        level: f64,
    },
    /// The light falls off, or there is a shadow or an object; holds the least ratio of dark to bright parts of a band.
    #[error(
        "the white target is uneven: its darkest part has {:.0} % of the light of its brightest; fill the picture with \
         the target, out of focus, and light it evenly", 100.0 * .0
    )]
    Uneven(f64),
    /// Too many pixels see no more of white than of dark; holds their share.
    #[error("{:.1} % of the pixels see the white target no brighter than dark: take both references again", 100.0 * .0)]
    NotAboveDark(f64),
    /// Frames differ in brightness; holds the largest change, as a share of the light (white) or of full scale (dark).
    #[error(
        "the light is unsteady: frames differ by {:.1} %; use a lamp that does not flicker and switch automatic \
         exposure off", 100.0 * .0
    )]
    Unsteady(f64),
}
