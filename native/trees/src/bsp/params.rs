// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of the trees with oblique planes.

use crate::list::List;
use crate::params::{
    AREA_STOP, BETA, LAZY, MAX_DEPTH, ROBUST, STOP, empty_factor, leaf_cost, step_cost,
    triangle_cost,
};
use crate::planes::rows::ANY_TRAVERSAL as TRAVERSAL;
use crate::planes::scalar::ANY_LEAVES as LEAVES;
use crate::ways::PLANE_NODES as NODES;
use halfspace_nodes::cost::Costs;
use halfspace_structure::row::{Group, Kind, Need, OFF_ON, ON_OFF, Only, ParamSpec, named};
use halfspace_structure::spec::Value;

/// Cost of a step through an oblique node, in the units of [`Costs::PLANES`]. Measured on killeroo, Sponza and
/// Conference: higher costs were not faster, although a step itself takes about twice as long as an axis node's.
const OBLIQUE_STEP: f32 = 22.0;

/// Largest number of triangles in a leaf, unless no plane splits them.
pub const LEAF_MOST: usize = 64;

/// Returns parameter K with its smallest and its default value.
pub const fn k(min: i64, usual: i64) -> ParamSpec {
    ParamSpec {
        name: "k",
        label: "K",
        doc: "Directions tried at each node, the axes included where they are tried. More finds better \
              planes and builds in proportion longer",
        unit: "directions",
        kind: Kind::Integer { min, max: 32 },
        default: Value::Integer(usual),
        group: Group::Main,
        needs: &[],
    }
}

/// Parameter alpha.
pub const ALPHA: ParamSpec = ParamSpec {
    name: "alpha",
    label: "Alpha",
    doc: "Share of a triangle's cost that a step through an oblique node costs for each triangle of the \
          node. More keeps oblique planes away from the top of the tree (Ize, Wald and Parker 2008)",
    unit: "",
    kind: Kind::Float {
        min: 0.0,
        max: 1000.0,
    },
    default: Value::Float(0.1),
    group: Group::Main,
    needs: &[],
};

/// Parameter seed.
pub const SEED: ParamSpec = ParamSpec {
    name: "seed",
    label: "Seed",
    doc: "Which random choices are made. The same seed always builds the same tree",
    unit: "",
    kind: Kind::Integer {
        min: 0,
        max: 0xffff_ffff,
    },
    default: Value::Integer(0),
    group: Group::Builder,
    needs: &[],
};

const COSTS: ParamSpec = ParamSpec {
    name: "costs",
    label: "Costs",
    doc: "fitted: costs measured for leaves that test eight triangles at once. thesis: 80 a triangle, 1 an \
          axis step, 5 an oblique step, one triangle per leaf, pbrt's stopping rule (Hoobergs 2019)",
    unit: "",
    kind: Kind::Choice(&[named("fitted", "Measured"), named("thesis", "Thesis")]),
    default: Value::Choice("fitted"),
    group: Group::Costs,
    needs: &[],
};

/// Parameter rule.
pub const RULE: ParamSpec = ParamSpec {
    name: "rule",
    label: "Fallback Rule",
    doc: "Where no plane pays at the linear cost of oblique planes but one does at the fixed cost: text \
          takes that one, code takes the first attempt's, as the thesis's program does",
    unit: "",
    kind: Kind::Choice(&[
        named("text", "As in the Text"),
        named("code", "As in the Code"),
    ]),
    default: Value::Choice("text"),
    group: Group::Costs,
    needs: &[],
};

const TIES: ParamSpec = ParamSpec {
    name: "ties",
    label: "Ties",
    doc: "Triangles that touch a plane. clean: stay on their side (Wald and Havran 2006). pbrt: starts sort \
          before ends, so that some land on both sides, and planes of a sweep may lie next to a cell's end; larger \
          trees",
    unit: "",
    kind: Kind::Choice(&[named("clean", "To One Side"), named("pbrt", "As in pbrt")]),
    default: Value::Choice("clean"),
    group: Group::Numerics,
    needs: &[],
};

const SLAB: ParamSpec = ParamSpec {
    name: "slab",
    label: "Slabs",
    doc: "Whether planes close to both sides of a flat group of triangles are tried, which keeps it away \
          from rays that pass. Fewer tests on walls, a longer build",
    unit: "",
    kind: ON_OFF,
    default: Value::Choice("1"),
    group: Group::Numerics,
    needs: &[],
};

const CLIP: ParamSpec = ParamSpec {
    name: "clip",
    label: "Clip",
    doc: "Whether triangles are cut to their cells. Fewer tests where triangles are long, a longer build",
    unit: "",
    kind: ON_OFF,
    default: Value::Choice("1"),
    group: Group::Numerics,
    needs: &[],
};

const EARLY: ParamSpec = ParamSpec {
    name: "early",
    label: "Early Stop",
    doc: "Whether a node tries no further direction once a plane parts its triangles without cutting any. \
          Builds faster, tests slightly more",
    unit: "",
    kind: OFF_ON,
    default: Value::Choice("0"),
    group: Group::Builder,
    needs: &[],
};

const AXES_DEPTH: ParamSpec = ParamSpec {
    name: "axes_depth",
    label: "Axes Above",
    doc: "Nodes above this depth try the axes only. More builds faster",
    unit: "levels",
    kind: Kind::Integer { min: 0, max: 60 },
    default: Value::Integer(0),
    group: Group::Builder,
    needs: &[],
};

/// Nodes of at most this number of triangles are small.
pub const SMALL: usize = 32;

/// Parameter K at small nodes.
pub const K_SMALL: ParamSpec = ParamSpec {
    name: "k_small",
    label: "K at Small Nodes",
    doc: "Share of K that is tried at nodes of up to 32 triangles, but always one direction besides the axes. Most \
          nodes are small; more builds slower and traces hardly faster. costs=thesis tries K everywhere",
    unit: "of K",
    kind: Kind::Float { min: 0.0, max: 1.0 },
    default: Value::Float(0.66),
    group: Group::Builder,
    needs: &[],
};

const ENOUGH: ParamSpec = ParamSpec {
    name: "enough",
    label: "Axes Enough",
    doc: "Nodes of more than eight triangles where a plane along an axis costs less than this share of their leaf \
          try no other direction. More builds faster; 0 tries all everywhere, as costs=thesis does",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1.0 },
    default: Value::Float(0.6),
    group: Group::Costs,
    needs: &[],
};

const OBLIQUE: ParamSpec = ParamSpec {
    name: "oblique_cost",
    label: "Oblique Cost",
    doc: "Cost of a step through a node with an oblique plane; where alpha asks for more, of the second \
          attempt. More gives fewer oblique planes. costs=thesis has its own",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1e6 },
    default: Value::Float(OBLIQUE_STEP as f64),
    group: Group::Costs,
    needs: &[],
};

/// Costs that only `costs=fitted` reads.
const FITTED: &[Need] = &[Need {
    key: "costs",
    only: Only::Options(&["fitted"]),
}];

/// Where directions other than the axes are tried.
pub const MORE_THAN_AXES: &[Need] = &[Need {
    key: "k",
    only: Only::Above(3.0),
}];

/// Both conditions: the costs are `fitted`, and directions other than the axes are tried.
const FITTED_MORE: &[Need] = &[FITTED[0], MORE_THAN_AXES[0]];

/// Where oblique planes have a linear cost.
const LINEAR: &[Need] = &[Need {
    key: "alpha",
    only: Only::Above(0.0),
}];

/// Where oblique planes have a linear cost and directions other than the axes are tried.
pub const LINEAR_MORE: &[Need] = &[LINEAR[0], MORE_THAN_AXES[0]];

/// The costs of `costs=fitted` as parameters, without that of a step along an axis: all steps cost the same.
const PRICES: [ParamSpec; 5] = [
    OBLIQUE.needing(FITTED),
    leaf_cost(Costs::PLANES).needing(FITTED),
    triangle_cost(Costs::PLANES).needing(FITTED),
    empty_factor(Costs::PLANES).needing(FITTED),
    AREA_STOP.needing(FITTED),
];

/// Returns the parameters of a variant without special axes.
pub const fn usual(k: ParamSpec) -> List<ParamSpec> {
    List::of(&[
        k,
        NODES,
        TRAVERSAL,
        SEED,
        K_SMALL.needing(FITTED),
        COSTS,
        STOP,
        BETA,
        TIES,
        SLAB,
        CLIP,
        EARLY,
        AXES_DEPTH,
        ROBUST,
        LEAVES,
        LAZY,
        MAX_DEPTH,
    ])
    .and(&PRICES)
}

/// Returns the parameters of a variant with the axes.
pub const fn plus(k: ParamSpec) -> List<ParamSpec> {
    usual(k)
        .with_needs("seed", MORE_THAN_AXES)
        .with_needs("k_small", FITTED_MORE)
        .insert_after("early", ENOUGH.needing(FITTED_MORE))
        .with_needs("axes_depth", MORE_THAN_AXES)
}

/// Returns the parameters of a variant with cheap axis nodes.
pub const fn kd(k: ParamSpec) -> List<ParamSpec> {
    plus(k)
        .insert_after("k", ALPHA.needing(MORE_THAN_AXES))
        .insert_after("costs", RULE.needing(LINEAR_MORE))
        .with_needs("slab", MORE_THAN_AXES)
        .insert_after("max_depth", step_cost(Costs::PLANES).needing(FITTED))
        .with_needs("oblique_cost", FITTED_MORE)
}

/// Returns the parameters of a tree that sweeps only the axes.
pub const fn single(own: ParamSpec) -> List<ParamSpec> {
    List::of(&[
        own, NODES, TRAVERSAL, COSTS, STOP, BETA, TIES, SLAB, CLIP, ROBUST, LEAVES, MAX_DEPTH,
    ])
    .and(&PRICES)
}

/// Returns the parameters of such a tree with cheap axis nodes.
pub const fn single_kd(own: ParamSpec) -> List<ParamSpec> {
    List::of(&[ALPHA])
        .and(single(own).slice())
        .insert_after("costs", RULE.needing(LINEAR))
        .insert_after("max_depth", step_cost(Costs::PLANES).needing(FITTED))
}
