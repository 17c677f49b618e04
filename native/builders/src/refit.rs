// SPDX-License-Identifier: GPL-3.0-or-later
//! Fits the bounds of a tree to moved triangles, from the leaves up: boxes and intervals in which each triangle lies in
//! one leaf. The links stay, so the work is in proportion to the nodes (Wald, Boulos and Shirley 2007, section 3.3).

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::members::{LeafBounds, Members};
use halfspace_nodes::refit::{Below, FitNode, FitTree, Fitted};
use halfspace_ray::FramedScene;
use rayon::prelude::*;

/// Smallest number of nodes that one task fits (chosen).
const TASK: usize = 1024;

/// Number of tasks per thread (chosen): few, because the nodes between tasks are fitted on one thread.
const TASKS: usize = 4;

/// The part of a tree that moving triangles leave as it is, except for the nodes themselves.
#[derive(Debug)]
pub struct Topology {
    members: Members,
    /// Position among the members of each leaf with triangles, in the order of the nodes that link them.
    positions: Vec<u32>,
    /// Per node, the number of such leaves that nodes before it link.
    starts: Vec<u32>,
}

/// A node of a task's range.
enum Outcome<N> {
    /// The node with its new bounds, and what lies below it.
    Done(N, Fitted),
    /// A child lies beyond the range.
    Later,
}

impl Topology {
    /// Reads the leaves of a tree.
    ///
    /// # Panics
    /// For 2^32 leaves or more, which the layouts' limits exclude.
    pub fn new<T: FitTree>(tree: &T, blocks: &Blocks) -> Self {
        let mut leaves = Vec::new();
        let mut starts = Vec::with_capacity(tree.nodes().len());
        // List the leaves with triangles, node by node.
        for &(mut node) in tree.nodes() {
            starts.push(u32::try_from(leaves.len()).expect("checked by the layout"));
            node.fit(|below| {
                if let Below::Leaf(leaf @ Leaf { count: 1.., .. }) = below {
                    leaves.push(leaf);
                }
                Fitted::NOTHING
            });
        }
        let (members, positions) = Members::new(blocks, &leaves);
        Self {
            members,
            positions,
            starts,
        }
    }

    /// Returns the numbers of all triangles in the leaves.
    pub fn ids(&self) -> &[u32] {
        self.members.ids()
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        self.members.bytes() + size_of_val(&*self.positions) + size_of_val(&*self.starts)
    }

    /// Fits the tree that the topology was read from to moved triangles, in the current rayon pool; returns the new
    /// tree and the data of its leaves. The result is the same on any number of threads.
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Cancelled`].
    pub fn refit<T: FitTree>(
        &self,
        tree: &T,
        framed: FramedScene<'_>,
        monitor: &Monitor,
    ) -> Result<(T, Blocks)> {
        let (blocks, leaves) = self.members.write(framed, monitor)?;
        let template = tree.nodes();
        let mut nodes = template.to_vec();
        let mut fitted = vec![Fitted::NOTHING; nodes.len()];
        // Fit ranges of nodes in parallel, the last node of each first, since children follow their parents.
        let tasks = TASKS * rayon::current_num_threads();
        let size = nodes.len().div_ceil(tasks).max(TASK);
        let ranges = (nodes.par_chunks_mut(size)).zip(fitted.par_chunks_mut(size));
        let later: Vec<Vec<usize>> = (ranges.enumerate())
            .map(|(range, (nodes, fitted))| {
                let first = range * size;
                let mut later = Vec::new();
                let mut done = vec![true; nodes.len()];
                for i in (0..nodes.len()).rev() {
                    let below = |child: usize| {
                        let inside = child - first;
                        (inside < fitted.len() && done[inside]).then(|| fitted[inside])
                    };
                    match self.node(nodes[i], first + i, &leaves, below) {
                        Outcome::Done(node, own) => (nodes[i], fitted[i]) = (node, own),
                        Outcome::Later => {
                            done[i] = false;
                            later.push(first + i);
                        }
                    }
                }
                later
            })
            .collect();
        // Fit the nodes whose children lie in several ranges.
        for i in later.into_iter().rev().flatten() {
            let below = |child: usize| Some(fitted[child]);
            if let Outcome::Done(node, own) = self.node(template[i], i, &leaves, below) {
                (nodes[i], fitted[i]) = (node, own);
            }
        }
        monitor.check()?;
        Ok((T::of_nodes(nodes), blocks))
    }

    /// Fits one node; `below` returns what lies below an inner child, if that is known.
    #[inline(always)]
    fn node<N: FitNode>(
        &self,
        mut node: N,
        index: usize,
        leaves: &[LeafBounds],
        below: impl Fn(usize) -> Option<Fitted>,
    ) -> Outcome<N> {
        let mut next = self.starts[index] as usize;
        let mut known = true;
        let own = node.fit(|child| match child {
            Below::Node(child) => below(child as usize).unwrap_or_else(|| {
                known = false;
                Fitted::NOTHING
            }),
            Below::Leaf(Leaf { count: 0, .. }) => Fitted::NOTHING,
            Below::Leaf(_) => {
                let (bounds, count) = leaves[self.positions[next] as usize];
                next += 1;
                Fitted { bounds, count }
            }
        });
        if known {
            Outcome::Done(node, own)
        } else {
            Outcome::Later
        }
    }
}
