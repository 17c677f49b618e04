// SPDX-License-Identifier: GPL-3.0-or-later
//! Configuration strings: `id`, or `id:key=value,key=value`.

use crate::row::{Kind, ParamSpec, StructureSpec};
use halfspace_base::error::{Error, Result};
use std::fmt::{self, Write};

/// A parameter's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A whole number.
    Integer(i64),
    /// A real number.
    Float(f64),
    /// One of the parameter's named options.
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
    /// Reads the part of a configuration string behind the colon: `key=value,key=value`. Keys not given take their
    /// defaults. The registry reads whole strings.
    ///
    /// # Errors
    /// [`Error::Spec`] that names an unknown key, a key given twice, or a value out of its range.
    pub fn read(structure: &'static StructureSpec, rest: &str) -> Result<Self> {
        let id = structure.id;
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
            // Find the parameter of this key.
            let slot = values.iter().position(|(p, _)| p.name == key.trim());
            let slot = slot.ok_or_else(|| {
                let known: Vec<_> = values.iter().map(|(p, _)| p.name).collect();
                Error::Spec(format!(
                    "spec: '{id}' has no key '{}'; it has {}",
                    key.trim(),
                    known.join(", ")
                ))
            })?;
            // Reject a key that is given twice.
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

    /// Returns the structure's row in the registry.
    pub fn structure(&self) -> &'static StructureSpec {
        self.structure
    }

    /// Returns the shortest string of this configuration: only the values that differ from their defaults.
    pub fn canonical(&self) -> String {
        let mut text = self.structure.id.to_owned();
        let changed = self.values.iter().filter(|(p, v)| p.default != *v);
        for (i, (param, value)) in changed.enumerate() {
            let separator = if i == 0 { ':' } else { ',' };
            write!(text, "{separator}{}={value}", param.name).expect("writing to a string");
        }
        text
    }

    /// The value of a parameter; `None` when the structure's row declares no such parameter.
    pub fn find(&self, name: &str) -> Option<&Value> {
        (self.values.iter().find(|(p, _)| p.name == name)).map(|(_, value)| value)
    }

    fn get(&self, name: &str) -> &Value {
        let found = self.values.iter().find(|(p, _)| p.name == name);
        &found
            .unwrap_or_else(|| panic!("{} declares no parameter {name}", self.structure.id))
            .1
    }

    /// Returns the value of an integer parameter that cannot be negative.
    ///
    /// # Panics
    /// When the structure's row declares no such parameter.
    pub fn integer(&self, name: &str) -> usize {
        match self.get(name) {
            Value::Integer(x) => usize::try_from(*x).expect("the range excludes negative numbers"),
            other => panic!("{name} is {other:?}, not a whole number"),
        }
    }

    /// Returns the value of a real-number parameter.
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

    /// Returns the value of a parameter with named options.
    ///
    /// # Panics
    /// When the structure's row declares no such parameter.
    pub fn choice(&self, name: &str) -> &'static str {
        match self.get(name) {
            Value::Choice(x) => x,
            other => panic!("{name} is {other:?}, not a choice"),
        }
    }

    /// Returns whether traversals apply error bounds for rounding: all except those configured to run as
    /// published.
    ///
    /// # Panics
    /// When the structure's row declares no parameter `robust`.
    pub fn robust(&self) -> bool {
        self.choice("robust") != "none"
    }

    /// Returns all values, in the order of the structure's row.
    pub fn values(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.values.iter().map(|(p, v)| (p.name, v))
    }
}

impl ParamSpec {
    /// Parses and checks one value of this parameter.
    fn parse(&self, text: &str) -> Result<Value> {
        let wrong =
            |expected: String| Error::Spec(format!("spec: {}={text} is not {expected}", self.name));
        // Parse the value as the parameter's kind requires.
        match self.kind {
            Kind::Integer { min, max } => match text.parse::<i64>() {
                Ok(x) if (min..=max).contains(&x) => Ok(Value::Integer(x)),
                _ => Err(wrong(format!("a whole number from {min} to {max}"))),
            },
            Kind::Float { min, max } => match text.parse::<f64>() {
                Ok(x) if (min..=max).contains(&x) => Ok(Value::Float(x)),
                _ => Err(wrong(format!("a number from {min} to {max}"))),
            },
            Kind::Choice(_) | Kind::Described(_) => {
                let options = self.kind.options().unwrap_or_default();
                match options.iter().find(|option| **option == text) {
                    Some(option) => Ok(Value::Choice(option)),
                    None => Err(wrong(format!("one of {}", options.join(", ")))),
                }
            }
        }
    }
}
