// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy whose two planes may be perpendicular to a diagonal. Wächter and Keller advise against
//! it; this row measures the effect.

use crate::bih::{EMPTY, LEAVES};
use crate::bsp::params::MORE_THAN_AXES;
use crate::ways::together;
use crate::{bih, leaf_tests, left_out, objects, params};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::slanted::{self, Policy};
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::slant_tree::SlantTree;
use halfspace_nodes::slanted_tree::DIRECTIONS;
use halfspace_papers::alone;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single::objects::slanted::slanted as slanted_rays;
use halfspace_structure::row::{Family, Group, Kind, Menu, ParamSpec, StructureSpec};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::{Built, Plan};
use std::sync::Arc;

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
    group: Group::Main,
    needs: &[],
};

const OBLIQUE_STEP: ParamSpec = ParamSpec {
    name: "oblique_step_cost",
    label: "Oblique Step Cost",
    doc: "Cost of a step through a node with oblique planes. More gives fewer of them",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1e6 },
    default: Value::Float(12.0),
    group: Group::Costs,
    needs: MORE_THAN_AXES,
};

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih-obl",
    code: 49,
    label: "Interval hierarchy, oblique",
    family: Family::Objects,
    summary: "Two parallel planes a node, along an axis or a diagonal, where the surface area heuristic is lowest.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy, who advise against it; \
            Klosowski et al. 1998, for the directions",
    params: &[
        K,
        bih::TRAVERSAL,
        EMPTY,
        LEAVES,
        params::ROBUST,
        params::step_cost(COSTS),
        OBLIQUE_STEP,
        params::leaf_cost(COSTS),
        params::triangle_cost(COSTS),
        params::LEAF_MAX,
    ],
    ways: &bih::WAYS,
    no_groups: "",
    menu: Menu::Intervals,
    literature: &[("BIH, oblique", "")],
    sweep: false,
    claims: &["intervals-*"],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    // Try the axes alone where no triangle is oblique.
    let directions = config.integer("k");
    let parallel = directions > 3 && left_out::is_parallel(scene);
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
        directions: if parallel { 3 } else { directions },
    };
    let built = slanted::build(scene, &frame, &policy, monitor)?;
    let mut leaves = Leaves::new(params::keep(config));
    let tree = SlantTree::new(&built, &mut leaves)?;
    let leaves = Arc::new(leaves.write(scene, &frame, &built.ids));
    let (tree, shape) = (Arc::new(tree), built.shape());
    let single = |kernel| Plan::single("intervals", "intervals", kernel);
    let plan = if leaf_tests::alone(config) {
        single(alone::slanted(&tree, &leaves, config.robust()))
    } else {
        let groups = together!(&tree, &leaves, slanted, shadow_slanted);
        groups.plan(single(slanted_rays(&tree, &leaves)), config.way().rays)
    };
    let mut built = objects::built(config, frame, tree, leaves, plan, shape);
    if shape.nodes_oblique == 0 && shape.nodes_axis > 0 && directions > 3 {
        let reason = if parallel {
            left_out::PARALLEL
        } else {
            "those along the axes were cheaper everywhere"
        };
        built.left_out.push(format!("oblique planes: {reason}"));
    }
    if policy.empty > 0.0 {
        built.left_out.extend(left_out::no_empty_space(&shape));
    }
    Ok(built)
}
