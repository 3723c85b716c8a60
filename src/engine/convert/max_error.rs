//! An error in the samples' unit, perhaps one for each variable.

use serde::Deserialize;
use std::str::FromStr;
use wavesplat_core::base::error::{Error, Result};

/// An error in the samples' unit: one number, or one for each variable as `temp=0.1,salt=0.01`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum MaxError {
    /// Of every variable.
    Number(f64),
    /// Of variables by name.
    Named(Vec<(String, f64)>),
}

impl FromStr for MaxError {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || "takes a number in the samples' unit, or NAME=NUMBER with commas between them".to_string();
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| wrong());
        if !text.contains('=') {
            return number(text).map(Self::Number);
        }
        let pair = |pair: &str| {
            let (name, error) = pair.rsplit_once('=').filter(|(name, _)| !name.trim().is_empty()).ok_or_else(wrong)?;
            Ok((name.trim().to_string(), number(error)?))
        };
        let named = text.split(',').map(pair).collect::<std::result::Result<Vec<_>, String>>()?;
        let twice = (1..named.len()).find(|i| named[..*i].iter().any(|(name, _)| *name == named[*i].0));
        twice.map_or(Ok(()), |i| Err(format!("gives {} twice", named[i].0)))?;
        Ok(Self::Named(named))
    }
}

impl MaxError {
    /// The error of a variable.
    ///
    /// # Errors
    /// Errors are given by name, and none of the names is the variable's.
    pub(super) fn for_variable(&self, variable: Option<&str>) -> Result<f64> {
        let named = match self {
            Self::Number(error) => return Ok(*error),
            Self::Named(named) => named,
        };
        if let Some((_, error)) = named.iter().find(|(name, _)| Some(name.as_str()) == variable) {
            return Ok(*error);
        }
        let names: Vec<&str> = named.iter().map(|(name, _)| name.as_str()).collect();
        let what = variable.map_or("the variable, which has no name: give one number".into(), ToString::to_string);
        Err(Error::setting("max_error", format!("is given for {}, not for {what}", names.join(", "))))
    }
}
