// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure over a scene: rays in, answers out.

use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{PlaneTree, Shape};
use crate::build::{Monitor, footprint};
use crate::error::{Error, Result};
use crate::registry::Built;
use crate::scene::Triangles;
use crate::spec::Config;
use crate::traverse::batch::{Batch, Walk};
use crate::traverse::objects::Objects;
use crate::traverse::query::{Any, Closest, Query};
use crate::traverse::{Hit, Ray, RayCounters, Tracer, plane_dir, plane_ta_b};
use crate::traverse::{
    Order, octree_beam, octree_glassner, octree_net, octree_param, octree_samet, octree_step,
};
use fearless_simd::Level;
use std::sync::Arc;
use std::time::Instant;

/// A tree, laid out for one way of walking: matched once per batch of rays, never per ray.
#[derive(Debug, Clone, PartialEq)]
pub enum Layout {
    /// No tree.
    Brute,
    /// Planes, by distances in the order of the direction.
    PlaneDir(PlaneTree),
    /// Axis-aligned planes, by entry and exit points.
    PlaneTaB(PlaneTree),
    /// Objects, by boxes or intervals around them.
    Objects(Objects),
    /// Octants, from the top.
    OctreeParam(Octree),
    /// Octants, from leaf to leaf by links.
    OctreeNet(Octree),
    /// The same, and tiles of rays as beams, down to this many rays.
    OctreeBeam(Octree, u32),
    /// Octants, from leaf to leaf by the common ancestor.
    OctreeSamet(Octree),
    /// Octants, from leaf to leaf by the root.
    OctreeGlassner(Octree),
}

/// A built structure.
#[derive(Debug)]
pub struct Structure {
    scene: Arc<Triangles>,
    config: Config,
    built: Built,
    build_seconds: f64,
}

impl Structure {
    /// Builds `config` over `scene` on `threads` threads, 0 for one per core.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when the monitor says so; [`Error::Memory`] when the build would need more than the
    /// monitor allows, or when no threads can start.
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
            build_seconds,
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

    /// Seconds that the build took, by the clock.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// The tree's shape.
    pub fn shape(&self) -> &Shape {
        &self.built.shape
    }

    /// What the scene did not need, each with its reason.
    pub fn left_out(&self) -> &[String] {
        &self.built.left_out
    }

    /// Everything that was built, for validation and drawing.
    pub fn built(&self) -> &Built {
        &self.built
    }

    /// Bytes of nodes and leaves, without the scene's own arrays.
    pub fn bytes(&self) -> usize {
        let nodes = match &self.built.layout {
            Layout::Brute => 0,
            Layout::PlaneDir(tree) | Layout::PlaneTaB(tree) => tree.bytes(),
            Layout::Objects(tree) => tree.nested().bytes(),
            Layout::OctreeParam(tree)
            | Layout::OctreeNet(tree)
            | Layout::OctreeBeam(tree, _)
            | Layout::OctreeSamet(tree)
            | Layout::OctreeGlassner(tree) => tree.bytes(),
        };
        nodes + self.built.blocks.bytes()
    }

    fn batch<'a>(&'a self, level: Level, rays: &'a [Ray]) -> Batch<'a> {
        Batch {
            scene: &self.scene,
            frame: &self.built.frame,
            blocks: &self.built.blocks,
            rays,
            level,
            shadow_cache: self.config.choice("shadow") == "cache",
        }
    }

    /// The same structure on a given instruction set instead of the best one: for tests, which show
    /// that answers do not depend on it.
    pub fn at_level(&self, level: Level) -> AtLevel<'_> {
        AtLevel {
            structure: self,
            level,
        }
    }

    fn trace<Q: Query, T>(
        &self,
        level: Level,
        rays: &[Ray],
        answers: &mut [T],
        counters: Option<&mut [RayCounters]>,
        answer: impl Fn(Hit) -> T + Copy,
    ) {
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        let job = self.batch(level, rays);
        let write = |i: usize, hit: Hit| answers[i] = answer(hit);
        match &self.built.layout {
            Layout::Brute => job.brute::<Q>(self.built.shape.references, write, counters),
            Layout::PlaneDir(tree) => job.walk::<_, Q>(&plane_dir::Walk(tree), write, counters),
            Layout::PlaneTaB(tree) => job.walk::<_, Q>(&plane_ta_b::Walk(tree), write, counters),
            Layout::Objects(tree) => tree.walk::<Q>(&job, write, counters),
            Layout::OctreeParam(tree) => {
                self.octree::<Q, _>(&job, (tree, &octree_param::Walk(tree)), write, counters);
            }
            Layout::OctreeNet(tree) | Layout::OctreeBeam(tree, _) => {
                let walk = octree_step::Walk(tree, octree_net::Links);
                self.octree::<Q, _>(&job, (tree, &walk), write, counters);
            }
            Layout::OctreeSamet(tree) => {
                let walk = octree_step::Walk(tree, octree_samet::Ascent);
                self.octree::<Q, _>(&job, (tree, &walk), write, counters);
            }
            Layout::OctreeGlassner(tree) => {
                let walk = octree_step::Walk(tree, octree_glassner::Location);
                self.octree::<Q, _>(&job, (tree, &walk), write, counters);
            }
        }
    }

    /// Walks rays through an octree, singly or as shadow beams.
    fn octree<Q: Query, W: Walk>(
        &self,
        job: &Batch<'_>,
        (tree, walk): (&Octree, &W),
        write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        if Q::ANY && self.config.choice("shadow") == "beam" {
            job.shadow_beams((tree, walk), write, counters);
        } else {
            job.walk::<_, Q>(walk, write, counters);
        }
    }
}

/// A structure whose rays run on a given instruction set.
pub struct AtLevel<'a> {
    structure: &'a Structure,
    level: Level,
}

impl Tracer for AtLevel<'_> {
    fn triangles(&self) -> &Triangles {
        &self.structure.scene
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        let (structure, level) = (self.structure, self.level);
        structure.trace::<Closest, _>(level, rays, hits, counters, |hit| hit);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        match (&self.structure.built.layout, order) {
            (Layout::OctreeBeam(tree, least), Order::Tiles) => {
                assert_eq!(rays.len(), hits.len(), "one answer per ray");
                let walk = octree_beam::Walk(tree, *least);
                self.structure.batch(self.level, rays).tiles(
                    &walk,
                    |i, hit| hits[i] = hit,
                    counters,
                );
            }
            _ => self.closest(rays, hits, counters),
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        let (structure, level) = (self.structure, self.level);
        structure.trace::<Any, _>(level, rays, occluded, counters, |hit| hit.is_hit());
    }
}

impl Tracer for Structure {
    fn triangles(&self) -> &Triangles {
        &self.scene
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new()).closest(rays, hits, counters);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        self.at_level(Level::new())
            .closest_ordered(rays, hits, counters, order);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new())
            .occluded(rays, occluded, counters);
    }
}
