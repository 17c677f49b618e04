// SPDX-License-Identifier: GPL-3.0-or-later
//! The only list of structures. User interface, command line, tests, benchmark and documentation
//! read these rows; a new structure is one file in `trees` and one row here.

use crate::build::Monitor;
use crate::build::shape::Shape;
use crate::error::Result;
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;
use crate::trees;

/// All structures, in the order in which lists show them.
pub const TREES: &[StructureSpec] = &[
    trees::kd::SPEC,
    trees::kd_sah::SPEC,
    trees::kd_median::SPACE,
    trees::kd_median::OBJECTS,
    trees::rbsp::PLAIN,
    trees::rbsp::KD,
    trees::bsp_ize::PLAIN,
    trees::bsp_ize::KD,
    trees::bsp_random::PLAIN,
    trees::bsp_random::PLUS,
    trees::bsp_random::PLUS_KD,
    trees::bsp_wn::PLAIN,
    trees::bsp_wn::PLUS,
    trees::bsp_wn::PLUS_KD,
    trees::bsp_wn_area::SPEC,
    trees::bsp_cn::PLAIN,
    trees::bsp_cn::PLUS,
    trees::bsp_cn::PLUS_KD,
    trees::bsp_cn_axial::SPEC,
    trees::bsp_hybrid::SPEC,
    trees::beam_hh::SPEC,
    trees::bvh_sah::SPEC,
    trees::bih::SPEC,
    trees::bih_sah::SPEC,
    trees::bih5::SPEC,
    trees::bih1::SPEC,
    trees::bih4::SPEC,
    trees::bih_n::SPEC,
    trees::bih_bvh::SPEC,
    trees::bih_obl::SPEC,
    trees::bbox_gs::SPEC,
    trees::bbox_gs::BRANCH_AND_BOUND,
    trees::octree_param::SPEC,
    trees::octree_arvo::SPEC,
    trees::octree_net::SPEC,
    trees::octree_beam::SPEC,
    trees::octree_samet::SPEC,
    trees::octree_glassner::SPEC,
    trees::grid::SPEC,
    trees::brute::SPEC,
];

/// Parameters that every structure has, unless its row has one of the same name.
pub const COMMON: &[ParamSpec] = &[params::SHADOW];

/// The same for structures that divide space.
const COMMON_SPACE: &[ParamSpec] = &[params::SHADOW_BEAM];

/// A structure's row.
#[derive(Debug)]
pub struct StructureSpec {
    /// Stable name: lower case, digits, hyphen.
    pub id: &'static str,
    /// Stable number, saved in .blend files; never reused.
    pub code: i32,
    /// What people read.
    pub label: &'static str,
    /// What is divided: "space", "objects", "octants", or "oracle" for nothing.
    pub family: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// Where it comes from.
    pub paper: &'static str,
    /// Its own parameters; see [`Self::all_params`].
    pub params: &'static [ParamSpec],
    /// Builds it over the live triangles, in the current rayon pool.
    pub build: fn(&Triangles, &Config, &Monitor) -> Result<Built>,
}

/// What a build function returns.
#[derive(Debug)]
pub struct Built {
    /// The frame its coordinates are in.
    pub frame: Frame,
    /// The triangles of its leaves.
    pub blocks: Blocks,
    /// The tree, laid out for one way of walking.
    pub layout: Layout,
    /// Its shape.
    pub shape: Shape,
    /// What this scene did not need, each with its reason.
    pub left_out: Vec<String>,
}

/// A parameter of a structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParamSpec {
    /// Key in configuration strings.
    pub name: &'static str,
    /// What people read.
    pub label: &'static str,
    /// What it does, and what more of it costs.
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
}

/// Names that other authors gave to much the same tree.
const ALIASES: &[(&str, &str)] = &[("skd", "bih"), ("boxtree", "bih")];

/// The other names of a structure.
pub fn aliases(id: &str) -> impl Iterator<Item = &'static str> + use<'_> {
    ALIASES
        .iter()
        .filter(move |(_, own)| *own == id)
        .map(|(alias, _)| *alias)
}

/// The row of a structure, by its id or another name of it.
pub fn find(name: &str) -> Option<&'static StructureSpec> {
    let alias = ALIASES.iter().find(|(alias, _)| *alias == name);
    let id = alias.map_or(name, |(_, id)| id);
    TREES.iter().find(|tree| tree.id == id)
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

    /// The ways of walking that it offers, the default first.
    pub fn traversals(&self) -> &'static [&'static str] {
        let traversal = self.params.iter().find(|p| p.name == "traversal");
        match traversal.map(|p| p.kind) {
            Some(Kind::Choice(options)) => options,
            _ => &[],
        }
    }
}

/// Parameters that several structures share.
pub mod params {
    use super::{Kind, ParamSpec, Value};
    use crate::build::cost::Costs;
    use crate::build::plane_tree;

    /// Walks of axis-aligned trees.
    pub const TRAVERSAL_AXIS: ParamSpec = ParamSpec {
        name: "traversal",
        label: "Traversal",
        doc: "How rays walk the tree. auto: whatever is quickest for a batch: through boxes, camera rays and \
              shadow rays in tiles, others in streams, of which each node is visited once for all rays that meet it; rays are counted as dir walks them. \
              boxes: one by one, through boxes around what the planes part, eight to a node, with leaves of their own, \
              which take about as much memory again. dir: one by one, by plane distances \
              in the order of the direction; ta-b: by entry and exit points (Havran et al. 1997); ta-a, sung, arvo: by the side of the \
              origin and distances, as TA-A, as Sung and Shirley 1992, as Arvo 1988. wide: three levels at a time, \
              several rays in turn, many in random order sorted by where they start. seq: each leaf from the root, \
              without a stack (Kaplan 1985). rope: from leaf to leaf by links to what lies across each face (MacDonald and \
              Booth 1990); ropetree: by a small tree for each face (Havran et al. 1998); both need about twice \
              the memory of nodes and more. tile8, tile16: as dir, but camera rays go in tiles of 64 or 256, and \
              shadow rays of one light in tiles of 64 from the light; tiles whose rays drift apart are split into packets. p4, \
              p8, p16: as dir, but in packets of 4, 8 or 16 rays, one to a lane, shadow rays always of 16. Shadow rays \
              are counted as dir walks them. The answer is the same",
        unit: "",
        kind: Kind::Choice(&[
            "auto", "dir", "wide", "boxes", "tile8", "tile16", "p4", "p8", "p16", "ta-b", "ta-a",
            "sung", "arvo", "seq", "rope", "ropetree",
        ]),
        default: Value::Choice("auto"),
    };

    /// The same, by single rays where nothing is said: for a tree that others are measured against.
    pub const TRAVERSAL_BASELINE: ParamSpec = ParamSpec {
        kind: Kind::Choice(&[
            "dir", "auto", "wide", "boxes", "tile8", "tile16", "p4", "p8", "p16", "ta-b", "ta-a",
            "sung", "arvo", "seq", "rope", "ropetree",
        ]),
        default: Value::Choice("dir"),
        ..TRAVERSAL_AXIS
    };

    /// Walks of trees with oblique planes.
    pub const TRAVERSAL_ANY: ParamSpec = ParamSpec {
        name: "traversal",
        label: "Traversal",
        doc: "How rays walk the tree. auto: whatever is quickest for a batch: through boxes, camera rays and \
              shadow rays in tiles, others in streams, of which each node is visited once for all rays that meet it; rays are counted as dir walks them. dir: one by one, by \
              plane distances in the order of the direction. boxes: one by one, through boxes around what the planes part, eight to a node, with sides along the axes only and leaves of their own, \
              which take about as much memory again. ta-b-poly: by the heights of entry and exit points over the plane. wide: three levels at a \
              time, several rays in turn, many in random order sorted by where they start. tile8, tile16: as dir, but camera rays go in tiles of 64 or 256, and shadow \
              rays of one light in tiles of 64 from the light; tiles whose rays drift apart are split into packets. p4, p8, \
              p16: as dir, but in packets of 4, 8 or 16 rays, one to a lane, shadow rays always of 16. Shadow rays are \
              counted as dir walks them. The answer is the same",
        unit: "",
        kind: Kind::Choice(&[
            "auto",
            "dir",
            "wide",
            "boxes",
            "tile8",
            "tile16",
            "p4",
            "p8",
            "p16",
            "ta-b-poly",
        ]),
        default: Value::Choice("auto"),
    };

    /// Walks of axis-aligned trees that are there to be compared with.
    pub const TRAVERSAL_PLAIN: ParamSpec = ParamSpec {
        doc: "How rays walk the tree, one by one. dir: by plane distances in the order of the direction; ta-b: by \
              entry and exit points (Havran et al. 1997); ta-a, sung, arvo: by the side of the origin and \
              distances, as TA-A, as Sung and Shirley 1992, as Arvo 1988; seq: each leaf from the root (Kaplan \
              1985); rope, ropetree: from leaf to leaf by links (MacDonald and Booth 1990; Havran et al. 1998). \
              The answer is the same",
        kind: Kind::Choice(&[
            "dir", "ta-b", "ta-a", "sung", "arvo", "seq", "rope", "ropetree",
        ]),
        default: Value::Choice("dir"),
        ..TRAVERSAL_AXIS
    };

    /// Whether a walk allows for rounding.
    pub const ROBUST: ParamSpec = ParamSpec {
        name: "robust",
        label: "Robustness",
        doc: "widen: intervals grow by the rounding error, no hit is ever lost. none: as in textbooks, \
              for measuring how often that fails; never for pictures",
        unit: "",
        kind: Kind::Choice(&["widen", "none"]),
        default: Value::Choice("widen"),
    };

    /// What shadow rays ask before the tree.
    pub const SHADOW: ParamSpec = ParamSpec {
        name: "shadow",
        label: "Shadow Rays",
        doc: "cache: what blocked a light last is tested first (Wilt 1994). Saves where shadows are large, and \
              costs a test where they end. The answer is the same",
        unit: "",
        kind: Kind::Choice(&["none", "cache"]),
        default: Value::Choice("none"),
    };

    /// The same on trees that divide space.
    pub const SHADOW_BEAM: ParamSpec = ParamSpec {
        doc: "cache: what blocked a light last is tested first (Wilt 1994). beam: rays to one light go \
              through the tree together; mostly one walk shows that nothing is in the way of all 64. On trees \
              of planes that saves walks, but is still slower than single rays. \
              The answer is the same",
        kind: Kind::Choice(&["none", "cache", "beam"]),
        ..SHADOW
    };

    /// Depth limit.
    pub const MAX_DEPTH: ParamSpec = ParamSpec {
        name: "max_depth",
        label: "Depth Limit",
        doc: "Leaves lie no deeper; 0 chooses by the number of triangles. More costs memory and \
              build time and rarely pays",
        unit: "levels",
        kind: Kind::Integer {
            min: 0,
            max: plane_tree::MAX_DEPTH as i64,
        },
        default: Value::Integer(0),
    };

    /// Leaf size.
    pub const LEAF_SIZE: ParamSpec = ParamSpec {
        name: "leaf_size",
        label: "Leaf Size",
        doc: "Nodes of at most this many triangles are not split. More builds faster and tests more",
        unit: "triangles",
        kind: Kind::Integer { min: 0, max: 64 },
        default: Value::Integer(1),
    };

    /// Largest leaf of hierarchies parted by the surface area heuristic.
    pub const LEAF_MAX: ParamSpec = ParamSpec {
        name: "leaf_max",
        label: "Largest Leaf",
        doc: "Nodes of more triangles are always parted. More saves memory where triangles crowd",
        unit: "triangles",
        kind: Kind::Integer { min: 1, max: 4096 },
        default: Value::Integer(64),
    };

    const fn cost(
        name: &'static str,
        label: &'static str,
        doc: &'static str,
        value: f32,
    ) -> ParamSpec {
        ParamSpec {
            name,
            label,
            doc,
            unit: "",
            kind: Kind::Float { min: 0.0, max: 1e6 },
            default: Value::Float(value as f64),
        }
    }

    /// Price of a step.
    pub const fn step_cost(costs: Costs) -> ParamSpec {
        cost(
            "step_cost",
            "Step Cost",
            "Price of a step through a node. More gives fewer, larger leaves",
            costs.step,
        )
    }

    /// Price of entering a leaf.
    pub const fn leaf_cost(costs: Costs) -> ParamSpec {
        cost(
            "leaf_cost",
            "Leaf Cost",
            "Price of entering a leaf with triangles. More gives fewer leaves",
            costs.leaf,
        )
    }

    /// Price of a triangle.
    pub const fn triangle_cost(costs: Costs) -> ParamSpec {
        cost(
            "triangle_cost",
            "Triangle Cost",
            "Price of testing a triangle. More gives smaller leaves, a larger tree and a longer build",
            costs.triangle,
        )
    }

    /// Factor for splits that cut off empty space.
    pub const fn empty_factor(costs: Costs) -> ParamSpec {
        ParamSpec {
            name: "empty_factor",
            label: "Empty Factor",
            doc: "Factor on the cost of a split that leaves one side empty. Less cuts off more empty \
                  space, at the price of longer walks",
            unit: "",
            kind: Kind::Float { min: 0.1, max: 1.0 },
            default: Value::Float(costs.empty as f64),
        }
    }

    /// Whether rays have the tree built.
    pub const LAZY: ParamSpec = ParamSpec {
        name: "lazy",
        label: "Lazy Build",
        doc: "1: only the upper part is built at once, the rest where a ray comes for the first time. The first picture \
              is there sooner, the tree and the answer are the same; rays outside tiles are traced one by one. Only with \
              the traversals auto, dir and tile8; others build the whole tree at once. What rays build later is not \
              counted as build time. The memory limit covers what is built before the first ray; where the whole, \
              estimated from some subtrees built on trial, would not fit, nothing is built",
        unit: "",
        kind: Kind::Choice(&["0", "1"]),
        default: Value::Choice("0"),
    };

    /// When a cell is too small to be parted.
    pub const AREA_STOP: ParamSpec = ParamSpec {
        name: "area_stop",
        label: "Area Stop",
        doc: "A node of n of N triangles, 16 at most, becomes a leaf where n^2 N times its share of the scene's surface \
              is no more than this: few rays come by. More gives a smaller tree and a shorter build",
        unit: "",
        kind: Kind::Float { min: 0.0, max: 1e6 },
        default: Value::Float(16.0),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_codes_are_unique_and_defaults_lie_in_their_ranges() {
        for (i, tree) in TREES.iter().enumerate() {
            assert!(
                TREES[..i]
                    .iter()
                    .all(|t| t.id != tree.id && t.code != tree.code),
                "{}",
                tree.id
            );
            assert!(ALIASES.iter().all(|(alias, _)| *alias != tree.id));
            for param in tree.all_params() {
                let inside = match (param.kind, param.default) {
                    (Kind::Integer { min, max }, Value::Integer(x)) => (min..=max).contains(&x),
                    (Kind::Float { min, max }, Value::Float(x)) => (min..=max).contains(&x),
                    (Kind::Choice(options), Value::Choice(x)) => options[0] == x,
                    _ => false,
                };
                assert!(inside, "{}: {}", tree.id, param.name);
                assert!(!param.doc.is_empty() && !param.label.is_empty());
            }
        }
        assert!(
            ALIASES
                .iter()
                .all(|(alias, id)| find(alias).is_some_and(|tree| tree.id == *id))
        );
    }
}
