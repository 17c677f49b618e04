// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernel of streams: thousands of rays visit each node of eight boxes together.

use crate::batch::Batch;
use crate::kernel::{Kernel, store};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_ray::Hit;
use halfspace_ray::query::Closest;
use std::sync::Arc;

/// Rays in streams.
#[derive(Debug)]
struct Streams {
    tree: Arc<BoxTree<8>>,
    leaves: Arc<Blocks>,
}

impl Kernel<Closest> for Streams {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Hit]) {
        let launch = batch.on(&self.leaves);
        launch.streams(&self.tree, store::<Closest>(answers));
    }

    fn working_set(&self) -> Option<usize> {
        Some(size_of_val(&*self.tree.nodes) + self.leaves.bytes())
    }
}

/// Nearest hits of streams through nodes of eight boxes, [`BoxTree::by_corners`].
pub fn boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(Streams {
        tree: tree.clone(),
        leaves: leaves.clone(),
    })
}
