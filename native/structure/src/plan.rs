// SPDX-License-Identifier: GPL-3.0-or-later
//! The assignment of kernels to kinds of ray batches. A plan is made once, with the tree, so no caller matches on the
//! kind of tree.

use crate::coherence::{Limits, any_by_coherence};
use crate::footprint::{Footprint, closest_by_footprint};
use crate::way::Rays;
use halfspace_ray::Order;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_trace::kernel::{Kernel, SingleRays};
use std::sync::Arc;

/// Number of rays below which batches go one by one. Measured on Zen 3 with AVX2, bundles of rays from one point through
/// 1,500 and 200,000 triangles: streams of 16 take 1.1 to 7 times as long as single rays, of 64 0.9 to 5.6 times, of 128
/// 0.9 to 5.9 times; at the lower ends groups begin to pay.
const FEW: usize = 128;

/// A kernel, and how it groups rays.
#[derive(Debug)]
pub struct RoutedKernel<Q: Query> {
    /// The kernel.
    pub kernel: Arc<dyn Kernel<Q>>,
    /// How its rays are grouped.
    pub rays: Rays,
    /// Number of rays of the smallest batch that it traces; smaller ones go one by one.
    pub least: usize,
}

impl<Q: Query> RoutedKernel<Q> {
    /// All rays go to `kernel`.
    fn all(rays: Rays, kernel: Arc<dyn Kernel<Q>>) -> Self {
        Self {
            kernel,
            rays,
            least: 0,
        }
    }
}

/// The kernels of a structure. Batches without a kernel of their own go to `single`.
#[derive(Debug)]
pub struct Plan {
    /// Nodes against which rays are tested, as in [`crate::way::Way::nodes`].
    pub nodes: &'static str,
    /// Single rays: also those of instances, and those whose path is drawn or recorded.
    pub single: Arc<dyn SingleRays>,
    /// Nearest hits of rays in any order.
    pub closest: Option<RoutedKernel<Closest>>,
    /// Nearest hits of rays ordered in tiles of 8 x 8 pixels, if these have a kernel of their own.
    pub tiles: Option<RoutedKernel<Closest>>,
    /// Any hits.
    pub shadow: Option<RoutedKernel<Any>>,
    /// Whether any-hit rays first test the triangle that last blocked their light (Wilt 1994).
    pub shadow_cache: bool,
    /// Name of the traversal of `single`.
    pub counted_as: &'static str,
    /// Names of the counters [`halfspace_ray::RayCounters::cases`], in their order.
    pub cases: &'static [&'static str],
}

/// The kernel of one kind of batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Route {
    /// The kind: single, closest, tiles or shadow.
    pub batch: &'static str,
    /// Nodes against which rays are tested.
    pub nodes: &'static str,
    /// How rays are grouped.
    pub rays: Rays,
    /// Whether the kernel counts its own steps and tests; if not, single rays are counted in its place.
    pub counted: bool,
}

impl Plan {
    /// Makes a plan that traces single rays through `nodes`; `name` is the name of their traversal.
    pub fn single(nodes: &'static str, name: &'static str, single: Arc<dyn SingleRays>) -> Self {
        Self {
            nodes,
            single,
            closest: None,
            tiles: None,
            shadow: None,
            shadow_cache: false,
            counted_as: name,
            cases: &[],
        }
    }

    /// Assigns nearest-hit rays in any order to `kernel`.
    pub fn with_closest(mut self, rays: Rays, kernel: Arc<dyn Kernel<Closest>>) -> Self {
        self.closest = Some(RoutedKernel::all(rays, kernel));
        self
    }

    /// Assigns nearest-hit rays ordered in tiles of pixels to `kernel`.
    pub fn with_tiles(mut self, rays: Rays, kernel: Arc<dyn Kernel<Closest>>) -> Self {
        self.tiles = Some(RoutedKernel::all(rays, kernel));
        self
    }

    /// Assigns nearest-hit rays ordered in tiles of pixels to `packets` where most triangles that they hit are smaller
    /// than a few pixels, and to `tiles` elsewhere.
    pub fn with_tiles_by_footprint(
        self,
        tiles: Arc<dyn Kernel<Closest>>,
        packets: Arc<dyn Kernel<Closest>>,
        limit: Footprint,
    ) -> Self {
        self.with_tiles(Rays::Auto, closest_by_footprint(tiles, packets, limit))
    }

    /// Assigns any-hit rays to `kernel`.
    pub fn with_any(mut self, rays: Rays, kernel: Arc<dyn Kernel<Any>>) -> Self {
        self.shadow = Some(RoutedKernel::all(rays, kernel));
        self
    }

    /// Assigns any-hit rays that keep together, as most shadow rays do, to `tiles` or `packets`, and others to `streams`.
    pub fn with_any_by_coherence(
        self,
        tiles: Arc<dyn Kernel<Any>>,
        packets: Arc<dyn Kernel<Any>>,
        streams: Arc<dyn Kernel<Any>>,
        limits: Limits,
    ) -> Self {
        self.with_any(
            Rays::Auto,
            any_by_coherence(tiles, packets, streams, limits),
        )
    }

    /// Sends small batches, whether they are counted or not, one by one; those of camera rays stay as they are.
    pub fn with_few_singly(mut self) -> Self {
        if let Some(routed) = &mut self.closest {
            routed.least = FEW;
        }
        if let Some(routed) = &mut self.shadow {
            routed.least = FEW;
        }
        self
    }

    /// Applies the parameter `shadow`. `cache`: any-hit rays first test a cached blocker, tiles and packets the leaf that
    /// blocked the last one; streams and octree beams are replaced by single rays, because they read no cache. `beam`: `beams` replaces
    /// their kernel.
    ///
    /// # Panics
    /// For `beam` without `beams`, which the parameter's choices exclude.
    pub fn with_shadow(mut self, choice: &str, beams: Option<Arc<dyn Kernel<Any>>>) -> Self {
        match choice {
            "cache" => {
                self.shadow_cache = true;
                let reads = |rays: Rays| {
                    matches!(rays, Rays::Flight | Rays::Tile | Rays::Packet | Rays::Auto)
                };
                self.shadow = self.shadow.filter(|routed| reads(routed.rays));
                self
            }
            "beam" => {
                let beams = beams.expect("offered only where beams exist");
                self.with_any(Rays::Beam, beams)
            }
            _ => self,
        }
    }

    /// Returns the largest batch that its kernel gains from, for any hits or for nearest hits of rays in this order.
    pub fn batch(&self, order: Order, any: bool) -> Option<usize> {
        if any {
            return self.shadow.as_ref()?.kernel.batch();
        }
        let tiles = self.tiles.as_ref().filter(|_| order == Order::Tiles);
        tiles.or(self.closest.as_ref())?.kernel.batch()
    }

    /// Returns the bytes that rays in random order read from, if the kernel of any hits or of nearest hits gains from
    /// near rays following one another.
    pub fn working_set(&self, any: bool) -> Option<usize> {
        if any {
            return self.shadow.as_ref()?.kernel.working_set();
        }
        self.closest.as_ref()?.kernel.working_set()
    }

    /// Returns the route of each kind of batch.
    pub fn routes(&self) -> [Route; 4] {
        let closest = grouping(self.closest.as_ref());
        let tiles = grouping(self.tiles.as_ref()).or(closest);
        [
            ("single", None),
            ("closest", closest),
            ("tiles", tiles),
            ("shadow", grouping(self.shadow.as_ref())),
        ]
        .map(|(batch, group)| {
            let (rays, counted) = group.unwrap_or((Rays::Single, true));
            Route {
                batch,
                nodes: self.nodes,
                rays,
                counted,
            }
        })
    }
}

/// Returns how a kernel groups rays, and whether it counts their steps and tests.
fn grouping<Q: Query>(routed: Option<&RoutedKernel<Q>>) -> Option<(Rays, bool)> {
    routed.map(|routed| (routed.rays, routed.kernel.counts()))
}
