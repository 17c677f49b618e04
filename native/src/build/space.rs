// SPDX-License-Identifier: GPL-3.0-or-later
//! The space-partition loop: builds every tree of split planes, whatever its planes.
//!
//! A tree answers one question, "which candidates at this node?" ([`PlanePolicy`]); sweeping,
//! pricing, stopping, parting the triangles and going on in parallel happen here, once. The result
//! is a pure function of the triangles and the parameters, for any number of threads.

use super::Monitor;
use super::cell::{Cell, Direction, Plane};
use super::clip::clipped_bounds;
use super::cost::Costs;
use super::footprint;
use super::plane_tree::MAX_DEPTH;
use super::preorder::{Item, Preorder};
use super::sweep::{self, Scratch, Ties, sweep};
use crate::error::Result;
use crate::geom::Aabb;
use crate::scene::Triangles;
use crate::traverse::frame::Frame;
use rayon::prelude::*;

/// Subtrees of at least this many references become tasks of their own.
const TASK: usize = 4096;

/// Nodes of at least this many references sweep their candidates in parallel.
const PARALLEL_SWEEP: usize = 1 << 16;

/// References per triangle that no tree exceeds. A node's share of this budget goes to its children
/// in proportion to their references; a node that would overdraw it becomes a leaf.
const BUDGET: usize = 1024;

/// Something to try at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Candidate {
    /// Planes at all ends of the node's triangles along a direction.
    Sweep(Direction),
}

/// The one thing that tells plane trees apart.
pub trait PlanePolicy: Sync {
    /// Boxes if all planes are axis-aligned, polytopes otherwise.
    type Cell: Cell;
    /// The cell of the whole scene.
    fn root(&self, bounds: Aabb) -> Self::Cell;
    /// The candidates at a node of `cell`, into the empty `out`. Of equally cheap planes the
    /// earlier candidate's wins.
    fn candidates(&self, cell: &Self::Cell, out: &mut Vec<Candidate>);
}

/// When a node becomes a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// As soon as no split is cheaper than the leaf.
    Cheapest,
    /// As pbrt: a path may hold up to this many splits dearer than their leaf, but none four times
    /// as dear at fewer than 16 triangles (Pharr, Jakob and Humphreys, 3rd ed., section 4.4.2).
    Tolerant(u32),
}

/// What the loop is told besides the candidates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Prices.
    pub costs: Costs,
    /// What happens to triangles that touch a plane.
    pub ties: Ties,
    /// Whether triangles are cut to their cells (perfect splits).
    pub clip: bool,
    /// Nodes of at most this many triangles are leaves.
    pub leaf_size: usize,
    /// Leaves lie no deeper; at most [`MAX_DEPTH`].
    pub max_depth: usize,
    /// The stopping rule.
    pub stop: Stop,
}

/// A triangle in a node: its number, and the bounds of what the node's cell holds of it.
#[derive(Debug, Clone, Copy)]
struct Reference {
    bounds: Aabb,
    id: u32,
}

/// A node that is about to be built.
struct Pending<C> {
    cell: C,
    depth: usize,
    /// Splits on the path that cost more than their leaf.
    bad: u32,
    /// References that the subtree may hold at most.
    budget: usize,
    /// Share of the whole work.
    work: f64,
}

/// What one thread keeps while it builds a subtree.
#[derive(Default)]
struct Task {
    references: Vec<Reference>,
    scratch: Scratch,
    candidates: Vec<Candidate>,
    out: Preorder,
    done: f64,
    /// Bytes that the monitor has not been told of.
    gathered: usize,
}

struct Builder<'a, P: PlanePolicy> {
    scene: &'a Triangles,
    frame: &'a Frame,
    policy: &'a P,
    params: &'a Params,
    monitor: &'a Monitor,
    root_area: f64,
}

/// Builds a tree over the live triangles of `scene`, in the frame `frame`, in the current rayon pool.
///
/// # Errors
/// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
pub fn build<P: PlanePolicy>(
    scene: &Triangles,
    frame: &Frame,
    policy: &P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Preorder> {
    let root = policy.root(frame.bounds());
    let references: Vec<_> = scene
        .live()
        .par_iter()
        .map(|&id| {
            let corners = scene.corners(id).map(|p| frame.point(p));
            Reference {
                bounds: Aabb::of_triangle(corners),
                id,
            }
        })
        .collect();
    let builder = Builder {
        scene,
        frame,
        policy,
        params,
        monitor,
        root_area: root.area().max(f64::MIN_POSITIVE),
    };
    let budget = references.len().saturating_mul(BUDGET);
    builder.subtree(
        references,
        Pending {
            cell: root,
            depth: 0,
            bad: 0,
            budget,
            work: 1.0,
        },
    )
}

impl<P: PlanePolicy> Builder<'_, P> {
    /// Builds a subtree as a task of its own.
    fn subtree(&self, references: Vec<Reference>, node: Pending<P::Cell>) -> Result<Preorder> {
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

    /// Builds the node whose references are those of the task from `from` on, and removes them.
    fn node(&self, task: &mut Task, from: usize, node: Pending<P::Cell>) -> Result<()> {
        self.monitor.check()?;
        #[expect(clippy::cast_possible_truncation, reason = "a share of the surface")]
        let share = (node.cell.area() / self.root_area) as f32;
        let Some((plane, best, bad)) = self.choose(task, from, &node) else {
            let bytes = footprint::leaf::<Item>(task.references.len() - from, 8);
            self.monitor.charge(&mut task.gathered, bytes)?;
            task.out
                .leaf(task.references[from..].iter().map(|r| r.id), share);
            task.references.truncate(from);
            task.done += node.work;
            return Ok(());
        };

        // Part the references: those above the plane stay in place, those below follow them.
        let count = task.references.len() - from;
        let above = self.part(task, from, plane, best);
        let (n_above, n_below) = (above - from, task.references.len() - above);
        task.out.items.push(Item::Inner { plane, share });
        let (cell_below, cell_above) = node.cell.split(plane);
        let portion = |n: usize| n as f64 / (n_below + n_above).max(1) as f64;
        let child = |cell, n: usize| Pending {
            cell,
            depth: node.depth + 1,
            bad,
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a portion"
            )]
            budget: (node.budget as f64 * portion(n)) as usize,
            work: node.work * portion(n),
        };
        let (below, above_node) = (child(cell_below, n_below), child(cell_above, n_above));
        if count >= TASK {
            let references_below = task.references.split_off(above);
            let references_above = task.references.split_off(from);
            let (first, second) = rayon::join(
                || self.subtree(references_below, below),
                || self.subtree(references_above, above_node),
            );
            task.out.append(first?);
            task.out.append(second?);
            return Ok(());
        }
        self.node(task, above, below)?;
        self.node(task, from, above_node)
    }

    /// The plane to split the node by, or `None` for a leaf; and how many bad splits the path has.
    fn choose(
        &self,
        task: &mut Task,
        from: usize,
        node: &Pending<P::Cell>,
    ) -> Option<(Plane, sweep::Best, u32)> {
        let n = task.references.len() - from;
        let params = self.params;
        if n <= params.leaf_size || node.depth >= params.max_depth.min(MAX_DEPTH) {
            return None;
        }
        task.candidates.clear();
        self.policy.candidates(&node.cell, &mut task.candidates);
        let references = &task.references[from..];
        let attempt = |candidate: &Candidate, scratch: &mut Scratch| {
            let Candidate::Sweep(direction) = *candidate;
            let profile = node.cell.profile(direction)?;
            project(references, direction, scratch);
            let best = sweep(scratch, &profile, &params.costs, params.ties)?;
            Some((
                Plane {
                    direction,
                    offset: best.at,
                },
                best,
            ))
        };
        let cheaper =
            |a: Option<(Plane, sweep::Best)>, b: Option<(Plane, sweep::Best)>| match (a, b) {
                (Some(a), Some(b)) => Some(if b.1.cost < a.1.cost { b } else { a }),
                (a, b) => a.or(b),
            };
        let (plane, best) = if n >= PARALLEL_SWEEP {
            let attempts: Vec<_> = task
                .candidates
                .par_iter()
                .map(|candidate| attempt(candidate, &mut Scratch::default()))
                .collect();
            attempts.into_iter().fold(None, cheaper)?
        } else {
            let scratch = &mut task.scratch;
            task.candidates
                .iter()
                .map(|c| attempt(c, scratch))
                .fold(None, cheaper)?
        };

        let leaf = params.costs.leaf(n as f32);
        let bad = match params.stop {
            Stop::Cheapest if best.cost >= leaf => return None,
            Stop::Cheapest => 0,
            Stop::Tolerant(limit) => {
                let bad = node.bad + u32::from(best.cost > leaf);
                if (best.cost > 4.0 * leaf && n < 16) || bad >= limit {
                    return None;
                }
                bad
            }
        };
        let total: usize = references
            .iter()
            .map(|r| {
                let (min, max) = interval(r, plane.direction);
                let (below, above) = best.touching.sides(best.at, min, max);
                usize::from(below) + usize::from(above)
            })
            .sum();
        (total <= node.budget).then_some((plane, best, bad))
    }

    /// Parts the references from `from` on by a plane: first those above, then those below. Returns
    /// where those below begin.
    fn part(&self, task: &mut Task, from: usize, plane: Plane, best: sweep::Best) -> usize {
        let Direction::Axis(axis) = plane.direction;
        let end = task.references.len();
        let mut above_end = from;
        for i in from..end {
            let reference = task.references[i];
            let (min, max) = interval(&reference, plane.direction);
            let (below, above) = match best.touching.sides(best.at, min, max) {
                (true, true) if self.params.clip => self.clip(reference, axis, best.at),
                (below, above) => (below.then_some(reference), above.then_some(reference)),
            };
            if let Some(reference) = above {
                task.references[above_end] = reference;
                above_end += 1;
            }
            task.references.extend(below);
        }
        task.references.drain(above_end..end);
        above_end
    }

    /// The parts of a reference on both sides of an axis plane.
    fn clip(&self, r: Reference, axis: usize, at: f32) -> (Option<Reference>, Option<Reference>) {
        let corners = self.scene.corners(r.id).map(|p| self.frame.point(p));
        let (mut low, mut high) = (r.bounds, r.bounds);
        low.max[axis] = at;
        high.min[axis] = at;
        let magnitude = self.frame.bounds().magnitude();
        let part = |cell: &Aabb| {
            clipped_bounds(corners, cell, magnitude).map(|bounds| Reference { bounds, id: r.id })
        };
        match (part(&low), part(&high)) {
            (None, None) => (
                Some(Reference { bounds: low, ..r }),
                Some(Reference { bounds: high, ..r }),
            ),
            parts => parts,
        }
    }
}

/// The ends of a reference along a direction.
#[inline(always)]
fn interval(reference: &Reference, direction: Direction) -> (f32, f32) {
    let Direction::Axis(k) = direction;
    (reference.bounds.min[k], reference.bounds.max[k])
}

/// The ends of all references along a direction, for the sweep.
fn project(references: &[Reference], direction: Direction, scratch: &mut Scratch) {
    scratch.min.clear();
    scratch.max.clear();
    for reference in references {
        let (min, max) = interval(reference, direction);
        scratch.min.push(min);
        scratch.max.push(max);
    }
}
