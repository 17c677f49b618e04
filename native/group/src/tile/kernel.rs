// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of tiles: camera rays from their origin, shadow rays from their light.

use super::SuccessRate;
use super::traversal::{ShadowTiles, TileTree, Tiles};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::projected_tree::ProjectedTree;
use halfspace_ray::RayCounters;
use halfspace_ray::query::{Any, Closest};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::{Kernel, store};
use std::fmt::Debug;
use std::sync::Arc;

/// Camera rays in tiles of `16 R`.
#[derive(Debug)]
struct CameraTiles<T, const R: usize> {
    tree: Arc<T>,
    leaves: Arc<Blocks>,
    /// Share of the tiles of earlier batches that finished.
    rate: SuccessRate,
}

impl<T: TileTree + Debug + Send + 'static, const R: usize> Kernel<Closest> for CameraTiles<T, R> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [halfspace_ray::Hit]) {
        let tiles = Tiles::<_, R>(&*self.tree, Some(&self.rate));
        let launch = batch.on(&self.leaves);
        launch.quick_tiles(&tiles, store::<Closest>(answers));
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [halfspace_ray::Hit],
        counters: &mut [RayCounters],
    ) -> bool {
        // Counts must not depend on earlier batches.
        let tiles = Tiles::<_, R>(&*self.tree, None);
        let launch = batch.on(&self.leaves);
        launch.tiles(&tiles, store::<Closest>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

/// Shadow rays in tiles of 64, reversed: they start at their light.
#[derive(Debug)]
struct LightTiles<T> {
    tree: Arc<T>,
    leaves: Arc<Blocks>,
    /// Share of the tiles of earlier batches that finished.
    rate: SuccessRate,
}

impl<T> LightTiles<T> {
    /// The traversal of a batch.
    fn tiles<'a>(
        &'a self,
        batch: &Batch<'_>,
        rate: Option<&'a SuccessRate>,
    ) -> ShadowTiles<'a, T, 4> {
        ShadowTiles {
            tree: &*self.tree,
            rate,
            cache: batch.shadow_cache,
        }
    }
}

impl<T: TileTree + Debug + Send + 'static> Kernel<Any> for LightTiles<T> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [bool]) {
        let tiles = self.tiles(batch, Some(&self.rate));
        let launch = batch.on(&self.leaves);
        launch.quick_tiles(&tiles, store::<Any>(answers));
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [bool], counters: &mut [RayCounters]) -> bool {
        // Counts must not depend on earlier batches.
        let tiles = self.tiles(batch, None);
        let launch = batch.on(&self.leaves);
        launch.tiles(&tiles, store::<Any>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

fn camera<T, const R: usize>(tree: &Arc<T>, leaves: &Arc<Blocks>) -> CameraTiles<T, R> {
    CameraTiles {
        tree: tree.clone(),
        leaves: leaves.clone(),
        rate: SuccessRate::default(),
    }
}

fn light<T>(tree: &Arc<T>, leaves: &Arc<Blocks>) -> LightTiles<T> {
    LightTiles {
        tree: tree.clone(),
        leaves: leaves.clone(),
        rate: SuccessRate::default(),
    }
}

/// Defines two functions that make the kernels of tiles of 64 through a tree, for camera rays and for shadow rays.
macro_rules! tiles {
    ($(#[$doc:meta])* fn $closest:ident, $shadow:ident($tree:ty)) => {
        #[doc = "Camera rays in tiles of 64"]
        $(#[$doc])*
        pub fn $closest(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
            Arc::new(camera::<_, 4>(tree, leaves))
        }

        #[doc = "Shadow rays in tiles of 64"]
        $(#[$doc])*
        pub fn $shadow(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
            Arc::new(light(tree, leaves))
        }
    };
}

crate::visits::kernels_of_all_nodes!(tiles);

/// Camera rays in tiles of 64 through split planes.
pub fn planes(tree: &Arc<PlaneTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(camera::<_, 4>(tree, leaves))
}

/// [`planes`] whose rays are projected onto the directions of the tree once.
pub fn projected(tree: &Arc<ProjectedTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(camera::<_, 4>(tree, leaves))
}

/// [`shadow_planes`] whose rays are projected onto the directions of the tree once.
pub fn shadow_projected(tree: &Arc<ProjectedTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(light(tree, leaves))
}

/// Camera rays in tiles of 256 through split planes.
pub fn large_planes(tree: &Arc<PlaneTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(camera::<_, 16>(tree, leaves))
}

/// Camera rays in tiles of 64 through a tree whose lower parts are built when rays need them.
pub fn lazy(tree: &Arc<LazyTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(camera::<_, 4>(tree, leaves))
}

/// Camera rays in tiles of 64 through nodes of eight boxes.
pub fn boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(camera::<_, 4>(tree, leaves))
}

/// Camera rays in tiles of 256 through nodes of eight boxes.
pub fn large_boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Closest>> {
    Arc::new(camera::<_, 16>(tree, leaves))
}

/// Shadow rays in tiles of 64 through split planes.
pub fn shadow_planes(tree: &Arc<PlaneTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(light(tree, leaves))
}

/// Shadow rays in tiles of 64 through a tree whose lower parts are built when rays need them.
pub fn shadow_lazy(tree: &Arc<LazyTree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(light(tree, leaves))
}

/// Shadow rays in tiles of 64 through nodes of eight boxes.
pub fn shadow_boxes(tree: &Arc<BoxTree<8>>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
    Arc::new(light(tree, leaves))
}
