//! Settings as texts: by names, or in the form that options accept.

use serde::{Deserialize, Deserializer, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

/// A setting with a few values. Options, requests and reports call each by the same name.
pub trait Choice: Copy + PartialEq + Send + Sync + 'static {
    /// Every value: its name, the value, and what it does, for help texts.
    const CHOICES: &'static [(&'static str, Self, &'static str)];

    /// The name of the value.
    fn name(self) -> &'static str {
        Self::CHOICES.iter().find(|(_, value, _)| *value == self).expect("every value has a name").0
    }

    /// The value with a name.
    ///
    /// # Errors
    /// The names of all values, if none has this one.
    fn named(name: &str) -> Result<Self, String> {
        let found = Self::CHOICES.iter().find(|(known, ..)| *known == name);
        let names = || Self::CHOICES.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(" ");
        found.map(|(_, value, _)| *value).ok_or_else(|| format!("'{name}' is not one of {}", names()))
    }
}

/// Serialises a choice by its name.
pub fn serialize<T: Choice, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(value.name())
}

/// Reads a choice from its name.
pub fn deserialize<'de, T: Choice, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::named(&Given::deserialize(deserializer)?.text()).map_err(serde::de::Error::custom)
}

/// Choices that may be left out.
pub mod optional {
    use super::{Choice, Given};
    use serde::{Deserialize, Deserializer, Serializer};

    /// As [`super::serialize`].
    pub fn serialize<T: Choice, S: Serializer>(value: &Option<T>, serializer: S) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => serializer.serialize_str(value.name()),
            None => serializer.serialize_none(),
        }
    }

    /// As [`super::deserialize`].
    pub fn deserialize<'de, T: Choice, D: Deserializer<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
        let given = Option::<Given<'_>>::deserialize(deserializer)?;
        given.map(|given| T::named(&given.text())).transpose().map_err(serde::de::Error::custom)
    }
}

/// Reads a value from the text that an option accepts, or from a number.
pub fn from_text<'de, T: FromStr<Err: fmt::Display>, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    Given::deserialize(deserializer)?.text().parse().map_err(serde::de::Error::custom)
}

/// A text, or a number that stands for its text.
#[derive(Deserialize)]
#[serde(untagged)]
enum Given<'a> {
    #[serde(borrow)]
    Text(Cow<'a, str>),
    Number(serde_json::Number),
}

impl<'a> Given<'a> {
    fn text(self) -> Cow<'a, str> {
        match self {
            Self::Text(text) => text,
            Self::Number(number) => number.to_string().into(),
        }
    }
}

/// Serialises types as the texts that options accept, and reads them from such texts.
#[doc(hidden)]
#[macro_export]
macro_rules! serde_as_text {
    ($($type:ty),*) => {$(
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
                $crate::base::choice::from_text(deserializer)
            }
        }
    )*};
}
pub use serde_as_text;
