//! Shared by all commands: what people give to them, on the command line and by typing.

use std::io::BufRead;
use std::ops::RangeInclusive;
use std::path::Path;

use clap::builder::RangedI64ValueParser;
use clap::value_parser;

use parfocal_base::files::is_systems_own;
use parfocal_base::notices::tell;
use parfocal_devices::camera::LEAST_FPS;

/// Reads `--fps` of a command in which the control loop follows the camera.
pub fn frame_rate() -> RangedI64ValueParser<u32> {
    value_parser!(u32).range(i64::from(LEAST_FPS)..=1000)
}

/// What the help says of [`frame_rate`].
pub fn frame_rate_help() -> String {
    format!(
        "Frame rate to request from the camera, per second; at least {LEAST_FPS}, as a later frame counts as missing"
    )
}

/// Reads a whole number, which must be in `range`.
pub fn whole_number(range: RangeInclusive<usize>) -> impl Fn(&str) -> Result<usize, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("must be from {} to {}", range.start(), range.end()))
    }
}

/// Reads a number, which must be in `range`.
pub fn number(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("must be a number from {} to {}, not '{text}'", range.start(), range.end()))
    }
}

/// Hands the lines that are typed to `take`, until the terminal is closed or `take` wants no more. Its thread ends with
/// the process: reading a terminal cannot be interrupted.
pub fn hear_lines(take: impl Fn(String) -> bool + Send + 'static) {
    std::thread::spawn(move || {
        // Letters that are not UTF-8 are typed, too, and do not close the terminal.
        let lines = std::io::stdin().lock().split(b'\n').map_while(Result::ok);
        lines.map(|line| String::from_utf8_lossy(&line).into_owned()).all(take)
    });
}

/// The `paths` without files that an operating system keeps beside people's own, such as `Thumbs.db`; standard error
/// names each that is passed over. If there are no others, all of them: somebody means them.
pub fn without_systems_own<P: AsRef<Path>>(paths: &[P]) -> Vec<&P> {
    let is_own = |path: &&P| {
        let path = path.as_ref();
        path.is_file() && path.file_name().is_some_and(is_systems_own)
    };
    let (own, others): (Vec<&P>, Vec<&P>) = paths.iter().partition(is_own);
    if others.is_empty() {
        return own;
    }

    for path in own {
        tell(format_args!("passed over: {}, a file of the operating system", path.as_ref().display()));
    }
    others
}
