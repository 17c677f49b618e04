// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy whose two planes may lie along diagonals: what Wächter and Keller advise
//! against, for measuring what it does.

use super::interval::{EMPTY, LEAVES};
use crate::build::Monitor;
use crate::build::cost::Costs;
use crate::build::leaves::Leaves;
use crate::build::slanted::{self, Policy};
use crate::build::slanted_tree::DIRECTIONS;
use crate::error::Result;
use crate::registry::{Built, Kind, ParamSpec, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;
use crate::traverse::frame::Frame;
use crate::traverse::keep::Keep;
use crate::traverse::objects::Objects;
use crate::traverse::slant_tree::SlantTree;
use crate::trees::NO_PLANES;

const COSTS: Costs = Costs::BLOCKS;

const K: ParamSpec = ParamSpec {
    name: "k",
    label: "K",
    doc: "Directions tried at each node: the axes, then the diagonals of the cube, then those of its faces. \
          More finds closer planes and builds in proportion longer; 3 leaves the axes alone",
    unit: "directions",
    kind: Kind::Integer {
        min: 3,
        max: DIRECTIONS as i64,
    },
    default: Value::Integer(DIRECTIONS as i64),
};

const OBLIQUE_STEP: ParamSpec = ParamSpec {
    name: "oblique_step_cost",
    label: "Oblique Step Cost",
    doc: "Price of a step through a node with oblique planes. More gives fewer of them",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1e6 },
    default: Value::Float(12.0),
};

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih-obl",
    code: 49,
    label: "Interval hierarchy, oblique",
    family: "objects",
    summary: "Two parallel planes a node, along an axis or a diagonal, where the surface area heuristic is lowest.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy, who advise against it; \
            Klosowski et al. 1998, for the directions",
    params: &[
        K,
        EMPTY,
        LEAVES,
        params::ROBUST,
        params::step_cost(COSTS),
        OBLIQUE_STEP,
        params::leaf_cost(COSTS),
        params::triangle_cost(COSTS),
        params::LEAF_MAX,
    ],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = Policy {
        costs: Costs {
            step: config.float("step_cost"),
            leaf: config.float("leaf_cost"),
            triangle: config.float("triangle_cost"),
            ..COSTS
        },
        oblique_step: config.float("oblique_step_cost"),
        leaf_max: config.integer("leaf_max"),
        empty: config.float("empty"),
        directions: config.integer("k"),
    };
    let built = slanted::build(scene, &frame, &policy, monitor)?;
    let mut leaves = Leaves::new(Keep::of(config));
    let tree = SlantTree::new(&built, &mut leaves)?;
    let blocks = leaves.write(scene, &frame, &built.ids);
    let shape = built.shape();
    let mut left_out = vec![NO_PLANES.to_owned()];
    if shape.nodes_oblique == 0 {
        left_out.push("oblique planes: those along the axes were cheaper everywhere".to_owned());
    }
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        blocks,
        layout: Layout::Objects(Objects::Slanted(tree)),
        shape,
        left_out,
    })
}
