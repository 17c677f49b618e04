// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding interval hierarchy: triangles are parted by a grid that is halved again and again,
//! and each node states two planes, where the one half ends and where the other begins. Quick to
//! build, small, and of a size that is known beforehand.

use crate::build::Monitor;
use crate::build::global::Global;
use crate::build::object;
use crate::error::Result;
use crate::registry::{Built, Default, Kind, ParamSpec, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;
use crate::traverse::nested;
use crate::traverse::objects::Objects;
use crate::traverse::slab_tree::SlabTree;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih",
    code: 40,
    label: "Bounding interval hierarchy",
    family: "objects",
    summary: "Two planes a node, triangles parted by a regular grid: for scenes that change in each frame.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Ooi, \
            McDonell and Sacks-Davis 1987, Spatial kd-tree; Zachmann 2002, Minimal hierarchical \
            collision detection",
    params: &[LEAF_SIZE, params::ROBUST],
    build,
};

/// Leaf size of the hierarchies that a grid parts.
pub const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Nodes of at most this many triangles are not parted. More builds faster and tests more",
    unit: "triangles",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Default::Integer(6),
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = Global {
        leaf_size: config.integer("leaf_size"),
    };
    let binary = object::build(scene, &frame, &policy, monitor)?;
    let mut blocks = Blocks::new();
    let tree = SlabTree::new(&binary, scene, &frame, &mut blocks)?;
    let shape = nested::shape(&tree, frame.bounds());
    Ok(Built {
        frame: frame.with_robust(config.choice("robust") != "none"),
        blocks,
        layout: Layout::Objects(Objects::Slabs(tree)),
        shape,
        left_out: vec!["split planes: this structure parts triangles, not space".to_owned()],
    })
}
