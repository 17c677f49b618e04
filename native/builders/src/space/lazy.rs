// SPDX-License-Identifier: GPL-3.0-or-later
//! The build loop, stopped before small nodes, which are built when a ray reaches them.
//!
//! The subtree of a node depends only on what the loop passes to it: its triangles, cell, depth, key and budget.
//! These are kept, and the tree equals one that is built at once.
//!
//! The memory limit does not apply then, because rays cannot fail while they are traced; [`forecast`] checks it in
//! advance.
//!
//! A thread that traces a ray builds alone: if it waited for other threads within a subtree, the pool might give
//! it other rays meanwhile, which could reach the same subtree again.

use crate::space::{Builder, OpenNode, Params, PlanePolicy, forecast};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::cell::Cell;
use halfspace_nodes::lazy_tree::{LazyTree, Part, Seed, Unbuilt};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::sync::Arc;

/// Nodes of at most this number of references are not built in advance, so that the part built at once is a small
/// share of the work, and large enough to occupy all threads.
const TOP: usize = 4096;

/// A subtree is built down to nodes with this factor fewer references than its root.
const FAN: usize = 2;

/// Nodes of fewer references are built at once, because deferring them saves too little (chosen).
const LEAST: usize = 16;

/// Decides which nodes are built later.
pub trait Later<P: PlanePolicy>: Sync {
    /// Returns whether a node of this number of references is built later.
    fn takes(&self, count: usize) -> bool;

    /// Makes the unbuilt subtree of a node.
    fn keep(&self, pieces: Vec<P::Piece>, node: OpenNode<P::Cell>) -> Unbuilt;
}

/// Data that all subtrees of a tree need to be built.
struct Plan<P> {
    policy: P,
    params: Params,
    frame: Frame,
}

/// Defers nodes of at most `most` references.
struct UpTo<P> {
    plan: Arc<Plan<P>>,
    most: usize,
}

impl<P: PlanePolicy + Send + 'static> Later<P> for UpTo<P> {
    fn takes(&self, count: usize) -> bool {
        (LEAST..=self.most).contains(&count)
    }

    fn keep(&self, pieces: Vec<P::Piece>, node: OpenNode<P::Cell>) -> Unbuilt {
        let cell = node.cell.as_ref().map_or(0, Cell::allocated);
        Unbuilt::new(
            size_of_val(&*pieces) + size_of::<Deferred<P>>() + cell,
            pieces.len(),
            Box::new(Deferred {
                plan: self.plan.clone(),
                pieces,
                node,
            }),
        )
    }
}

/// A deferred node.
struct Deferred<P: PlanePolicy> {
    plan: Arc<Plan<P>>,
    pieces: Vec<P::Piece>,
    node: OpenNode<P::Cell>,
}

impl<P: PlanePolicy + Send + 'static> Seed for Deferred<P> {
    fn grow(self: Box<Self>, scene: &Triangles) -> Part {
        let Self { plan, pieces, node } = *self;
        let depth = node.depth;
        let most = pieces.len() / FAN;
        let monitor = Monitor::new();
        let later = UpTo { plan, most };
        let Plan {
            policy,
            params,
            frame,
        } = &*later.plan;
        // Build with the same policy and parameters, without limit, on this thread alone.
        let builder = Builder {
            scene,
            frame,
            policy,
            params,
            monitor: &monitor,
            later: Some(&later),
            alone: true,
        };
        // Reserve room, because each level of the tree puts the pieces below its plane behind the others.
        let mut room = Vec::with_capacity(3 * pieces.len());
        room.extend_from_slice(&pieces);
        drop(pieces);
        builder
            .subtree(room, node)
            .and_then(|preorder| Part::new(preorder, scene, frame, depth))
            .expect("a subtree of few references meets no limit")
    }

    fn again(&self) -> Box<dyn Seed> {
        Box::new(Self {
            plan: self.plan.clone(),
            pieces: self.pieces.clone(),
            node: self.node.clone(),
        })
    }
}

/// Builds the upper part of a tree like [`crate::space::build`], in the current rayon pool; the rest is built by the
/// rays that reach it.
///
/// # Errors
/// Those of [`crate::space::build`] and [`halfspace_nodes::plane_tree::PlaneTree::new`];
/// [`halfspace_base::error::Error::Memory`] also when the whole tree would not fit into the limit.
pub fn build<P: PlanePolicy + Send + 'static>(
    scene: &Triangles,
    frame: Frame,
    policy: P,
    params: &Params,
    monitor: &Monitor,
) -> Result<LazyTree> {
    let plan = Arc::new(Plan {
        policy,
        params: *params,
        frame,
    });
    // Defer nodes up to this size, at most half of the scene.
    let most = TOP.min(scene.live().len() / FAN);
    let later = UpTo { plan, most };
    let builder = Builder {
        scene,
        frame: &frame,
        policy: &later.plan.policy,
        params,
        monitor,
        later: Some(&later),
        alone: false,
    };
    // Refuse a tree that cannot fit into memory before any ray depends on it.
    let preorder = builder.tree()?;
    forecast::check_room(&preorder.parts, scene, monitor)?;
    Ok(LazyTree::new(Part::new(preorder, scene, &frame, 0)?))
}
