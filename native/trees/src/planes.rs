// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes: from the builder's nodes to the tree and its plan.

use crate::params;
use crate::traversal::{Traversal, chosen, offer, parameter};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::plane_boxes::PlaneBoxes;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::plane_boxes::PlaneBoxTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::planes::views::Linked;
use halfspace_nodes::preorder::Preorder;
use halfspace_nodes::ropes::{self, Ropes};
use halfspace_nodes::shape::Shape;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::row::{Derived, ParamSpec};
use halfspace_structure::spec::Config;
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::SingleRays;
use halfspace_trace::single::objects::boxes::boxes8;
use halfspace_trace::single::planes::{
    arvo, dir, rope, seq, seq_1985, sung, ta_a, ta_b, ta_b_1997, ta_b_poly,
};
use halfspace_trace::{beam, flight, packet, stream, tile};
use std::sync::Arc;

/// A tree of split planes for which a plan is made.
pub struct Planes<'a> {
    tree: Arc<PlaneTree>,
    leaves: Arc<Blocks>,
    scene: &'a Triangles,
    config: &'a Config,
    /// Without the choice of `robust`.
    frame: &'a Frame,
    /// Whether traversals use error bounds, rather than being as published.
    robust: bool,
    monitor: &'a Monitor,
    shape: Shape,
    derived: Vec<Derived>,
}

/// Share of the build time that progress gives to the boxes. It is less where planes are expensive.
const BOXES: f64 = 0.35;

/// Makes the kernels for a tree of split planes. May derive further nodes from it.
pub type MakePlan = fn(&mut Planes<'_>) -> Result<Plan>;

/// All traversals of split planes.
pub const TRAVERSALS: [Traversal<MakePlan>; 17] = [
    Traversal {
        name: "auto",
        doc: "the fastest for each batch: through boxes around what the planes separate, camera rays and shadow rays in \
              tiles, other rays in streams, which visit each node once for all rays that meet it; rays are counted as \
              dir traverses",
        plan: auto,
    },
    Traversal {
        name: "dir",
        doc: "one by one, by plane distances in the order of the direction",
        plan: |planes| Ok(planes.singly("dir", dir::dir(&planes.tree, &planes.leaves))),
    },
    Traversal {
        name: "wide",
        doc: "nodes of three levels at a time, several rays in turn, many rays in random order sorted by origin",
        plan: wide,
    },
    Traversal {
        name: "boxes",
        doc: "one by one, through boxes around what the planes separate, eight to a node, with leaves of their own, which \
              take about as much memory again",
        plan: boxes,
    },
    Traversal {
        name: "tile8",
        doc: "as dir, but camera rays in tiles of 64, and shadow rays of one light in tiles of 64 from the light; tiles \
              whose rays diverge are split into packets",
        plan: |planes| {
            let mut plan = planes.singly("dir", dir::dir(&planes.tree, &planes.leaves));
            plan.tiles = Some(tile::kernel::planes(&planes.tree, &planes.leaves));
            plan.shadow = Some(tile::kernel::shadow_planes(&planes.tree, &planes.leaves));
            Ok(plan)
        },
    },
    Traversal {
        name: "tile16",
        doc: "as tile8, but camera rays in tiles of 256",
        plan: |planes| {
            let mut plan = planes.singly("dir", dir::dir(&planes.tree, &planes.leaves));
            plan.tiles = Some(tile::kernel::large_planes(&planes.tree, &planes.leaves));
            plan.shadow = Some(tile::kernel::shadow_planes(&planes.tree, &planes.leaves));
            Ok(plan)
        },
    },
    Traversal {
        name: "p4",
        doc: "as dir, but nearest hits in packets of 4 rays, one to a lane",
        plan: |planes| planes.packets(4),
    },
    Traversal {
        name: "p8",
        doc: "the same in packets of 8",
        plan: |planes| planes.packets(8),
    },
    Traversal {
        name: "p16",
        doc: "the same in packets of 16, shadow rays too, which are counted as dir traverses",
        plan: |planes| planes.packets(16),
    },
    Traversal {
        name: "ta-b",
        doc: "one by one, by entry and exit points (Havran et al. 1997)",
        plan: |planes| {
            let (bounded, published) = (ta_b::ta_b, ta_b_1997::ta_b_published);
            let mut plan = planes.as_chosen("ta-b", bounded, published);
            plan.cases = &halfspace_ray::cases::NAMES;
            Ok(plan)
        },
    },
    Traversal {
        name: "ta-b-poly",
        doc: "one by one, by the heights of entry and exit points over planes of any direction",
        plan: |planes| {
            let kernel = ta_b_poly::ta_b_poly(&planes.tree, &planes.leaves);
            Ok(planes.singly("ta-b-poly", kernel))
        },
    },
    Traversal {
        name: "ta-a",
        doc: "one by one, by the side of the origin and distances (Havran et al. 1997)",
        plan: |planes| Ok(planes.as_chosen("ta-a", ta_a::ta_a, ta_a::ta_a_published)),
    },
    Traversal {
        name: "sung",
        doc: "one by one, by the side of the origin and distances (Sung and Shirley 1992)",
        plan: |planes| Ok(planes.as_chosen("sung", sung::sung, sung::sung_published)),
    },
    Traversal {
        name: "arvo",
        doc: "one by one, by the side of the origin and distances (Arvo 1988)",
        plan: |planes| Ok(planes.as_chosen("arvo", arvo::arvo, arvo::arvo_published)),
    },
    Traversal {
        name: "seq",
        doc: "one by one, each leaf located from the root, without a stack (Kaplan 1985)",
        plan: |planes| {
            let bounds = planes.frame.bounds();
            Ok(planes.as_chosen("seq", seq::seq, |tree, leaves| {
                seq_1985::seq_published(tree, leaves, bounds)
            }))
        },
    },
    Traversal {
        name: "rope",
        doc: "one by one, from leaf to leaf by links to what lies across each face (MacDonald and Booth 1990), which take \
              about twice the memory of the nodes and more",
        plan: |planes| planes.roped("rope", ropes::Kind::Ropes),
    },
    Traversal {
        name: "ropetree",
        doc: "the same by a small tree for each face (Havran et al. 1998)",
        plan: |planes| planes.roped("ropetree", ropes::Kind::RopeTrees),
    },
];

/// Camera rays as beams, for a structure without a choice of traversals (Heckbert and Hanrahan 1984).
const BEAMS: Traversal<MakePlan> = Traversal {
    name: "beams",
    doc: "camera rays in tiles of 64 that each plane cuts as one beam, other rays as dir",
    plan: |planes| {
        let least = u32::try_from(planes.config.integer("beam_least")).expect("in range");
        let mut plan = planes.singly("dir", dir::dir(&planes.tree, &planes.leaves));
        plan.tiles = Some(beam::kernel::planes(&planes.tree, &planes.leaves, least));
        plan.cases = &beam::planes::NAMES;
        Ok(plan)
    },
};

/// Traversals of axis-aligned trees.
pub const AXIS: ParamSpec = parameter(
    &const {
        offer(
            &TRAVERSALS,
            [
                "auto", "dir", "wide", "boxes", "tile8", "tile16", "p4", "p8", "p16", "ta-b",
                "ta-a", "sung", "arvo", "seq", "rope", "ropetree",
            ],
        )
    },
);

/// The same with single rays as the default: for a tree that others are measured against.
pub const BASELINE: ParamSpec = parameter(
    &const {
        offer(
            &TRAVERSALS,
            [
                "dir", "auto", "wide", "boxes", "tile8", "tile16", "p4", "p8", "p16", "ta-b",
                "ta-a", "sung", "arvo", "seq", "rope", "ropetree",
            ],
        )
    },
);

/// Traversals of trees with oblique planes.
pub const ANY: ParamSpec = parameter(
    &const {
        offer(
            &TRAVERSALS,
            [
                "auto",
                "dir",
                "wide",
                "boxes",
                "tile8",
                "tile16",
                "p4",
                "p8",
                "p16",
                "ta-b-poly",
            ],
        )
    },
);

/// Traversals of axis-aligned trees that only serve comparisons.
pub const PLAIN: ParamSpec = parameter(
    &const {
        offer(
            &TRAVERSALS,
            [
                "dir", "ta-b", "ta-a", "sung", "arvo", "seq", "rope", "ropetree",
            ],
        )
    },
);

/// Makes the kernel of single rays over a tree of planes.
type Single = fn(&Arc<PlaneTree>, &Arc<Blocks>) -> Arc<dyn SingleRays>;

impl Planes<'_> {
    fn singly(&self, name: &'static str, kernel: Arc<dyn SingleRays>) -> Plan {
        Plan::single(name, kernel)
    }

    /// Single rays with error bounds, or as published.
    fn as_chosen(
        &self,
        name: &'static str,
        bounded: Single,
        published: impl FnOnce(&Arc<PlaneTree>, &Arc<Blocks>) -> Arc<dyn SingleRays>,
    ) -> Plan {
        let kernel = if self.robust {
            bounded(&self.tree, &self.leaves)
        } else {
            published(&self.tree, &self.leaves)
        };
        self.singly(name, kernel)
    }

    fn packets(&self, rays: usize) -> Result<Plan> {
        let mut plan = self.singly("dir", dir::dir(&self.tree, &self.leaves));
        plan.closest = Some(packet::kernel::planes(&self.tree, &self.leaves, rays));
        if rays == 16 {
            plan.shadow = Some(packet::kernel::shadow_planes(&self.tree, &self.leaves));
        }
        Ok(plan)
    }

    fn roped(&mut self, name: &'static str, kind: ropes::Kind) -> Result<Plan> {
        let ropes = Ropes::new(&self.tree, self.frame.bounds(), kind, self.monitor)?;
        self.shape.links = ropes.count();
        let ropes = Arc::new(ropes);
        self.derived.push(Derived {
            tree: Arc::new(Linked {
                tree: self.tree.clone(),
                ropes: ropes.clone(),
            }),
            leaves: None,
            single: false,
        });
        let make = if self.robust {
            rope::rope
        } else {
            rope::rope_published
        };
        Ok(self.singly(name, make(&self.tree, &self.leaves, ropes)))
    }

    /// Makes boxes around what the planes separate. `single`: whether single rays traverse them.
    fn make_boxes(&mut self, single: bool) -> Result<(Arc<BoxTree<8>>, Arc<Blocks>)> {
        let made = self.monitor.during(BOXES, || {
            PlaneBoxes::new(&self.tree, (self.scene, self.frame), self.monitor)
        })?;
        let (tree, leaves) = (Arc::new(made.tree), Arc::new(made.blocks));
        self.derived.push(Derived {
            tree: Arc::new(PlaneBoxTree(tree.clone())),
            leaves: Some(leaves.clone()),
            single,
        });
        Ok((tree, leaves))
    }
}

fn auto(planes: &mut Planes<'_>) -> Result<Plan> {
    let (boxes, leaves) = planes.make_boxes(false)?;
    let mut plan = planes.singly("dir", dir::dir(&planes.tree, &planes.leaves));
    plan.placed = Some(boxes8(&boxes, &leaves));
    plan.closest = Some(stream::kernel::boxes(&boxes, &leaves));
    plan.tiles = Some(tile::kernel::boxes_uncounted(&boxes, &leaves));
    plan.shadow = Some(tile::kernel::shadow_boxes(&boxes, &leaves));
    Ok(plan)
}

fn boxes(planes: &mut Planes<'_>) -> Result<Plan> {
    let (boxes, leaves) = planes.make_boxes(true)?;
    Ok(planes.singly("boxes", boxes8(&boxes, &leaves)))
}

fn wide(planes: &mut Planes<'_>) -> Result<Plan> {
    let nodes = WideTree::new(&planes.tree);
    planes.monitor.take(nodes.bytes())?;
    let nodes = Arc::new(nodes);
    planes.derived.push(Derived {
        tree: nodes.clone(),
        leaves: None,
        single: false,
    });
    let single = flight::kernel::single_wide_planes(&nodes, &planes.leaves);
    let mut plan = planes.singly("wide", single);
    plan.closest = Some(flight::kernel::wide_planes(&nodes, &planes.leaves));
    plan.shadow = Some(flight::kernel::shadow_wide_planes(&nodes, &planes.leaves));
    Ok(plan)
}

/// Runs the part of a build that makes the planes; progress leaves room for boxes where the traversal needs them.
pub fn during_planes<T>(config: &Config, monitor: &Monitor, work: impl FnOnce() -> T) -> T {
    let boxed = ["auto", "boxes"].contains(&params::traversal(config));
    monitor.during(if boxed { 1.0 - BOXES } else { 1.0 }, work)
}

/// Lays out a tree of split planes and makes the plan that the configuration chooses.
///
/// # Errors
/// As [`PlaneTree::new`], and those of the nodes that the traversal derives.
pub fn lay_out(
    scene: &Triangles,
    config: &Config,
    frame: Frame,
    preorder: &Preorder,
    monitor: &Monitor,
) -> Result<Built> {
    let mut blocks = Blocks::new();
    let tree = PlaneTree::new(preorder, scene, &frame, &mut blocks)?;
    let frame = frame.with_robust(config.robust());
    let mut planes = Planes {
        tree: Arc::new(tree),
        leaves: Arc::new(blocks),
        scene,
        config,
        frame: &frame,
        robust: config.robust(),
        monitor,
        shape: Shape::new(preorder),
        derived: Vec::new(),
    };
    let row = match config.find("beam_least") {
        Some(_) => &BEAMS,
        None => chosen(&TRAVERSALS, config),
    };
    let plan = (row.plan)(&mut planes)?;
    let choice = config.choice("shadow");
    let beams =
        (choice == "beam").then(|| beam::kernel::shadow_planes(&planes.tree, &planes.leaves));
    let plan = plan.with_shadow(choice, row.name == "wide", beams);
    let Planes {
        tree,
        leaves,
        shape,
        derived,
        ..
    } = planes;
    Ok(Built {
        frame,
        tree: Some(tree),
        leaves,
        derived,
        plan,
        shape,
        left_out: Vec::new(),
        growing: None,
    })
}
