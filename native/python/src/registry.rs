// SPDX-License-Identifier: GPL-3.0-or-later
//! The registry as dictionaries for Python.

use crate::errors::raise;
use halfspace_structure::row::{Kind, Need, Only, ParamSpec, StructureSpec};
use halfspace_structure::spec::Value;
use halfspace_structure::way::Way;
use halfspace_trees::registry::{TREES, aliases, effective};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Sets a key to the value of a parameter.
fn set_value(dict: &Bound<'_, PyDict>, key: &str, value: &Value) -> PyResult<()> {
    match value {
        Value::Integer(x) => dict.set_item(key, x),
        Value::Float(x) => dict.set_item(key, x),
        Value::Choice(x) => dict.set_item(key, x),
    }
}

/// Converts a parameter; absent limits and options are None.
fn parameter<'py>(py: Python<'py>, param: &ParamSpec) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("name", param.name)?;
    dict.set_item("label", param.label)?;
    dict.set_item("doc", param.full_doc())?;
    dict.set_item("unit", param.unit)?;
    set_value(&dict, "default", &param.default)?;
    for key in ["min", "max", "options", "labels"] {
        dict.set_item(key, py.None())?;
    }
    match param.kind {
        Kind::Integer { min, max } => {
            dict.set_item("kind", "integer")?;
            dict.set_item("min", min)?;
            dict.set_item("max", max)?;
        }
        Kind::Float { min, max } => {
            dict.set_item("kind", "float")?;
            dict.set_item("min", min)?;
            dict.set_item("max", max)?;
        }
        Kind::Choice(options) => {
            dict.set_item("kind", "choice")?;
            dict.set_item("options", param.kind.options())?;
            let labels: Vec<_> = options.iter().map(|option| option.label).collect();
            dict.set_item("labels", labels)?;
        }
    }
    dict.set_item("group", param.group.name())?;
    dict.set_item("needs", needs(py, param.needs)?)?;
    let of_options = PyDict::new(py);
    if let Kind::Choice(options) = param.kind {
        for option in options.iter().filter(|option| !option.needs.is_empty()) {
            of_options.set_item(option.name, needs(py, option.needs)?)?;
        }
    }
    dict.set_item("option_needs", of_options)?;
    Ok(dict)
}

/// Converts conditions.
fn needs<'py>(py: Python<'py>, needs: &[Need]) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for condition in needs {
        list.append(need(py, condition)?)?;
    }
    Ok(list)
}

/// Converts a condition: the key of another parameter, and its values under which the parameter has an effect, as a list
/// of options or as a number that it exceeds; the other of the two is None.
fn need<'py>(py: Python<'py>, need: &Need) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("key", need.key)?;
    let (options, above) = match need.only {
        Only::Options(options) => (Some(options.to_vec()), None),
        Only::Above(least) => (None, Some(least)),
    };
    dict.set_item("options", options)?;
    dict.set_item("above", above)?;
    Ok(dict)
}

/// Converts a way of tracing.
fn way<'py>(py: Python<'py>, way: &Way) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("nodes", way.nodes)?;
    dict.set_item("traversal", way.traversal)?;
    dict.set_item("rays", way.rays.name())?;
    dict.set_item("label", way.label)?;
    dict.set_item("doc", way.doc)?;
    Ok(dict)
}

/// Converts a structure.
fn row<'py>(py: Python<'py>, spec: &StructureSpec) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("id", spec.id)?;
    let others = PyDict::new(py);
    for alias in aliases(spec.id) {
        others.set_item(alias.name, alias.given)?;
    }
    dict.set_item("aliases", others)?;
    dict.set_item("code", spec.code)?;
    dict.set_item("label", spec.label)?;
    dict.set_item("family", spec.family.name())?;
    dict.set_item("heading", spec.family.label())?;
    dict.set_item("menu", spec.menu.title())?;
    dict.set_item("summary", spec.summary)?;
    dict.set_item("paper", spec.paper)?;
    let parameters = PyList::empty(py);
    for param in spec.all_params() {
        parameters.append(parameter(py, param)?)?;
    }
    dict.set_item("parameters", parameters)?;
    dict.set_item("traversals", spec.traversals())?;
    let ways = PyList::empty(py);
    for one in spec.ways {
        ways.append(way(py, one)?)?;
    }
    dict.set_item("ways", ways)?;
    dict.set_item("no_groups", spec.no_groups)?;
    let named = spec.literature.iter().map(|(name, parameters)| {
        let separator = if parameters.is_empty() { "" } else { ":" };
        (*name, format!("{}{separator}{parameters}", spec.id))
    });
    dict.set_item("literature", named.collect::<Vec<_>>())?;
    dict.set_item("sweep", spec.sweep)?;
    dict.set_item("claims", spec.claims.to_vec())?;
    Ok(dict)
}

/// The registry: every structure and its parameters, in display order.
#[pyfunction]
fn structures(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for spec in TREES {
        list.append(row(py, spec)?)?;
    }
    Ok(list)
}

/// Each parameter of a configuration's structure with its effective value, or None where it has no effect.
///
/// The configuration may contradict itself: a value out of its range becomes the nearest, an option that the other
/// values exclude becomes the default. SpecError for an unknown structure or parameter, or text that is no number.
#[pyfunction(name = "effective")]
fn effective_values<'py>(py: Python<'py>, spec: &str) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for one in effective(spec).map_err(raise)? {
        match one.value {
            Some(value) => set_value(&dict, one.param.name, &value)?,
            None => dict.set_item(one.param.name, py.None())?,
        }
    }
    Ok(dict)
}

/// The options of each choice that are valid with the other values, which may contradict each other. SpecError.
#[pyfunction]
fn options<'py>(py: Python<'py>, spec: &str) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let params = effective(spec).map_err(raise)?;
    for one in params
        .iter()
        .filter(|one| one.param.kind.options().is_some())
    {
        dict.set_item(one.param.name, &one.options)?;
    }
    Ok(dict)
}

/// The given values that have no effect with the others: name, and name of the parameter that prevents it.
///
/// SpecError as for effective().
#[pyfunction]
fn idle(spec: &str) -> PyResult<Vec<(&'static str, &'static str)>> {
    let params = effective(spec).map_err(raise)?;
    let idle = params
        .iter()
        .filter_map(|one| Some((one.param.name, one.unmet?.key)));
    Ok(idle.collect())
}

/// Adds the registry to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(effective_values, module)?)?;
    module.add_function(wrap_pyfunction!(options, module)?)?;
    module.add_function(wrap_pyfunction!(idle, module)?)?;
    module.add_function(wrap_pyfunction!(structures, module)?)
}
