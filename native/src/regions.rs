// SPDX-License-Identifier: GPL-3.0-or-later
//! What nodes cover, whatever their layout: convex regions with their faces, for drawing and for
//! following a ray. Walks do not come here.

use crate::build::cell::Plane;
use crate::geom::Aabb;
use crate::structure::{Layout, Structure};
use crate::traverse::objects::Objects;

mod layouts;
mod region;

pub use self::layouts::Boxes;
pub use self::region::{Face, Line, Region, rectangle};

/// What is found at a node.
#[derive(Debug, Clone, Default)]
pub struct Found<P> {
    /// For a leaf, where its blocks begin and how many triangles they hold.
    pub leaf: Option<(u32, usize)>,
    /// For an inner node, the planes that it states, each with its kind as in [`crate::polygons`].
    pub planes: Vec<(Plane, u8)>,
    /// Its children and their regions.
    pub children: Vec<(P, Region)>,
}

/// A layout, seen as nodes that cover regions.
pub trait Cells {
    /// Where a node is found.
    type Place: Copy;

    /// The root and its region; `bounds` is the scene's box.
    fn top(&self, bounds: Aabb) -> (Self::Place, Region);

    /// What is found at a node of this region.
    fn look(&self, place: Self::Place, region: &Region) -> Found<Self::Place>;
}

/// Something to be done with a layout, whatever it is.
pub trait Task {
    /// What comes out.
    type Result;

    /// Does it.
    fn run<T: Cells>(self, tree: &T) -> Self::Result;
}

/// Does `task` with the tree whose leaves the walks of single rays test: most often the structure's own; `None` when it
/// has none.
pub fn with_walked_cells<K: Task>(structure: &Structure, task: K) -> Option<K::Result> {
    match structure.walked() {
        Some(boxes) => Some(task.run(&Boxes(&boxes.tree))),
        None => with_cells(structure, task),
    }
}

/// Does `task` with a structure's tree; `None` when it has none.
pub fn with_cells<K: Task>(structure: &Structure, task: K) -> Option<K::Result> {
    Some(match &structure.built().layout {
        Layout::Brute => return None,
        Layout::Lazy(_) => unreachable!("what is built is whole"),
        Layout::Plane(tree, _) => task.run(tree),
        Layout::Objects(Objects::Slanted(tree)) => task.run(tree),
        Layout::Objects(tree) => task.run(&Boxes(tree.nested())),
        Layout::Grid(grid) => task.run(grid),
        Layout::OctreeParam(tree)
        | Layout::OctreeNet(tree)
        | Layout::OctreeBeam(tree, _)
        | Layout::OctreeSamet(tree)
        | Layout::OctreeGlassner(tree) => task.run(tree),
    })
}

/// A leaf: where it is and what it holds.
#[derive(Debug, Clone, Copy)]
pub struct Leaf<'a> {
    /// Where its blocks begin.
    pub first: u32,
    /// How many triangles they hold.
    pub count: usize,
    /// Of the leaf; the root has depth 0.
    pub depth: usize,
    /// What it covers.
    pub region: &'a Region,
}

/// Visits all leaves in the order of the tree.
pub fn each_leaf<T: Cells>(tree: &T, bounds: Aabb, mut see: impl FnMut(Leaf<'_>)) {
    let (top, whole) = tree.top(bounds);
    let mut waiting = vec![(top, whole, 0)];
    while let Some((place, region, depth)) = waiting.pop() {
        let found = tree.look(place, &region);
        if let Some((first, count)) = found.leaf {
            see(Leaf {
                first,
                count,
                depth,
                region: &region,
            });
        }
        let children = found.children.into_iter().rev();
        waiting.extend(children.map(|(place, region)| (place, region, depth + 1)));
    }
}
