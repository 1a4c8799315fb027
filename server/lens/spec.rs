//! Lens specifications, as given on the command line: `KIND`, `KIND:DEVICE`, each with `?NAME=VALUE&…` behind it.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::str::FromStr;
use std::sync::Arc;

use super::optotune::OptotuneLens;
use super::simulated::SimulatedLens;
use super::{Lens, LensError};
use crate::clock::Clock;

/// Opens the lens that `spec` names: `simulated` (option `fault`, see [`super::SimulatedFault`]), `optotune:auto` or
/// `optotune:/dev/...` (options `min` and `max`, the dioptres to use, `low` and `high`, the temperature limits in °C).
///
/// # Errors
/// When the specification makes no sense, or its device cannot be used; says what to do.
pub fn open(spec: &str, clock: Arc<dyn Clock>) -> Result<Box<dyn Lens>, LensError> {
    let (device, options) = Options::split(spec)?;
    match device.split_once(':') {
        None if device == "simulated" => Ok(Box::new(SimulatedLens::open(options, clock)?)),
        Some(("optotune", port)) => Ok(Box::new(OptotuneLens::open(port, options, clock)?)),
        _ => Err(LensError::BadSpec(format!(
            "there is no lens '{spec}': use 'simulated', 'optotune:auto' or 'optotune:/dev/...'"
        ))),
    }
}

/// The options behind a specification's `?`. Take each that is known, then [`Options::finish`].
#[derive(Debug)]
pub(super) struct Options<'a> {
    spec: &'a str,
    values: BTreeMap<&'a str, &'a str>,
    known: Vec<&'static str>,
}

impl<'a> Options<'a> {
    /// `spec` as the part before `?` and its options.
    pub(super) fn split(spec: &'a str) -> Result<(&'a str, Self), LensError> {
        let (device, text) = spec.split_once('?').unwrap_or((spec, ""));
        let mut values = BTreeMap::new();
        for pair in text.split('&').filter(|pair| !pair.is_empty()) {
            let Some((name, value)) = pair.split_once('=') else {
                return Err(LensError::BadSpec(format!("in lens '{spec}': '{pair}' is not NAME=VALUE")));
            };
            if values.insert(name, value).is_some() {
                return Err(LensError::BadSpec(format!("in lens '{spec}': '{name}' is given twice")));
            }
        }
        Ok((device, Self { spec, values, known: Vec::new() }))
    }

    /// Option `name`, if it was given.
    pub(super) fn take<T: FromStr<Err: Display>>(&mut self, name: &'static str) -> Result<Option<T>, LensError> {
        self.known.push(name);
        let parse = |value: &str| {
            value
                .parse()
                .map_err(|error| LensError::BadSpec(format!("in lens '{}': {name}={value}: {error}", self.spec)))
        };
        self.values.remove(name).map(parse).transpose()
    }

    /// Fails on an option that nobody took.
    pub(super) fn finish(self) -> Result<(), LensError> {
        match self.values.keys().next() {
            None => Ok(()),
            Some(name) => Err(LensError::BadSpec(format!(
                "in lens '{}': there is no option '{name}'; there are: {}",
                self.spec,
                self.known.join(", ")
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::SystemClock;
    use crate::lens::SimulatedFault;

    fn message(spec: &str) -> String {
        open(spec, Arc::new(SystemClock)).err().unwrap().to_string()
    }

    #[test]
    fn opens_a_simulated_lens_with_its_fault() {
        let fault = |spec| open(spec, Arc::new(SystemClock)).unwrap().faults().unwrap().get();
        assert_eq!(fault("simulated"), SimulatedFault::None);
        assert_eq!(fault("simulated?fault=stalls"), SimulatedFault::Stalls);
    }

    #[test]
    fn a_bad_specification_says_what_is_wrong_with_it() {
        assert!(message("magic").contains("'simulated', 'optotune:auto' or 'optotune:/dev/...'"));
        assert!(message("simulated?fault=fire").contains("choose from none, drops"));
        assert!(message("simulated?fault").contains("'fault' is not NAME=VALUE"));
        assert!(message("simulated?size=3").contains("no option 'size'; there are: fault"));
        assert!(message("simulated?fault=none&fault=gone").contains("twice"));
    }
}
