// SPDX-License-Identifier: GPL-3.0-or-later
//! The octree loop: cubes halved along all three axes until they hold few triangles (Glassner 1984).
//!
//! The root is a cube whose side is a power of two and whose corner is a multiple of the smallest
//! cell there can be. So every mid plane is an f32, exactly, and a cell is three integers and a
//! level. The result is a pure function of the triangles and the parameters, for any number of
//! threads.

use super::Monitor;
use super::footprint;
use super::overlap::TriangleBox;
use crate::error::Result;
use crate::scene::Triangles;
use crate::traverse::frame::{Frame, U};
use rayon::prelude::*;

/// No tree is deeper: cells at this depth are a millionth of the root.
pub const MAX_DEPTH: u32 = 20;

/// Walks from cell to cell are right for origins within this many times the scene's largest
/// coordinate; see [`Cube::step_margin`]. Others walk from the top.
pub const FAR: f32 = 4.0;

/// References that any tree may hold, so that small scenes are divided to the end.
const FREE: usize = 1 << 13;

/// Bytes of a node with its links, and of those that the links are found with.
const NODE: usize = 16 + 24 + 24;

/// Nodes of at least this many references build their children in parallel.
const TASK: usize = 4096;

/// The root cell, and the grid of the smallest cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cube {
    /// Smallest coordinates.
    pub corner: [f32; 3],
    /// Edge length, a power of two.
    pub side: f32,
    /// Leaves lie no deeper: a smallest cell measures `side / 2^depth`.
    pub depth: u32,
}

impl Cube {
    /// The cube around a scene, with at most `depth` levels below it. With `steps` they are also
    /// few enough for the smallest cell to be large against [`Self::step_margin`].
    pub fn new(frame: &Frame, depth: u32, steps: bool) -> Self {
        let bounds = frame.bounds();
        if bounds.is_empty() {
            return Self {
                corner: [0.0; 3],
                side: 1.0,
                depth: 0,
            };
        }
        let magnitude = f64::from(bounds.magnitude());
        let extent = (0..3).map(|k| bounds.extent(k)).fold(0.0, f64::max);
        let mut side = 2.0_f64.powi(extent.log2().ceil() as i32 - 1);
        loop {
            side *= 2.0;
            let mut cube = Self {
                corner: [0.0; 3],
                #[expect(clippy::cast_possible_truncation, reason = "a power of two")]
                side: side as f32,
                depth: depth.min(MAX_DEPTH),
            };
            // All planes are multiples of the smallest cell, and below 2^24 of them: exact in f32.
            let coarse = |cube: &Self| {
                let unit = f64::from(cube.unit());
                magnitude + side > 16_777_216.0 * unit
                    || steps && 4.0 * f64::from(cube.step_margin(frame)) > unit
            };
            while cube.depth > 0 && coarse(&cube) {
                cube.depth -= 1;
            }
            let unit = f64::from(cube.unit());
            let inside = (0..3).all(|k| {
                let (min, max) = (f64::from(bounds.min[k]), f64::from(bounds.max[k]));
                let corner = ((0.5 * (min + max - side)) / unit).floor() * unit;
                #[expect(clippy::cast_possible_truncation, reason = "few bits, see above")]
                let stored = corner as f32 + 0.0;
                cube.corner[k] = stored;
                f64::from(stored) == corner && corner <= min && max <= corner + side
            });
            if inside {
                return cube;
            }
        }
    }

    /// Edge length of the smallest cells.
    #[inline(always)]
    pub fn unit(&self) -> f32 {
        self.side / (1_u32 << self.depth) as f32
    }

    /// Edge length of the cells at a level.
    #[inline(always)]
    pub fn edge(&self, level: u32) -> f32 {
        self.side / (1_u32 << level) as f32
    }

    /// The lowest corner of the cell whose lowest smallest cell is `place`; exact.
    #[inline(always)]
    pub fn low(&self, place: [u32; 3]) -> [f32; 3] {
        let unit = self.unit();
        std::array::from_fn(|k| self.corner[k] + place[k] as f32 * unit)
    }

    /// How far outside its cell a walk from cell to cell may be at a moment that it counts to that
    /// cell, per axis, for origins within [`FAR`].
    ///
    /// Such a walk compares times with plane distances, or coordinates with planes: the former are
    /// off by at most 8 u (|o| + M) when turned into coordinates ([`FrameRay::pad`]), the latter
    /// by at most u (|o| + M) + u M, and u side for the distance from the corner. Every moment is
    /// compared with each plane directly, never with an earlier result, so nothing adds up.
    ///
    /// [`FrameRay::pad`]: crate::traverse::frame::FrameRay::pad
    pub fn step_margin(&self, frame: &Frame) -> f32 {
        8.0 * U * (FAR + 1.0) * frame.bounds().magnitude() + 2.0 * U * self.side
    }
}

/// What the loop is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// The root.
    pub cube: Cube,
    /// Nodes of at most this many triangles are leaves.
    pub leaf_size: usize,
    /// References per triangle that the tree may hold, on average. A node's share of this budget goes
    /// to its children in proportion to their references; a node that would overdraw it becomes a
    /// leaf. So cells are halved farther where that parts triangles, and not around the corners
    /// that they share.
    pub budget: usize,
    /// Leaves also hold what lies outside their cell by at most this much, per axis.
    pub margin: f32,
}

/// A node in preorder; an inner one is followed by its eight subtrees, octant by octant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item {
    /// Halved along all axes. Bit `k` of an octant's number says on which side of axis `k` it is.
    Inner,
    /// A leaf; so many of the triangle numbers are its own.
    Leaf(u32),
}

/// A tree or subtree in preorder.
#[derive(Debug, Default)]
pub struct Octants {
    /// Nodes.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one after another.
    pub ids: Vec<u32>,
}

/// A triangle in a node, and the octants of the node that it reaches, one bit each.
#[derive(Clone, Copy)]
struct Reference {
    id: u32,
    octants: u8,
}

/// A node that is about to be built.
#[derive(Clone, Copy)]
struct Pending {
    place: [u32; 3],
    level: u32,
    /// References that the subtree may hold at most.
    budget: usize,
    /// Share of the whole work.
    work: f64,
}

struct Builder<'a> {
    scene: &'a Triangles,
    frame: &'a Frame,
    params: &'a Params,
    monitor: &'a Monitor,
}

/// What one thread keeps while it builds a subtree.
#[derive(Default)]
struct Task {
    references: Vec<Reference>,
    out: Octants,
    done: f64,
    /// Bytes that the monitor has not been told of.
    gathered: usize,
}

/// Builds an octree over the live triangles of `scene`, in the current rayon pool.
///
/// # Errors
/// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
pub fn build(
    scene: &Triangles,
    frame: &Frame,
    params: &Params,
    monitor: &Monitor,
) -> Result<Octants> {
    let reference = |&id| Reference { id, octants: 0 };
    let references: Vec<_> = scene.live().iter().map(reference).collect();
    let root = Pending {
        place: [0; 3],
        level: 0,
        budget: references.len().saturating_mul(params.budget) + FREE,
        work: 1.0,
    };
    let builder = Builder {
        scene,
        frame,
        params,
        monitor,
    };
    builder.subtree(references, root)
}

impl Builder<'_> {
    /// Builds a subtree as a task of its own.
    fn subtree(&self, references: Vec<Reference>, node: Pending) -> Result<Octants> {
        let _held = self
            .monitor
            .hold(footprint::waiting::<Reference>(references.len()))?;
        let mut task = Task {
            references,
            ..Task::default()
        };
        self.node(&mut task, 0, node)?;
        self.monitor.take(task.gathered)?;
        self.monitor.advance(task.done);
        Ok(task.out)
    }

    /// Builds the node whose references are those of the task from `from` on.
    fn node(&self, task: &mut Task, from: usize, node: Pending) -> Result<()> {
        self.monitor.check()?;
        let count = task.references.len() - from;
        let Params {
            cube, leaf_size, ..
        } = self.params;
        let mut counts = [0_usize; 8];
        let inner = count > *leaf_size && node.level < cube.depth && {
            self.part(&mut task.references[from..], node, &mut counts);
            counts.iter().sum::<usize>() <= node.budget
        };
        if !inner {
            let bytes = footprint::leaf::<Item>(count, NODE);
            self.monitor.charge(&mut task.gathered, bytes)?;
            let ids = task.references[from..].iter().map(|r| r.id);
            task.out.ids.extend(ids);
            #[expect(clippy::cast_possible_truncation, reason = "at most 2^29 triangles")]
            task.out.items.push(Item::Leaf(count as u32));
            task.done += node.work;
            return Ok(());
        }

        task.out.items.push(Item::Inner);
        let total: usize = counts.iter().sum();
        let half = 1 << (cube.depth - node.level - 1);
        let child = |octant: usize| {
            let portion = counts[octant] as f64 / total.max(1) as f64;
            Pending {
                place: std::array::from_fn(|k| node.place[k] + half * (octant >> k & 1) as u32),
                level: node.level + 1,
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a portion"
                )]
                budget: (node.budget as f64 * portion) as usize,
                work: node.work * portion,
            }
        };
        if count >= TASK {
            let references = &task.references[from..];
            let parts: Vec<_> = (0..8)
                .into_par_iter()
                .map(|octant| {
                    let own = references.iter().filter(|r| r.octants >> octant & 1 == 1);
                    self.subtree(own.copied().collect(), child(octant))
                })
                .collect::<Result<_>>()?;
            for mut part in parts {
                task.out.items.append(&mut part.items);
                task.out.ids.append(&mut part.ids);
            }
            return Ok(());
        }
        for octant in 0..8 {
            let end = from + count;
            for i in from..end {
                let reference = task.references[i];
                if reference.octants >> octant & 1 == 1 {
                    task.references.push(reference);
                }
            }
            self.node(task, end, child(octant))?;
            task.references.truncate(end);
        }
        Ok(())
    }

    /// Finds the octants that each reference reaches, and counts them.
    fn part(&self, references: &mut [Reference], node: Pending, counts: &mut [usize; 8]) {
        let Params { cube, margin, .. } = self.params;
        let (low, half) = (cube.low(node.place), cube.edge(node.level + 1));
        let mid = low.map(|x| x + half);
        // A point within the margin of the mid plane lies in both halves.
        let (above, below) = (mid.map(|x| x - margin), mid.map(|x| x + margin));
        for reference in references {
            let corners = self.scene.corners(reference.id);
            let corners = corners.map(|p| self.frame.point(p));
            let mut octants = 0xff_u8;
            for (k, [lower, upper]) in [[0x55, 0xaa], [0x33, 0xcc], [0x0f, 0xf0]]
                .into_iter()
                .enumerate()
            {
                let heights = corners.map(|p| p[k]);
                if heights.iter().all(|x| *x < above[k].next_down()) {
                    octants &= lower;
                } else if heights.iter().all(|x| *x > below[k].next_up()) {
                    octants &= upper;
                }
            }
            // In one octant only: the part of the triangle in this cell lies there.
            if octants.count_ones() > 1 {
                let triangle = TriangleBox::new(corners, self.frame.bounds().magnitude());
                for octant in 0..8 {
                    if octants >> octant & 1 == 1 {
                        let centre = std::array::from_fn(|k| {
                            let side = if octant >> k & 1 == 1 { 0.5 } else { -0.5 };
                            f64::from(mid[k]) + side * f64::from(half)
                        });
                        let reach = 0.5 * f64::from(half) + f64::from(*margin);
                        if !triangle.meets(centre, reach) {
                            octants &= !(1 << octant);
                        }
                    }
                }
            }
            reference.octants = octants;
            for (octant, count) in counts.iter_mut().enumerate() {
                *count += usize::from(octants >> octant & 1);
            }
        }
    }
}
