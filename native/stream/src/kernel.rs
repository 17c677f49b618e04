// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of streams: thousands of rays visit each node together.

use crate::blockers::BlockersFirst;
use crate::order::Rule;
use crate::{Run, Steps};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_ray::RayCounters;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::{Kernel, store};
use std::fmt::Debug;
use std::sync::Arc;

/// Rays in streams.
#[derive(Debug)]
struct Streams<T> {
    tree: Arc<T>,
    leaves: Arc<Blocks>,
}

impl<T> Streams<T> {
    fn new(tree: &Arc<T>, leaves: &Arc<Blocks>) -> Arc<Self> {
        Arc::new(Self {
            tree: tree.clone(),
            leaves: leaves.clone(),
        })
    }
}

impl<Q: Query, T: Steps + Debug + Send> Kernel<Q> for Streams<T> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let launch = batch.on(&self.leaves);
        Run(launch).streams::<T, Q>(&self.tree, &mut store::<Q>(answers));
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let launch = batch.on(&self.leaves);
        Run(launch).count_streams::<T, Q>(&self.tree, &mut store::<Q>(answers), counters);
        true
    }

    fn counts(&self) -> bool {
        true
    }

    fn working_set(&self) -> Option<usize> {
        Some(self.tree.bytes() + self.leaves.bytes())
    }
}

/// Defines two functions that make the kernels of streams through a tree, one for nearest hits and one for any hits.
macro_rules! streams {
    ($(#[$doc:meta])* fn $closest:ident, $shadow:ident($tree:ty)) => {
        #[doc = "Nearest hits of streams"]
        $(#[$doc])*
        pub fn $closest(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
            Streams::new(tree, leaves)
        }

        #[doc = "Any hits of streams"]
        $(#[$doc])*
        pub fn $shadow(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
            Streams::new(tree, leaves)
        }
    };
}

/// Nearest hits of streams through nodes of eight boxes, [`BoxTree::by_corners`].
pub fn boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Streams::new(tree, leaves)
}

/// Any hits of streams through nodes of eight boxes, whose children are visited in the order of a rule.
pub fn shadow_boxes(
    tree: &Arc<BoxTree<8>>,
    leaves: &Arc<Blocks>,
    rule: Rule,
) -> Arc<dyn Kernel<Any>> {
    Streams::new(&Arc::new(BlockersFirst::new(tree, leaves, rule)), leaves)
}

streams! {
    /// through split planes.
    fn planes, shadow_planes(PlaneTree)
}

halfspace_group::visits::kernels_of_all_nodes!(streams);
