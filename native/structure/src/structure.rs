// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure over a scene.

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

/// What the motions of the triangles did to a structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refitted {
    /// Number of times that it was fitted to moved triangles since it was built.
    pub times: u32,
    /// Wall-clock seconds of the last fit; 0 if there was none.
    pub seconds: f64,
    /// Expected cost of a ray when it was built, as [`Shape::sah_cost`].
    pub cost_built: f64,
}

/// A built structure. Immutable; any number of threads may trace rays through it.
#[derive(Debug)]
pub struct Structure {
    pub(crate) scene: Arc<Triangles>,
    config: Config,
    pub(crate) built: Built,
    /// The whole tree in one piece, if rays build the tree; made on demand.
    whole: OnceLock<Built>,
    build_seconds: f64,
    refitted: Refitted,
    /// Made on demand.
    pub(crate) leaf_depths: OnceLock<LeafDepths>,
    /// Made for the first instance.
    outline: OnceLock<Outline>,
}

impl Structure {
    /// Builds `config` over `scene` on `threads` threads; 0 means one per core.
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
        let pool = pool(threads)?;
        let start = Instant::now();
        let built = pool.install(|| (config.structure().build)(&scene, &config, monitor))?;
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            scene,
            config,
            whole: OnceLock::new(),
            build_seconds,
            refitted: Refitted {
                times: 0,
                seconds: 0.0,
                cost_built: built.shape.sah_cost,
            },
            built,
            leaf_depths: OnceLock::new(),
            outline: OnceLock::new(),
        })
    }

    /// Fits the structure to its triangles at other places, `vertices` those of its scene in their order, on `threads`
    /// threads; 0 means one per core. The result has the nodes of the build with other bounds. Its answers are those of
    /// a structure built over the moved triangles; rays may take longer to find them ([`Self::refitted`]).
    ///
    /// # Errors
    /// [`Error::Refit`] if the nodes divide space or their bounds cannot be fitted, or if a triangle can be hit that the
    /// build left out; [`Error::Shape`] for another number of vertices; [`Error::Cancelled`] when the monitor is cancelled;
    /// [`Error::Memory`] when no threads can start.
    pub fn refit(
        &self,
        vertices: Vec<[f32; 3]>,
        threads: usize,
        monitor: &Monitor,
    ) -> Result<Self> {
        let Some(refit) = &self.built.refit else {
            return Err(Error::Refit(self.reason()));
        };
        pool(threads)?.install(|| {
            let scene = Arc::new(self.scene.moved(vertices, monitor)?);
            let start = Instant::now();
            let built = refit.refit(&scene, &self.config, monitor)?;
            Ok(Self {
                scene,
                config: self.config.clone(),
                built,
                whole: OnceLock::new(),
                build_seconds: self.build_seconds,
                refitted: Refitted {
                    times: self.refitted.times + 1,
                    seconds: start.elapsed().as_secs_f64(),
                    ..self.refitted
                },
                leaf_depths: OnceLock::new(),
                outline: OnceLock::new(),
            })
        })
    }

    /// Why this structure cannot be fitted to moved triangles.
    fn reason(&self) -> String {
        let row = self.config.structure();
        let why = match row.family {
            "space" | "octants" => "its nodes divide space, not triangles",
            "oracle" => "it has no nodes",
            _ => "no fit exists for its kind of bounds",
        };
        format!(
            "{} cannot be fitted to moved triangles: {why}; build it again",
            row.id
        )
    }

    /// Returns whether [`Self::refit`] exists for this kind of structure.
    pub fn can_refit(&self) -> bool {
        self.built.refit.is_some()
    }

    /// Returns the number and the cost of the fits since the structure was built.
    pub fn refitted(&self) -> Refitted {
        self.refitted
    }

    /// Returns the triangles.
    pub fn scene(&self) -> &Arc<Triangles> {
        &self.scene
    }

    /// Returns the structure's row and its parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Returns the wall-clock seconds of the build.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Returns statistics of the tree's shape, as far as it is built.
    pub fn shape(&self) -> Shape {
        self.progress().shape
    }

    /// Returns the progress of the build; only trees that rays build are ever incomplete.
    pub fn progress(&self) -> Progress {
        match &self.built.growing {
            Some(growing) => growing.progress(),
            None => Progress {
                shape: self.built.shape,
                ..Progress::default()
            },
        }
    }

    /// Returns the frame of the tree's coordinates.
    pub fn frame(&self) -> &Frame {
        &self.built.frame
    }

    /// Returns the features that this scene did not need, each with its reason, as far as the tree is built.
    pub fn left_out(&self) -> Vec<String> {
        match &self.built.growing {
            Some(growing) => growing.left_out(),
            None => self.built.left_out.clone(),
        }
    }

    /// Returns the whole tree, for validation and drawing. If rays build the tree, builds the rest, and copies the tree
    /// to one piece.
    ///
    /// # Panics
    /// If that piece has more nodes or leaf data than its links can address; other builds return an error for it.
    pub fn built(&self) -> &Built {
        match &self.built.growing {
            None => &self.built,
            Some(growing) => self
                .whole
                .get_or_init(|| growing.whole(&self.scene, &self.built.frame)),
        }
    }

    /// Returns the triangles of the leaves.
    pub fn leaves(&self) -> &Blocks {
        &self.built().leaves
    }

    /// Returns the kernel of each kind of batch.
    pub fn routes(&self) -> [Route; 4] {
        self.built.plan.routes()
    }

    /// Returns the name of the traversal that is counted where the kernel of a batch cannot count.
    pub fn counted_as(&self) -> &'static str {
        self.built.plan.counted_as
    }

    /// Returns the names of the counters [`halfspace_ray::RayCounters::cases`], in their order.
    pub fn cases(&self) -> &'static [&'static str] {
        self.built.plan.cases
    }

    /// Returns the bytes of all nodes and leaves, without the scene's arrays.
    pub fn bytes(&self) -> usize {
        self.built.bytes() + self.whole.get().map_or(0, Built::bytes)
    }

    /// Returns the outline of the triangles, which instances need.
    pub fn outline(&self) -> &Outline {
        self.outline.get_or_init(|| Outline::new(&self.scene))
    }
}

/// Starts `threads` threads; 0 means one per core.
fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Memory(format!("threads: {e}")))
}
