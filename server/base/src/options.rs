//! Options of a device's specification on the command line: `DEVICE?NAME=VALUE&…`.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Invalid options. The message says which and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadOptions(String);

/// The options after a specification's `?`. Take each known option, then call [`Options::finish`].
#[derive(Debug)]
pub struct Options<'a> {
    spec: &'a str,
    values: BTreeMap<&'a str, &'a str>,
    known: Vec<&'static str>,
}

impl<'a> Options<'a> {
    /// Splits `spec` into the part before `?` and its options.
    ///
    /// # Errors
    /// If an option is not `NAME=VALUE`, or is given twice.
    pub fn split(spec: &'a str) -> Result<(&'a str, Self), BadOptions> {
        let (device, text) = spec.split_once('?').unwrap_or((spec, ""));
        let mut values = BTreeMap::new();

        for pair in text.split('&').filter(|pair| !pair.is_empty()) {
            let Some((name, value)) = pair.split_once('=') else {
                return Err(BadOptions(format!("in '{spec}': '{pair}' is not NAME=VALUE")));
            };
            if values.insert(name, value).is_some() {
                return Err(BadOptions(format!("in '{spec}': '{name}' is given twice")));
            }
        }

        Ok((device, Self { spec, values, known: Vec::new() }))
    }

    /// The value of option `name`, if it was given.
    ///
    /// # Errors
    /// If its value cannot be parsed.
    pub fn take<T: FromStr<Err: Display>>(&mut self, name: &'static str) -> Result<Option<T>, BadOptions> {
        self.known.push(name);
        let parse = |value: &str| {
            value.parse().map_err(|error| BadOptions(format!("in '{}': {name}={value}: {error}", self.spec)))
        };
        self.values.remove(name).map(parse).transpose()
    }

    /// The number of option `name`, if it was given. It must be within `range`; `unit` says in what.
    ///
    /// # Errors
    /// If its value is no number, or outside `range`, as NaN and infinity are.
    pub fn take_within<T>(
        &mut self,
        name: &'static str,
        range: RangeInclusive<T>,
        unit: &str,
    ) -> Result<Option<T>, BadOptions>
    where
        T: FromStr + PartialOrd + Display,
    {
        self.known.push(name);
        let Some(text) = self.values.remove(name) else { return Ok(None) };

        let value = text.parse().ok().filter(|value| range.contains(value));
        let outside = || {
            let (least, most) = (range.start(), range.end());
            BadOptions(format!("in '{}': {name}={text}: must be from {least} to {most}{unit}", self.spec))
        };
        value.map(Some).ok_or_else(outside)
    }

    /// Rejects unknown options.
    ///
    /// # Errors
    /// If an option was not taken.
    pub fn finish(self) -> Result<(), BadOptions> {
        match self.values.keys().next() {
            None => Ok(()),
            Some(name) => Err(BadOptions(format!(
                "in '{}': unknown option '{name}'; there are: {}",
                self.spec,
                self.known.join(", ")
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_taken_by_name() {
        let (device, mut options) = Options::split("optotune:/dev/x?min=5.5&max=10").unwrap();
        assert_eq!(device, "optotune:/dev/x");
        assert_eq!(options.take::<f64>("max"), Ok(Some(10.0)));
        assert_eq!(options.take::<f64>("min"), Ok(Some(5.5)));
        assert_eq!(options.take::<f64>("low"), Ok(None));
        assert_eq!(options.finish(), Ok(()));
    }

    #[test]
    fn a_number_outside_its_range_is_refused_by_name() {
        for value in ["five", "", "nan", "NaN", "inf", "-inf", "infinity", "200.5", "-0.5", "1e999"] {
            let spec = format!("x?low={value}");
            let (_, mut options) = Options::split(&spec).unwrap();
            let said = options.take_within("low", 0.0..=200.0, " °C").unwrap_err().to_string();
            assert!(said.contains("low=") && said.ends_with(": must be from 0 to 200 °C"), "{said}");
        }

        let (_, mut options) = Options::split("x?low=-0&high=200").unwrap();
        assert_eq!(options.take_within("low", 0.0..=200.0, ""), Ok(Some(-0.0)));
        assert_eq!(options.take_within("high", 0..=200, ""), Ok(Some(200)));
        assert_eq!(options.take_within("none", 0..=200, ""), Ok(None));
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        let message = |outcome: Result<(), BadOptions>| outcome.unwrap_err().to_string();
        assert!(message(Options::split("x?fault").map(drop)).contains("'fault' is not NAME=VALUE"));
        assert!(message(Options::split("x?a=1&a=2").map(drop)).contains("'a' is given twice"));
        let (_, mut options) = Options::split("x?min=five").unwrap();
        assert_eq!(message(options.take::<f64>("min").map(drop)), "in 'x?min=five': min=five: invalid float literal");
        let (_, mut options) = Options::split("x?size=3").unwrap();
        options.take::<f64>("min").unwrap();
        options.take::<f64>("max").unwrap();
        assert_eq!(message(options.finish()), "in 'x?size=3': unknown option 'size'; there are: min, max");
    }
}
