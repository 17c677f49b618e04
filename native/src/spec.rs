// SPDX-License-Identifier: GPL-3.0-or-later
//! Configuration strings: `id`, or `id:key=value,key=value`.

use crate::error::{Error, Result};
use crate::registry::{self, Kind, ParamSpec, StructureSpec};
use std::fmt::{self, Write};

/// A parameter's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A whole number.
    Integer(i64),
    /// A real number.
    Float(f64),
    /// One of the names that the parameter offers.
    Choice(&'static str),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(x) => write!(f, "{x}"),
            Self::Float(x) => write!(f, "{x}"),
            Self::Choice(x) => f.write_str(x),
        }
    }
}

/// A structure and a value for each of its parameters.
#[derive(Debug, Clone)]
pub struct Config {
    structure: &'static StructureSpec,
    values: Vec<(&'static ParamSpec, Value)>,
}

impl Config {
    /// Reads a configuration string. Keys not given take their defaults.
    ///
    /// # Errors
    /// [`Error::Spec`] that names an unknown structure or key, a key given twice, or a value out of its range.
    pub fn parse(text: &str) -> Result<Self> {
        let (id, rest) = text.trim().split_once(':').unwrap_or((text.trim(), ""));
        let structure = registry::find(id).ok_or_else(|| {
            let known: Vec<_> = registry::TREES.iter().map(|t| t.id).collect();
            Error::Spec(format!(
                "spec: unknown structure '{id}'; known are {}",
                known.join(", ")
            ))
        })?;
        let mut values: Vec<_> = structure.all_params().map(|p| (p, p.default)).collect();
        let mut given = vec![false; values.len()];
        for pair in rest
            .split(',')
            .map(str::trim)
            .filter(|pair| !pair.is_empty())
        {
            let (key, text) = pair.split_once('=').ok_or_else(|| {
                Error::Spec(format!("spec: '{pair}' in '{id}' should read key=value"))
            })?;
            let slot = values.iter().position(|(p, _)| p.name == key.trim());
            let slot = slot.ok_or_else(|| {
                let known: Vec<_> = values.iter().map(|(p, _)| p.name).collect();
                Error::Spec(format!(
                    "spec: '{id}' has no key '{}'; it has {}",
                    key.trim(),
                    known.join(", ")
                ))
            })?;
            if std::mem::replace(&mut given[slot], true) {
                let name = values[slot].0.name;
                return Err(Error::Spec(format!(
                    "spec: {name} is given twice in '{id}'"
                )));
            }
            let slot = &mut values[slot];
            slot.1 = slot.0.parse(text.trim())?;
        }
        Ok(Self { structure, values })
    }

    /// The structure.
    pub fn structure(&self) -> &'static StructureSpec {
        self.structure
    }

    /// The string that names this configuration with only what differs from the defaults.
    pub fn canonical(&self) -> String {
        let mut text = self.structure.id.to_owned();
        let changed = self.values.iter().filter(|(p, v)| p.default != *v);
        for (i, (param, value)) in changed.enumerate() {
            let separator = if i == 0 { ':' } else { ',' };
            write!(text, "{separator}{}={value}", param.name).expect("writing to a string");
        }
        text
    }

    fn get(&self, name: &str) -> &Value {
        let found = self.values.iter().find(|(p, _)| p.name == name);
        &found
            .unwrap_or_else(|| panic!("{} declares no parameter {name}", self.structure.id))
            .1
    }

    /// The value of a whole-number parameter that cannot be negative.
    ///
    /// # Panics
    /// When the structure's row declares no such parameter.
    pub fn integer(&self, name: &str) -> usize {
        match self.get(name) {
            Value::Integer(x) => usize::try_from(*x).expect("the range excludes negative numbers"),
            other => panic!("{name} is {other:?}, not a whole number"),
        }
    }

    /// The value of a real-number parameter.
    ///
    /// # Panics
    /// When the structure's row declares no such parameter.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "parameters need no more than f32"
    )]
    pub fn float(&self, name: &str) -> f32 {
        match self.get(name) {
            Value::Float(x) => *x as f32,
            other => panic!("{name} is {other:?}, not a real number"),
        }
    }

    /// The value of a parameter that names one of several ways.
    ///
    /// # Panics
    /// When the structure's row declares no such parameter.
    pub fn choice(&self, name: &str) -> &'static str {
        match self.get(name) {
            Value::Choice(x) => x,
            other => panic!("{name} is {other:?}, not a choice"),
        }
    }

    /// Whether walks allow for rounding: all but those that are asked to run as published.
    ///
    /// # Panics
    /// When the structure's row declares no parameter `robust`.
    pub fn robust(&self) -> bool {
        self.choice("robust") != "none"
    }

    /// All values, in the order of the structure's row.
    pub fn values(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.values.iter().map(|(p, v)| (p.name, v))
    }
}

impl ParamSpec {
    fn parse(&self, text: &str) -> Result<Value> {
        let wrong =
            |expected: String| Error::Spec(format!("spec: {}={text} is not {expected}", self.name));
        match self.kind {
            Kind::Integer { min, max } => match text.parse::<i64>() {
                Ok(x) if (min..=max).contains(&x) => Ok(Value::Integer(x)),
                _ => Err(wrong(format!("a whole number from {min} to {max}"))),
            },
            Kind::Float { min, max } => match text.parse::<f64>() {
                Ok(x) if (min..=max).contains(&x) => Ok(Value::Float(x)),
                _ => Err(wrong(format!("a number from {min} to {max}"))),
            },
            Kind::Choice(options) => match options.iter().find(|o| **o == text) {
                Some(option) => Ok(Value::Choice(option)),
                None => Err(wrong(format!("one of {}", options.join(", ")))),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specs_read_and_write() {
        let config = Config::parse(" kd:traversal=dir, max_depth=20 ").unwrap();
        assert_eq!(
            (config.choice("traversal"), config.integer("max_depth")),
            ("dir", 20)
        );
        assert_eq!(config.canonical(), "kd:traversal=dir,max_depth=20");
        assert_eq!(Config::parse("kd").unwrap().canonical(), "kd");
        assert_eq!(
            Config::parse("kd:traversal=auto").unwrap().canonical(),
            "kd"
        );
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("tree", "unknown structure 'tree'"),
            ("kd:colour=red", "'kd' has no key 'colour'"),
            (
                "kd:max_depth=61",
                "max_depth=61 is not a whole number from 0 to 60",
            ),
            ("kd:step_cost=nan", "step_cost=nan is not a number"),
            (
                "kd:traversal=fast",
                "traversal=fast is not one of auto, dir",
            ),
            ("kd:max_depth", "'max_depth' in 'kd' should read key=value"),
            (
                "kd:traversal=dir,max_depth=9,traversal =dir",
                "spec: traversal is given twice in 'kd'",
            ),
            ("", "unknown structure ''"),
        ] {
            let message = Config::parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
