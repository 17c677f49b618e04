// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of streams: thousands of rays visit each node together.

use crate::batch::Batch;
use crate::kernel::{Kernel, store};
use crate::stream::Steps;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::slab_node::{Double, Single};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_nodes::slab_wide::WideSlabs;
use halfspace_nodes::slant_tree::SlantTree;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_ray::RayCounters;
use halfspace_ray::query::{Any, Closest, Query};
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
        launch.streams::<T, Q>(&self.tree, &mut store::<Q>(answers));
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let launch = batch.on(&self.leaves);
        launch.count_streams::<T, Q>(&self.tree, &mut store::<Q>(answers), counters);
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

streams! {
    /// through nodes of eight boxes, [`BoxTree::by_corners`].
    fn boxes, shadow_boxes(BoxTree<8>)
}

streams! {
    /// through nodes of four boxes.
    fn boxes4, shadow_boxes4(BoxTree<4>)
}

streams! {
    /// through nodes of two boxes.
    fn boxes2, shadow_boxes2(BoxTree<2>)
}

streams! {
    /// through split planes.
    fn planes, shadow_planes(PlaneTree)
}

streams! {
    /// through wide nodes of split planes.
    fn wide_planes, shadow_wide_planes(WideTree)
}

streams! {
    /// through intervals, two planes to a node.
    fn intervals, shadow_intervals(SlabTree<Double>)
}

streams! {
    /// through intervals, one plane to a node.
    fn single_intervals, shadow_single_intervals(SlabTree<Single>)
}

streams! {
    /// through nodes of two intervals.
    fn intervals2, shadow_intervals2(WideSlabs<2>)
}

streams! {
    /// through nodes of four intervals.
    fn intervals4, shadow_intervals4(WideSlabs<4>)
}

streams! {
    /// through nodes of eight intervals.
    fn intervals8, shadow_intervals8(WideSlabs<8>)
}

streams! {
    /// through intervals along any of thirteen directions.
    fn slanted, shadow_slanted(SlantTree)
}

streams! {
    /// through octrees.
    fn octants, shadow_octants(Octree)
}
