// SPDX-License-Identifier: GPL-3.0-or-later
//! The loop, stopped before small nodes: rays that reach one have it built.
//!
//! What a node becomes depends on what the loop knows of it, its triangles, cell, depth, key and budget, and
//! on nothing else; so that is all that is kept, and the tree comes out as if it had been built at once.
//!
//! No limit holds then, as rays cannot fail half way: [`forecast`] looks ahead instead.
//!
//! Whoever traces a ray builds alone: a thread that waited for others in the middle of a subtree might be
//! handed other rays meanwhile, and meet the same subtree again.

use super::{Builder, Params, Pending, PlanePolicy, forecast};
use crate::build::Monitor;
use crate::build::lazy_tree::{LazyTree, Part, Seed, Unbuilt};
use crate::error::Result;
use crate::scene::Triangles;
use crate::traverse::frame::Frame;
use std::sync::Arc;

/// Nodes of no more references are not built before rays come, so that what is built at once is a small
/// part of the work, and large enough for all threads to share.
const TOP: usize = 4096;

/// A subtree is built down to nodes of so many times fewer references than its root.
const FAN: usize = 2;

/// Nodes of fewer references are not worth waiting for.
const LEAST: usize = 16;

/// What the loop asks before each node.
pub(super) trait Later<P: PlanePolicy>: Sync {
    /// Whether a node of so many references is built later.
    fn takes(&self, count: usize) -> bool;

    /// Keeps what that takes.
    fn keep(&self, pieces: Vec<P::Piece>, node: Pending<P::Cell>) -> Unbuilt;
}

/// What all subtrees of a tree need to be built.
struct Plan<P> {
    policy: P,
    params: Params,
    frame: Frame,
}

/// Puts off nodes of no more than so many references.
struct UpTo<P> {
    plan: Arc<Plan<P>>,
    most: usize,
}

impl<P: PlanePolicy + Send + 'static> Later<P> for UpTo<P> {
    fn takes(&self, count: usize) -> bool {
        (LEAST..=self.most).contains(&count)
    }

    fn keep(&self, pieces: Vec<P::Piece>, node: Pending<P::Cell>) -> Unbuilt {
        Unbuilt::new(
            size_of_val(&*pieces),
            pieces.len(),
            Box::new(Waiting {
                plan: self.plan.clone(),
                pieces,
                node,
            }),
        )
    }
}

/// A node that waits.
struct Waiting<P: PlanePolicy> {
    plan: Arc<Plan<P>>,
    pieces: Vec<P::Piece>,
    node: Pending<P::Cell>,
}

impl<P: PlanePolicy + Send + 'static> Seed for Waiting<P> {
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
        let builder = Builder {
            scene,
            frame,
            policy,
            params,
            monitor: &monitor,
            later: Some(&later),
            alone: true,
        };
        // Each level of the tree puts the pieces below its plane behind the others.
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

/// Builds the upper part of a tree as [`super::build`] would, in the current rayon pool; the rest is built by
/// the rays that reach it.
///
/// # Errors
/// As [`super::build`] and [`crate::build::plane_tree::PlaneTree::new`]; [`crate::error::Error::Memory`] also when
/// what rays may have built would not have room.
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
    let preorder = builder.tree()?;
    forecast::check_room(&preorder.parts, scene, monitor)?;
    Ok(LazyTree::new(Part::new(preorder, scene, &frame, 0)?))
}
