// SPDX-License-Identifier: GPL-3.0-or-later
//! Oriented bounding boxes: the hierarchy of `bvh-sah`, whose nodes are then turned to their triangles. The topology
//! does not change, so the two differ by the boxes alone.
//!
//! From the bottom up, each node takes the rotation that is cheapest by the surface area heuristic. With `A` the
//! surface of the node's own axis-aligned box, `A_c` that of a child's box in the rotation, and `C_c` the price of
//! entering that child (of its step, or of its leaf), the node costs `step A + sum A_c C_c`. The step of a turned node
//! is dearer, since the ray has to be rotated.
//!
//! Candidates are the axes, the largest triangle below the node (its plane and its longest edge), and a fixed set
//! that covers all orientations of a box: the quaternions `(4, i, j, k)` with `i`, `j`, `k` from -1 to 1. A box looks
//! the same after 24 rotations, so its orientations are the Rodrigues vectors of components up to `tan(pi / 8)`, about
//! 0.41; the set has the components 0 and 1/4, of either sign. Heights along these rows are merged from child to
//! parent, so each vertex is multiplied with them once.

mod rotations;
mod turning;

use crate::bih;
use crate::boxes::{self, Boxes};
use crate::left_out;
use crate::list::List;
use crate::objects;
use crate::params;
use crate::ways::{distinct, offer, together, traversal};
use halfspace_base::error::Result;
use halfspace_base::monitor::Monitor;
use halfspace_builders::object;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::nested;
use halfspace_nodes::obb_tree::{ObbTree, WIDTH};
use halfspace_ray::frame::Frame;
use halfspace_scene::triangles::Triangles;
use halfspace_single::objects::obb::oriented_boxes;
use halfspace_stream::order::Rule;
use halfspace_structure::row::{
    Family, Group, Kind, Menu, Named, Need, Only, ParamSpec, StructureSpec, named,
};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::{Rays, Way};
use halfspace_structure::{Built, Plan};
use rotations::{FIXED, Rows, fixed};
use std::sync::Arc;
use turning::Turning;

const COSTS: Costs = Costs::BOXES;

/// The ways that both boxes along the axes and turned ones have.
const WAYS: List<Way> = offer(
    &boxes::TRAVERSALS,
    &["auto", "ordered", "tile", "packet", "stream"],
);

const OPTIONS: List<Named> = distinct(WAYS.slice());

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "obb",
    code: 31,
    label: "Oriented boxes",
    family: Family::Objects,
    summary: "The boxes of bvh-sah, those of each node's children turned together to fit their triangles.",
    paper: "Vitsas, Evangelou, Papaioannou and Gkaravelis 2023, Parallel transformation of bounding volume hierarchies \
            into oriented bounding box trees; DOBB-BVH 2025, arXiv 2506.22849, for one rotation per node",
    params: &[
        traversal(OPTIONS.slice()),
        FRAMES,
        SET,
        LEAVES,
        params::ROBUST,
        params::step_cost(COSTS),
        OBLIQUE_STEP,
        params::leaf_cost(COSTS),
        params::triangle_cost(COSTS),
        params::LEAF_MAX,
    ],
    ways: WAYS.slice(),
    no_groups: "",
    menu: Menu::Boxes,
    literature: &[
        ("Oriented boxes (Vitsas et al.)", ""),
        ("DOBB-BVH (Kern et al.)", "set=fixed"),
    ],
    sweep: false,
    claims: &["oriented-boxes-*"],
    build,
};

const FRAMES: ParamSpec = ParamSpec {
    name: "frames",
    label: "Rotations",
    doc: "Rotations tried at each node: 1 is the axes alone, 2 adds the largest triangle's own, more add up to 26 \
          fixed ones, first those about one axis. More finds closer boxes and builds longer",
    unit: "rotations",
    kind: Kind::Integer {
        min: 1,
        max: 2 + FIXED as i64,
    },
    default: Value::Integer(2 + FIXED as i64),
    group: Group::Main,
    needs: &[],
};

const SET: ParamSpec = ParamSpec {
    name: "set",
    label: "Set of Rotations",
    doc: "any: that of the largest triangle below the node, and the fixed ones. fixed: the fixed ones alone, as \
          published for DOBB-BVH; builds sooner",
    unit: "",
    kind: Kind::Choice(&[named("any", "Any"), named("fixed", "Fixed")]),
    default: Value::Choice("any"),
    group: Group::Builder,
    needs: &[Need {
        key: "frames",
        only: Only::Above(2.0),
    }],
};

const LEAVES: ParamSpec = ParamSpec {
    doc: "corners: leaves hold copies of the corners, ready for the test. indices: they name triangles and corners, \
          less than half the memory",
    kind: Kind::Choice(&[
        named("corners", "Corner Copies"),
        named("indices", "Indices"),
    ]),
    default: Value::Choice("corners"),
    ..bih::LEAVES
};

const OBLIQUE_STEP: ParamSpec = ParamSpec {
    name: "oblique_step_cost",
    label: "Turned Step Cost",
    doc: "Cost of a step through a turned node. More leaves more nodes along the axes",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1e6 },
    default: Value::Float(12.0),
    group: Group::Costs,
    needs: &[Need {
        key: "frames",
        only: Only::Above(1.0),
    }],
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = params::surface_area(config, COSTS);
    // Build the hierarchy of axis-aligned boxes.
    let binary = monitor.during(0.5, || object::build(scene, &frame, &policy, monitor))?;
    let mut leaves = Leaves::new(params::keep(config));
    let boxes = BoxTree::<WIDTH>::new(&binary, &mut leaves)?.by_corners();
    let leaves = Arc::new(leaves.write(scene, &frame, &binary.ids));
    drop(binary);

    // Choose the rotation of each node, and turn the boxes.
    let wanted = config.integer("frames");
    let parallel = wanted > 1 && left_out::is_parallel(scene);
    let frames = if parallel { 1 } else { wanted };
    let turning = Turning {
        scene,
        frame: &frame,
        leaves: &leaves,
        boxes: &boxes,
        costs: policy.costs,
        oblique_step: config.float("oblique_step_cost"),
        own: frames > 1 && config.choice(SET.name) == "any",
        fixed: &Rows::new(&fixed()[..frames.saturating_sub(2)]),
        monitor,
    };
    let turns = monitor.during(0.5, || turning.all())?;
    // Without a turned node the tree is that of `bvh-sah`, whose kernels take corners.
    let corners = config.choice(LEAVES.name) == "corners";
    let mut built = if turns.is_empty() && corners {
        let any_order = Rule::Cost;
        let tree = Arc::new(boxes);
        let plan = Boxes {
            tree: tree.clone(),
            leaves: leaves.clone(),
            any_order,
        }
        .plan(config);
        let shape = nested::shape(&*tree, frame.bounds());
        objects::built(config, frame, tree, leaves, plan, shape)
    } else {
        let tree = Arc::new(ObbTree::new(boxes, &turns));
        let shape = tree.shape(frame.bounds());
        let single = Plan::single("boxes", "ordered", oriented_boxes(&tree, &leaves));
        let groups = together!(&tree, &leaves, turned_boxes, shadow_turned_boxes);
        let plan = match config.way().rays {
            // Send all rays in streams: tiles and packets turn every ray at each node that some of them meet.
            Rays::Auto => groups
                .streams
                .take_all(single, Rays::Stream)
                .with_few_singly(),
            rays => groups.plan(single, rays),
        };
        objects::built(config, frame, tree, leaves, plan, shape)
    };
    if wanted > 1 && turns.is_empty() && !scene.live().is_empty() {
        let reason = if parallel {
            left_out::PARALLEL
        } else {
            "those along the axes were cheapest at every node"
        };
        built.left_out.push(format!("turned boxes: {reason}"));
    }
    Ok(built)
}
