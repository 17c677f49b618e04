// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of packets: 4, 8 or 16 rays, one to a lane, whatever their order.

use super::traversal::{PacketTree, Packets};
use super::{Eight, Four, Sixteen, Width};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::projected_tree::ProjectedTree;
use halfspace_ray::RayCounters;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::{Kernel, store};
use std::fmt::Debug;
use std::marker::PhantomData;
use std::sync::Arc;

/// Packets of `L::RAYS` rays.
#[derive(Debug)]
struct InPackets<T, L> {
    tree: Arc<T>,
    leaves: Arc<Blocks>,
    width: PhantomData<L>,
}

impl<T, L> InPackets<T, L> {
    fn new(tree: &Arc<T>, leaves: &Arc<Blocks>) -> Self {
        Self {
            tree: tree.clone(),
            leaves: leaves.clone(),
            width: PhantomData,
        }
    }
}

impl<Q: Query, T, L> Kernel<Q> for InPackets<T, L>
where
    T: PacketTree + Debug + Send + 'static,
    L: Width + Debug + Send + Sync,
{
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let packets = Packets::<_, Q, L>::new(&*self.tree, batch.shadow_cache);
        batch
            .on(&self.leaves)
            .quick_tiles(&packets, store::<Q>(answers));
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let packets = Packets::<_, Q, L>::new(&*self.tree, batch.shadow_cache);
        let launch = batch.on(&self.leaves);
        launch.tiles(&packets, store::<Q>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

fn nearest<T: PacketTree + Debug + Send + 'static>(
    tree: &Arc<T>,
    leaves: &Arc<Blocks>,
    rays: usize,
) -> Arc<dyn Kernel<Closest>> {
    match rays {
        4 => Arc::new(InPackets::<_, Four>::new(tree, leaves)),
        8 => Arc::new(InPackets::<_, Eight>::new(tree, leaves)),
        _ => Arc::new(InPackets::<_, Sixteen>::new(tree, leaves)),
    }
}

/// Nearest hits by packets of 4, 8 or 16 rays through split planes.
pub fn planes(
    tree: &Arc<PlaneTree>,
    leaves: &Arc<Blocks>,
    rays: usize,
) -> Arc<dyn Kernel<Closest>> {
    nearest(tree, leaves, rays)
}

/// [`planes`] by packets of 16 rays, which are projected onto the directions of the tree once.
pub fn projected(tree: &Arc<ProjectedTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(InPackets::<_, Sixteen>::new(tree, leaves))
}

/// [`shadow_planes`] whose rays are projected onto the directions of the tree once.
pub fn shadow_projected(tree: &Arc<ProjectedTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(InPackets::<_, Sixteen>::new(tree, leaves))
}

/// Nearest hits by packets of 4, 8 or 16 rays through nodes of eight boxes.
pub fn boxes(
    tree: &Arc<BoxTree<8>>,
    leaves: &Arc<Blocks>,
    rays: usize,
) -> Arc<dyn Kernel<Closest>> {
    nearest(tree, leaves, rays)
}

/// Defines two functions that make the kernels of packets of 16 rays through a tree, for nearest hits and for any hits.
macro_rules! packets {
    ($(#[$doc:meta])* fn $closest:ident, $shadow:ident($tree:ty)) => {
        #[doc = "Nearest hits by packets of 16 rays"]
        $(#[$doc])*
        pub fn $closest(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
            Arc::new(InPackets::<_, Sixteen>::new(tree, leaves))
        }

        #[doc = "Any hits by packets of 16 rays"]
        $(#[$doc])*
        pub fn $shadow(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
            Arc::new(InPackets::<_, Sixteen>::new(tree, leaves))
        }
    };
}

crate::visits::kernels_of_all_nodes!(packets);

/// Any hits by packets of 16 rays through split planes.
pub fn shadow_planes(tree: &Arc<PlaneTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(InPackets::<_, Sixteen>::new(tree, leaves))
}

/// Any hits by packets of 16 rays through nodes of eight boxes.
pub fn shadow_boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(InPackets::<_, Sixteen>::new(tree, leaves))
}
