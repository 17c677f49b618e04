// SPDX-License-Identifier: GPL-3.0-or-later
//! The octree loop: cubes halved along all three axes until they hold few triangles (Glassner 1984).
//!
//! The root is a cube whose side is a power of two and whose corner is a multiple of the smallest possible cell.
//! Every mid plane is therefore an exact f32, and a cell is three integers and a level. The result is a pure
//! function of the triangles and the parameters, for any number of threads.

use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::overlap::TriangleBox;
use halfspace_nodes::octants::{Cube, Item, Octants};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// Number of references that every tree may have, so that small scenes are subdivided fully (chosen).
const FREE: usize = 1 << 13;

/// Bytes of a node, of its links, and of the table from which the links are computed.
const NODE: usize = 16 + 24 + 24;

/// Nodes of at least this number of references build their children in parallel.
const TASK: usize = 4096;

/// Parameters of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Root cell.
    pub cube: Cube,
    /// Nodes of at most this number of triangles are leaves.
    pub leaf_size: usize,
    /// Largest average number of references per triangle. The children of a node share its budget in proportion to
    /// their references; a node that would exceed its budget becomes a leaf. Cells are therefore subdivided where
    /// that separates triangles, and not around vertices that many triangles share.
    pub budget: usize,
    /// Leaves also hold triangles outside their cell by at most this distance per axis.
    pub margin: f32,
}

/// A triangle in a node, and a mask of the octants that it reaches.
#[derive(Clone, Copy)]
struct Reference {
    id: u32,
    octants: u8,
}

/// A node that is still to be built.
#[derive(Clone, Copy)]
struct OpenNode {
    /// Lowest corner on the grid of the smallest cells.
    corner: [u32; 3],
    level: u32,
    /// Largest number of references of the subtree.
    budget: usize,
    /// Share of the whole work.
    work: f64,
}

/// The inputs of a build.
struct Builder<'a> {
    scene: &'a Triangles,
    frame: &'a Frame,
    params: &'a Params,
    monitor: &'a Monitor,
}

/// State of one thread while it builds a subtree.
#[derive(Default)]
struct Task {
    references: Vec<Reference>,
    out: Octants,
    done: f64,
    /// Bytes not yet reported to the monitor.
    gathered: usize,
}

/// Builds an octree over the live triangles of `scene`, in the current rayon pool.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build(
    scene: &Triangles,
    frame: &Frame,
    params: &Params,
    monitor: &Monitor,
) -> Result<Octants> {
    // All triangles are references of the root.
    let reference = |&id| Reference { id, octants: 0 };
    let references: Vec<_> = scene.live().iter().map(reference).collect();
    // Small scenes get an extra budget.
    let root = OpenNode {
        corner: [0; 3],
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
    /// Builds a subtree as a separate task.
    fn subtree(&self, references: Vec<Reference>, node: OpenNode) -> Result<Octants> {
        // The references are held only while the subtree is built.
        let _held = self
            .monitor
            .hold(footprint::unsplit::<Reference>(references.len()))?;
        let mut task = Task {
            references,
            ..Task::default()
        };
        self.node(&mut task, 0, node)?;
        self.monitor.take(task.gathered)?;
        self.monitor.advance(task.done);
        Ok(task.out)
    }

    /// Builds the node whose references are those of the task from index `from` on.
    fn node(&self, task: &mut Task, from: usize, node: OpenNode) -> Result<()> {
        self.monitor.check()?;
        let count = task.references.len() - from;
        let Params {
            cube, leaf_size, ..
        } = self.params;
        // Classify the references by octant, unless the node must be a leaf.
        let mut counts = [0_usize; 8];
        let inner = count > *leaf_size && node.level < cube.depth && {
            self.classify(&mut task.references[from..], node, &mut counts);
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

        // Give each child its share of the budget and of the work.
        task.out.items.push(Item::Inner);
        let total: usize = counts.iter().sum();
        let half = 1 << (cube.depth - node.level - 1);
        let child = |octant: usize| {
            let portion = counts[octant] as f64 / total.max(1) as f64;
            OpenNode {
                corner: std::array::from_fn(|k| node.corner[k] + half * (octant >> k & 1) as u32),
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
        // Build the children of a large node in parallel.
        if count >= TASK {
            let references = &task.references[from..];
            let parts: Vec<_> = (0..8)
                .into_par_iter()
                .map(|octant| {
                    // Each child copies its references.
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
        // Build the children of a small node in sequence, with their references at the end of the list.
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

    /// Computes the mask of octants of each reference, and counts the references per octant.
    fn classify(&self, references: &mut [Reference], node: OpenNode, counts: &mut [usize; 8]) {
        let Params { cube, margin, .. } = self.params;
        let (low, half) = (cube.low(node.corner), cube.edge(node.level + 1));
        let mid = low.map(|x| x + half);
        // A point within the margin of the mid plane lies in both halves.
        let (above, below) = (mid.map(|x| x - margin), mid.map(|x| x + margin));
        // Find the octants of each triangle.
        for reference in references {
            let corners = self.scene.corners(reference.id);
            let corners = corners.map(|p| self.frame.point(p));
            // Exclude octants by the triangle's box first, axis by axis.
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
            // If one octant is left, the part of the triangle in this cell lies there; otherwise test each
            // exactly.
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
            // Store the mask and count its octants.
            reference.octants = octants;
            for (octant, count) in counts.iter_mut().enumerate() {
                *count += usize::from(octants >> octant & 1);
            }
        }
    }
}
