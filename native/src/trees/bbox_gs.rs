// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies of bounding boxes that grow object by object, walked with a heap: what object-oriented
//! ray tracers of the early nineties used, among them the OORT library.

use super::interval::LEAVES;
use crate::build::Monitor;
use crate::build::insertion::{self, Growth, Search, WIDEST};
use crate::build::leaves::Leaves;
use crate::build::object;
use crate::error::Result;
use crate::registry::{Built, Kind, ParamSpec, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;
use crate::traverse::dop_tree::DopTree;
use crate::traverse::frame::Frame;
use crate::traverse::keep::Keep;
use crate::traverse::nested;
use crate::traverse::objects::Objects;
use crate::trees::NO_PLANES;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bbox-gs",
    code: 50,
    label: "Boxes by insertion",
    family: "objects",
    summary: "Boxes that grow triangle by triangle, each put where it costs least; walked with a heap.",
    paper: "Goldsmith and Salmon 1987, Automatic creation of object hierarchies for ray tracing; Kay and \
            Kajiya 1986, Ray tracing complex scenes",
    params: PARAMS,
    build: |scene, config, monitor| build(scene, config, monitor, Search::Greedy),
};

/// The row of the same with branch and bound.
pub const BRANCH_AND_BOUND: StructureSpec = StructureSpec {
    id: "bbox-gs-bnb",
    code: 51,
    label: "Boxes by insertion, best place",
    summary: "As bbox-gs, but each triangle's best place of all is found, by branch and bound.",
    paper: "Goldsmith and Salmon 1987, Automatic creation of object hierarchies for ray tracing; \
            Bittner, Hapala and Havran 2015, Incremental BVH construction for ray tracing",
    build: |scene, config, monitor| build(scene, config, monitor, Search::BranchAndBound),
    ..SPEC
};

const PARAMS: &[ParamSpec] = &[SLABS, CHILDREN, LEAF_SIZE, LEAVES, params::ROBUST, SEED];

const SLABS: ParamSpec = ParamSpec {
    name: "slabs",
    label: "Slabs",
    doc: "Pairs of planes around each node: 3 are a box, 7 add the diagonals of the cube, 13 those of its \
          faces too. More fit closer and cost memory and time at each node",
    unit: "slabs",
    kind: Kind::Choice(&["3", "7", "13"]),
    default: Value::Choice("3"),
};

const CHILDREN: ParamSpec = ParamSpec {
    name: "children",
    label: "Children",
    doc: "Nodes have at most this many children. More lets large triangles stay near the root",
    unit: "nodes",
    kind: Kind::Integer {
        min: 2,
        max: WIDEST as i64,
    },
    default: Value::Integer(WIDEST as i64),
};

const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Subtrees of at most this many triangles become leaves; 1 is the published form. More saves \
          memory and tests more",
    unit: "triangles",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Value::Integer(4),
};

const SEED: ParamSpec = ParamSpec {
    name: "seed",
    label: "Seed",
    doc: "Shuffles the order in which triangles come, on which the tree depends",
    unit: "",
    kind: Kind::Integer {
        min: 0,
        max: 0x7fff_ffff,
    },
    default: Value::Integer(1),
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor, search: Search) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let objects = object::gather(scene, &frame);
    let growth = Growth {
        search,
        children: config.integer("children"),
        seed: config.integer("seed") as u64,
    };
    let grown = insertion::grow(&objects, &growth, monitor)?;
    let mut leaves = Leaves::new(Keep::of(config));
    let mut ids = Vec::with_capacity(objects.len());
    let (triangles, out) = ((scene, &frame, &objects[..]), (&mut leaves, &mut ids));
    let leaf_size = config.integer("leaf_size");
    let tree = match config.choice("slabs") {
        "3" => Objects::Dops3(DopTree::new(&grown, triangles, leaf_size, out)?),
        "7" => Objects::Dops7(DopTree::new(&grown, triangles, leaf_size, out)?),
        _ => Objects::Dops13(DopTree::new(&grown, triangles, leaf_size, out)?),
    };
    let shape = nested::shape(tree.nested(), frame.bounds());
    let blocks = leaves.write(scene, &frame, &ids);
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        blocks,
        layout: Layout::Objects(tree),
        shape,
        left_out: vec![NO_PLANES.to_owned()],
    })
}
