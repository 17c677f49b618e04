// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of rays in flight: sixteen rays alternate, so that the memory of each is fetched while others step.

use crate::Run;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_ray::RayCounters;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_single::steps::boxes::BoxSteps;
use halfspace_single::steps::planes::PlaneSteps;
use halfspace_single::steps::{SingleSteps, Steps};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::{Kernel, store};
use std::fmt::Debug;
use std::sync::Arc;

/// A tree that rays in flight step through.
trait Steppable: Debug + Send + Sync + 'static {
    /// The steps over the borrowed tree.
    type Steps<'a>: Steps
    where
        Self: 'a;

    /// Borrows the tree.
    fn steps(&self) -> Self::Steps<'_>;

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;
}

impl Steppable for WideTree {
    type Steps<'a> = PlaneSteps<'a>;

    fn steps(&self) -> PlaneSteps<'_> {
        PlaneSteps(self)
    }

    fn bytes(&self) -> usize {
        WideTree::bytes(self)
    }
}

impl Steppable for BoxTree<8> {
    type Steps<'a> = BoxSteps<'a>;

    fn steps(&self) -> BoxSteps<'_> {
        BoxSteps(self)
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// Rays in flight through a tree.
#[derive(Debug)]
struct InFlight<T> {
    tree: Arc<T>,
    leaves: Arc<Blocks>,
}

impl<Q: Query, T: Steppable> Kernel<Q> for InFlight<T> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let launch = batch.on(&self.leaves);
        Run(launch).in_flight::<_, Q>(&self.tree.steps(), store::<Q>(answers));
    }

    /// A ray in flight takes the steps that it takes alone; only their order among those of other rays differs.
    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let launch = batch.on(&self.leaves);
        let mut write = store::<Q>(answers);
        launch.trace::<_, Q>(&SingleSteps(self.tree.steps()), &mut write, Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }

    fn working_set(&self) -> Option<usize> {
        Some(self.tree.bytes() + self.leaves.bytes())
    }
}

/// Nearest hits of rays in flight through wide nodes of planes.
pub fn wide_planes(tree: &Arc<WideTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(InFlight {
        tree: tree.clone(),
        leaves: leaves.clone(),
    })
}

/// Any hits of rays in flight through wide nodes of planes.
pub fn shadow_wide_planes(tree: &Arc<WideTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(InFlight {
        tree: tree.clone(),
        leaves: leaves.clone(),
    })
}

/// Nearest hits of rays in flight through nodes of eight boxes, [`BoxTree::by_corners`].
pub fn wide_boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(InFlight {
        tree: tree.clone(),
        leaves: leaves.clone(),
    })
}

/// Any hits of rays in flight through nodes of eight boxes, [`BoxTree::by_corners`].
pub fn shadow_wide_boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(InFlight {
        tree: tree.clone(),
        leaves: leaves.clone(),
    })
}
