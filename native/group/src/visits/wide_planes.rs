// SPDX-License-Identifier: GPL-3.0-or-later
//! Wide nodes of split planes, three binary levels at a time, one ray per lane
//! ([`halfspace_single::steps::planes`]). The octant, or for oblique planes the first ray, decides the order of the
//! children; each ray keeps its own interval in all of them.

use crate::visits::planes::{Plane, oblique};
use crate::visits::{Cut, FAR, INV, Inside, Lanes, NEAR, Nodes, Visitor};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::next::Next;
use halfspace_nodes::wide_tree::{Info, Line as Row, PLANES, WideTree};
use halfspace_ray::query::Counters;

/// Number of children of a node.
const CHILDREN: usize = PLANES + 1;

impl Nodes for WideTree {
    /// The word of a node or a leaf.
    type Node = u32;
    const CHILDREN: usize = CHILDREN;

    fn root(&self) -> u32 {
        WideTree::root(self)
    }

    #[inline(always)]
    fn leaf(&self, node: &u32) -> Option<Leaf> {
        (Next::of(*node) == Next::LEAF).then(|| WideTree::leaf(self, *node))
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &u32, blocks: &Blocks) {
        match Next::of(*node) {
            Next::PLAIN => WideTree::fetch_ahead::<1>(self, *node),
            Next::GENERAL => WideTree::fetch_ahead::<3>(self, *node),
            _ => blocks.fetch_ahead(WideTree::leaf(self, *node).first),
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, node: &u32, counters: &mut C) {
        if Next::of(*node) == Next::GENERAL {
            counters.step_oblique();
        } else {
            counters.step_axis();
        }
    }

    #[inline(always)]
    fn visit<S: Simd>(&self, simd: S, node: &u32, visitor: &mut impl Visitor<u32>) {
        if Next::of(*node) == Next::GENERAL {
            let lines = self.lines(*node);
            let lead = visitor.lead();
            let signs = signs(|i| {
                let [x, y, z] = normal(lines, i);
                (x * lead[0] + y * lead[1] + z * lead[2]).is_sign_negative()
            });
            let children = children(&lines[0], signs);
            visitor.distribute(simd, children, &Across { lines, signs });
        } else {
            let line = self.line(*node);
            let octant = visitor.octant();
            let signs = signs(|i| octant >> axis(line, i) & 1 == 1);
            let children = children(line, signs);
            visitor.distribute(simd, children, &Along { line, signs });
        }
    }

    fn bytes(&self) -> usize {
        WideTree::bytes(self)
    }
}

/// Bit `i` is set if the rays descend through plane `i`.
#[inline(always)]
fn signs(down: impl Fn(usize) -> bool) -> usize {
    (0..PLANES).fold(0, |signs, i| signs | usize::from(down(i)) << i)
}

/// Axis of a plane of a node whose planes are all axis-aligned.
#[inline(always)]
pub fn axis(line: &Row, i: usize) -> usize {
    let info = Info(line.first[PLANES].to_bits());
    (info.along_y() >> i & 1 | (info.along_z() >> i & 1) << 1) as usize
}

/// Normal of a plane of a node with oblique planes.
#[inline(always)]
pub fn normal(lines: &[Row; 3], i: usize) -> [f32; 3] {
    [lines[1].first[i], lines[1].second[i], lines[2].first[i]]
}

/// The sides of part `i` of a node on the three levels, 1 for above: the farthest part is the first.
#[inline(always)]
fn sides(signs: usize, i: usize) -> [usize; 3] {
    // The near child of a plane is the upper one for a descending ray.
    let rank = CHILDREN - 1 - i;
    let top = (signs ^ rank >> 2) & 1;
    let middle = (signs >> (1 + top) ^ rank >> 1) & 1;
    let low = (signs >> (3 + 2 * top + middle) ^ rank) & 1;
    [top, middle, low]
}

/// The children of a node, the farthest first; `None` for those without triangles.
#[inline(always)]
fn children(line: &Row, signs: usize) -> [Option<u32>; CHILDREN] {
    std::array::from_fn(|i| {
        let [top, middle, low] = sides(signs, i);
        child(line, 4 * top + 2 * middle + low)
    })
}

/// A child of a node; `None` if it contains no triangles.
#[inline(always)]
pub fn child(line: &Row, child: usize) -> Option<u32> {
    let used = Info(line.first[PLANES].to_bits()).used();
    (used >> child & 1 == 1).then(|| line.second[child].to_bits())
}

/// Cuts the intervals in a node on three levels; `cut` cuts those of one part at a plane and returns the far side and
/// the near side. The farthest part is the first. `SKIPS`: whether a part that no ray meets is not cut, which saves
/// more than the test costs where planes are oblique.
#[inline(always)]
fn levels<S: Simd, const SKIPS: bool>(
    whole: Inside<S>,
    signs: usize,
    cut: impl Fn(usize, Inside<S>) -> [Inside<S>; 2],
) -> [Inside<S>; CHILDREN] {
    let mut parts = [whole; CHILDREN];
    let mut halve = |first: usize, step: usize, plane: usize| {
        let part = parts[first];
        let is_empty = SKIPS && part.enter.simd_le(part.leave).to_bitmask() == 0;
        [parts[first], parts[first + step]] = if is_empty {
            [part; 2]
        } else {
            cut(plane, part)
        };
    };
    halve(0, 4, 0);
    for first in [0, 4] {
        halve(first, 2, 1 + sides(signs, first)[0]);
    }
    for first in [0, 2, 4, 6] {
        let [top, middle, _] = sides(signs, first);
        halve(first, 1, 3 + 2 * top + middle);
    }
    parts
}

/// A node whose planes are all axis-aligned, and the planes through which the rays descend.
struct Along<'a> {
    line: &'a Row,
    signs: usize,
}

impl<S: Simd> Cut<S, CHILDREN> for Along<'_> {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; CHILDREN] {
        let &Self { line, signs } = self;
        let axes = [lanes.axis(0), lanes.axis(1), lanes.axis(2)];
        levels::<S, false>(
            lanes.within(&axes[0]),
            signs,
            #[inline(always)]
            |i, Inside { enter, leave }| {
                let rows = &axes[axis(line, i) % 3];
                let split = f32x8::splat(simd, line.first[i]);
                let late = split.mul_add(rows[INV], rows[FAR]);
                let soon = split.mul_add(rows[INV], rows[NEAR]);
                // Ignore a distance that is NaN.
                [
                    Inside {
                        enter: keep_max_each(soon, enter),
                        leave,
                    },
                    Inside {
                        enter,
                        leave: keep_min_each(late, leave),
                    },
                ]
            },
        )
    }
}

/// A node with oblique planes, and the planes through which the first ray descends.
struct Across<'a> {
    lines: &'a [Row; 3],
    signs: usize,
}

impl<S: Simd> Cut<S, CHILDREN> for Across<'_> {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; CHILDREN] {
        let &Self { lines, signs } = self;
        let (origins, directions) = (lanes.origins(), lanes.directions());
        levels::<S, true>(
            lanes.within(&lanes.axis(0)),
            signs,
            #[inline(always)]
            |i, inside| {
                let plane = Plane {
                    normal: normal(lines, i),
                    offset: lines[0].first[i],
                };
                let [below, above] = oblique(simd, &origins, &directions, inside, plane);
                if signs >> i & 1 == 1 {
                    [below, above]
                } else {
                    [above, below]
                }
            },
        )
    }
}
