// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees: one build, and one row for each way from a cell to the next.

use crate::build::Monitor;
use crate::build::octree::{self, Cube, MAX_DEPTH, Params};
use crate::build::octree_nodes::Octree;
use crate::error::Result;
use crate::registry::{Built, Kind, ParamSpec};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;

/// Depth limit.
pub const MAX_DEPTH_PARAM: ParamSpec = ParamSpec {
    name: "max_depth",
    label: "Depth Limit",
    doc: "Leaves lie no deeper; 0 chooses by the number of triangles. Each level more may cost four \
          times the memory, and splits what small leaves could not",
    unit: "levels",
    kind: Kind::Integer {
        min: 0,
        max: MAX_DEPTH as i64,
    },
    default: Value::Integer(0),
};

/// Leaf size.
pub const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Cells of at most this many triangles are not halved. Around a corner that more triangles \
          share, cells go down to the depth limit",
    unit: "triangles",
    kind: Kind::Integer { min: 0, max: 64 },
    default: Value::Integer(2),
};

/// Budget.
pub const REFERENCES: ParamSpec = ParamSpec {
    name: "references",
    label: "References",
    doc: "Places in leaves per triangle that the tree may use; large scenes stop halving there. More \
          costs memory in proportion, and soon more time in fetching it than it saves",
    unit: "per triangle",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Value::Integer(3),
};

/// The depth limit where the user gives none: enough for triangles of uneven size.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small"
)]
fn default_depth(triangles: usize) -> u32 {
    (5.0 + 0.5 * (triangles.max(1) as f64).log2()).round() as u32
}

/// How rays will walk an octree, which decides what has to be built.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Walked {
    /// From the top.
    FromTop,
    /// From leaf to leaf: leaves allow for the rounding of the steps.
    FromLeafToLeaf,
    /// The same by stored links.
    ByLinks,
}

/// Builds an octree and lays it out.
pub fn build(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    walked: Walked,
    layout: impl FnOnce(Octree) -> Layout,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let depth = match config.integer("max_depth") {
        0 => default_depth(scene.live().len()),
        depth => u32::try_from(depth).expect("in range"),
    };
    let steps = walked != Walked::FromTop;
    let cube = Cube::new(&frame, depth, steps);
    let params = Params {
        cube,
        leaf_size: config.integer("leaf_size"),
        budget: config.integer("references"),
        margin: if steps { cube.step_margin(&frame) } else { 0.0 },
    };
    let octants = octree::build(scene, &frame, &params, monitor)?;
    let mut blocks = Blocks::new();
    let mut tree = Octree::new(&octants, cube, (scene, &frame), &mut blocks)?;
    if walked == Walked::ByLinks {
        tree = tree.with_links();
    }
    let shape = tree.shape(&frame);
    Ok(Built {
        frame,
        blocks,
        layout: layout(tree),
        shape,
        left_out: vec!["oblique planes: an octree halves along the axes".to_owned()],
    })
}
