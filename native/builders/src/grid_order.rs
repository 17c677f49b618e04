// SPDX-License-Identifier: GPL-3.0-or-later
//! The tree of [`Global`] by sorting. Where cells are always halved along their longest side, all cells of one
//! level have the same shape, so the halvings around a triangle's centre are the bits of a number, and sorting by
//! these numbers gives the order that repeated halving would (Lauterbach et al. 2009 build hierarchies this way on
//! graphics processors). A radix sort replaces about twenty rounds of partitioning by four passes; triangles with
//! equal bits are partitioned by [`Global`] itself.

use crate::global::Global;
use crate::object::{self, Object, ObjectPolicy, TASK};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_nodes::object_tree::{Item, ObjectTree};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// Number of bits of a position in the grid; the lower bits of a key hold the triangle's number.
const POSITION_BITS: usize = 32;

/// Largest number of these bits for one axis.
const AXIS_BITS: usize = 16;

/// Builds a tree over the live triangles of `scene`, in the frame `frame`, in the current rayon pool. `policy`
/// must split cells into two parts.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build(
    scene: &Triangles,
    frame: &Frame,
    policy: &Global,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    // Compute the keys: position in the grid above, triangle number below.
    let grid = Grid::new(frame.bounds());
    let key = |&id: &u32| grid.position(&bounds(scene, frame, id)) << POSITION_BITS | u64::from(id);
    let mut keys: Vec<u64> = scene.live().par_iter().map(key).collect();
    monitor.check()?;
    // The sort is stable: triangles with equal positions stay in the order of their numbers.
    radsort::sort_by_key(&mut keys, |key| position(*key));
    // Build the tree top-down over the sorted keys.
    let builder = Builder {
        scene,
        frame,
        policy,
        monitor,
        grid: &grid,
        parallel: object::parallel_from(keys.len()),
    };
    let mut items = Vec::with_capacity(keys.len() / policy.leaf_size.max(2));
    builder.subtree(&mut keys, 0, 1.0, &mut items)?;
    Ok(ObjectTree {
        items,
        ids: keys.into_iter().map(number).collect(),
    })
}

/// Returns a triangle's box, in the structure's frame.
#[inline(always)]
fn bounds(scene: &Triangles, frame: &Frame, id: u32) -> Aabb {
    Aabb::of_triangle(scene.corners(id).map(|p| frame.point(p)))
}

/// Returns the position bits of a key.
#[inline(always)]
fn position(key: u64) -> u32 {
    (key >> POSITION_BITS) as u32
}

/// Returns the triangle number of a key.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the low half")]
fn number(key: u64) -> u32 {
    key as u32
}

/// The finest cells, and the order in which their sides are halved.
struct Grid {
    /// Axis of each halving, the first one first.
    axes: Vec<usize>,
    /// Lowest corner.
    low: [f32; 3],
    /// Number of cells per unit of length.
    scale: [f32; 3],
    /// Index of the last cell along each axis.
    last: [f32; 3],
    /// Position bits of a cell's index along each axis, by its low and its high byte.
    bits: [[[u32; 256]; 2]; 3],
}

impl Grid {
    /// Makes the grid of a scene's box.
    fn new(bounds: Aabb) -> Self {
        let mut grid = Self {
            axes: Vec::with_capacity(POSITION_BITS),
            low: bounds.min,
            scale: [0.0; 3],
            last: [0.0; 3],
            bits: [[[0; 256]; 2]; 3],
        };
        // An empty scene keeps a grid of a single cell.
        if bounds.is_empty() {
            return grid;
        }
        // Choose the axis of each halving: the longest side that has bits left.
        let sides = [0, 1, 2].map(|k| bounds.extent(k));
        let mut side = sides;
        let mut levels = [0; 3];
        while grid.axes.len() < POSITION_BITS {
            let axis = (1..3).fold(0, |best, k| if side[k] > side[best] { k } else { best });
            if side[axis] == 0.0 || levels[axis] == AXIS_BITS {
                break;
            }
            grid.axes.push(axis);
            side[axis] *= 0.5;
            levels[axis] += 1;
        }
        // Scale the coordinates of each axis to its cells.
        for k in 0..3 {
            let cells = f64::from(1_u32 << levels[k]);
            if levels[k] > 0 {
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "any scale close to it will do"
                )]
                let scale = (cells / sides[k]) as f32;
                grid.scale[k] = scale;
            }
            // Map the bits of each axis to their bits in the position.
            #[expect(clippy::cast_possible_truncation, reason = "a whole number below 2^16")]
            let last = (cells - 1.0) as f32;
            grid.last[k] = last;
            // The halvings along this axis, the last one first, are the bits of its cells' indices.
            let own = (0..grid.axes.len()).rev().filter(|&i| grid.axes[i] == k);
            for (bit, level) in own.enumerate() {
                let to = 1 << (POSITION_BITS - 1 - level);
                for (byte, spread) in grid.bits[k][bit / 8].iter_mut().enumerate() {
                    *spread |= if byte >> (bit % 8) & 1 == 1 { to } else { 0 };
                }
            }
        }
        grid
    }

    /// Returns the position of a box's centre; a centre on the wall between two cells is in the lower one.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the cells of the grid"
    )]
    fn position(&self, bounds: &Aabb) -> u64 {
        let object = Object {
            bounds: *bounds,
            id: 0,
        };
        let mut position = 0;
        for k in 0..3 {
            // Rounding up minus one puts a centre on a wall into the cell below it.
            let at = (object.centre(k) - self.low[k]) * self.scale[k];
            let cell = (at.ceil() - 1.0).clamp(0.0, self.last[k]) as usize;
            let [low, high] = &self.bits[k];
            position |= low[cell & 0xff] | high[cell >> 8 & 0xff];
        }
        u64::from(position)
    }
}

/// The inputs of a build.
struct Builder<'a> {
    scene: &'a Triangles,
    frame: &'a Frame,
    policy: &'a Global,
    monitor: &'a Monitor,
    grid: &'a Grid,
    /// Number of triangles from which nodes are built on two threads.
    parallel: usize,
}

impl Builder<'_> {
    /// Appends the subtree of sorted keys; `work` is its share of the whole work.
    fn subtree(
        &self,
        keys: &mut [u64],
        depth: usize,
        work: f64,
        items: &mut Vec<Item>,
    ) -> Result<()> {
        let split = if keys.len() < TASK {
            None
        } else {
            self.split(keys)
        };
        // Small subtrees report memory and progress as a whole.
        let Some((axis, split)) = split else {
            let before = items.len();
            self.node(keys, depth, items)?;
            self.monitor
                .take(footprint::boxes::<Item>(items.len() - before))?;
            self.monitor.advance(work);
            return Ok(());
        };
        let index = items.len();
        items.push(Item::inner(axis));
        // Divide the work in proportion to the triangles.
        let share = split as f64 / keys.len() as f64;
        let both = keys.len() >= self.parallel;
        let (below, above) = keys.split_at_mut(split);
        // The two halves of the keys are independent, so both threads may reorder theirs.
        let distance = object::grow_both(
            items,
            both,
            |items| self.subtree(below, depth + 1, work * share, items),
            |items| self.subtree(above, depth + 1, work * (1.0 - share), items),
        )?;
        Item::link(&mut items[index..], distance - index);
        Ok(())
    }

    /// Appends a subtree without reporting progress. The depth of the recursion is that of the tree.
    fn node(&self, keys: &mut [u64], depth: usize, items: &mut Vec<Item>) -> Result<()> {
        self.monitor.check()?;
        if keys.len() <= self.policy.leaf_size {
            let around =
                |all: Aabb, key: &u64| all.union(&bounds(self.scene, self.frame, number(*key)));
            items.push(Item::leaf(
                keys.iter().fold(Aabb::EMPTY, around),
                keys.len(),
            ));
            return Ok(());
        }
        // Partition the triangles of one finest cell by the policy, as no bit separates them.
        let Some((axis, split)) = self.split(keys) else {
            return self.crowd(keys, depth, items);
        };
        // Both children follow the item, which is linked once their sizes are known.
        let index = items.len();
        items.push(Item::inner(axis));
        let (below, above) = keys.split_at_mut(split);
        self.node(below, depth + 1, items)?;
        let distance = items.len() - index;
        self.node(above, depth + 1, items)?;
        Item::link(&mut items[index..], distance);
        Ok(())
    }

    /// Returns the axis of the first halving that leaves neither side empty, and the number of keys below; `None`
    /// if all positions are equal.
    #[inline(always)]
    fn split(&self, keys: &[u64]) -> Option<(usize, usize)> {
        // The highest differing bit of the first and last key is the first halving that separates any.
        let differ = position(keys.first()? ^ keys.last()?);
        if differ == 0 {
            return None;
        }
        let level = differ.leading_zeros() as usize;
        let bit = 2 * POSITION_BITS - 1 - level;
        let split = keys.partition_point(|key| key >> bit & 1 == 0);
        Some((self.grid.axes[level], split))
    }

    /// Partitions the triangles of one finest cell by [`Global`].
    fn crowd(&self, keys: &mut [u64], depth: usize, items: &mut Vec<Item>) -> Result<()> {
        // Start again from the box of centres: the finest cell cannot be halved.
        let mut objects: Vec<_> = keys
            .iter()
            .map(|key| Object {
                bounds: bounds(self.scene, self.frame, number(*key)),
                id: number(*key),
            })
            .collect();
        let centres = object::measure(&objects).1;
        let region = self.policy.root(centres);
        object::build_subtree(
            &mut objects,
            region,
            depth,
            self.policy,
            self.monitor,
            items,
        )?;
        // Write the new order back to the keys.
        for (key, object) in keys.iter_mut().zip(&objects) {
            *key = u64::from(object.id);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_nodes::object_tree::ItemKind;
    use halfspace_oracle::cases::{Random, soup};

    /// Returns a scene within [0, 8]^3, where all halvings are exact, with triangles at its corners.
    fn scattered(count: usize) -> Triangles {
        let mut random = Random(11);
        let mut corners = vec![[0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]];
        corners.extend([[8.0; 3], [7.5, 8.0, 8.0], [8.0, 7.5, 8.0]]);
        while corners.len() < 3 * count {
            let p = random.point(0.5, 7.5);
            // Some lie in a dense group, some have centres on the walls between cells.
            let p = match corners.len() % 9 {
                0 => p,
                3 => p.map(|x| 3.0 + x * 0.1),
                _ => p.map(f32::round),
            };
            let at = |d: [f32; 3]| [p[0] + d[0], p[1] + d[1], p[2] + d[2]];
            corners.push(at([-0.25, 0.0, -0.25]));
            corners.extend([at([0.25, 0.25, 0.25]), at([0.0, -0.25, 0.0])]);
        }
        Triangles::clone(&soup(corners))
    }

    /// Returns the sorted triangle numbers of each leaf: their order differs.
    fn leaves(tree: &ObjectTree) -> Vec<Vec<u32>> {
        let mut leaves = Vec::new();
        for (index, first) in tree.firsts().into_iter().enumerate() {
            if let ItemKind::Leaf { count } = tree.kind(index) {
                let first = first as usize;
                let mut ids = tree.ids[first..first + count].to_vec();
                ids.sort_unstable();
                leaves.push(ids);
            }
        }
        leaves
    }

    #[test]
    fn sorting_builds_the_tree_that_partitioning_builds() {
        let scene = scattered(6000);
        let frame = Frame::new(scene.bounds());
        for leaf_size in [1, 6] {
            let policy = Global { leaf_size, ways: 2 };
            let monitor = Monitor::new();
            let sorted = build(&scene, &frame, &policy, &monitor).unwrap();
            let partitioned = object::build(&scene, &frame, &policy, &monitor).unwrap();
            assert!(leaves(&sorted) == leaves(&partitioned), "leaves differ");
            assert!(sorted.items == partitioned.items, "items differ");
        }
    }
}
