// SPDX-License-Identifier: GPL-3.0-or-later
//! Object trees seen from outside, whatever their layout: for their shape, for validation and for
//! drawing. Walks do not come here.

use crate::cells::{Cells, NodeId, NodeView, SLAB};
use crate::check;
use crate::shape::{Measure, Shape};
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_geom::region::Region;

/// What is found at a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// A leaf, by where its triangles begin and their number.
    Leaf {
        /// Where its triangles begin.
        first: u32,
        /// How many they are.
        count: usize,
    },
    /// An inner node that states the box of each child.
    Boxes,
    /// An inner node that states, along one axis, between which planes each child lies.
    Slabs {
        /// 0, 1 or 2.
        axis: usize,
    },
}

/// Where a node is found: what the number means is the layout's own affair.
pub type Place = (u32, u32);

/// A layout of an object tree.
pub trait Nested {
    /// Where the root is found.
    fn top(&self) -> Place;

    /// What is found at `place`. The children of an inner node are appended, each with the region that
    /// the nodes on its path leave it; `region` is that of the node itself.
    fn look(&self, place: Place, region: &Aabb, children: &mut Vec<(Place, Aabb)>) -> Look;

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;

    /// Whether the bounds of a node hold those of its children, as far as regions do not say it.
    fn nests(&self, place: Place) -> bool {
        let _ = place;
        true
    }

    /// Whether the bounds of a leaf hold a triangle, as far as its region does not say it.
    fn holds(&self, leaf: Place, corners: [[f32; 3]; 3]) -> bool {
        let _ = (leaf, corners);
        true
    }
}

/// Visits all nodes below `bounds`, parents before children: place and region, depth, what is there,
/// and the places and regions of the children.
pub fn visit<T: Nested + ?Sized>(
    tree: &T,
    bounds: Aabb,
    mut see: impl FnMut((Place, &Aabb), usize, Look, &[(Place, Aabb)]),
) {
    let mut waiting = vec![(tree.top(), bounds, 0)];
    let mut children = Vec::new();
    while let Some((place, region, depth)) = waiting.pop() {
        children.clear();
        let look = tree.look(place, &region, &mut children);
        see((place, &region), depth, look, &children);
        waiting.extend(
            children
                .iter()
                .rev()
                .map(|&(place, region)| (place, region, depth + 1)),
        );
    }
}

/// Measures a tree over a scene of these bounds.
pub fn shape<T: Nested + ?Sized>(tree: &T, bounds: Aabb) -> Shape {
    let mut measure = Measure::default();
    let root_area = bounds.area();
    visit(tree, bounds, |(_, region), depth, look, _| {
        let share = if root_area > 0.0 && !region.is_empty() {
            region.area() / root_area
        } else {
            0.0
        };
        if let Look::Leaf { count, .. } = look {
            measure.leaf(count, depth, share);
        } else {
            measure.axis(share);
        }
    });
    measure.finish()
}

/// Every layout of boxes or slabs.
impl<T: Nested + PartialEq + std::fmt::Debug + Send + Sync + 'static> Tree for T {
    fn bytes(&self) -> usize {
        Nested::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        // Regions do not matter here; this one contains every node.
        let everywhere = Aabb {
            min: [f32::MIN; 3],
            max: [f32::MAX; 3],
        };
        visit(self, everywhere, |_, _, look, _| {
            if let Look::Leaf { first, count } = look {
                see(first, count);
            }
        });
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::objects::object_tree(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A node is named by its [`Place`].
impl<T: Nested> Cells for T {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        let (a, b) = self.top();
        ([a, b, 0, 0], Region::of_scene(bounds))
    }

    fn node(&self, [a, b, ..]: NodeId, region: &Region) -> NodeView {
        let mut children = Vec::new();
        let bounds = region.bounds().expect("a box within a tree of boxes");
        let look = self.look((a, b), &bounds, &mut children);
        let planes = match look {
            Look::Leaf { first, count } => return NodeView::leaf(first, count),
            Look::Boxes => Vec::new(),
            // Only planes that cut something off the region are planes of this node.
            Look::Slabs { axis } => (children.iter())
                .filter(|(_, child)| !child.is_empty())
                .flat_map(|(_, child)| {
                    [
                        (bounds.min[axis], child.min[axis]),
                        (bounds.max[axis], child.max[axis]),
                    ]
                })
                .filter(|(whole, part)| whole != part)
                .map(|(_, offset)| {
                    let direction = Direction::Axis(axis);
                    (Plane { direction, offset }, SLAB)
                })
                .collect(),
        };
        let regions = children
            .into_iter()
            .map(|((a, b), bounds)| ([a, b, 0, 0], region.part(bounds)));
        NodeView {
            planes,
            children: regions.collect(),
            boxes: look == Look::Boxes,
            leaf: None,
        }
    }
}
