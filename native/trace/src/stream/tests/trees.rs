// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of every kind over one scene, and the answers of brute force.

use crate::batch::Batch;
use crate::kernel::{Kernel, SingleRays};
use crate::single::brute::brute;
use fearless_simd::Level;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::binned::SurfaceArea;
use halfspace_builders::piece::Whole;
use halfspace_builders::space::{self, Node, ObliqueStep, Params, PlanePolicy, Stop};
use halfspace_builders::sweep::Ties;
use halfspace_builders::{grid, object, octree, slanted};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{ConvexCell, Direction};
use halfspace_geom::tighten::Tighten;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::keep::Keep;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::grid::Grid;
use halfspace_nodes::object_tree::ObjectTree;
use halfspace_nodes::octants::Cube;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::slab_node::SlabNode;
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_nodes::slab_wide::WideSlabs;
use halfspace_nodes::slant_tree::SlantTree;
use halfspace_nodes::slanted_tree::DIRECTIONS as DIRECTIONS_OF_SLABS;
use halfspace_ray::FramedScene;
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;
use halfspace_ray::query::Query;
use halfspace_scene::Triangles;
use std::sync::Arc;

/// A tree and its leaves.
pub struct Grown<T> {
    pub tree: Arc<T>,
    pub leaves: Arc<Blocks>,
}

/// The frame of trees over a scene.
pub fn frame_of(scene: &Triangles) -> Frame {
    Frame::new(scene.bounds())
}

/// A batch of rays of the scene.
pub fn batch<'a>(
    scene: &'a Triangles,
    frame: &'a Frame,
    rays: &'a [Ray],
    level: Level,
) -> Batch<'a> {
    Batch {
        scene,
        frame,
        rays,
        level,
        shadow_cache: false,
        placed: None,
    }
}

/// Answers a batch with a kernel.
pub fn answers<Q: Query>(
    kernel: &(impl Kernel<Q> + ?Sized),
    scene: &Triangles,
    rays: &[Ray],
    level: Level,
    blank: Q::Answer,
) -> Vec<Q::Answer> {
    let mut answers = vec![blank; rays.len()];
    kernel.trace(&batch(scene, &frame_of(scene), rays, level), &mut answers);
    answers
}

/// Brute force over the triangles that can be hit.
pub fn brute_force(scene: &Triangles) -> Arc<dyn SingleRays> {
    let frame = frame_of(scene);
    let mut blocks = Blocks::new();
    blocks.push_leaf(scene, &frame, scene.live());
    blocks.seal();
    brute(&Arc::new(blocks), scene.live().len())
}

/// Sweeps these directions at every node.
struct Sweep(&'static [Direction]);

/// The axes, and directions along which nothing lies.
const DIRECTIONS: [Direction; 6] = [
    Direction::Axis(0),
    Direction::Axis(1),
    Direction::Axis(2),
    Direction::Oblique([0.6, 0.8, 0.0]),
    Direction::Oblique([0.0, -0.6, 0.8]),
    Direction::Oblique([0.48, 0.6, -0.64]),
];

impl PlanePolicy for Sweep {
    type Cell = ConvexCell;
    type Piece = Whole;

    fn root(&self, bounds: Aabb) -> ConvexCell {
        ConvexCell::from_box(bounds, bounds.magnitude())
    }

    fn directions(&self, _: &Node<'_, Whole>, out: &mut Vec<Direction>) {
        out.extend(self.0);
    }
}

/// A tree of objects by the surface area heuristic.
pub fn objects(scene: &Triangles) -> ObjectTree {
    let policy = SurfaceArea {
        costs: Costs::BOXES,
        leaf_max: 4,
    };
    let frame = frame_of(scene);
    object::build(scene, &frame, &policy, &Monitor::new()).expect("enough memory")
}

/// Lays out a tree of objects; `leaves` keep corners or indices.
pub fn laid_out<T>(
    scene: &Triangles,
    keep: Keep,
    make: impl FnOnce(&ObjectTree, &mut Leaves) -> Result<T>,
) -> Grown<T> {
    let (binary, mut leaves) = (objects(scene), Leaves::new(keep));
    let tree = make(&binary, &mut leaves).expect("enough memory");
    let frame = frame_of(scene);
    Grown {
        tree: Arc::new(tree),
        leaves: Arc::new(leaves.write(scene, &frame, &binary.ids)),
    }
}

/// Nodes of boxes.
pub fn boxes<const W: usize>(scene: &Triangles) -> Grown<BoxTree<W>> {
    laid_out(scene, Keep::Corners, BoxTree::new)
}

/// Intervals along the axes. Empty space is cut off often, by nodes with one child.
pub fn slabs<N: SlabNode>(scene: &Triangles, keep: Keep) -> Grown<SlabTree<N>> {
    let bounds = frame_of(scene).bounds();
    laid_out(scene, keep, |binary, leaves| {
        SlabTree::new(binary, bounds, Tighten(0.9), true, leaves)
    })
}

/// Nodes of several intervals along one axis.
pub fn wide_slabs<const W: usize>(scene: &Triangles) -> Grown<WideSlabs<W>> {
    let bounds = frame_of(scene).bounds();
    laid_out(scene, Keep::Indices, |binary, leaves| {
        WideSlabs::new(binary, bounds, Tighten(0.9), leaves)
    })
}

/// Intervals along thirteen directions.
pub fn slanted(scene: &Triangles) -> Grown<SlantTree> {
    let policy = slanted::Policy {
        costs: Costs::BOXES,
        oblique_step: Costs::BOXES.step,
        leaf_max: 4,
        empty: 0.9,
        directions: DIRECTIONS_OF_SLABS,
    };
    let frame = frame_of(scene);
    let built = slanted::build(scene, &frame, &policy, &Monitor::new()).expect("enough memory");
    let mut leaves = Leaves::new(Keep::Corners);
    let tree = SlantTree::new(&built, &mut leaves).expect("enough memory");
    Grown {
        tree: Arc::new(tree),
        leaves: Arc::new(leaves.write(scene, &frame, &built.ids)),
    }
}

/// A uniform grid.
pub fn cells(scene: &Triangles) -> Grown<Grid> {
    let frame = frame_of(scene);
    let mut blocks = Blocks::new();
    let number = 4.0 * scene.live().len() as f64;
    let framed = FramedScene {
        scene,
        frame: &frame,
    };
    let tree = grid::build(framed, number, &mut blocks, &Monitor::new());
    Grown {
        tree: Arc::new(tree.expect("enough memory")),
        leaves: Arc::new(blocks),
    }
}

/// An octree.
pub fn octree(scene: &Triangles) -> Grown<Octree> {
    let frame = frame_of(scene);
    let cube = Cube::new(&frame, 8, false);
    let params = octree::Params {
        cube,
        leaf_size: 2,
        budget: 64,
        margin: 0.0,
    };
    let octants = octree::build(scene, &frame, &params, &Monitor::new()).expect("enough memory");
    let mut blocks = Blocks::new();
    let framed = FramedScene {
        scene,
        frame: &frame,
    };
    let tree = Octree::new(&octants, cube, framed, &mut blocks).expect("enough memory");
    Grown {
        tree: Arc::new(tree),
        leaves: Arc::new(blocks),
    }
}

/// A tree of split planes across the axes, or, with `oblique`, across other directions, too.
pub fn planes(scene: &Triangles, oblique: bool) -> Grown<PlaneTree> {
    let frame = frame_of(scene);
    let params = Params {
        costs: Costs::PLANES,
        oblique: ObliqueStep::Fixed(Costs::PLANES.step),
        ties: Ties::Clean,
        slab: 0.0,
        leaf_size: 1,
        leaf_most: 8,
        area_stop: 0.0,
        max_depth: 24,
        stop: Stop::Cheapest,
        sorted: false,
        early: false,
        enough: 0.0,
    };
    let policy = Sweep(&DIRECTIONS[if oblique { 0..6 } else { 0..3 }]);
    let preorder = space::build(scene, &frame, &policy, &params, &Monitor::new());
    let preorder = preorder.expect("enough memory");
    let mut blocks = Blocks::new();
    let tree = PlaneTree::new(&preorder, scene, &frame, &mut blocks).expect("enough memory");
    Grown {
        tree: Arc::new(tree),
        leaves: Arc::new(blocks),
    }
}
