// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal by tiles of all nodes that cut the intervals of rays ([`crate::visits`]): interval arithmetic over the whole
//! tile bounds the distances in which any of its rays may be inside a child. Children are visited nearest first.

use crate::packet::traversal::PacketTree;
use crate::tile::leaf::{self, Resolver};
use crate::tile::nearest::join;
use crate::tile::planes::{Cut, Plane, across, oblique};
use crate::tile::traversal::TileTree;
use crate::tile::{LANES, Tile};
use crate::visits::{Nodes, wide_planes};
use fearless_simd::Simd;
use halfspace_geom::Aabb;
use halfspace_geom::vec3::map;
use halfspace_nodes::dop_tree::NORMALS;
use halfspace_nodes::grid::Grid;
use halfspace_nodes::next::Next;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_node::{SlabKind, SlabNode};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_nodes::slab_wide::{LEAF, WideSlabs};
use halfspace_nodes::slant_tree::{self, SlantKind, SlantTree};
use halfspace_nodes::wide_tree::{PLANES, WideTree};
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;
use halfspace_trace::input::Input;
use halfspace_trace::stack::{Entry, make_room, pop_within};

/// A node and the interval of distances in which rays of the tile may be inside it.
#[derive(Clone, Copy)]
pub struct NodeEntry<P> {
    node: P,
    inside: Interval,
}

impl<P: Copy> Entry for NodeEntry<P> {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.inside.enter
    }
}

/// The stack of a tile.
pub struct Stack<P> {
    entries: Vec<NodeEntry<P>>,
    size: usize,
    /// Index of the first child of the node that is visited.
    base: usize,
}

impl<P: Copy> Stack<P> {
    /// A stack with room for the deepest path.
    fn new<T: Nodes<Node = P>>(tree: &T) -> Self {
        let blank = NodeEntry {
            node: tree.root(),
            inside: Interval::new(0.0, 0.0),
        };
        Self {
            entries: vec![blank; (MAX_DEPTH + 3) * T::CHILDREN],
            size: 0,
            base: 0,
        }
    }

    /// Pushes a child, if it exists and the tile meets it. Of children that the tile enters at the same distance, the
    /// one pushed last is visited first.
    #[inline(always)]
    fn push(&mut self, child: Option<P>, inside: Interval) {
        let Some(node) = child.filter(|_| inside.enter <= inside.leave) else {
            return;
        };
        let at = make_room(&mut self.entries, self.base, &mut self.size, inside.enter);
        self.entries[at] = NodeEntry { node, inside };
    }
}

/// A tree whose nodes cut the interval of a tile.
trait TileNodes: Nodes {
    /// Pushes the children of an inner node that the tile meets.
    fn cut<S: Simd, const R: usize>(
        &self,
        simd: S,
        tile: &Tile<R>,
        own: &NodeEntry<Self::Node>,
        stack: &mut Stack<Self::Node>,
    );
}

/// The part of an interval below (0) or above (1) a plane.
#[inline(always)]
fn part(cut: &Cut, side: u32, Interval { enter, leave }: Interval) -> Interval {
    if cut.near == side {
        Interval::new(enter, leave.min(cut.crossing.leave))
    } else {
        Interval::new(enter.max(cut.crossing.enter), leave)
    }
}

/// The part of an interval between two planes across an axis.
#[inline(always)]
fn between<const R: usize>(
    tile: &Tile<R>,
    axis: usize,
    [low, high]: [f32; 2],
    inside: Interval,
) -> Interval {
    let above = part(&across(tile, axis, low, 0, 0), 1, inside);
    part(&across(tile, axis, high, 0, 0), 0, above)
}

/// Traverses the tree with a tile; returns whether it finished within its budget. Steps and leaves are counted for the
/// tile's first ray, visits for each active ray.
#[inline(always)]
fn trace<S: Simd, T: TileNodes, C: Counters, J: Resolver<R>, const R: usize>(
    simd: S,
    tree: &T,
    input: Input<'_>,
    tile: &mut Tile<R>,
    resolver: &mut J,
    stack: &mut Stack<T::Node>,
    counters: &mut [C],
) -> bool {
    let mut budget = J::BUDGET * R * LANES;
    (stack.size, stack.base) = (0, 0);
    stack.push(Some(tree.root()), tile.inside);
    // Pop the nearest node that starts before the farthest ray's end.
    while let Some(mut own) = pop_within(&stack.entries, &mut stack.size, tile.far) {
        own.inside.leave = own.inside.leave.min(tile.far);
        join(tile, counters);
        let Some(leaf) = tree.leaf(&own.node) else {
            tree.count(&own.node, &mut counters[0]);
            stack.base = stack.size;
            tree.cut(simd, tile, &own, stack);
            if let Some(next) = stack.entries[..stack.size].last() {
                tree.fetch_ahead(&next.node, input.blocks);
            }
            continue;
        };
        counters[0].leaf(leaf.count);
        let kept = leaf::test(simd, input, leaf, own.inside, tile, resolver, counters);
        // Give up tiles whose rays diverge: a leaf costs four units of the budget, each kept candidate one.
        match budget.checked_sub(4 + kept) {
            Some(left) => budget = left,
            None => return false,
        }
    }
    true
}

impl TileNodes for WideTree {
    #[inline(always)]
    fn cut<S: Simd, const R: usize>(
        &self,
        simd: S,
        tile: &Tile<R>,
        own: &NodeEntry<u32>,
        stack: &mut Stack<u32>,
    ) {
        // Compute where the tile crosses the seven planes.
        let mut cuts = [Cut::NONE; PLANES];
        let line = if Next::of(own.node) == Next::GENERAL {
            let lines = self.lines(own.node);
            for (i, cut) in cuts.iter_mut().enumerate() {
                let (normal, offset) = (wide_planes::normal(lines, i), lines[0].first[i]);
                *cut = oblique(simd, tile, Plane { normal, offset }, 0, 0);
            }
            &lines[0]
        } else {
            let line = self.line(own.node);
            for (i, cut) in cuts.iter_mut().enumerate() {
                *cut = across(tile, wide_planes::axis(line, i) % 3, line.first[i], 0, 0);
            }
            line
        };
        // Cut the interval on three levels, the far side first.
        for far in [true, false] {
            let top = cuts[0].near ^ u32::from(far);
            let first = part(&cuts[0], top, own.inside);
            for far in [true, false] {
                let plane = 1 + top as usize;
                let middle = cuts[plane].near ^ u32::from(far);
                let second = part(&cuts[plane], middle, first);
                for far in [true, false] {
                    let plane = 3 + 2 * top as usize + middle as usize;
                    let low = cuts[plane].near ^ u32::from(far);
                    let child = wide_planes::child(line, (4 * top + 2 * middle + low) as usize);
                    stack.push(child, part(&cuts[plane], low, second));
                }
            }
        }
    }
}

/// The region of a node of which no plane is known.
const EVERYWHERE: Aabb = Aabb {
    min: [f32::NEG_INFINITY; 3],
    max: [f32::INFINITY; 3],
};

impl<N: SlabNode> TileNodes for SlabTree<N> {
    #[inline(always)]
    fn cut<S: Simd, const R: usize>(
        &self,
        _: S,
        tile: &Tile<R>,
        own: &NodeEntry<N>,
        stack: &mut Stack<N>,
    ) {
        match own.node.kind() {
            SlabKind::Pair { axis, link } => {
                let parts = own.node.parts(axis, &EVERYWHERE);
                let far = usize::from(tile.up[axis]);
                for side in [far, far ^ 1] {
                    let Aabb { min, max } = parts[side];
                    let inside = between(tile, axis, [min[axis], max[axis]], own.inside);
                    stack.push(Some(self.nodes[link as usize + side]), inside);
                }
            }
            SlabKind::Only { axis, link } => {
                let [Aabb { min, max }, _] = own.node.parts(axis, &EVERYWHERE);
                let inside = between(tile, axis, [min[axis], max[axis]], own.inside);
                stack.push(Some(self.nodes[link as usize]), inside);
            }
            SlabKind::Leaf { .. } => {}
        }
    }
}

impl<const W: usize> TileNodes for WideSlabs<W> {
    #[inline(always)]
    fn cut<S: Simd, const R: usize>(
        &self,
        _: S,
        tile: &Tile<R>,
        own: &NodeEntry<u32>,
        stack: &mut Stack<u32>,
    ) {
        let node = &self.nodes[own.node as usize];
        let axis = (node.word & LEAF) as usize % 3;
        for child in 0..node.children() {
            let lane = child as usize % W;
            let planes = [node.planes[0][lane], node.planes[1][lane]];
            let inside = between(tile, axis, planes, own.inside);
            stack.push(Some(node.link() + child), inside);
        }
    }
}

impl TileNodes for SlantTree {
    #[inline(always)]
    fn cut<S: Simd, const R: usize>(
        &self,
        simd: S,
        tile: &Tile<R>,
        own: &NodeEntry<slant_tree::Node>,
        stack: &mut Stack<slant_tree::Node>,
    ) {
        let SlantKind::Inner {
            direction,
            alone,
            planes,
            link,
        } = own.node.kind()
        else {
            return;
        };
        // Halve the normals, which are up to sqrt(3) long: the bounds of oblique planes hold for lengths up to 1.
        let normal = map(NORMALS[direction % NORMALS.len()], |x| 0.5 * x);
        let [first, second] = planes.map(|plane| 0.5 * plane);
        let plane = |offset| Plane { normal, offset };
        let cuts = [
            oblique(simd, tile, plane(first), 0, 0),
            oblique(simd, tile, plane(second), 0, 0),
        ];
        let link = link as usize;
        if alone {
            // The only child lies between the planes.
            let inside = part(&cuts[1], 0, part(&cuts[0], 1, own.inside));
            stack.push(Some(self.nodes[link]), inside);
            return;
        }
        for side in [cuts[0].near ^ 1, cuts[0].near] {
            let inside = part(&cuts[side as usize % 2], side, own.inside);
            stack.push(Some(self.nodes[link + side as usize]), inside);
        }
    }
}

impl TileNodes for Octree {
    #[inline(always)]
    fn cut<S: Simd, const R: usize>(
        &self,
        _: S,
        tile: &Tile<R>,
        own: &NodeEntry<Self::Node>,
        stack: &mut Stack<Self::Node>,
    ) {
        let mid = own.node.mid(self);
        let cuts = [
            across(tile, 0, mid[0], 0, 0),
            across(tile, 1, mid[1], 0, 0),
            across(tile, 2, mid[2], 0, 0),
        ];
        let near = cuts[0].near | cuts[1].near << 1 | cuts[2].near << 2;
        // Cut the interval at the three mid planes, the octant far of all of them first.
        for far in (0..8).rev() {
            let octant = near ^ far;
            let mut inside = own.inside;
            for (axis, cut) in cuts.iter().enumerate() {
                inside = part(cut, octant >> axis & 1, inside);
            }
            stack.push(own.node.child(self, octant as usize, mid), inside);
        }
    }
}

impl TileNodes for Grid {
    #[inline(always)]
    fn cut<S: Simd, const R: usize>(
        &self,
        _: S,
        tile: &Tile<R>,
        own: &NodeEntry<Self::Node>,
        stack: &mut Stack<Self::Node>,
    ) {
        let wall = own.node.wall(self);
        let cut = across(tile, wall.axis, wall.at, 0, 0);
        for side in [cut.near ^ 1, cut.near] {
            let child = own.node.part(self, wall, side as usize);
            stack.push(child, part(&cut, side, own.inside));
        }
    }
}

/// Implements tiles for a tree.
macro_rules! tiles {
    ([$($of:tt)*] $tree:ty) => {
        impl<$($of)*> TileTree for $tree
        where
            Self: PacketTree,
        {
            type Room = Stack<<Self as Nodes>::Node>;

            fn room(&self) -> Self::Room {
                Stack::new(self)
            }

            #[inline(always)]
            fn trace_tile<S: Simd, C: Counters, J: Resolver<R>, const R: usize>(
                &self,
                simd: S,
                input: Input<'_>,
                tile: &mut Tile<R>,
                resolver: &mut J,
                stack: &mut Self::Room,
                counters: &mut [C],
            ) -> bool {
                trace(simd, self, input, tile, resolver, stack, counters)
            }
        }
    };
}

tiles!([] WideTree);
tiles!([N: SlabNode] SlabTree<N>);
tiles!([const W: usize] WideSlabs<W>);
tiles!([] SlantTree);
tiles!([] Octree);
tiles!([] Grid);
