// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure over a scene: rays in, answers out.

use crate::leaf_depth::LeafDepths;
use crate::outline::Outline;
use crate::plan::Route;
use crate::row::Built;
use crate::spec::Config;
use halfspace_base::error::{Error, Result};
use halfspace_base::{Monitor, footprint};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::lazy_tree::Progress;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// A built structure. Immutable; any number of threads may trace rays through it.
#[derive(Debug)]
pub struct Structure {
    pub(crate) scene: Arc<Triangles>,
    config: Config,
    pub(crate) built: Built,
    /// The whole of a tree that is built as far as rays reach, in one piece; made on demand.
    whole: OnceLock<Built>,
    build_seconds: f64,
    /// Made on demand.
    pub(crate) leaf_depths: OnceLock<LeafDepths>,
    /// Made for the first instance.
    outline: OnceLock<Outline>,
}

impl Structure {
    /// Builds `config` over `scene` on `threads` threads, 0 for one per core.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when the monitor is cancelled; [`Error::Memory`] when the build would need more than the
    /// monitor allows, or when no threads can start; [`Error::Spec`] for parameters that exclude each other.
    pub fn build(
        scene: Arc<Triangles>,
        config: Config,
        threads: usize,
        monitor: &Monitor,
    ) -> Result<Self> {
        let _held = monitor.hold(scene.live().len() * footprint::TRIANGLE)?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Memory(format!("threads: {e}")))?;
        let start = Instant::now();
        let built = pool.install(|| (config.structure().build)(&scene, &config, monitor))?;
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            scene,
            config,
            built,
            whole: OnceLock::new(),
            build_seconds,
            leaf_depths: OnceLock::new(),
            outline: OnceLock::new(),
        })
    }

    /// The triangles.
    pub fn scene(&self) -> &Arc<Triangles> {
        &self.scene
    }

    /// Structure and parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Wall-clock seconds of the build.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Statistics of the tree's shape, as far as it is built.
    pub fn shape(&self) -> Shape {
        self.progress().shape
    }

    /// How far the tree is built: wholly, unless rays build it.
    pub fn progress(&self) -> Progress {
        match &self.built.growing {
            Some(growing) => growing.progress(),
            None => Progress {
                shape: self.built.shape,
                ..Progress::default()
            },
        }
    }

    /// The frame of its coordinates.
    pub fn frame(&self) -> &Frame {
        &self.built.frame
    }

    /// What the scene did not need, each with its reason.
    pub fn left_out(&self) -> &[String] {
        &self.built.left_out
    }

    /// The whole tree, for validation and drawing. If rays build the tree, this builds the rest and lays all of it out
    /// once more in one piece.
    ///
    /// # Panics
    /// When the whole has more nodes or leaf data than its links can name; other builds return an error for that.
    pub fn built(&self) -> &Built {
        match &self.built.growing {
            None => &self.built,
            Some(growing) => self.whole.get_or_init(|| {
                growing.whole(&self.scene, &self.built.frame, &self.built.left_out)
            }),
        }
    }

    /// The leaves that rays test.
    pub fn leaves(&self) -> &Blocks {
        &self.built().leaves
    }

    /// Which kernel answers each kind of batch.
    pub fn routes(&self) -> [Route; 4] {
        self.built.plan.routes()
    }

    /// Name of the traversal that counters count where the kernel of a batch cannot count.
    pub fn counted_as(&self) -> &'static str {
        self.built.plan.counted_as
    }

    /// What the counters [`halfspace_ray::RayCounters::cases`] mean, in their order.
    pub fn cases(&self) -> &'static [&'static str] {
        self.built.plan.cases
    }

    /// Bytes of all nodes and leaves, without the scene's own arrays.
    pub fn bytes(&self) -> usize {
        self.built.bytes() + self.whole.get().map_or(0, Built::bytes)
    }

    /// The outline of the triangles, for instances.
    pub fn outline(&self) -> &Outline {
        self.outline.get_or_init(|| Outline::new(&self.scene))
    }
}
