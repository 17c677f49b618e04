// SPDX-License-Identifier: GPL-3.0-or-later
//! What the bounding interval hierarchies share: parameters, and building up to the layout.

use crate::build::Monitor;
use crate::build::global::Global;
use crate::build::grid_order;
use crate::build::leaves::Leaves;
use crate::build::object;
use crate::build::object_tree::ObjectTree;
use crate::build::tighten::Tighten;
use crate::error::Result;
use crate::geom::Aabb;
use crate::registry::{Built, Kind, ParamSpec};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;
use crate::traverse::frame::Frame;
use crate::traverse::keep::Keep;
use crate::traverse::objects::Objects;
use crate::trees::NO_PLANES;

/// Leaf size where a grid parts the triangles.
pub const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Nodes of at most this many triangles are not parted. More builds faster and tests more",
    unit: "triangles",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Value::Integer(6),
};

/// What leaves keep.
pub const LEAVES: ParamSpec = ParamSpec {
    name: "leaves",
    label: "Leaves",
    doc: "indices: leaves name triangles and corners, less than half the memory. corners: they hold \
          copies, which are tested sooner and take longer to build",
    unit: "",
    kind: Kind::Choice(&["indices", "corners"]),
    default: Value::Choice("indices"),
};

/// When empty space is cut off.
pub const EMPTY: ParamSpec = ParamSpec {
    name: "empty",
    label: "Empty Space",
    doc: "A node is put in to cut off empty space where less than this share of the surface is left. \
          0 for never; more costs memory and steps and saves visits of leaves",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1.0 },
    default: Value::Float(0.7),
};

/// When to cut off empty space, as the configuration says.
pub fn tighten(config: &Config) -> Tighten {
    Tighten(f64::from(config.float("empty")))
}

/// Parts the triangles by a grid, `ways` to a node, and lays the tree out.
///
/// # Errors
/// Those of building.
pub fn by_grid(
    (scene, config, monitor): (&Triangles, &Config, &Monitor),
    ways: usize,
    lay_out: impl FnOnce(&ObjectTree, Aabb, &mut Leaves) -> Result<Objects>,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = Global {
        leaf_size: config.integer("leaf_size"),
        ways,
    };
    // Where cells are parted more than two ways, how depends on what is empty.
    let binary = if ways == 2 {
        grid_order::build(scene, &frame, &policy, monitor)?
    } else {
        object::build(scene, &frame, &policy, monitor)?
    };
    finish((scene, config), frame, &binary, lay_out)
}

/// Lays out a tree and writes its leaves.
///
/// # Errors
/// Those of the layout.
pub fn finish(
    (scene, config): (&Triangles, &Config),
    frame: Frame,
    binary: &ObjectTree,
    lay_out: impl FnOnce(&ObjectTree, Aabb, &mut Leaves) -> Result<Objects>,
) -> Result<Built> {
    let mut leaves = Leaves::new(Keep::of(config));
    let tree = lay_out(binary, frame.bounds(), &mut leaves)?;
    let (shape, blocks) = rayon::join(
        || tree.shape(frame.bounds()),
        || leaves.write(scene, &frame, &binary.ids),
    );
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        blocks,
        layout: Layout::Objects(tree),
        shape,
        left_out: vec![NO_PLANES.to_owned()],
    })
}
