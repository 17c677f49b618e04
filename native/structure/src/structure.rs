// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure over a scene.

use crate::division::{self, Parts};
use crate::leaf_depth::LeafDepths;
use crate::outline::Outline;
use crate::plan::Route;
use crate::row::{Built, Family};
use crate::spec::Config;
use crate::work::Trees;
use halfspace_base::error::{Error, Result};
use halfspace_base::{Monitor, footprint};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::lazy_tree::Progress;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Effects of the motions of the triangles on a structure.
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
    /// The trees of triangles that differ too much in scale from those of `built`; mostly none.
    pub(crate) apart: Vec<Built>,
    /// As [`Parts::growing`].
    growing: Option<Arc<Triangles>>,
    /// As [`Parts::part_of`].
    part_of: Vec<u8>,
    /// As [`Parts::remarks`].
    remarks: Vec<String>,
    /// The whole tree in one piece, if rays build the tree; made on demand.
    whole: OnceLock<Built>,
    /// All triangles of each part in one leaf, for rays that its tree does not separate; made on demand.
    pub(crate) one_leaf: Box<[OnceLock<Option<Built>>]>,
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
        Self::build_with(scene, config, Some(pool(threads)?), monitor, Trees::Worth)
    }

    /// As [`Self::build`], on the threads of the current pool.
    pub(crate) fn build_here(
        scene: Arc<Triangles>,
        config: Config,
        monitor: &Monitor,
    ) -> Result<Self> {
        Self::build_with(scene, config, None, monitor, Trees::Worth)
    }

    /// As [`Self::build`], but keeps trees whose rays do more work than brute force: to inspect and test them.
    ///
    /// # Errors
    /// Those of [`Self::build`].
    pub fn build_kept(
        scene: Arc<Triangles>,
        config: Config,
        threads: usize,
        monitor: &Monitor,
    ) -> Result<Self> {
        Self::build_with(scene, config, Some(pool(threads)?), monitor, Trees::All)
    }

    fn build_with(
        scene: Arc<Triangles>,
        config: Config,
        pool: Option<rayon::ThreadPool>,
        monitor: &Monitor,
        trees: Trees,
    ) -> Result<Self> {
        let _held = monitor.hold(scene.live().len() * footprint::TRIANGLE)?;
        let start = Instant::now();
        let build = || division::build(&scene, &config, monitor, trees);
        let parts = match pool {
            Some(pool) => pool.install(build),
            None => build(),
        }?;
        let build_seconds = start.elapsed().as_secs_f64();
        let Parts {
            main,
            apart,
            growing,
            part_of,
            remarks,
        } = parts;
        Ok(Self {
            scene,
            config,
            whole: OnceLock::new(),
            one_leaf: one_each(apart.len() + 1),
            build_seconds,
            refitted: Refitted {
                times: 0,
                seconds: 0.0,
                cost_built: joined(main.shape, &apart).sah_cost,
            },
            built: main,
            apart,
            growing,
            part_of,
            remarks,
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
        if !self.can_refit() {
            return Err(Error::Refit(self.reason()));
        }
        pool(threads)?.install(|| {
            let scene = Arc::new(self.scene.moved(vertices, monitor)?);
            let start = Instant::now();
            let mut parts = division::refit(&scene, self.parts(), &self.part_of, |refit, own| {
                refit.refit(own, &self.config, monitor)
            })?;
            let one_leaf = one_each(parts.len());
            let built = parts.remove(0);
            Ok(Self {
                scene,
                config: self.config.clone(),
                built,
                apart: parts,
                growing: None,
                part_of: self.part_of.clone(),
                remarks: self.remarks.clone(),
                whole: OnceLock::new(),
                one_leaf,
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
            Family::Space | Family::Octants => "its nodes divide space, not triangles",
            Family::Oracle => "it has no nodes",
            Family::Objects => "no fit exists for its kind of bounds",
        };
        format!(
            "{} cannot be fitted to moved triangles: {why}; build it again",
            row.id
        )
    }

    /// Returns whether [`Self::refit`] exists for this kind of structure.
    pub fn can_refit(&self) -> bool {
        self.parts().all(|built| built.refit.is_some())
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

    /// Returns statistics of the shape of all trees, as far as they are built.
    pub fn shape(&self) -> Shape {
        joined(self.progress().shape, &self.apart)
    }

    /// Returns the trees of triangles that differ too much in scale from those of [`Self::built`]; mostly none.
    pub fn apart(&self) -> &[Built] {
        &self.apart
    }

    /// Returns all trees, that of [`Self::built`] first.
    fn parts(&self) -> impl Iterator<Item = &Built> {
        std::iter::once(&self.built).chain(&self.apart)
    }

    /// Returns the triangles that a tree may read: its own if rays build it, else those of the scene.
    pub(crate) fn triangles(&self, built: &Built) -> &Triangles {
        let own = self.growing.as_ref();
        own.filter(|_| std::ptr::eq(built, &self.built))
            .unwrap_or(&self.scene)
    }

    /// Returns the triangles of [`Self::built`], or of `apart()[part - 1]`; all others have no area.
    ///
    /// # Errors
    /// None, unless the scene's own arrays are refused.
    pub fn scene_of(&self, part: usize) -> Result<Arc<Triangles>> {
        if self.part_of.is_empty() {
            return Ok(self.scene.clone());
        }
        Ok(Arc::new(division::only(&self.scene, &self.part_of, part)?))
    }

    /// Returns the triangles of a part that can be hit, as of [`Self::scene_of`].
    pub(crate) fn ids_of(&self, part: usize) -> Vec<u32> {
        let of = |id: u32| self.part_of.get(id as usize).map_or(0, |&of| of.into());
        let live = self.scene.live().iter().copied();
        live.filter(|&id| of(id) == part).collect()
    }

    /// Returns the progress of the build of the tree that [`Self::built`] returns; only trees that rays build are ever
    /// incomplete.
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
        let mut lines = match &self.built.growing {
            Some(growing) => growing.left_out(),
            None => self.built.left_out.clone(),
        };
        lines.extend(self.remarks.iter().cloned());
        lines
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
                .get_or_init(|| growing.whole(self.triangles(&self.built), &self.built.frame)),
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
        let trees: usize = self.parts().map(Built::bytes).sum();
        trees + self.part_of.len() + self.whole.get().map_or(0, Built::bytes)
    }

    /// Returns the outline of the triangles, which instances need.
    pub fn outline(&self) -> &Outline {
        self.outline.get_or_init(|| Outline::new(&self.scene))
    }

    /// Returns the same structure for an instance that rounds no vertex, so that triangles without area stay without.
    pub(crate) fn unrounded(mut self) -> Self {
        let mut outline = Outline::new(&self.scene);
        outline.flat.clear();
        self.outline = OnceLock::from(outline);
        self
    }
}

/// Returns the statistics of several trees.
fn joined(mut shape: Shape, others: &[Built]) -> Shape {
    for other in others {
        shape.join(&other.shape, 0);
    }
    shape
}

/// Returns a place for each part.
fn one_each(parts: usize) -> Box<[OnceLock<Option<Built>>]> {
    (0..parts).map(|_| OnceLock::new()).collect()
}

/// Starts `threads` threads; 0 means one per core.
fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Memory(format!("threads: {e}")))
}
