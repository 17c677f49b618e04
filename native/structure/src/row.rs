// SPDX-License-Identifier: GPL-3.0-or-later
//! The types of the registry's rows: a structure, its parameters, and what its build returns.

use crate::plan::Plan;
use crate::spec::{Config, Value};
use crate::way::{NODES, TRAVERSAL, Way};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::Tree;
use halfspace_nodes::lazy_tree::Progress;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::fmt::{self, Debug};
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
    /// Kind of division of its nodes.
    pub family: Family,
    /// One sentence.
    pub summary: &'static str,
    /// The publication that it follows.
    pub paper: &'static str,
    /// Its own parameters, without those of all structures; see [`Self::all_params`].
    pub params: &'static [ParamSpec],
    /// All valid pairs of nodes and traversal; the first is the default.
    pub ways: &'static [Way],
    /// Why neither packets nor tiles nor streams go through its nodes; empty where all of them do.
    pub no_groups: &'static str,
    /// Menu of the names in [`Self::literature`].
    pub menu: Menu,
    /// Names in the literature, each with the parameters of that configuration, as [`crate::spec::Config::read`] takes
    /// them.
    pub literature: &'static [(&'static str, &'static str)],
    /// Whether split directions are selected anew at every node: the trees of the thesis, `bsp-sweep` in lists.
    pub sweep: bool,
    /// Ids of the published claims about it; a `*` at the end includes all ids that begin so.
    pub claims: &'static [&'static str],
    /// Builds it over the live triangles, in the current rayon pool.
    pub build: fn(&Triangles, &Config, &Monitor) -> Result<Built>,
}

/// Kind of division of the nodes of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Space.
    Space,
    /// The triangles.
    Objects,
    /// Space, into eight equal octants.
    Octants,
    /// Nothing: brute force, which all others must equal.
    Oracle,
}

impl Family {
    /// Returns the name in registries and lists of configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Space => "space",
            Self::Objects => "objects",
            Self::Octants => "octants",
            Self::Oracle => "oracle",
        }
    }

    /// Returns the heading in user interfaces and documents.
    pub fn label(self) -> &'static str {
        match self {
            Self::Space => "Spatial subdivisions",
            Self::Objects => "Object hierarchies",
            Self::Octants => "Octrees",
            Self::Oracle => "Reference",
        }
    }
}

/// Menus of names in the literature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Menu {
    /// Kd-trees.
    Kd,
    /// Trees with oblique planes.
    Bsp,
    /// Hierarchies of intervals.
    Intervals,
    /// Hierarchies of boxes.
    Boxes,
    /// Octrees.
    Octrees,
    /// All others.
    Others,
}

impl Menu {
    /// Returns the title.
    pub fn title(self) -> &'static str {
        match self {
            Self::Kd => "Kd-Trees",
            Self::Bsp => "BSP and RBSP",
            Self::Intervals => "Interval Hierarchies",
            Self::Boxes => "Hierarchies of Boxes",
            Self::Octrees => "Octrees",
            Self::Others => "Others",
        }
    }
}

/// A tree that rays build where they reach it.
pub trait Growing: Debug + Send + Sync {
    /// Returns the progress of the build.
    fn progress(&self) -> Progress;

    /// Returns the features that the built part did not need, each with its reason.
    fn left_out(&self) -> Vec<String>;

    /// Builds the rest, and copies the whole tree to one piece.
    fn whole(&self, scene: &Triangles, frame: &Frame) -> Built;
}

/// A second layout, made from the tree for kernels that need one; its leaves are those of the tree.
#[derive(Debug, Clone)]
pub struct Derived {
    /// The nodes or links.
    pub tree: Arc<dyn Tree>,
}

/// A tree whose nodes can be fitted to moved triangles.
pub trait Refit: Debug + Send + Sync {
    /// Fits the nodes and writes the leaves of the same triangles at other places, in the current rayon pool.
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Refit`] if a triangle that the tree does not hold can be hit now;
    /// [`halfspace_base::error::Error::Cancelled`].
    fn refit(&self, scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built>;

    /// Returns the bytes that it keeps in addition to those of the tree.
    fn bytes(&self) -> usize;
}

/// Result of a build function.
#[derive(Debug)]
pub struct Built {
    /// The frame of its coordinates.
    pub frame: Frame,
    /// The tree; `None` for brute force.
    pub tree: Option<Arc<dyn Tree>>,
    /// The triangles of its leaves.
    pub leaves: Arc<Blocks>,
    /// Further layouts that were made from the tree.
    pub derived: Vec<Derived>,
    /// The kernel of each kind of batch.
    pub plan: Plan,
    /// Statistics of its shape.
    pub shape: Shape,
    /// Features that this scene did not need, each with its reason; empty if rays build the tree.
    pub left_out: Vec<String>,
    /// The tree that rays build, if they do.
    pub growing: Option<Arc<dyn Growing>>,
    /// Fits the tree to moved triangles, where its kind allows that.
    pub refit: Option<Arc<dyn Refit>>,
}

impl Built {
    /// Returns whether both have the same nodes, bit for bit.
    pub fn same_nodes(&self, other: &Self) -> bool {
        match (&self.tree, &other.tree) {
            (Some(one), Some(other)) => one.same(&**other),
            (None, None) => true,
            _ => false,
        }
    }

    /// Returns the bytes of nodes and leaves, derived layouts included.
    pub fn bytes(&self) -> usize {
        let derived = self.derived.iter().map(|derived| derived.tree.bytes());
        let nodes = match &self.growing {
            Some(growing) => growing.progress().bytes,
            None => self.tree.as_ref().map_or(0, |tree| tree.bytes()),
        };
        let refit = self.refit.as_ref().map_or(0, |refit| refit.bytes());
        nodes + self.leaves.bytes() + derived.sum::<usize>() + refit
    }
}

/// A parameter of a structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParamSpec {
    /// Key in configuration strings.
    pub name: &'static str,
    /// Name in user interfaces.
    pub label: &'static str,
    /// Effect, and cost of a larger value; see [`Self::full_doc`].
    pub doc: &'static str,
    /// Unit, empty for none.
    pub unit: &'static str,
    /// Type and range.
    pub kind: Kind,
    /// Value if none is given.
    pub default: Value,
    /// Part of a panel that shows it.
    pub group: Group,
    /// Conditions under which it has an effect: all must hold.
    pub needs: &'static [Need],
}

/// Parts of a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// The most important parameters; always open.
    Main,
    /// How the tree is built.
    Builder,
    /// Constants of the cost model.
    Costs,
    /// Rounding, and what leaves store.
    Numerics,
}

impl Group {
    /// Returns the name in registries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Main => "main",
            Self::Builder => "builder",
            Self::Costs => "costs",
            Self::Numerics => "numerics",
        }
    }
}

/// A condition on another parameter of the same structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Need {
    /// The other parameter.
    pub key: &'static str,
    /// Its values under which the condition holds.
    pub only: Only,
}

/// A set of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Only {
    /// These options of a choice.
    Options(&'static [&'static str]),
    /// Numbers above this one.
    Above(f64),
}

impl Need {
    /// Returns whether the condition holds for a value of the other parameter.
    pub fn holds(&self, value: &Value) -> bool {
        match (self.only, value) {
            (Only::Options(options), Value::Choice(x)) => options.contains(x),
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            (Only::Above(least), Value::Integer(x)) => *x as f64 > least,
            (Only::Above(least), Value::Float(x)) => *x > least,
            _ => false,
        }
    }
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.only {
            Only::Options(options) => write!(f, "{}={}", self.key, options.join("|")),
            Only::Above(least) => write!(f, "{} above {least}", self.key),
        }
    }
}

/// An option of a choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Named {
    /// Value in configuration strings.
    pub name: &'static str,
    /// Name in user interfaces.
    pub label: &'static str,
    /// One clause for the documentation; empty if the parameter's text describes it.
    pub doc: &'static str,
    /// Conditions under which it can be chosen: all must hold.
    pub needs: &'static [Need],
}

/// Makes an option that its parameter's text describes.
pub const fn named(name: &'static str, label: &'static str) -> Named {
    Named {
        name,
        label,
        doc: "",
        needs: &[],
    }
}

/// A switch that is off by default.
pub const OFF_ON: Kind = Kind::Choice(&[named("0", "Off"), named("1", "On")]);

/// A switch that is on by default.
pub const ON_OFF: Kind = Kind::Choice(&[named("1", "On"), named("0", "Off")]);

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
    /// One of these options.
    Choice(&'static [Named]),
}

impl Kind {
    /// Returns the conditions under which a value can be chosen.
    pub fn needs(&self, value: &Value) -> &'static [Need] {
        match (self, value) {
            (Self::Choice(options), Value::Choice(name)) => (options.iter())
                .find(|option| option.name == *name)
                .map_or(&[], |option| option.needs),
            _ => &[],
        }
    }

    /// Returns the names of the options of a choice; `None` for a number.
    pub fn options(&self) -> Option<Vec<&'static str>> {
        match self {
            Self::Choice(options) => Some(options.iter().map(|option| option.name).collect()),
            _ => None,
        }
    }
}

impl ParamSpec {
    /// Returns the description, followed by the clauses of the options.
    pub fn full_doc(&self) -> String {
        let Kind::Choice(options) = self.kind else {
            return self.doc.to_owned();
        };
        let described: Vec<_> = (options.iter().filter(|option| !option.doc.is_empty()))
            .map(|option| format!("{}: {}", option.name, option.doc))
            .collect();
        if described.is_empty() {
            return self.doc.to_owned();
        }
        format!(
            "{}. {}. The answers are the same",
            self.doc,
            described.join("; ")
        )
    }

    /// Returns the same parameter with these conditions.
    pub const fn needing(self, needs: &'static [Need]) -> Self {
        Self { needs, ..self }
    }
}

impl StructureSpec {
    /// Returns its own parameters, then those of all structures that it does not redefine.
    pub fn all_params(&self) -> impl Iterator<Item = &'static ParamSpec> + use<> {
        let own = self.params;
        let divided = matches!(self.family, Family::Space | Family::Octants);
        let common = if own.iter().any(|param| param.name == NODES) {
            COMMON_NODES
        } else if divided {
            COMMON_SPACE
        } else {
            COMMON
        };
        let common = (common.iter()).filter(move |c| own.iter().all(|p| p.name != c.name));
        own.iter().chain(common)
    }

    /// Returns the traversals of its default nodes, the default first; empty if the structure has only one.
    pub fn traversals(&self) -> Vec<&'static str> {
        let own = self.ways[0].nodes;
        (self.ways.iter())
            .filter(|way| way.nodes == own && !way.traversal.is_empty())
            .map(|way| way.traversal)
            .collect()
    }

    /// Returns the part of a configuration string that chooses a way; empty for the default.
    pub fn spelled(&self, way: &Way) -> String {
        let usual = &self.ways[0];
        let choices = [
            (NODES, way.nodes, usual.nodes),
            (TRAVERSAL, way.traversal, usual.traversal),
        ];
        let changed = choices.iter().filter(|(_, value, usual)| value != usual);
        let parts: Vec<_> = changed
            .map(|(key, value, _)| format!("{key}={value}"))
            .collect();
        parts.join(",")
    }

    /// Returns configuration strings for all ways, the default first.
    pub fn spelled_ways(&self) -> Vec<String> {
        let spelled = self.ways.iter().map(|way| self.spelled(way));
        let whole = spelled.map(|part| {
            let separator = if part.is_empty() { "" } else { ":" };
            format!("{}{separator}{part}", self.id)
        });
        whole.collect()
    }
}

/// The parameter `shadow` of structures without beams.
pub const SHADOW: ParamSpec = ParamSpec {
    name: "shadow",
    label: "Shadow Rays",
    doc: "cache: the triangle that blocked a light last is tested first (Wilt 1994), by tiles and packets the leaf \
          that blocked the last one. Saves time where shadows are large, and costs a test where they end. The answer is the same",
    unit: "",
    kind: Kind::Choice(&[
        named("none", "As Other Rays"),
        named("cache", "Blocker First"),
    ]),
    default: Value::Choice("none"),
    group: Group::Main,
    needs: &[],
};

/// [`SHADOW`] of structures with beams: trees that divide space.
pub const SHADOW_BEAM: ParamSpec = ParamSpec {
    doc: "cache: the triangle that blocked a light last is tested first (Wilt 1994), by tiles and packets the leaf \
          that blocked the last one. beam: rays to one light go \
          through the tree together; mostly one traversal shows that nothing blocks any of 64. On trees \
          of planes that saves traversals, but is still slower than single rays. \
          The answer is the same",
    kind: Kind::Choice(&[
        named("none", "As Other Rays"),
        named("cache", "Blocker First"),
        named("beam", "Beams"),
    ]),
    ..SHADOW
};

/// [`SHADOW`] of trees with a choice of nodes, whose beams need the planes.
const SHADOW_NODES: ParamSpec = ParamSpec {
    kind: Kind::Choice(&[
        named("none", "As Other Rays"),
        named("cache", "Blocker First"),
        Named {
            needs: &[Need {
                key: NODES,
                only: Only::Options(&["planes"]),
            }],
            ..named("beam", "Beams")
        },
    ]),
    ..SHADOW_BEAM
};

/// Parameters of every structure, unless its row has one of the same name.
pub const COMMON: &[ParamSpec] = &[SHADOW];

/// [`COMMON`] of structures that divide space.
const COMMON_SPACE: &[ParamSpec] = &[SHADOW_BEAM];

/// [`COMMON`] of trees with a choice of nodes.
const COMMON_NODES: &[ParamSpec] = &[SHADOW_NODES];
