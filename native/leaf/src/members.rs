// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of all leaves of a tree, for writing the leaves again where the triangles have moved.

use crate::blocks::Blocks;
use crate::keep::Keep;
use crate::leaf::Leaf;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_ray::FramedScene;
use rayon::prelude::*;

/// Largest number of leaves that one task writes (chosen).
const TASK: usize = 1024;

/// A leaf with triangles.
#[derive(Debug, Clone, Copy)]
struct Member {
    /// Offset of its data in words.
    at: usize,
    /// Index of its first triangle number.
    first: usize,
    /// Number of triangles.
    count: usize,
}

/// The leaves with triangles of a tree, in the order of their data, and the numbers of their triangles.
#[derive(Debug)]
pub struct Members {
    keep: Keep,
    leaves: Vec<Member>,
    ids: Vec<u32>,
    /// Number of words of all leaves.
    words: usize,
}

/// The box of a leaf's triangles that can be hit, in the tree's frame, and their number.
pub type LeafBounds = (Aabb, u32);

/// A range of leaves to write: the words and the bounds that belong to it.
struct Part<'a> {
    leaves: &'a [Member],
    /// Word offset at which `words` begin.
    start: usize,
    words: &'a mut [f32],
    bounds: &'a mut [LeafBounds],
}

impl Members {
    /// Reads the triangle numbers of `leaves`, which have triangles and are in any order, from their data; returns also
    /// the position of each among all.
    ///
    /// # Panics
    /// For 2^32 leaves or more, which the layouts' limits exclude.
    pub fn new(blocks: &Blocks, leaves: &[Leaf]) -> (Self, Vec<u32>) {
        let number = |i: usize| u32::try_from(i).expect("checked by the layout");
        // Order the leaves by the offsets of their data.
        let mut order: Vec<_> = (0..number(leaves.len())).collect();
        order.par_sort_unstable_by_key(|&i| leaves[i as usize].first);
        let mut positions = vec![0; leaves.len()];
        let keep = blocks.keep();
        let (mut first, mut words) = (0, 0);
        let mut members = Vec::with_capacity(leaves.len());
        for (position, &i) in order.iter().enumerate() {
            let Leaf { first: at, count } = leaves[i as usize];
            let at = at as usize;
            positions[i as usize] = number(position);
            members.push(Member { at, first, count });
            first += count;
            words = at + keep.words(count);
        }
        // Read the triangle numbers of each leaf.
        let ids = (order.par_iter())
            .flat_map_iter(|&i| {
                let Leaf { first, count } = leaves[i as usize];
                blocks.ids(first, count)
            })
            .collect();
        let all = Self {
            keep,
            leaves: members,
            ids,
            words,
        };
        (all, positions)
    }

    /// Returns the numbers of all triangles.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Returns the size of the lists in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.leaves) + size_of_val(&*self.ids)
    }

    /// Writes the leaves of moved triangles, in parallel, each at the offset that it had. Triangles that can no longer
    /// be hit are left out; their words stay unused. Returns the data, and the box and the number of triangles of each
    /// leaf.
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Cancelled`].
    pub fn write(
        &self,
        framed: FramedScene<'_>,
        monitor: &Monitor,
    ) -> Result<(Blocks, Vec<LeafBounds>)> {
        let scene = framed.scene;
        let mut bounds = vec![(Aabb::EMPTY, 0); self.leaves.len()];
        // Mark the triangles that can be hit, unless all can be.
        let live = (scene.live().len() < scene.len()).then(|| {
            let mut live = vec![false; scene.len()];
            for &id in scene.live() {
                live[id as usize] = true;
            }
            live
        });
        let blocks = Blocks::filled(framed.frame, self.keep, self.words, |words| {
            let all = Part {
                leaves: &self.leaves,
                start: 0,
                words,
                bounds: &mut bounds,
            };
            self.part(all, framed, live.as_deref(), monitor);
        });
        monitor.check()?;
        Ok((blocks, bounds))
    }

    /// Writes a range of leaves, in two tasks if there are many; none once the monitor is cancelled.
    fn part(
        &self,
        part: Part<'_>,
        framed: FramedScene<'_>,
        live: Option<&[bool]>,
        monitor: &Monitor,
    ) {
        if monitor.is_cancelled() {
            return;
        }
        let Part {
            leaves,
            start,
            words,
            bounds,
        } = part;
        if leaves.len() > TASK {
            let half = leaves.len() / 2;
            let (before, after) = leaves.split_at(half);
            let middle = after[0].at;
            let (left, right) = words.split_at_mut(middle - start);
            let (low, high) = bounds.split_at_mut(half);
            let before = Part {
                leaves: before,
                start,
                words: left,
                bounds: low,
            };
            let after = Part {
                leaves: after,
                start: middle,
                words: right,
                bounds: high,
            };
            rayon::join(
                || self.part(before, framed, live, monitor),
                || self.part(after, framed, live, monitor),
            );
            return;
        }
        // Write each leaf, without the triangles that cannot be hit.
        let FramedScene { scene, frame } = framed;
        let mut kept = Vec::new();
        for (leaf, bounds) in leaves.iter().zip(bounds) {
            let mut ids = &self.ids[leaf.first..leaf.first + leaf.count];
            if let Some(live) = live {
                kept.clear();
                kept.extend(ids.iter().filter(|&&id| live[id as usize]));
                ids = &kept;
            }
            let around = (ids.iter()).fold(Aabb::EMPTY, |all, &id| {
                let corners = scene.corners(id).map(|p| frame.point(p));
                all.union(&Aabb::of_triangle(corners))
            });
            *bounds = (around, u32::try_from(ids.len()).expect("part of a scene"));
            let at = leaf.at - start;
            let words = &mut words[at..at + self.keep.words(ids.len())];
            self.keep.write(words, scene, frame, ids);
        }
    }
}
