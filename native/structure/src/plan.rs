// SPDX-License-Identifier: GPL-3.0-or-later
//! Which kernel answers which batch of rays. A plan is made once, with the tree; no caller matches on the kind of
//! the tree.

use crate::way::Rays;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_trace::kernel::{Kernel, SingleRays};
use std::sync::Arc;

/// A kernel, and how it sends rays.
#[derive(Debug)]
pub struct RoutedKernel<Q: Query> {
    /// The kernel.
    pub kernel: Arc<dyn Kernel<Q>>,
    /// How its rays go together.
    pub rays: Rays,
}

/// The kernels of a structure. Batches without a kernel of their own go to `single`.
#[derive(Debug)]
pub struct Plan {
    /// What rays are tested against.
    pub nodes: &'static str,
    /// Single rays: also those of instances, and the traversal that is shown and recorded.
    pub single: Arc<dyn SingleRays>,
    /// Nearest hits of rays in any order.
    pub closest: Option<RoutedKernel<Closest>>,
    /// Nearest hits of rays that come in tiles of 8 x 8 pixels, where those have a kernel of their own.
    pub tiles: Option<RoutedKernel<Closest>>,
    /// Any hits of shadow rays.
    pub shadow: Option<RoutedKernel<Any>>,
    /// Whether any-hit rays first test the triangle that blocked their light last (Wilt 1994).
    pub shadow_cache: bool,
    /// Name of the traversal of `single`.
    pub counted_as: &'static str,
    /// What the counters [`halfspace_ray::RayCounters::cases`] mean, in their order.
    pub cases: &'static [&'static str],
}

/// Which kernel answers one kind of batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Route {
    /// The kind: single, closest, tiles or shadow.
    pub batch: &'static str,
    /// What rays are tested against.
    pub nodes: &'static str,
    /// How they go together.
    pub rays: Rays,
    /// Whether the kernel counts its own steps and tests; if not, single rays are counted in its place.
    pub counted: bool,
}

impl Plan {
    /// A plan of single rays alone through `nodes`; `name` is the name of their traversal.
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

    /// Sends nearest-hit rays in any order to `kernel`.
    pub fn with_closest(mut self, rays: Rays, kernel: Arc<dyn Kernel<Closest>>) -> Self {
        self.closest = Some(RoutedKernel { kernel, rays });
        self
    }

    /// Sends nearest-hit rays that come in tiles of pixels to `kernel`.
    pub fn with_tiles(mut self, rays: Rays, kernel: Arc<dyn Kernel<Closest>>) -> Self {
        self.tiles = Some(RoutedKernel { kernel, rays });
        self
    }

    /// Sends any-hit rays to `kernel`.
    pub fn with_any(mut self, rays: Rays, kernel: Arc<dyn Kernel<Any>>) -> Self {
        self.shadow = Some(RoutedKernel { kernel, rays });
        self
    }

    /// Applies the parameter `shadow`: `cache` sends shadow rays one by one past a cache of blockers, unless they are
    /// rays in flight, which look into that cache themselves; `beam` replaces their kernel by `beams`.
    ///
    /// # Panics
    /// For `beam` without `beams`, which the parameter's choices exclude.
    pub fn with_shadow(mut self, choice: &str, beams: Option<Arc<dyn Kernel<Any>>>) -> Self {
        match choice {
            "cache" => {
                self.shadow_cache = true;
                self.shadow = self.shadow.filter(|group| group.rays == Rays::Flight);
                self
            }
            "beam" => {
                let beams = beams.expect("offered only where beams exist");
                self.with_any(Rays::Beam, beams)
            }
            _ => self,
        }
    }

    /// Which kernel answers each kind of batch.
    pub fn routes(&self) -> [Route; 4] {
        let closest = known(self.closest.as_ref());
        let tiles = known(self.tiles.as_ref()).or(closest);
        [
            ("single", None),
            ("closest", closest),
            ("tiles", tiles),
            ("shadow", known(self.shadow.as_ref())),
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

/// How the rays of a kernel go together, and whether it counts them.
fn known<Q: Query>(group: Option<&RoutedKernel<Q>>) -> Option<(Rays, bool)> {
    group.map(|group| (group.rays, group.kernel.counts()))
}
