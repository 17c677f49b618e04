// SPDX-License-Identifier: GPL-3.0-or-later
//! The types of the registry's rows: a structure, its parameters, and what its build returns.

use crate::plan::Plan;
use crate::spec::{Config, Value};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::Tree;
use halfspace_nodes::lazy_tree::Progress;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::fmt::Debug;
use std::sync::Arc;

/// A structure's row.
#[derive(Debug)]
pub struct StructureSpec {
    /// Stable name: lower case, digits, hyphen.
    pub id: &'static str,
    /// Stable number, saved in .blend files; never reused.
    pub code: i32,
    /// Name in user interfaces.
    pub label: &'static str,
    /// What is divided: "space", "objects", "octants", or "oracle" for nothing.
    pub family: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// The source.
    pub paper: &'static str,
    /// Its own parameters; see [`Self::all_params`].
    pub params: &'static [ParamSpec],
    /// Builds it over the live triangles, in the current rayon pool.
    pub build: fn(&Triangles, &Config, &Monitor) -> Result<Built>,
}

/// A tree that is built as far as rays reach.
pub trait Growing: Debug + Send + Sync {
    /// How far it is built.
    fn progress(&self) -> Progress;

    /// Builds the rest and lays the whole tree out in one piece.
    fn whole(&self, scene: &Triangles, frame: &Frame, left_out: &[String]) -> Built;
}

/// Nodes that were made from the tree, for kernels that do not run on the tree itself.
#[derive(Debug, Clone)]
pub struct Derived {
    /// The nodes.
    pub tree: Arc<dyn Tree>,
    /// Their leaves, where those are not the leaves of the tree.
    pub leaves: Option<Arc<Blocks>>,
    /// Whether single rays traverse these nodes in place of the tree's.
    pub single: bool,
}

/// What a build function returns.
#[derive(Debug)]
pub struct Built {
    /// The frame of its coordinates.
    pub frame: Frame,
    /// The tree; `None` for brute force.
    pub tree: Option<Arc<dyn Tree>>,
    /// The triangles of its leaves.
    pub leaves: Arc<Blocks>,
    /// Nodes that were made from the tree.
    pub derived: Vec<Derived>,
    /// Which kernel answers which rays.
    pub plan: Plan,
    /// Statistics of its shape.
    pub shape: Shape,
    /// What this scene did not need, each with its reason.
    pub left_out: Vec<String>,
    /// The part that rays have not built yet, if they build it.
    pub growing: Option<Arc<dyn Growing>>,
}

impl Built {
    /// The tree that single rays traverse, and its leaves.
    pub fn traversed(&self) -> (Option<&dyn Tree>, &Blocks) {
        match self.derived.iter().find(|derived| derived.single) {
            Some(derived) => (
                Some(&*derived.tree),
                derived.leaves.as_deref().unwrap_or(&self.leaves),
            ),
            None => (self.tree.as_deref(), &self.leaves),
        }
    }

    /// Whether both have the same nodes, bit for bit.
    pub fn same_nodes(&self, other: &Self) -> bool {
        match (&self.tree, &other.tree) {
            (Some(one), Some(other)) => one.same(&**other),
            (None, None) => true,
            _ => false,
        }
    }

    /// Bytes of nodes and leaves, those of derived nodes included.
    pub fn bytes(&self) -> usize {
        let derived = self.derived.iter().map(|derived| {
            derived.tree.bytes() + derived.leaves.as_ref().map_or(0, |leaves| leaves.bytes())
        });
        let nodes = match &self.growing {
            Some(growing) => growing.progress().bytes,
            None => self.tree.as_ref().map_or(0, |tree| tree.bytes()),
        };
        nodes + self.leaves.bytes() + derived.sum::<usize>()
    }
}

/// A parameter of a structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParamSpec {
    /// Key in configuration strings.
    pub name: &'static str,
    /// Name in user interfaces.
    pub label: &'static str,
    /// What it does, and what more of it costs; see [`Self::full_doc`].
    pub doc: &'static str,
    /// Unit, empty for none.
    pub unit: &'static str,
    /// Type and range.
    pub kind: Kind,
    /// Value where none is given.
    pub default: Value,
}

/// Type and range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A whole number in a closed range.
    Integer {
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
    },
    /// A real number in a closed range.
    Float {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// One of these names.
    Choice(&'static [&'static str]),
    /// One of these names, each with its description: the rows of a table of traversals.
    Described(&'static [(&'static str, &'static str)]),
}

impl Kind {
    /// The names of a choice; `None` for a number.
    pub fn options(&self) -> Option<Vec<&'static str>> {
        match self {
            Self::Choice(names) => Some(names.to_vec()),
            Self::Described(rows) => Some(rows.iter().map(|(name, _)| *name).collect()),
            _ => None,
        }
    }
}

impl ParamSpec {
    /// The description with a clause for each described option.
    pub fn full_doc(&self) -> String {
        let Kind::Described(rows) = self.kind else {
            return self.doc.to_owned();
        };
        let rows: Vec<_> = rows
            .iter()
            .map(|(name, doc)| format!("{name}: {doc}"))
            .collect();
        format!(
            "{}. {}. The answers are the same",
            self.doc,
            rows.join("; ")
        )
    }
}

impl StructureSpec {
    /// Its parameters, and those that all structures have.
    pub fn all_params(&self) -> impl Iterator<Item = &'static ParamSpec> + use<> {
        let own = self.params;
        let space = matches!(self.family, "space" | "octants");
        let common = if space { COMMON_SPACE } else { COMMON }
            .iter()
            .filter(move |c| own.iter().all(|p| p.name != c.name));
        own.iter().chain(common)
    }

    /// The traversals that it offers, the default first.
    pub fn traversals(&self) -> Vec<&'static str> {
        let traversal = self.params.iter().find(|p| p.name == "traversal");
        traversal.and_then(|p| p.kind.options()).unwrap_or_default()
    }
}

/// The shadow cache.
pub const SHADOW: ParamSpec = ParamSpec {
    name: "shadow",
    label: "Shadow Rays",
    doc: "cache: the triangle that blocked a light last is tested first (Wilt 1994). Saves time where shadows are large, \
          and costs a test where they end. The answer is the same",
    unit: "",
    kind: Kind::Choice(&["none", "cache"]),
    default: Value::Choice("none"),
};

/// The same for trees that divide space, which offer beams too.
pub const SHADOW_BEAM: ParamSpec = ParamSpec {
    doc: "cache: the triangle that blocked a light last is tested first (Wilt 1994). beam: rays to one light go \
          through the tree together; mostly one traversal shows that nothing blocks any of 64. On trees \
          of planes that saves traversals, but is still slower than single rays. \
          The answer is the same",
    kind: Kind::Choice(&["none", "cache", "beam"]),
    ..SHADOW
};

/// Parameters that every structure has, unless its row has one of the same name.
pub const COMMON: &[ParamSpec] = &[SHADOW];

/// The same for structures that divide space.
const COMMON_SPACE: &[ParamSpec] = &[SHADOW_BEAM];
