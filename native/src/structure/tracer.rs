// SPDX-License-Identifier: GPL-3.0-or-later
//! A structure as what answers rays: which way a batch goes, by its order and what is asked.

use super::tracing::Batches;
use super::{Layout, PlaneWalk, Structure};
use crate::geom::Aabb;
use crate::leaf_depth::LeafDepths;
use crate::scene::Triangles;
use crate::traverse::batch::Batch;
use crate::traverse::nested::Nested;
use crate::traverse::objects::Objects;
use crate::traverse::query::{Any, Closest};
use crate::traverse::tile_walk::Tiles;
use crate::traverse::{Hit, Order, Ray, RayCounters, Tracer, octree_beam, packet, plane_beam};
use fearless_simd::Level;

/// A structure of so many bytes stays in the caches next to a core, whatever the order of its rays.
const IN_CACHE: usize = 4 << 20;

impl Structure {
    /// The same structure on a given instruction set instead of the best one: for tests, which show
    /// that answers do not depend on it.
    pub fn at_level(&self, level: Level) -> AtLevel<'_> {
        AtLevel {
            structure: self,
            level,
        }
    }
}

/// A structure whose rays run on a given instruction set.
pub struct AtLevel<'a> {
    structure: &'a Structure,
    level: Level,
}

impl Tracer for AtLevel<'_> {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.structure.scene)
    }

    fn count(&self) -> usize {
        self.structure.scene.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.structure.scene.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        let (structure, level) = (self.structure, self.level);
        let job = structure.batch(level, rays);
        match structure.batches {
            Batches::Packets(4) => structure.packets::<packet::Four>(&job, hits, counters),
            Batches::Packets(8) => structure.packets::<packet::Eight>(&job, hits, counters),
            Batches::Packets(_) => structure.packets::<packet::Sixteen>(&job, hits, counters),
            _ => structure.trace::<Closest, _>(level, rays, hits, counters, |hit| hit),
        }
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        let job = self.structure.batch(self.level, rays);
        let write = |i: usize, hit: Hit| hits[i] = hit;
        if order != Order::Tiles {
            return self.closest(rays, hits, counters);
        }
        // What is counted is the same each time.
        let lately = counters.is_none().then_some(&self.structure.lately[0]);
        let auto = self.structure.batches == Batches::Auto && counters.is_none();
        if let (true, Some((tree, blocks))) = (auto, self.structure.flown()) {
            let job = Batch { blocks, ..job };
            return job.tiles(&Tiles::<_, 4>(tree, lately), write, None);
        }
        match (&self.structure.built.layout, self.structure.batches) {
            (Layout::OctreeBeam(tree, least), _) => {
                job.tiles(&octree_beam::Walk(tree, *least), write, counters);
            }
            (Layout::Plane(tree, PlaneWalk::Beams(least)), _) => {
                job.tiles(&plane_beam::Walk(tree, *least), write, counters);
            }
            (Layout::Plane(tree, _), Batches::Eight) => {
                job.tiles(&Tiles::<_, 4>(tree, lately), write, counters);
            }
            (Layout::Lazy(tree), Batches::Auto | Batches::Eight) if counters.is_none() => {
                job.tiles(&Tiles::<_, 4>(tree, lately), write, counters);
            }
            (Layout::Plane(tree, _), Batches::Sixteen) => {
                job.tiles(&Tiles::<_, 16>(tree, lately), write, counters);
            }
            (Layout::Objects(Objects::Boxes8(tree)), Batches::Eight) => {
                job.tiles(&Tiles::<_, 4>(tree, lately), write, counters);
            }
            (Layout::Objects(Objects::Boxes8(tree)), Batches::Sixteen) => {
                job.tiles(&Tiles::<_, 16>(tree, lately), write, counters);
            }
            _ => self.closest(rays, hits, counters),
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let (structure, level) = (self.structure, self.level);
        if !structure.shadow_groups(level, rays, occluded, counters.is_some()) {
            structure.trace::<Any, _>(level, rays, occluded, counters, |hit| hit.is_hit());
        }
    }
}

impl Tracer for Structure {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.scene)
    }

    fn count(&self) -> usize {
        self.scene.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.scene.corners(id)
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

    fn near_rays(&self) -> Option<Aabb> {
        let bytes = match self.flown() {
            Some((tree, blocks)) => tree.bytes() + blocks.bytes(),
            None if self.wide.is_some() => self.bytes(),
            None => 0,
        };
        (bytes > IN_CACHE).then(|| self.scene.bounds())
    }

    fn leaf_depths(&self, rays: &[Ray], depths: &mut [u32]) {
        let known = self.leaf_depths.get_or_init(|| LeafDepths::new(self));
        for (ray, depth) in rays.iter().zip(depths) {
            *depth = known.of(self, ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new())
            .occluded(rays, occluded, counters);
    }
}
