// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies (Wächter and Keller 2006): one row for each form of the nodes. A parameter
//! selects how triangles are divided; the row by area has the costs of its heuristic as parameters.

pub mod params;

use params::{BY_SURFACE, CHILDREN, CUT, LEAF_SIZE, SPLIT, WIDE_LEAVES};
pub use params::{EMPTY, LEAVES, SLAB_LEAVES};

use crate::leaf_tests;
use crate::left_out;
use crate::list::List;
use crate::params as shared;
use crate::refit::{self, Layers, MakePlan};
use crate::ways::{distinct, every_way, together, traversal};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::binned::SurfaceArea;
use halfspace_builders::global::Global;
use halfspace_builders::middle::{At, Longest};
use halfspace_builders::{grid_order, object};
use halfspace_geom::Aabb;
use halfspace_geom::tighten::Tighten;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::nested;
use halfspace_nodes::object_tree::ObjectTree;
use halfspace_nodes::refit::FitTree;
use halfspace_nodes::slab_boxes::SlabBoxes;
use halfspace_nodes::slab_node::Double;
use halfspace_nodes::slab_tree::{Gaps, SlabTree};
use halfspace_nodes::slab_wide::WideSlabs;
use halfspace_papers::alone;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single::objects::{slab_boxes, slabs, wide_slabs};
use halfspace_structure::row::{Family, Menu, Named, ParamSpec, StructureSpec};
use halfspace_structure::spec::Config;
use halfspace_structure::way::Way;
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::SingleRays;
use std::sync::Arc;

/// Reads the threshold below which empty space is cut off from a configuration.
pub fn tighten(config: &Config) -> Tighten {
    Tighten(f64::from(config.float("empty")))
}

const WACHTER_KELLER: &str =
    "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy";

const WACHTER: &str = "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; \
                       Wächter 2008, Quasi-Monte Carlo light transport simulation by efficient ray tracing";

/// Ways through the nodes of interval hierarchies.
pub const WAYS: [Way; 5] = every_way("intervals", "ordered");

const OPTIONS: List<Named> = distinct(&WAYS);

/// The parameter `traversal` with these ways.
pub const TRAVERSAL: ParamSpec = traversal(OPTIONS.slice());

/// The registry's row: two planes a node.
pub const PLAIN: StructureSpec = StructureSpec {
    id: "bih",
    code: 40,
    label: "Bounding interval hierarchy",
    family: Family::Objects,
    summary: "Two planes a node, triangles divided by a regular grid or otherwise: for scenes that change in each frame.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Ooi, \
            McDonell and Sacks-Davis 1987, Spatial kd-tree; Zachmann 2002, Minimal hierarchical \
            collision detection",
    params: &[SPLIT, TRAVERSAL, LEAF_SIZE, EMPTY, LEAVES, shared::ROBUST],
    ways: &WAYS,
    no_groups: "",
    menu: Menu::Intervals,
    literature: &[("BIH", ""), ("SKD-tree", ""), ("BoxTree", "")],
    sweep: false,
    claims: &["intervals-*", "moving-*"],
    build: |scene, config, monitor| {
        let order = ordered(scene, config, monitor, 2)?;
        order.lay_out(
            |binary, bounds, leaves| {
                SlabTree::new(binary, bounds, tighten(config), Gaps::Leaf, leaves)
            },
            |config, tree, leaves, _| two_planes(config, tree, leaves),
        )
    },
};

/// The registry's row: the surface area heuristic instead of the grid.
pub const SURFACE_AREA: StructureSpec = StructureSpec {
    id: "bih-sah",
    code: 41,
    label: "Interval hierarchy by area",
    summary: "Two planes a node, triangles divided where the surface area heuristic is lowest.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Wald 2007, On \
            fast construction of SAH-based bounding volume hierarchies",
    params: &[
        TRAVERSAL,
        EMPTY,
        LEAVES,
        shared::ROBUST,
        shared::step_cost(Costs::BLOCKS),
        shared::leaf_cost(Costs::BLOCKS),
        shared::triangle_cost(Costs::BLOCKS),
        shared::LEAF_MAX,
    ],
    literature: &[("BIH by SAH", "")],
    claims: &["intervals-*", "moving-*"],
    build: |scene, config, monitor| {
        let frame = Frame::new(scene.bounds());
        let policy = shared::surface_area(config, Costs::BLOCKS);
        let binary = object::build(scene, &frame, &policy, monitor)?;
        let order = Ordered {
            scene,
            config,
            frame,
            binary,
        };
        order.lay_out(
            |binary, bounds, leaves| {
                SlabTree::new(binary, bounds, tighten(config), Gaps::Leaf, leaves)
            },
            |config, tree, leaves, _| two_planes(config, tree, leaves),
        )
    },
    ..PLAIN
};

/// The registry's row: with the fifth case. Where much of a region is empty, a node with one child cuts it off on both
/// sides: its two planes are where the child begins and where it ends.
pub const FIFTH_CASE: StructureSpec = StructureSpec {
    id: "bih5",
    code: 42,
    label: "Interval hierarchy, empty cut",
    summary: "As bih, and nodes of one child that cut off empty space on both sides.",
    paper: WACHTER_KELLER,
    params: &[
        SPLIT,
        TRAVERSAL,
        CUT,
        LEAF_SIZE,
        EMPTY.needing(BY_SURFACE),
        LEAVES,
        shared::ROBUST,
    ],
    literature: &[("BIH, five cases", "")],
    claims: &["intervals-*"],
    build: |scene, config, monitor| {
        let gaps = config.pick(
            "cut",
            [("surface", Gaps::OneChild), ("split", Gaps::SplitAxis)],
        );
        let order = ordered(scene, config, monitor, 2)?;
        order.lay_out(
            |binary, bounds, leaves| SlabTree::new(binary, bounds, tighten(config), gaps, leaves),
            |config, tree, leaves, _| two_planes(config, tree, leaves),
        )
    },
    ..PLAIN
};

/// The registry's row: one plane a node, eight bytes. It bounds the child for which that saves more.
pub const ONE_PLANE: StructureSpec = StructureSpec {
    id: "bih1",
    code: 43,
    label: "Interval hierarchy, one plane",
    summary: "One plane a node, which bounds one of the two children: the smallest nodes of all hierarchies.",
    paper: WACHTER_KELLER,
    literature: &[("BIH, one plane", "")],
    claims: &["intervals-*"],
    build: |scene, config, monitor| {
        let order = ordered(scene, config, monitor, 2)?;
        order.lay_out(
            |binary, bounds, leaves| {
                SlabTree::new(binary, bounds, tighten(config), Gaps::OneChild, leaves)
            },
            |config, tree, leaves, _| {
                if leaf_tests::alone(config) {
                    return one_by_one(alone::single_slabs(tree, leaves, config.robust()));
                }
                let groups = together!(tree, leaves, single_intervals, shadow_single_intervals);
                groups.plan(
                    one_by_one(slabs::single_slabs(tree, leaves)),
                    config.way().rays,
                )
            },
        )
    },
    ..PLAIN
};

/// The registry's row: two or more children a node, each between two planes of its own, all along one axis and tested at
/// once.
pub const WIDE: StructureSpec = StructureSpec {
    id: "bih-n",
    code: 45,
    label: "Interval hierarchy, wide",
    summary: "Several intervals a node along one axis, tested at once.",
    paper: WACHTER,
    params: &[
        CHILDREN,
        SPLIT,
        TRAVERSAL,
        LEAF_SIZE,
        EMPTY,
        WIDE_LEAVES,
        shared::ROBUST,
    ],
    literature: &[("BIH, four planes", "n=2"), ("BIH, n-ary", "n=4")],
    claims: &["intervals-*"],
    build: |scene, config, monitor| {
        let children = config.choice("n").parse().expect("a choice of numbers");
        wide(scene, config, monitor, children)
    },
    ..PLAIN
};

/// The registry's row: traversed as boxes.
pub const AS_BOXES: StructureSpec = StructureSpec {
    id: "bih-bvh",
    code: 46,
    label: "Interval hierarchy as boxes",
    summary: "The tree of bih; rays make the boxes of a box hierarchy from its planes on the way down, a group of rays one \
              box a node.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; Wald, Boulos and \
            Shirley 2007, Ray tracing deformable scenes using dynamic bounding volume hierarchies",
    literature: &[("BIH traversed as BVH", "")],
    claims: &["intervals-*"],
    build: |scene, config, monitor| {
        let order = ordered(scene, config, monitor, 2)?;
        order.lay_out(
            |binary, bounds, leaves| {
                SlabTree::new(binary, bounds, tighten(config), Gaps::Leaf, leaves)
            },
            |config, tree, leaves, bounds| {
                let boxes = Arc::new(SlabBoxes {
                    tree: tree.clone(),
                    bounds,
                });
                if leaf_tests::alone(config) {
                    return one_by_one(alone::slab_boxes(&boxes, leaves, config.robust()));
                }
                let groups = together!(&boxes, leaves, slab_boxes, shadow_slab_boxes);
                let single = one_by_one(slab_boxes::slab_boxes(&boxes, leaves));
                groups.plan(single, config.way().rays)
            },
        )
    },
    ..PLAIN
};

/// Triangles in the order of a binary tree over them.
struct Ordered<'a> {
    scene: &'a Triangles,
    config: &'a Config,
    frame: Frame,
    binary: ObjectTree,
}

/// Orders the triangles as the configuration chooses, for nodes of up to `children` children.
fn ordered<'a>(
    scene: &'a Triangles,
    config: &'a Config,
    monitor: &Monitor,
    children: usize,
) -> Result<Ordered<'a>> {
    let frame = Frame::new(scene.bounds());
    let longest = |at| Longest {
        leaf_size: config.integer("leaf_size"),
        at,
    };
    let binary = match config.choice("split") {
        "middle" => object::build(scene, &frame, &longest(At::Middle), monitor)?,
        "median" => object::build(scene, &frame, &longest(At::Median), monitor)?,
        "sah" => {
            let policy = SurfaceArea {
                costs: Costs::BLOCKS,
                leaf_max: shared::LARGEST_LEAF,
            };
            object::build(scene, &frame, &policy, monitor)?
        }
        _ => {
            let policy = Global {
                leaf_size: config.integer("leaf_size"),
                ways: children,
            };
            // The fast order needs partitions that depend on the cell alone. With more children, empty halves matter
            // too.
            if children == 2 {
                grid_order::build(scene, &frame, &policy, monitor)?
            } else {
                object::build(scene, &frame, &policy, monitor)?
            }
        }
    };
    Ok(Ordered {
        scene,
        config,
        frame,
        binary,
    })
}

impl Ordered<'_> {
    /// Lays the tree out, writes its leaves and makes its plan.
    fn lay_out<T: FitTree>(
        &self,
        nodes: impl FnOnce(&ObjectTree, Aabb, &mut Leaves) -> Result<T>,
        plan: MakePlan<T>,
    ) -> Result<Built> {
        let mut leaves = Leaves::new(shared::keep(self.config));
        let bounds = self.frame.bounds();
        let tree = nodes(&self.binary, bounds, &mut leaves)?;
        let (shape, blocks) = rayon::join(
            || nested::shape(&tree, bounds),
            || leaves.write(self.scene, &self.frame, &self.binary.ids),
        );
        let layers = Layers {
            frame: self.frame,
            tree: Arc::new(tree),
            leaves: Arc::new(blocks),
            shape,
        };
        let remark = (self.config.float("empty") > 0.0)
            .then(|| left_out::no_empty_space(&layers.shape))
            .flatten();
        let mut built = refit::built(self.config, layers, plan);
        built.left_out.extend(remark);
        Ok(built)
    }
}

fn one_by_one(kernel: Arc<dyn SingleRays>) -> Plan {
    Plan::single("intervals", "intervals", kernel)
}

/// The plan of trees of two planes per node.
fn two_planes(config: &Config, tree: &Arc<SlabTree<Double>>, leaves: &Arc<Blocks>) -> Plan {
    if leaf_tests::alone(config) {
        return one_by_one(alone::slabs(tree, leaves, config.robust()));
    }
    let groups = together!(tree, leaves, intervals, shadow_intervals);
    groups.plan(one_by_one(slabs::slabs(tree, leaves)), config.way().rays)
}

/// Builds a hierarchy with an interval for each of 2, 4 or 8 children.
fn wide(scene: &Triangles, config: &Config, monitor: &Monitor, children: usize) -> Result<Built> {
    let order = ordered(scene, config, monitor, children)?;
    let tighten = tighten(config);
    match children {
        2 => order.lay_out(
            |binary, bounds, leaves| WideSlabs::new(binary, bounds, tighten, leaves),
            |config, tree, leaves, _| {
                if leaf_tests::alone(config) {
                    return one_by_one(alone::wide_slabs2(tree, leaves, config.robust()));
                }
                let groups = together!(tree, leaves, intervals2, shadow_intervals2);
                groups.plan(
                    one_by_one(wide_slabs::wide_slabs2(tree, leaves)),
                    config.way().rays,
                )
            },
        ),
        4 => order.lay_out(
            |binary, bounds, leaves| WideSlabs::new(binary, bounds, tighten, leaves),
            |config, tree, leaves, _| {
                let groups = together!(tree, leaves, intervals4, shadow_intervals4);
                groups.plan(
                    one_by_one(wide_slabs::wide_slabs4(tree, leaves)),
                    config.way().rays,
                )
            },
        ),
        _ => order.lay_out(
            |binary, bounds, leaves| WideSlabs::new(binary, bounds, tighten, leaves),
            |config, tree, leaves, _| {
                let groups = together!(tree, leaves, intervals8, shadow_intervals8);
                groups.plan(
                    one_by_one(wide_slabs::wide_slabs8(tree, leaves)),
                    config.way().rays,
                )
            },
        ),
    }
}
