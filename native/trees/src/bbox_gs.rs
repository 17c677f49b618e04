// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies of bounding boxes that grow object by object, traversed with a heap: what object-oriented
//! ray tracers of the early nineties used, among them the OORT library.

use crate::bih::SLAB_LEAVES;
use crate::leaf_tests;
use crate::ways::only_singly;
use crate::{objects, params};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::insertion::{self, Growth, Order, Search, WIDEST};
use halfspace_builders::object;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::dop_tree::DopTree;
use halfspace_nodes::nested;
use halfspace_papers::alone;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single::objects::dops;
use halfspace_structure::row::{
    Family, Group, Kind, Menu, Need, Only, ParamSpec, StructureSpec, named,
};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::Way;
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::SingleRays;
use std::sync::Arc;

const WAYS: [Way; 1] = only_singly("boxes");

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bbox-gs",
    code: 50,
    label: "Boxes by insertion",
    family: Family::Objects,
    summary: "Boxes that grow triangle by triangle, each put where it costs least; a heap yields the nearest node.",
    paper: "Goldsmith and Salmon 1987, Automatic creation of object hierarchies for ray tracing; Kay and \
            Kajiya 1986, Ray tracing complex scenes",
    params: PARAMS,
    ways: &WAYS,
    no_groups: "a heap yields the nearest node of one ray, and each ray of a group would need its own",
    menu: Menu::Boxes,
    literature: &[
        ("B.Box (OORT)", ""),
        ("B.Box, as published", "fanout=any,leaf_size=1"),
    ],
    sweep: false,
    claims: &["octrees-beat-boxes", "boxes-beat-octrees", "teapot-*"],
    build: |scene, config, monitor| build(scene, config, monitor, Search::Greedy),
};

/// The registry's row: the best place of each triangle, by branch and bound.
pub const BRANCH_AND_BOUND: StructureSpec = StructureSpec {
    id: "bbox-gs-bnb",
    code: 51,
    label: "Boxes by insertion, best place",
    summary: "As bbox-gs, but each triangle's best place of all is found, by branch and bound.",
    paper: "Goldsmith and Salmon 1987, Automatic creation of object hierarchies for ray tracing; \
            Bittner, Hapala and Havran 2015, Incremental BVH construction for ray tracing",
    literature: &[("B.Box, branch and bound", "")],
    build: |scene, config, monitor| build(scene, config, monitor, Search::BranchAndBound),
    ..SPEC
};

const PARAMS: &[ParamSpec] = &[
    SLABS,
    FANOUT,
    CHILDREN,
    LEAF_SIZE,
    SLAB_LEAVES,
    params::ROBUST,
    ORDER,
    SEED,
];

const SLABS: ParamSpec = ParamSpec {
    name: "slabs",
    label: "Slabs",
    doc: "Pairs of planes around each node: 3 are a box, 7 add the diagonals of the cube, 13 those of its \
          faces too. More fit closer and cost memory and time at each node",
    unit: "slabs",
    kind: Kind::Choice(&[
        named("3", "3 Slabs"),
        named("7", "7 Slabs"),
        named("13", "13 Slabs"),
    ]),
    default: Value::Choice("3"),
    group: Group::Main,
    needs: &[],
};

const FANOUT: ParamSpec = ParamSpec {
    name: "fanout",
    label: "Fan-Out",
    doc: "limited: at most eight children; an object goes below one of them when they are all taken. any: the number \
          of children that costs least (Goldsmith and Salmon 1987); builds take longer where nodes have many",
    unit: "",
    kind: Kind::Choice(&[named("limited", "Limited"), named("any", "Any Number")]),
    default: Value::Choice("limited"),
    group: Group::Main,
    needs: &[],
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
    group: Group::Main,
    needs: &[Need {
        key: "fanout",
        only: Only::Options(&["limited"]),
    }],
};

const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Subtrees of at most this many triangles become leaves; 1 is the published form. More saves \
          memory and tests more",
    unit: "triangles",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Value::Integer(4),
    group: Group::Builder,
    needs: &[],
};

const ORDER: ParamSpec = ParamSpec {
    name: "order",
    label: "Order",
    doc: "Order in which triangles come, on which the tree depends. shuffled: random, as Goldsmith and Salmon advise, \
          because neighbours in a scene often are neighbours in its file. given: that of the scene",
    unit: "",
    kind: Kind::Choice(&[named("shuffled", "Shuffled"), named("given", "As Given")]),
    default: Value::Choice("shuffled"),
    group: Group::Builder,
    needs: &[],
};

const SEED: ParamSpec = ParamSpec {
    name: "seed",
    label: "Seed",
    doc: "Which random order triangles come in",
    unit: "",
    kind: Kind::Integer {
        min: 0,
        max: 0x7fff_ffff,
    },
    default: Value::Integer(1),
    group: Group::Builder,
    needs: &[Need {
        key: "order",
        only: Only::Options(&["shuffled"]),
    }],
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor, search: Search) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let objects = object::gather(scene, &frame);
    let growth = Growth {
        search,
        children: config.pick(
            "fanout",
            [("any", usize::MAX), ("limited", config.integer("children"))],
        ),
        order: config.pick(
            "order",
            [
                ("given", Order::Given),
                ("shuffled", Order::Shuffled(config.integer("seed") as u64)),
            ],
        ),
    };
    let grown = insertion::grow(&objects, &growth, monitor)?;
    let ids: Vec<_> = objects.iter().map(|object| object.id).collect();
    let order = Inserted {
        scene,
        config,
        frame,
        grown: &grown,
        ids: &ids,
    };
    match (config.choice("slabs"), leaf_tests::alone(config)) {
        ("3", false) => order.lay_out(dops::dops3),
        ("3", true) => order.lay_out(|tree, leaves| alone::dops3(tree, leaves, config.robust())),
        ("7", false) => order.lay_out(dops::dops7),
        ("7", true) => order.lay_out(|tree, leaves| alone::dops7(tree, leaves, config.robust())),
        _ => order.lay_out(dops::dops13),
    }
}

/// Triangles in the tree that insertion has grown.
struct Inserted<'a> {
    scene: &'a Triangles,
    config: &'a Config,
    frame: Frame,
    grown: &'a insertion::Grown,
    ids: &'a [u32],
}

impl Inserted<'_> {
    /// Lays the tree out with `D` slabs per node, writes its leaves and makes its plan.
    fn lay_out<const D: usize>(
        &self,
        kernel: impl FnOnce(&Arc<DopTree<D>>, &Arc<Blocks>) -> Arc<dyn SingleRays>,
    ) -> Result<Built> {
        let mut leaves = Leaves::new(params::keep(self.config));
        let mut ids = Vec::with_capacity(self.ids.len());
        let (scene, frame) = (self.scene, &self.frame);
        let framed = FramedScene { scene, frame };
        let leaf_size = self.config.integer("leaf_size");
        let tree = DopTree::new(
            self.grown,
            framed,
            self.ids,
            leaf_size,
            &mut leaves,
            &mut ids,
        )?;
        let shape = nested::shape(&tree, self.frame.bounds());
        let leaves = Arc::new(leaves.write(self.scene, &self.frame, &ids));
        let tree = Arc::new(tree);
        let plan = Plan::single("boxes", "heap", kernel(&tree, &leaves));
        Ok(objects::built(
            self.config,
            self.frame,
            tree,
            leaves,
            plan,
            shape,
        ))
    }
}
