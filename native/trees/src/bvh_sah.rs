// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding volume hierarchy of today's renderers: binned surface area heuristic, wide nodes,
//! ordered traversal. The yardstick of all other structures.

use crate::traversal::{Traversal, chosen, offer, parameter};
use crate::{objects, params};
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_builders::object;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::keep::Keep;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::nested;
use halfspace_nodes::object_tree::ObjectTree;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::row::{Kind, ParamSpec, StructureSpec};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::SingleRays;
use halfspace_trace::single::objects::boxes::{boxes2, boxes4, boxes8};
use halfspace_trace::{flight, packet, stream, tile};
use std::sync::Arc;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bvh-sah",
    code: 30,
    label: "Bounding volume hierarchy",
    family: "objects",
    summary: "Boxes around boxes by the surface area heuristic: what most renderers use today.",
    paper: "Wald 2007, On fast construction of SAH-based bounding volume hierarchies; Wald, Benthin and \
            Boulos 2008, Getting rid of packets",
    params: &[
        TRAVERSAL,
        WIDTH,
        params::ROBUST,
        params::step_cost(Costs::BOXES),
        params::leaf_cost(Costs::BOXES),
        params::triangle_cost(Costs::BOXES),
        params::LEAF_MAX,
    ],
    build,
};

/// A tree of eight boxes to a node for which a plan is made.
struct Boxes {
    tree: Arc<BoxTree<8>>,
    leaves: Arc<Blocks>,
}

/// Makes the kernels for a tree of eight boxes to a node.
type MakePlan = fn(&Boxes) -> Result<Plan>;

/// Traversals of eight boxes to a node.
const TRAVERSALS: [Traversal<MakePlan>; 8] = [
    Traversal {
        name: "ordered",
        doc: "one by one, the nearest box first",
        plan: |boxes| Ok(boxes.singly()),
    },
    Traversal {
        name: "auto",
        doc: "the fastest for each batch: tile8 for camera rays and for shadow rays, for other rays streams, which visit \
              each node once for all rays that meet it",
        plan: |boxes| {
            let mut plan = boxes.singly();
            plan.placed = Some(boxes8(&boxes.tree, &boxes.leaves));
            plan.closest = Some(stream::kernel::boxes(&boxes.tree, &boxes.leaves));
            plan.tiles = Some(tile::kernel::boxes_uncounted(&boxes.tree, &boxes.leaves));
            plan.shadow = Some(tile::kernel::shadow_boxes(&boxes.tree, &boxes.leaves));
            Ok(plan)
        },
    },
    Traversal {
        name: "wide",
        doc: "several rays in flight, boxes in the order of the direction's octant, many rays in random order sorted by \
              origin",
        plan: |boxes| {
            let mut plan = boxes.singly();
            plan.closest = Some(flight::kernel::wide_boxes(&boxes.tree, &boxes.leaves));
            plan.shadow = Some(flight::kernel::shadow_wide_boxes(
                &boxes.tree,
                &boxes.leaves,
            ));
            Ok(plan)
        },
    },
    Traversal {
        name: "tile8",
        doc: "camera rays in tiles of 64, shadow rays of one light in tiles of 64 from the light; tiles whose rays diverge \
              are split into packets",
        plan: |boxes| {
            let mut plan = boxes.singly();
            plan.tiles = Some(tile::kernel::boxes(&boxes.tree, &boxes.leaves));
            plan.shadow = Some(tile::kernel::shadow_boxes(&boxes.tree, &boxes.leaves));
            Ok(plan)
        },
    },
    Traversal {
        name: "tile16",
        doc: "as tile8, but camera rays in tiles of 256",
        plan: |boxes| {
            let mut plan = boxes.singly();
            plan.tiles = Some(tile::kernel::large_boxes(&boxes.tree, &boxes.leaves));
            plan.shadow = Some(tile::kernel::shadow_boxes(&boxes.tree, &boxes.leaves));
            Ok(plan)
        },
    },
    Traversal {
        name: "p4",
        doc: "packets of 4 rays, one to a lane",
        plan: |boxes| Ok(boxes.packets(4)),
    },
    Traversal {
        name: "p8",
        doc: "packets of 8",
        plan: |boxes| Ok(boxes.packets(8)),
    },
    Traversal {
        name: "p16",
        doc: "packets of 16, shadow rays too. All but ordered need eight boxes to a node, and count shadow rays as ordered \
              traverses them",
        plan: |boxes| {
            let mut plan = boxes.packets(16);
            plan.shadow = Some(packet::kernel::shadow_boxes(&boxes.tree, &boxes.leaves));
            Ok(plan)
        },
    },
];

impl Boxes {
    fn singly(&self) -> Plan {
        Plan::single("ordered", boxes8(&self.tree, &self.leaves))
    }

    fn packets(&self, rays: usize) -> Plan {
        let mut plan = self.singly();
        plan.closest = Some(packet::kernel::boxes(&self.tree, &self.leaves, rays));
        plan
    }
}

const TRAVERSAL: ParamSpec = parameter(
    &const {
        offer(
            &TRAVERSALS,
            [
                "ordered", "auto", "wide", "tile8", "tile16", "p4", "p8", "p16",
            ],
        )
    },
);

const WIDTH: ParamSpec = ParamSpec {
    name: "width",
    label: "Width",
    doc: "Boxes per node, all tested at once. More makes fewer, dearer steps; 2 is the textbook's tree",
    unit: "boxes",
    kind: Kind::Choice(&["8", "4", "2"]),
    default: Value::Choice("8"),
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let (traversal, width) = (config.choice("traversal"), config.choice("width"));
    if traversal != "ordered" && width != "8" {
        return Err(Error::Spec(format!(
            "traversal={traversal} needs width=8, got width={width}"
        )));
    }
    let frame = Frame::new(scene.bounds());
    let policy = params::surface_area(config, Costs::BOXES);
    let binary = object::build(scene, &frame, &policy, monitor)?;
    let order = Ordered {
        scene,
        config,
        frame,
        binary,
    };
    match width {
        "2" => order.lay_out(
            |tree| tree,
            |tree, leaves| Ok(ordered(boxes2(tree, leaves))),
        ),
        "4" => order.lay_out(
            |tree| tree,
            |tree, leaves| Ok(ordered(boxes4(tree, leaves))),
        ),
        _ => {
            let by_corners = matches!(traversal, "wide" | "auto");
            order.lay_out(
                |tree| if by_corners { tree.by_corners() } else { tree },
                |tree, leaves| {
                    let boxes = Boxes {
                        tree: tree.clone(),
                        leaves: leaves.clone(),
                    };
                    (chosen(&TRAVERSALS, config).plan)(&boxes)
                },
            )
        }
    }
}

fn ordered(kernel: Arc<dyn SingleRays>) -> Plan {
    Plan::single("ordered", kernel)
}

/// Triangles in the order of a binary tree over them.
struct Ordered<'a> {
    scene: &'a Triangles,
    config: &'a Config,
    frame: Frame,
    binary: ObjectTree,
}

impl Ordered<'_> {
    /// Lays the tree out with `W` boxes a node, writes its leaves and makes its plan.
    fn lay_out<const W: usize>(
        &self,
        place: impl FnOnce(BoxTree<W>) -> BoxTree<W>,
        plan: impl FnOnce(&Arc<BoxTree<W>>, &Arc<Blocks>) -> Result<Plan>,
    ) -> Result<Built> {
        let mut leaves = Leaves::new(Keep::Corners);
        let tree = Arc::new(place(BoxTree::new(&self.binary, &mut leaves)?));
        let leaves = Arc::new(leaves.write(self.scene, &self.frame, &self.binary.ids));
        let shape = nested::shape(&*tree, self.frame.bounds());
        let plan = plan(&tree, &leaves)?;
        // Rays in flight look into the shadow cache themselves.
        let cached = params::traversal(self.config) == "wide";
        Ok(objects::built(
            self.config,
            self.frame,
            tree,
            leaves,
            plan,
            cached,
            shape,
        ))
    }
}
