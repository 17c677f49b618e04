// SPDX-License-Identifier: GPL-3.0-or-later
//! Effective values: which parameters of a configuration have an effect, and which options are valid with the others.
//!
//! Here a configuration may contradict itself, as the settings of a user interface do that keep values for later:
//! [`Config::read`](crate::spec::Config::read) rejects what this replaces or ignores.

use crate::row::{Group, Kind, Need, ParamSpec, StructureSpec};
use crate::spec::{Value, pairs};
use crate::way::{NODES, TRAVERSAL};
use halfspace_base::error::{Error, Result};

/// A parameter of a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Effective {
    /// Its row.
    pub param: &'static ParamSpec,
    /// A valid value: the given one, or the nearest, or the default; `None` where the parameter has no effect.
    pub value: Option<Value>,
    /// The options of a choice that are valid with the other values; empty for a number.
    pub options: Vec<&'static str>,
    /// The condition because of which a given value has no effect, if it is not the default.
    pub unmet: Option<&'static Need>,
}

/// Returns each parameter of a structure with its effective value. `rest` is the part of a configuration string after
/// the colon.
///
/// # Errors
/// [`Error::Spec`] for an unknown key, or text that is no number where one is expected.
pub fn effective(structure: &'static StructureSpec, rest: &str) -> Result<Vec<Effective>> {
    let mut values = Values::new(structure);
    for pair in pairs(structure, rest) {
        let (key, text) = pair?;
        values.set(key, text)?;
    }
    let given = values.values.iter();
    let unmet: Vec<_> = given
        .map(|(param, value)| values.unmet(param, value))
        .collect();
    values.settle();
    let params = values.values.iter().zip(unmet);
    let params = params.map(|(&(param, value), unmet)| Effective {
        param,
        value: values.hold(param.needs).then_some(value),
        options: values.options(param),
        unmet,
    });
    Ok(params.collect())
}

/// A value for each parameter of a structure.
struct Values {
    structure: &'static StructureSpec,
    values: Vec<(&'static ParamSpec, Value)>,
}

impl Values {
    /// Makes the defaults.
    fn new(structure: &'static StructureSpec) -> Self {
        let values = structure.all_params().map(|p| (p, p.default)).collect();
        Self { structure, values }
    }

    /// Returns the value of a parameter; `None` if the structure has no such parameter.
    fn find(&self, key: &str) -> Option<&Value> {
        (self.values.iter().find(|(p, _)| p.name == key)).map(|(_, value)| value)
    }

    /// Sets the nearest valid value to a given one.
    fn set(&mut self, key: &str, text: &str) -> Result<()> {
        let slot = self.values.iter_mut().find(|(p, _)| p.name == key);
        let (param, value) = slot.ok_or_else(|| {
            let id = self.structure.id;
            Error::Spec(format!("spec: '{id}' has no key '{key}'"))
        })?;
        *value = param.nearest(text)?;
        Ok(())
    }

    /// Replaces each option that is not valid with the other values.
    fn settle(&mut self) {
        for i in 0..self.values.len() {
            let (param, value) = self.values[i];
            let options = self.options(param);
            let Value::Choice(chosen) = value else {
                continue;
            };
            if options.contains(&chosen) {
                continue;
            }
            let usual = match param.default {
                Value::Choice(name) if options.contains(&name) => name,
                _ => options[0],
            };
            self.values[i].1 = Value::Choice(usual);
        }
    }

    /// Returns the first condition of a value that does not hold; none for a default.
    fn unmet(&self, param: &ParamSpec, value: &Value) -> Option<&'static Need> {
        let mut needs = param.needs.iter().chain(param.kind.needs(value));
        let first = needs.find(|need| !self.holds(need));
        first.filter(|_| *value != param.default)
    }

    /// Returns whether a condition holds; one on a parameter that the structure lacks does.
    fn holds(&self, need: &Need) -> bool {
        (self.find(need.key)).is_none_or(|value| need.holds(value))
    }

    /// Returns whether all conditions hold.
    fn hold(&self, needs: &[Need]) -> bool {
        needs.iter().all(|need| self.holds(need))
    }

    /// Returns the options of a choice that are valid with the other values.
    fn options(&self, param: &ParamSpec) -> Vec<&'static str> {
        let Kind::Choice(options) = param.kind else {
            return Vec::new();
        };
        let offered = options.iter().filter(|option| self.hold(option.needs));
        let offered = offered.map(|option| option.name);
        if param.name == TRAVERSAL {
            offered.filter(|name| self.has_traversal(name)).collect()
        } else {
            offered.collect()
        }
    }

    /// Returns whether the chosen nodes have a traversal, and the other values permit it.
    fn has_traversal(&self, name: &'static str) -> bool {
        let nodes = self.find(NODES);
        let of_nodes = self.structure.ways.iter().any(|way| {
            way.traversal == name && nodes.is_none_or(|nodes| *nodes == Value::Choice(way.nodes))
        });
        // A value of the main group that is not the default, such as a width of nodes, restricts the traversals.
        let main = self.values.iter().filter(|(p, _)| p.group == Group::Main);
        let given = main.filter(|(p, value)| *value != p.default);
        let mut needs = given.flat_map(|(p, _)| p.needs);
        of_nodes && needs.all(|need| need.key != TRAVERSAL || need.holds(&Value::Choice(name)))
    }
}
