// SPDX-License-Identifier: GPL-3.0-or-later
//! The space-partition loop: builds every tree of split planes.
//!
//! A tree supplies only a policy that proposes directions at a node ([`PlanePolicy`]); sweeps and costs
//! ([`choice`], [`single`]), termination, the assignment of triangles to children and parallelism are implemented
//! here, once. The result is a pure function of the triangles and the parameters, for any number of threads.

mod choice;
mod curve;
mod forecast;
pub mod lazy;
mod params;
mod policy;
mod single;
mod worth;

use crate::groups::Groups;
use crate::piece::Piece;
pub use crate::space::params::{ObliqueStep, Params, Stop, even_split_pays, one_child_only};
pub use crate::space::policy::{Node, PlanePolicy};
use crate::sweep::{Best, Scratch};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::cell::{Cell, Direction, Plane};
use halfspace_geom::profile::Profile;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::preorder::{Item, Preorder};
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use lazy::Later;
use rayon::prelude::*;

/// Subtrees of at least this number of references become separate tasks.
const TASK: usize = 4096;

/// Nodes of more triangles are split however small their cells are: the camera may be close to a detail of a large
/// scene.
const AREA_STOP_MOST: usize = 16;

/// Largest number of references per triangle of any tree. The children of a node share its budget in proportion to
/// their references; a node that would exceed its budget becomes a leaf.
const BUDGET: usize = 1024;

/// A node that is still to be built.
#[derive(Clone)]
pub struct OpenNode<C> {
    /// `None` for nodes that are leaves in any case.
    cell: Option<C>,
    /// Surface area of the cell divided by that of the root.
    share: f32,
    depth: usize,
    key: u64,
    /// Number of splits on the path that cost more than their leaf.
    bad: u32,
    /// Largest number of references of the subtree.
    budget: usize,
    /// Share of the whole work.
    work: f64,
}

impl<C> OpenNode<C> {
    /// Returns the view of the node that its policy gets.
    fn view<'a, P>(&self, pieces: &'a [P], monitor: &'a Monitor) -> Node<'a, P> {
        Node {
            pieces,
            depth: self.depth,
            key: self.key,
            monitor,
        }
    }
}

/// Round of a node's search for directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Round {
    /// The first directions, and further ones if these are not enough.
    First,
    /// Directions for nodes that would otherwise be leaves.
    More,
}

/// State of one thread while it builds a subtree.
struct Task<P> {
    pieces: Vec<P>,
    /// Buffer for pieces below a plane.
    aside: Vec<P>,
    scratch: Scratch,
    profile: Profile,
    directions: Vec<Direction>,
    planes: Vec<Plane>,
    groups: Groups,
    out: Preorder,
    done: f64,
    /// Bytes not yet reported to the monitor.
    gathered: usize,
}

/// Buffers of a task, reused by the next one; their contents are undefined.
#[derive(Default)]
struct Kept {
    scratch: Scratch,
    profile: Profile,
    directions: Vec<Direction>,
    planes: Vec<Plane>,
    groups: Groups,
}

thread_local! {
    static KEPT: std::cell::Cell<Kept> = std::cell::Cell::default();
}

/// The chosen split of a node.
struct Choice {
    plane: Plane,
    best: Best,
    /// Number of splits on the path, this one included, that cost more than their leaf.
    bad: u32,
}

/// The inputs of a build.
struct Builder<'a, P: PlanePolicy> {
    scene: &'a Triangles,
    frame: &'a Frame,
    policy: &'a P,
    params: &'a Params,
    monitor: &'a Monitor,
    /// Decides which nodes are built later; `None` if none is.
    later: Option<&'a dyn Later<P>>,
    /// Whether the calling thread builds everything alone.
    alone: bool,
}

/// Builds a tree over the live triangles of `scene`, in the frame `frame`, in the current rayon pool.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build<P: PlanePolicy>(
    scene: &Triangles,
    frame: &Frame,
    policy: &P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Preorder> {
    Builder {
        scene,
        frame,
        policy,
        params,
        monitor,
        later: None,
        alone: false,
    }
    .tree()
}

impl<P: PlanePolicy> Builder<'_, P> {
    /// Builds the tree of the whole scene.
    fn tree(&self) -> Result<Preorder> {
        let (scene, frame) = (self.scene, self.frame);
        let root = self.policy.root(frame.bounds());
        // Make the piece of each live triangle.
        let mut pieces: Vec<_> = scene
            .live()
            .par_iter()
            .map(|&id| P::Piece::new(id, scene.corners(id).map(|p| frame.point(p))))
            .collect();
        if self.params.sorted {
            curve::sort(&mut pieces, &frame.bounds());
        }
        // Start with the whole scene as the root.
        let budget = pieces.len().saturating_mul(BUDGET);
        let share = f32::from(u8::from(root.area() > 0.0));
        let leaf = self.is_leaf(pieces.len(), 0, share);
        self.subtree(
            pieces,
            OpenNode {
                share,
                cell: (!leaf).then_some(root),
                depth: 0,
                key: 0,
                bad: 0,
                budget,
                work: 1.0,
            },
        )
    }

    /// Builds a subtree as a separate task.
    fn subtree(&self, pieces: Vec<P::Piece>, node: OpenNode<P::Cell>) -> Result<Preorder> {
        let _held = self
            .monitor
            .hold(footprint::unsplit::<P::Piece>(pieces.len()))?;
        // A thread that builds many small subtrees alone reuses its buffers.
        let kept = if self.alone {
            KEPT.take()
        } else {
            Kept::default()
        };
        // Build the subtree.
        let mut task = Task {
            pieces,
            aside: Vec::new(),
            scratch: kept.scratch,
            profile: kept.profile,
            directions: kept.directions,
            planes: kept.planes,
            groups: kept.groups,
            out: Preorder::default(),
            done: 0.0,
            gathered: 0,
        };
        self.node(&mut task, 0, node)?;
        // Return the buffers to the thread.
        if self.alone {
            KEPT.set(Kept {
                scratch: task.scratch,
                profile: task.profile,
                directions: task.directions,
                planes: task.planes,
                groups: task.groups,
            });
        }
        self.monitor.take(task.gathered)?;
        self.monitor.advance(task.done);
        Ok(task.out)
    }

    /// Builds the node whose pieces are those of the task from index `from` on, and removes them.
    fn node(&self, task: &mut Task<P::Piece>, from: usize, node: OpenNode<P::Cell>) -> Result<()> {
        self.monitor.check()?;
        let count = task.pieces.len() - from;
        // Defer small nodes of a tree that is built on demand.
        if let Some(later) = self.later
            && let Some(cell) = &node.cell
            && later.takes(count)
        {
            let bytes = footprint::later::<P::Piece>(count) + cell.allocated();
            self.monitor.charge(&mut task.gathered, bytes)?;
            task.done += node.work;
            let pieces = task.pieces.split_off(from);
            task.out.later(later.keep(pieces, node));
            return Ok(());
        }
        // Choose a split; a policy that was cancelled chooses none or a bad one.
        let chosen = self.choose(task, from, &node);
        self.monitor.check()?;
        // Make a leaf if no split is accepted.
        let Some((cell, choice)) = chosen else {
            let bytes = footprint::leaf::<Item>(task.pieces.len() - from, 24);
            self.monitor.charge(&mut task.gathered, bytes)?;
            let ids = task.pieces[from..].iter().map(Piece::id);
            task.out.leaf(ids, node.share);
            task.pieces.truncate(from);
            task.done += node.work;
            return Ok(());
        };

        // Split the pieces: those above the plane stay in place, those below follow them.
        let Choice { plane, best, bad } = choice;
        self.split(task, from, plane, best);
        let above = task.pieces.len();
        let (n_above, n_below) = (above - from, task.aside.len());
        let share = node.share;
        task.out.items.push(Item::Inner { plane, share });
        // Compute cells only for children that may be split.
        let shares = best.shares.map(|part| share * part);
        let [cell_below, cell_above] = cell.parts(
            plane,
            [
                !self.is_leaf(n_below, node.depth + 1, shares[0]),
                !self.is_leaf(n_above, node.depth + 1, shares[1]),
            ],
        );
        // Give each child its share of the budget and of the work.
        let portion = |n: usize| n as f64 / (n_below + n_above).max(1) as f64;
        let child = |cell, side: usize, n: usize| OpenNode {
            cell,
            share: shares[side],
            depth: node.depth + 1,
            key: child_key(node.key, side),
            bad,
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a portion"
            )]
            budget: (node.budget as f64 * portion(n)) as usize,
            work: node.work * portion(n),
        };
        // Make both children.
        let below = child(cell_below, 0, n_below);
        let above_node = child(cell_above, 1, n_above);
        // Build the children of a large node in parallel.
        if count >= TASK {
            let pieces_below = std::mem::take(&mut task.aside);
            let pieces_above = if from == 0 {
                std::mem::take(&mut task.pieces)
            } else {
                task.pieces.split_off(from)
            };
            let below = || self.subtree(pieces_below, below);
            let above = || self.subtree(pieces_above, above_node);
            let (first, second) = if self.alone {
                (below(), above())
            } else {
                rayon::join(below, above)
            };
            task.out.append(first?);
            task.out.append(second?);
            return Ok(());
        }
        // Build the children of a small node in sequence, the one below at the end of the list.
        task.pieces.extend_from_slice(&task.aside);
        self.node(task, above, below)?;
        self.node(task, from, above_node)
    }

    /// Returns whether a node is a leaf before any plane is tried, and so needs no cell.
    fn is_leaf(&self, n: usize, depth: usize, share: f32) -> bool {
        let params = self.params;
        let visits = share * self.scene.live().len() as f32;
        n <= params.leaf_size
            || depth >= MAX_DEPTH
            || (depth >= params.max_depth && n <= params.leaf_most)
            || (n <= AREA_STOP_MOST && (n * n) as f32 * visits <= params.area_stop)
    }

    /// Returns the split of a node and its cell, or `None` for a leaf.
    fn choose<'c>(
        &self,
        task: &mut Task<P::Piece>,
        from: usize,
        node: &'c OpenNode<P::Cell>,
    ) -> Option<(&'c P::Cell, Choice)> {
        let n = task.pieces.len() - from;
        let params = self.params;
        let cell = node.cell.as_ref()?;
        // Get the directions and single planes to try at this node.
        task.directions.clear();
        task.planes.clear();
        let view = node.view(&task.pieces[from..], self.monitor);
        self.policy.directions(&view, &mut task.directions);
        self.policy.planes(&view, &mut task.planes);
        let mut choice = None;
        // Choose the best split; try the policy's additional directions for nodes that would become leaves.
        if node.depth < params.max_depth {
            choice = self.affordable(task, from, node, Round::First);
            if choice.as_ref().is_none_or(|c| c.bad > node.bad) {
                // Keep the directions tried before, for a forced split.
                let tried = std::mem::take(&mut task.directions);
                let view = node.view(&task.pieces[from..], self.monitor);
                self.policy.more(&view, &mut task.directions);
                if !task.directions.is_empty() {
                    let second = self.affordable(task, from, node, Round::More);
                    choice = match (choice, second) {
                        (Some(a), Some(b)) => Some(if b.best.cost < a.best.cost { b } else { a }),
                        (a, b) => a.or(b),
                    };
                }
                task.directions.extend(tried);
            }
        } else {
            let view = node.view(&task.pieces[from..], self.monitor);
            self.policy.further(&view, &mut task.directions);
        }
        // Reject splits not worth their cost, but split nodes too large for a leaf at any cost.
        let leaf = params.costs.leaf(n as f32);
        let choice = match choice.filter(|c| self.is_worth(c, leaf, node, n)) {
            None if n > params.leaf_most => self.forced(task, from, node)?,
            choice => choice?,
        };
        Some((cell, choice))
    }

    /// Splits the pieces from index `from` on by a plane: those above stay, those below go to `task.aside`.
    fn split(&self, task: &mut Task<P::Piece>, from: usize, plane: Plane, best: Best) {
        let framed = FramedScene {
            scene: self.scene,
            frame: self.frame,
        };
        // Reserve the known number of pieces below.
        let Task { pieces, aside, .. } = task;
        let end = pieces.len();
        let mut above_end = from;
        aside.clear();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count"
        )]
        aside.reserve(best.counts[0] as usize);
        // Assign each piece to its sides; compact those above in place.
        for i in from..end {
            let (min, max) = pieces[i].interval(plane.direction);
            match best.touching.sides(plane.offset, min, max) {
                (false, true) => {
                    if above_end < i {
                        pieces[above_end] = pieces[i];
                    }
                    above_end += 1;
                }
                (true, false) => aside.push(pieces[i]),
                // Cut a piece that lies on both sides.
                (below, above) => {
                    let parts = if below && above {
                        pieces[i].cut(plane, framed)
                    } else {
                        (None, None)
                    };
                    if let Some(piece) = parts.1 {
                        pieces[above_end] = piece;
                        above_end += 1;
                    }
                    aside.extend(parts.0);
                }
            }
        }
        pieces.truncate(above_end);
    }
}

/// Returns the key of a node's child: a bijection that mixes all bits (Steele, Lea and Flood 2014).
fn child_key(key: u64, side: usize) -> u64 {
    let mut x = key
        .wrapping_mul(2)
        .wrapping_add(side as u64 + 1)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
