// SPDX-License-Identifier: GPL-3.0-or-later
//! Which kernel answers which batch of rays. A plan is made once, with the tree; no caller matches on the kind of
//! the tree.

use halfspace_ray::query::{Any, Closest};
use halfspace_trace::kernel::{Kernel, SingleRays};
use std::sync::Arc;

/// The kernels of a structure. Batches without a kernel of their own go to `single`.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Single rays: also the traversal that is counted where the kernel of a batch cannot count, that is shown, and that
    /// is recorded.
    pub single: Arc<dyn SingleRays>,
    /// Rays in the space of an instance, where that is not `single`.
    pub placed: Option<Arc<dyn SingleRays>>,
    /// Nearest hits of rays in any order.
    pub closest: Option<Arc<dyn Kernel<Closest>>>,
    /// Nearest hits of rays that come in tiles of 8 x 8 pixels.
    pub tiles: Option<Arc<dyn Kernel<Closest>>>,
    /// Any hits of shadow rays.
    pub shadow: Option<Arc<dyn Kernel<Any>>>,
    /// Whether any-hit rays first test the triangle that blocked their light last (Wilt 1994).
    pub shadow_cache: bool,
    /// Name of the traversal of `single`.
    pub counted_as: &'static str,
    /// What the counters [`halfspace_ray::RayCounters::cases`] mean, in their order.
    pub cases: &'static [&'static str],
}

impl Plan {
    /// A plan of single rays alone; `name` is the name of their traversal.
    pub fn single(name: &'static str, single: Arc<dyn SingleRays>) -> Self {
        Self {
            single,
            placed: None,
            closest: None,
            tiles: None,
            shadow: None,
            shadow_cache: false,
            counted_as: name,
            cases: &[],
        }
    }

    /// Applies the parameter `shadow`: `cache` sends shadow rays one by one past a cache of blockers, unless their
    /// kernel looks into that cache itself (`cached`); `beam` replaces their kernel by `beams`.
    ///
    /// # Panics
    /// For `beam` without `beams`, which the parameter's choices exclude.
    pub fn with_shadow(
        mut self,
        choice: &str,
        cached: bool,
        beams: Option<Arc<dyn Kernel<Any>>>,
    ) -> Self {
        match choice {
            "cache" => {
                self.shadow_cache = true;
                if !cached {
                    self.shadow = None;
                }
            }
            "beam" => self.shadow = Some(beams.expect("offered only where beams exist")),
            _ => {}
        }
        self
    }
}
