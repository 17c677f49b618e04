// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes: from the builder's nodes to the tree and its plan.

pub mod rows;
pub mod scalar;

use crate::boxes::Boxes;
use crate::leaf_tests;
use crate::ways::{Pair, chosen, together};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_beam as beam;
use halfspace_builders::plane_boxes::PlaneBoxes;
use halfspace_group::{packet, tile};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::axis_tree::SharedAxisTree;
use halfspace_nodes::nested;
use halfspace_nodes::plane_boxes::PlaneBoxTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::planes::views::{Linked, Numbered};
use halfspace_nodes::preorder::Preorder;
use halfspace_nodes::projected_tree::ProjectedTree;
use halfspace_nodes::ropes::{self, Ropes};
use halfspace_nodes::shape::Shape;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_papers::{projected, rope};
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_ray::query::Closest;
use halfspace_scene::Triangles;
use halfspace_single::planes::dir;
use halfspace_single::steps::wide_planes;
use halfspace_stream as stream;
use halfspace_stream::flight;
use halfspace_stream::order::Rule;
use halfspace_structure::row::Derived;
use halfspace_structure::spec::Config;
use halfspace_structure::way::Rays;
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::{Kernel, SingleRays};
use std::sync::Arc;

/// A tree of split planes for which a plan is made.
pub struct Planes<'a> {
    tree: Arc<PlaneTree>,
    leaves: Arc<Blocks>,
    config: &'a Config,
    /// The frame of the tree.
    frame: &'a Frame,
    /// Whether traversals use error bounds, rather than being as published.
    robust: bool,
    monitor: &'a Monitor,
    shape: Shape,
    derived: Vec<Derived>,
    /// The nodes that store the number of a direction, where they have been derived.
    numbered: Option<Arc<ProjectedTree>>,
}

/// Share of the progress of a build that the boxes get. Their share of the time is smaller where planes are expensive.
const BOXES: f64 = 0.35;

/// Makes the kernel of single rays over a tree of planes.
type Single = fn(&Arc<PlaneTree>, &Arc<Blocks>) -> Arc<dyn SingleRays>;

/// Makes the kernel of single rays over a tree without oblique planes.
type AlongAxes = fn(&Arc<SharedAxisTree>, &Arc<Blocks>) -> Arc<dyn SingleRays>;

impl Planes<'_> {
    /// Single rays by plane distances.
    fn by_distances(&self) -> Plan {
        Plan::single("planes", "dir", dir::dir(&self.tree, &self.leaves))
    }

    /// Whether the structure's planes have few directions.
    fn has_few_directions(&self) -> bool {
        let ways = self.config.structure().ways;
        ways.contains(&rows::PROJECTED)
    }

    /// Single rays in the quickest way: projected onto the tree's directions where these are few, else by plane distances.
    fn quickest(&mut self) -> Result<Plan> {
        if self.has_few_directions() {
            self.projected()
        } else {
            Ok(self.by_distances())
        }
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
        Plan::single("planes", name, kernel)
    }

    /// The tree, for traversals of trees without oblique planes.
    fn axis_tree(&self) -> Result<Arc<SharedAxisTree>> {
        SharedAxisTree::new(&self.tree).map(Arc::new)
    }

    /// As [`Self::as_chosen`], by a traversal of trees without oblique planes.
    fn along_axes(
        &self,
        name: &'static str,
        bounded: AlongAxes,
        published: impl FnOnce(&Arc<SharedAxisTree>, &Arc<Blocks>) -> Arc<dyn SingleRays>,
    ) -> Result<Plan> {
        let tree = self.axis_tree()?;
        let kernel = if self.robust {
            bounded(&tree, &self.leaves)
        } else {
            published(&tree, &self.leaves)
        };
        Ok(Plan::single("planes", name, kernel))
    }

    /// Nearest hits in packets of this number of rays; shadow rays too in those of 16.
    fn packets(&self, rays: usize) -> Plan {
        let packets = packet::kernel::planes(&self.tree, &self.leaves, rays);
        let plan = self.by_distances().with_closest(Rays::Packet, packets);
        if rays < 16 {
            return plan;
        }
        let shadow = packet::kernel::shadow_planes(&self.tree, &self.leaves);
        plan.with_any(Rays::Packet, shadow)
    }

    /// Camera rays in `tiles`, shadow rays in tiles of 64.
    fn in_tiles(&self, tiles: Arc<dyn Kernel<Closest>>) -> Plan {
        let shadow = tile::kernel::shadow_planes(&self.tree, &self.leaves);
        (self.by_distances().with_tiles(Rays::Tile, tiles)).with_any(Rays::Tile, shadow)
    }

    /// All rays in streams.
    fn in_streams(&self) -> Plan {
        let streams = Pair {
            closest: stream::kernel::planes(&self.tree, &self.leaves),
            any: stream::kernel::shadow_planes(&self.tree, &self.leaves),
        };
        streams.take_all(self.by_distances(), Rays::Stream)
    }

    /// Derives nodes of seven planes.
    fn wide(&mut self) -> Result<Arc<WideTree>> {
        let nodes = WideTree::new(&self.tree);
        self.monitor.take(nodes.bytes())?;
        let nodes = Arc::new(nodes);
        self.derived.push(Derived {
            tree: nodes.clone(),
        });
        Ok(nodes)
    }

    /// Single rays through nodes of seven planes.
    fn singly_through(&self, nodes: &Arc<WideTree>) -> Plan {
        let single = wide_planes(nodes, &self.leaves);
        Plan::single("wide", "flight", single)
    }

    /// Rays in flight through nodes of seven planes.
    fn wide_in_flight(&mut self) -> Result<Plan> {
        let nodes = self.wide()?;
        let closest = flight::kernel::wide_planes(&nodes, &self.leaves);
        let shadow = flight::kernel::shadow_wide_planes(&nodes, &self.leaves);
        let plan = self.singly_through(&nodes);
        Ok((plan.with_closest(Rays::Flight, closest)).with_any(Rays::Flight, shadow))
    }

    /// Groups of rays through nodes of seven planes.
    fn wide_together(&mut self, rays: Rays) -> Result<Plan> {
        let nodes = self.wide()?;
        let groups = together!(&nodes, &self.leaves, wide_planes, shadow_wide_planes);
        let single = self.singly_through(&nodes);
        if rays != Rays::Auto {
            return Ok(groups.plan(single, rays));
        }
        // Tiles of shadow rays are slow where nodes have oblique planes, because each of the seven planes is compared
        // with all rays; streams take them instead.
        let plan = groups.streams.take_all(single, Rays::Stream);
        Ok((plan.with_tiles(Rays::Tile, groups.tiles.closest)).with_few_singly())
    }

    /// Nodes that store the number of a direction, derived once.
    fn numbered(&mut self) -> Result<Arc<ProjectedTree>> {
        if let Some(nodes) = &self.numbered {
            return Ok(nodes.clone());
        }
        let nodes = ProjectedTree::new(&self.tree)?;
        self.monitor.take(nodes.bytes())?;
        let nodes = Arc::new(nodes);
        self.derived.push(Derived {
            tree: Arc::new(Numbered {
                tree: self.tree.clone(),
                nodes: nodes.clone(),
            }),
        });
        self.numbered = Some(nodes.clone());
        Ok(nodes)
    }

    /// Tiles of 64 and packets of 16 that are projected onto the tree's directions.
    fn projected_together(&mut self) -> Result<[Pair; 2]> {
        let (nodes, leaves) = (self.numbered()?, &self.leaves);
        Ok([
            Pair {
                closest: tile::kernel::projected(&nodes, leaves),
                any: tile::kernel::shadow_projected(&nodes, leaves),
            },
            Pair {
                closest: packet::kernel::projected(&nodes, leaves),
                any: packet::kernel::shadow_projected(&nodes, leaves),
            },
        ])
    }

    /// Tiles of 64 and packets of 16 in the quickest way, as [`Self::quickest`].
    fn quickest_together(&mut self) -> Result<[Pair; 2]> {
        if self.has_few_directions() {
            return self.projected_together();
        }
        let (tree, leaves) = (&self.tree, &self.leaves);
        Ok([
            Pair {
                closest: tile::kernel::planes(tree, leaves),
                any: tile::kernel::shadow_planes(tree, leaves),
            },
            Pair {
                closest: packet::kernel::planes(tree, leaves, 16),
                any: packet::kernel::shadow_planes(tree, leaves),
            },
        ])
    }

    /// Single rays that are projected onto the tree's directions.
    fn projected(&mut self) -> Result<Plan> {
        let nodes = self.numbered()?;
        let make = if self.robust {
            projected::projected
        } else {
            projected::projected_published
        };
        let kernel = make(&nodes, &self.leaves);
        Ok(Plan::single("planes", "projected", kernel))
    }

    /// Derives links of this kind from the tree.
    fn links(&mut self, kind: ropes::LinkKind) -> Result<Arc<Ropes>> {
        let tree = self.axis_tree()?;
        let ropes = Ropes::new(tree.borrowed(), self.frame.bounds(), kind, self.monitor)?;
        self.shape.links = ropes.count();
        let ropes = Arc::new(ropes);
        self.derived.push(Derived {
            tree: Arc::new(Linked {
                tree,
                ropes: ropes.clone(),
            }),
        });
        Ok(ropes)
    }

    /// Single rays from leaf to leaf by links of this kind.
    fn roped(&mut self, name: &'static str, kind: ropes::LinkKind) -> Result<Plan> {
        let ropes = self.links(kind)?;
        let make = if self.robust {
            rope::rope
        } else {
            rope::rope_published
        };
        let kernel = make(&self.axis_tree()?, &self.leaves, ropes);
        Ok(Plan::single("planes", name, kernel))
    }
}

/// Runs the part of a build that makes the planes; progress leaves room for boxes where rays need them.
pub fn during_planes<T>(config: &Config, monitor: &Monitor, work: impl FnOnce() -> T) -> T {
    let boxed = config.way().nodes == "boxes";
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
    if config.way().nodes == "boxes" {
        drop(blocks);
        return boxed(scene, config, frame, &tree, monitor);
    }
    let mut planes = Planes {
        tree: Arc::new(tree),
        leaves: Arc::new(blocks),
        config,
        frame: &frame,
        robust: config.robust(),
        monitor,
        shape: Shape::new(preorder),
        derived: Vec::new(),
        numbered: None,
    };
    let way = config.way();
    let plan = match way.rays {
        _ if leaf_tests::alone(config) => (chosen(&scalar::ONE_BY_ONE, way).plan)(&mut planes)?,
        Rays::Beam => (chosen(&rows::BEAMS, way).plan)(&mut planes)?,
        _ if way.nodes == "wide" => (chosen(&rows::WIDE, way).plan)(&mut planes)?,
        _ => (chosen(&rows::BINARY, way).plan)(&mut planes)?,
    };
    let choice = config.choice("shadow");
    let beams =
        (choice == "beam").then(|| beam::kernel::shadow_planes(&planes.tree, &planes.leaves));
    let plan = plan.with_shadow(choice, beams);
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
        refit: None,
    })
}

/// Makes boxes around what the planes separate, with leaves of their own. The planes are not kept.
fn boxed(
    scene: &Triangles,
    config: &Config,
    frame: Frame,
    planes: &PlaneTree,
    monitor: &Monitor,
) -> Result<Built> {
    let framed = FramedScene {
        scene,
        frame: &frame,
    };
    let made = monitor.during(BOXES, || PlaneBoxes::new(planes, framed, monitor))?;
    let boxes = Boxes {
        tree: Arc::new(made.tree),
        leaves: Arc::new(made.blocks),
        any_order: Rule::Cost,
    };
    let plan = boxes.plan(config);
    Ok(Built {
        frame,
        shape: nested::shape(&*boxes.tree, frame.bounds()),
        tree: Some(Arc::new(PlaneBoxTree(boxes.tree))),
        leaves: boxes.leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(config.choice("shadow"), None),
        left_out: Vec::new(),
        growing: None,
        refit: None,
    })
}
