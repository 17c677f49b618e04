// SPDX-License-Identifier: GPL-3.0-or-later
//! Configuration strings: `id`, or `id:key=value,key=value`.

use crate::row::{Kind, Need, ParamSpec, StructureSpec};
use crate::way::{NODES, TRAVERSAL, Way};
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
    /// Parses the part of a configuration string after the colon: `key=value,key=value`. A key that is not given has
    /// its default; if only `nodes` is given, the traversal is the first of these nodes. The registry parses whole
    /// strings.
    ///
    /// # Errors
    /// [`Error::Spec`] for an unknown key, a key given twice, a value out of its range, nodes and a traversal that
    /// exclude each other, or a value that has no effect with the others; the message names the key.
    pub fn read(structure: &'static StructureSpec, rest: &str) -> Result<Self> {
        let mut reader = Reader::new(structure);
        for pair in pairs(structure, rest) {
            let (key, text) = pair?;
            reader.set(key, text)?;
        }
        reader.finish()
    }

    /// Returns the structure's row in the registry.
    pub fn structure(&self) -> &'static StructureSpec {
        self.structure
    }

    /// Returns the shortest string of this configuration: only the values that differ from their defaults.
    pub fn canonical(&self) -> String {
        let mut text = self.structure.id.to_owned();
        // Compare the traversal with the default of the chosen nodes, other values with their own default.
        let default = self.default_traversal();
        let changed = self.values.iter().filter(|(p, v)| match default {
            Some(default) if p.name == TRAVERSAL => *v != Value::Choice(default),
            _ => p.default != *v,
        });
        for (i, (param, value)) in changed.enumerate() {
            let separator = if i == 0 { ':' } else { ',' };
            write!(text, "{separator}{}={value}", param.name).expect("writing to a string");
        }
        text
    }

    /// Returns the default traversal of the chosen nodes; `None` without a choice of nodes.
    fn default_traversal(&self) -> Option<&'static str> {
        let Some(Value::Choice(nodes)) = self.find(NODES) else {
            return None;
        };
        let first = self.structure.ways.iter().find(|way| way.nodes == *nodes);
        first.map(|way| way.traversal)
    }

    /// Returns the chosen nodes and traversal.
    pub fn way(&self) -> &'static Way {
        let chosen = |key: &str, default| match self.find(key) {
            Some(Value::Choice(name)) => *name,
            _ => default,
        };
        let ways = self.structure.ways;
        let nodes = chosen(NODES, ways[0].nodes);
        let traversal = chosen(TRAVERSAL, ways[0].traversal);
        let way = (ways.iter()).find(|way| way.nodes == nodes && way.traversal == traversal);
        way.expect("reading checks the pair")
    }

    /// Returns the value of a parameter; `None` when the structure's row declares no such parameter.
    pub fn find(&self, name: &str) -> Option<&Value> {
        (self.values.iter().find(|(p, _)| p.name == name)).map(|(_, value)| value)
    }

    /// Returns the value of a parameter that the structure's row declares.
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

    /// Returns the meaning of a parameter's option.
    ///
    /// # Panics
    /// When the structure's row declares no such parameter, or its option has no meaning here.
    pub fn pick<T, const N: usize>(&self, name: &str, meanings: [(&str, T); N]) -> T {
        let chosen = self.choice(name);
        let mut meanings = meanings.into_iter();
        let found = meanings.find(|(option, _)| *option == chosen);
        found
            .unwrap_or_else(|| panic!("{name}={chosen} has no meaning"))
            .1
    }

    /// Returns whether a switch is on.
    ///
    /// # Panics
    /// When the structure's row declares no such switch.
    pub fn on(&self, name: &str) -> bool {
        self.pick(name, [("0", false), ("1", true)])
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

/// Splits the part of a configuration string after the colon into keys and values; a part without `=` is an error.
pub fn pairs<'a>(
    structure: &StructureSpec,
    rest: &'a str,
) -> impl Iterator<Item = Result<(&'a str, &'a str)>> {
    let id = structure.id;
    let parts = rest.split(',').map(str::trim);
    parts.filter(|pair| !pair.is_empty()).map(move |pair| {
        let (key, text) = pair.split_once('=').ok_or_else(|| {
            Error::Spec(format!("spec: '{pair}' in '{id}' should read key=value"))
        })?;
        Ok((key.trim(), text.trim()))
    })
}

/// The state of parsing a configuration string.
struct Reader {
    structure: &'static StructureSpec,
    values: Vec<(&'static ParamSpec, Value)>,
    /// Whether each value was given.
    given: Vec<bool>,
}

impl Reader {
    /// Makes the state in which every parameter has its default.
    fn new(structure: &'static StructureSpec) -> Self {
        let values: Vec<_> = structure.all_params().map(|p| (p, p.default)).collect();
        Self {
            structure,
            given: vec![false; values.len()],
            values,
        }
    }

    /// Returns the index of a parameter.
    fn slot(&self, key: &str) -> Option<usize> {
        self.values.iter().position(|(p, _)| p.name == key)
    }

    /// Sets the value of one parameter.
    fn set(&mut self, key: &str, text: &str) -> Result<()> {
        let id = self.structure.id;
        // Find the parameter of this key.
        let slot = self.slot(key).ok_or_else(|| {
            let known: Vec<_> = self.values.iter().map(|(p, _)| p.name).collect();
            Error::Spec(format!(
                "spec: '{id}' has no key '{key}'; it has {}",
                known.join(", ")
            ))
        })?;
        // Reject a key that is given twice.
        if std::mem::replace(&mut self.given[slot], true) {
            return Err(Error::Spec(format!("spec: {key} is given twice in '{id}'")));
        }
        let slot = &mut self.values[slot];
        slot.1 = slot.0.parse(text)?;
        Ok(())
    }

    /// Returns the current option of a choice.
    fn chosen(&self, key: &str) -> Option<&'static str> {
        match self.values[self.slot(key)?].1 {
            Value::Choice(name) => Some(name),
            _ => None,
        }
    }

    /// Checks the values together, and returns the configuration.
    fn finish(mut self) -> Result<Config> {
        self.choose_way()?;
        self.check_needs()?;
        Ok(Config {
            structure: self.structure,
            values: self.values,
        })
    }

    /// Chooses the first traversal of the chosen nodes if none was given, and checks that the structure has this pair.
    fn choose_way(&mut self) -> Result<()> {
        let ways = self.structure.ways;
        let (Some(nodes), Some(at)) = (self.chosen(NODES), self.slot(TRAVERSAL)) else {
            return Ok(());
        };
        if !self.given[at] {
            let first = ways.iter().find(|way| way.nodes == nodes);
            let first = first.expect("each option of nodes has a way").traversal;
            self.values[at].1 = Value::Choice(first);
        }
        let traversal = self.chosen(TRAVERSAL).unwrap_or_default();
        if ways
            .iter()
            .any(|way| way.nodes == nodes && way.traversal == traversal)
        {
            return Ok(());
        }
        // Name the traversals of these nodes and the nodes of this traversal.
        let traversals: Vec<_> = (ways.iter().filter(|way| way.nodes == nodes))
            .map(|way| way.traversal)
            .collect();
        let others: Vec<_> = (ways.iter().filter(|way| way.traversal == traversal))
            .map(|way| way.nodes)
            .collect();
        Err(Error::Spec(format!(
            "spec: '{}' has no traversal={traversal} through nodes={nodes}; nodes={nodes} has {}, and \
             traversal={traversal} needs nodes={}",
            self.structure.id,
            traversals.join(", "),
            others.join("|")
        )))
    }

    /// Returns the first condition that does not hold, and the value of its parameter.
    fn unmet(&self, needs: &'static [Need]) -> Option<(&'static Need, &Value)> {
        needs.iter().find_map(|need| {
            let other = &self.values[self.slot(need.key)?].1;
            (!need.holds(other)).then_some((need, other))
        })
    }

    /// Checks that each value that was given and differs from the default can be chosen and has an effect.
    fn check_needs(&self) -> Result<()> {
        // Check only given values other than the default.
        for ((param, value), given) in self.values.iter().zip(&self.given) {
            if !given || param.default == *value {
                continue;
            }
            let (id, name) = (self.structure.id, param.name);
            if let Some((need, other)) = self.unmet(param.needs) {
                return Err(Error::Spec(format!(
                    "spec: {name}={value} has no effect in '{id}' with {}={other}; it needs {need}",
                    need.key
                )));
            }
            if let Some((need, other)) = self.unmet(param.kind.needs(value)) {
                return Err(Error::Spec(format!(
                    "spec: {name}={value} needs {need} in '{id}', got {}={other}",
                    need.key
                )));
            }
        }
        Ok(())
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
            Kind::Choice(_) => {
                let options = self.kind.options().unwrap_or_default();
                match options.iter().find(|option| **option == text) {
                    Some(option) => Ok(Value::Choice(option)),
                    None => Err(wrong(format!("one of {}", options.join(", ")))),
                }
            }
        }
    }

    /// Parses one value, and returns the nearest one of this parameter; the default for an unknown option.
    ///
    /// # Errors
    /// [`Error::Spec`] for text that is no number where one is expected.
    pub fn nearest(&self, text: &str) -> Result<Value> {
        let wrong = |what: &str| {
            Err(Error::Spec(format!(
                "spec: {}={text} is not {what}",
                self.name
            )))
        };
        match self.kind {
            Kind::Integer { min, max } => match text.parse::<i64>() {
                Ok(x) => Ok(Value::Integer(x.clamp(min, max))),
                Err(_) => wrong("a whole number"),
            },
            Kind::Float { min, max } => match text.parse::<f64>() {
                Ok(x) if !x.is_nan() => Ok(Value::Float(x.clamp(min, max))),
                _ => wrong("a number"),
            },
            Kind::Choice(_) => Ok(self.parse(text).unwrap_or(self.default)),
        }
    }
}
