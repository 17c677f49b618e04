// SPDX-License-Identifier: GPL-3.0-or-later
//! Tables of traversals: one per family of trees. A row has the name of a traversal, its description, and the function
//! that makes its plan. The choices of the parameter `traversal`, its documentation and the contract tests read the
//! rows, so a traversal that is not in a table does not exist.

use halfspace_structure::row::{Kind, ParamSpec};
use halfspace_structure::spec::{Config, Value};

/// A row: a way to send rays through a tree. `F` is the function that makes its plan.
#[derive(Debug)]
pub struct Traversal<F> {
    /// Value of the parameter `traversal`.
    pub name: &'static str,
    /// One clause for its documentation.
    pub doc: &'static str,
    /// Makes the kernels. May derive further nodes from the tree.
    pub plan: F,
}

/// Name and description of each row that a structure offers, in the order in which it offers them.
///
/// # Panics
/// At compile time, for a name that the table does not have.
pub const fn offer<F, const N: usize, const M: usize>(
    table: &[Traversal<F>; M],
    names: [&str; N],
) -> [(&'static str, &'static str); N] {
    let mut rows = [("", ""); N];
    let mut i = 0;
    while i < N {
        let mut k = 0;
        while !equal(table[k].name, names[i]) {
            k += 1;
        }
        rows[i] = (table[k].name, table[k].doc);
        i += 1;
    }
    rows
}

const fn equal(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// The parameter of a structure that offers these rows, the default first.
pub const fn parameter(rows: &'static [(&'static str, &'static str)]) -> ParamSpec {
    ParamSpec {
        name: "traversal",
        label: "Traversal",
        doc: "How rays traverse the tree",
        unit: "",
        kind: Kind::Described(rows),
        default: Value::Choice(rows[0].0),
    }
}

/// The row that a configuration chooses; the first of the table for a structure without the parameter.
///
/// # Panics
/// For a name that is not in the table, which [`offer`] excludes.
pub fn chosen<'a, F>(table: &'a [Traversal<F>], config: &Config) -> &'a Traversal<F> {
    match config.find("traversal") {
        Some(Value::Choice(name)) => (table.iter().find(|row| row.name == *name))
            .unwrap_or_else(|| panic!("no row of the table is named {name}")),
        _ => &table[0],
    }
}
