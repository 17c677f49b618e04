// SPDX-License-Identifier: GPL-3.0-or-later
//! Lists that the compiler makes: tables of parameters and of ways, changed by name.

use halfspace_structure::row::{Need, ParamSpec};
use halfspace_structure::spec::Value;

/// Largest length of a list.
const MOST: usize = 32;

/// A list of constants. Its functions run at compile time; a name that the list lacks is an error of the compiler.
#[derive(Debug, Clone, Copy)]
pub struct List<T> {
    items: [T; MOST],
    len: usize,
}

impl<T: Copy> List<T> {
    /// Makes a list of these items.
    ///
    /// # Panics
    /// At compile time, for none or too many.
    pub const fn of(items: &[T]) -> Self {
        let list = Self {
            items: [items[0]; MOST],
            len: 0,
        };
        list.and(items)
    }

    /// Appends items.
    ///
    /// # Panics
    /// At compile time, for too many.
    pub const fn and(mut self, more: &[T]) -> Self {
        let mut i = 0;
        while i < more.len() {
            self.items[self.len] = more[i];
            self.len += 1;
            i += 1;
        }
        self
    }

    /// Returns the items.
    pub const fn slice(&self) -> &[T] {
        self.items.split_at(self.len).0
    }

    /// Inserts an item at an index.
    const fn insert(mut self, at: usize, item: T) -> Self {
        let mut i = self.len;
        while i > at {
            self.items[i] = self.items[i - 1];
            i -= 1;
        }
        self.items[at] = item;
        self.len += 1;
        self
    }
}

impl List<ParamSpec> {
    /// Returns the index of a parameter.
    const fn index(&self, name: &str) -> usize {
        let mut i = 0;
        while i < self.len {
            if equal(self.items[i].name, name) {
                return i;
            }
            i += 1;
        }
        panic!("the list has no parameter of this name")
    }

    /// Removes a parameter.
    pub const fn without(mut self, name: &str) -> Self {
        let mut i = self.index(name);
        self.len -= 1;
        while i < self.len {
            self.items[i] = self.items[i + 1];
            i += 1;
        }
        self
    }

    /// Replaces a parameter.
    pub const fn replace(mut self, name: &str, with: ParamSpec) -> Self {
        self.items[self.index(name)] = with;
        self
    }

    /// Inserts a parameter after another one.
    pub const fn insert_after(self, name: &str, param: ParamSpec) -> Self {
        let at = self.index(name) + 1;
        self.insert(at, param)
    }

    /// Changes the conditions of a parameter.
    pub const fn with_needs(self, name: &str, needs: &'static [Need]) -> Self {
        let param = self.items[self.index(name)];
        self.replace(name, param.needing(needs))
    }

    /// Changes the default of a parameter.
    pub const fn with_default(self, name: &str, default: Value) -> Self {
        let param = self.items[self.index(name)];
        self.replace(name, ParamSpec { default, ..param })
    }
}

/// Returns whether two names are equal, at compile time.
pub const fn equal(a: &str, b: &str) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{LEAF_SIZE, MAX_DEPTH, ROBUST};

    fn names(list: &List<ParamSpec>) -> Vec<&'static str> {
        list.slice().iter().map(|param| param.name).collect()
    }

    #[test]
    fn lists_are_changed_by_name() {
        const ALL: List<ParamSpec> = List::of(&[LEAF_SIZE, MAX_DEPTH]);
        assert_eq!(names(&ALL.without("leaf_size")), ["max_depth"]);
        assert_eq!(
            names(&ALL.replace("leaf_size", ROBUST)),
            ["robust", "max_depth"]
        );
        assert_eq!(
            names(&ALL.insert_after("leaf_size", ROBUST)),
            ["leaf_size", "robust", "max_depth"]
        );
        assert_eq!(
            names(&ALL.insert_after("max_depth", ROBUST).without("max_depth")),
            ["leaf_size", "robust"]
        );
        let other = ALL.with_default("max_depth", Value::Integer(7));
        assert_eq!(other.slice()[1].default, Value::Integer(7));
        assert_eq!(other.slice()[0], LEAF_SIZE);
    }

    #[test]
    #[should_panic(expected = "no parameter of this name")]
    fn an_unknown_name_is_an_error() {
        let _ = List::of(&[LEAF_SIZE]).without("colour");
    }
}
