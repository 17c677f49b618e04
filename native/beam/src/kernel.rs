// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of beams: tiles of camera rays, and shadow rays of one light.

use super::octants::OctantBeams;
use super::planes::PlaneBeams;
use super::shadow::Run;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_ray::query::{Any, Closest};
use halfspace_ray::{Hit, RayCounters};
use halfspace_single::octants::glassner::Location;
use halfspace_single::octants::net::Links;
use halfspace_single::octants::param::OctreeTraversal;
use halfspace_single::octants::samet::Ascent;
use halfspace_single::octants::step::NeighbourTraversal;
use halfspace_single::planes::dir::PlaneTraversal;
use halfspace_trace::batch::{Batch, TileTraversal};
use halfspace_trace::kernel::{Kernel, store};
use std::fmt::Debug;
use std::sync::Arc;

/// Tiles of camera rays as beams.
#[derive(Debug)]
struct CameraBeams<T> {
    tree: Arc<T>,
    leaves: Arc<Blocks>,
    /// Rays continue singly when fewer than this are left together.
    least: u32,
}

/// A tree with beams of camera rays.
trait BeamTree: Debug + Send + Sync + 'static {
    /// The beams over the borrowed tree.
    type Beams<'a>: TileTraversal
    where
        Self: 'a;

    /// Borrows the tree.
    fn beams(&self, least: u32) -> Self::Beams<'_>;
}

impl BeamTree for Octree {
    type Beams<'a> = OctantBeams<'a>;

    fn beams(&self, least: u32) -> OctantBeams<'_> {
        OctantBeams { tree: self, least }
    }
}

impl BeamTree for PlaneTree {
    type Beams<'a> = PlaneBeams<'a>;

    fn beams(&self, least: u32) -> PlaneBeams<'_> {
        PlaneBeams { tree: self, least }
    }
}

impl<T: BeamTree> Kernel<Closest> for CameraBeams<T> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Hit]) {
        let launch = batch.on(&self.leaves);
        launch.quick_tiles(&self.tree.beams(self.least), store::<Closest>(answers));
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [Hit], counters: &mut [RayCounters]) -> bool {
        let (beams, launch) = (self.tree.beams(self.least), batch.on(&self.leaves));
        launch.tiles(&beams, store::<Closest>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

/// Camera rays as beams through octants; below `least` rays they continue singly.
pub fn octants(tree: &Arc<Octree>, leaves: &Arc<Blocks>, least: u32) -> Arc<dyn Kernel<Closest>> {
    Arc::new(CameraBeams {
        tree: tree.clone(),
        leaves: leaves.clone(),
        least,
    })
}

/// Camera rays as beams through split planes; below `least` rays they continue singly.
pub fn planes(tree: &Arc<PlaneTree>, leaves: &Arc<Blocks>, least: u32) -> Arc<dyn Kernel<Closest>> {
    Arc::new(CameraBeams {
        tree: tree.clone(),
        leaves: leaves.clone(),
        least,
    })
}

/// Defines a function that makes the kernel of shadow beams through a tree; the traversal `$single` takes the rays that
/// beams leave.
macro_rules! shadow_beams {
    ($(#[$doc:meta])* fn $constructor:ident($tree:ty) { |$kernel:ident| $single:expr }) => {
        $(#[$doc])*
        pub fn $constructor(tree: &Arc<$tree>, leaves: &Arc<Blocks>) -> Arc<dyn Kernel<Any>> {
            #[derive(Debug)]
            struct ShadowBeams {
                tree: Arc<$tree>,
                leaves: Arc<Blocks>,
            }
            impl Kernel<Any> for ShadowBeams {
                fn trace(&self, batch: &Batch<'_>, answers: &mut [bool]) {
                    let $kernel = self;
                    let launch = batch.on(&self.leaves);
                    Run(launch).shadow_beams(&*self.tree, &$single, store::<Any>(answers), None);
                }

                fn count(
                    &self,
                    batch: &Batch<'_>,
                    answers: &mut [bool],
                    counters: &mut [RayCounters],
                ) -> bool {
                    let $kernel = self;
                    let (single, write) = ($single, store::<Any>(answers));
                    let launch = batch.on(&self.leaves);
                    Run(launch).shadow_beams(&*self.tree, &single, write, Some(counters));
                    true
                }

                fn counts(&self) -> bool {
                    true
                }
            }
            Arc::new(ShadowBeams {
                tree: tree.clone(),
                leaves: leaves.clone(),
            })
        }
    };
}

shadow_beams! {
    /// Shadow rays as beams through split planes.
    fn shadow_planes(PlaneTree) { |kernel| PlaneTraversal(&*kernel.tree) }
}

shadow_beams! {
    /// Shadow rays as beams through octants, single rays from the root.
    fn shadow_param(Octree) { |kernel| OctreeTraversal(&kernel.tree) }
}

shadow_beams! {
    /// Shadow rays as beams through octants, single rays by links.
    fn shadow_net(Octree) { |kernel| NeighbourTraversal(&kernel.tree, Links) }
}

shadow_beams! {
    /// Shadow rays as beams through octants, single rays by the common ancestor.
    fn shadow_samet(Octree) { |kernel| NeighbourTraversal(&kernel.tree, Ascent) }
}

shadow_beams! {
    /// Shadow rays as beams through octants, single rays that locate each leaf from the root.
    fn shadow_glassner(Octree) { |kernel| NeighbourTraversal(&kernel.tree, Location) }
}
