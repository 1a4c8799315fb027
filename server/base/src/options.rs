//! Options of a device's specification on the command line: `DEVICE?NAME=VALUE&…`.

use std::collections::BTreeMap;
use std::fmt::Display;
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
