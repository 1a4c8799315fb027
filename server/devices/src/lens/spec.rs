//! Lens specifications, as given on the command line: `KIND` or `KIND:DEVICE`, optionally followed by
//! `?NAME=VALUE&…`.

use std::sync::Arc;

use super::emulated::EmulatedLens;
use super::optotune::{Opening, OptotuneLens};
use super::simulated::SimulatedLens;
use super::{Lens, LensError};
use parfocal_base::clock::Clock;
use parfocal_base::options::Options;

/// Opens the lens that `spec` names:
///
/// - `simulated`, with the options `fault` (`none`, `drops`, `stalls`, `refuses` or `gone`), `delay` and `settling` (milliseconds);
/// - `emulated`, with the options `latency`, `delay`, `settling`, `hysteresis`, `temperature` and `fault` (see
///   [`super::emulator::Model`]);
/// - `optotune:auto` or `optotune:/dev/...`, with the options `min` and `max`, the dioptres to use, and `low` and
///   `high`, the temperature limits in °C.
///
/// # Errors
/// If the specification is invalid, or its device cannot be used. The error says what to do.
pub fn open(spec: &str, clock: Arc<dyn Clock>) -> Result<Box<dyn Lens>, LensError> {
    opened(spec, Opening::Now, clock)
}

/// Like [`open`], except that a lens driver that does not answer is treated like one that was lost: it is looked for until
/// it is there. For a server, which may be switched on before its lens.
///
/// # Errors
/// If the specification is invalid, or the device answers and cannot be used.
pub fn open_or_await(spec: &str, clock: Arc<dyn Clock>) -> Result<Box<dyn Lens>, LensError> {
    opened(spec, Opening::OrAwait, clock)
}

/// Like [`open`], for moving a lens by hand: the lens keeps its state when it is opened, and its focal power when it is
/// dropped.
///
/// # Errors
/// If [`open`] would fail.
pub fn open_to_stay(spec: &str, clock: Arc<dyn Clock>) -> Result<Box<dyn Lens>, LensError> {
    opened(spec, Opening::ToStay, clock)
}

fn opened(spec: &str, opening: Opening, clock: Arc<dyn Clock>) -> Result<Box<dyn Lens>, LensError> {
    let (device, options) = Options::split(spec)?;
    match device.split_once(':') {
        None if device == "simulated" => Ok(Box::new(SimulatedLens::open(options, clock)?)),
        None if device == "emulated" => Ok(Box::new(EmulatedLens::open(options, clock)?)),
        Some(("optotune", port)) if !port.is_empty() => {
            Ok(Box::new(OptotuneLens::open(port, options, opening, clock)?))
        }
        _ => Err(LensError::BadSpec(format!(
            "unknown lens '{spec}': use 'simulated', 'emulated', 'optotune:auto' or 'optotune:/dev/...'"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_base::FocalPower;
    use parfocal_base::clock::SystemClock;

    fn message(spec: &str) -> String {
        open(spec, Arc::new(SystemClock)).err().unwrap().to_string()
    }

    #[test]
    fn opens_a_simulated_lens_with_its_fault() {
        let set = |spec| open(spec, Arc::new(SystemClock)).unwrap().set(FocalPower::MAX);
        assert_eq!(set("simulated"), Ok(()));
        assert!(matches!(set("simulated?fault=stalls"), Err(LensError::Stalled(_))));
        let slow = open("simulated?delay=20&settling=60", Arc::new(SystemClock)).unwrap().dynamics();
        assert_eq!((slow.delay.as_millis(), slow.settling.as_millis()), (20, 60));
    }

    #[test]
    fn a_bad_specification_says_what_is_wrong_with_it() {
        for spec in ["magic", "optotune:"] {
            assert!(message(spec).contains("'simulated', 'emulated', 'optotune:auto' or 'optotune:/dev/...'"));
        }
        assert!(message("simulated?fault=fire").contains("choose from none, drops"));
        assert!(message("emulated?fault=fire").contains("choose from none, garbage"));
        assert!(message("emulated?hysteresis=9").contains("must be from 0 to 5 dpt"));
        for spec in ["emulated?temperature=nan", "optotune:/dev/none?low=nan", "optotune:/dev/none?high=inf"] {
            assert!(message(spec).ends_with("must be from -100 to 200 °C"), "{}", message(spec));
        }
        assert!(message("optotune:/dev/none?min=-inf").contains("min=-inf: must be from -160 to 160 dpt"));
        assert!(message("optotune:/dev/none?low=40&high=20").contains("but low is 40 °C and high is 20 °C"));
        assert!(message("optotune:/dev/none?high=20").contains("but low is 20 °C and high is 20 °C"), "the usual low");
        assert!(message("optotune:/dev/none?min=9&max=6").contains("but min is 9 dpt and max is 6 dpt"));
        for spec in ["simulated?delay=4000000000", "emulated?latency=10001", "emulated?settling=10001"] {
            assert!(message(spec).ends_with("must be from 0 to 10000 ms"), "{}", message(spec));
        }
        assert!(message("simulated?size=3").contains("unknown option 'size'; there are: fault, delay, settling"));
    }
}
