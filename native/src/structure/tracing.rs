// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays through a built structure: which walk a batch of them takes.

use super::{Layout, PlaneWalk, Structure};
use crate::build::ropes::Ropes;
use crate::registry::Built;
use crate::spec::{Config, Value};
use crate::traverse::batch::{Batch, Walk, WithWalk, Write};
use crate::traverse::blocks::Blocks;
use crate::traverse::box_tree::{self, BoxTree};
use crate::traverse::flight::Alone;
use crate::traverse::frame::FrameRay;
use crate::traverse::objects::Objects;
use crate::traverse::packet::Width;
use crate::traverse::packet_walk::Packets;
use crate::traverse::plane_boxes::PlaneBoxes;
use crate::traverse::query::{Any, Closest, Query};
use crate::traverse::tile_walk::ShadowTiles;
use crate::traverse::{
    Hit, Ray, RayCounters, box_flight, grid_step, octree_glassner, octree_net, octree_param,
    octree_samet, octree_step, packet, packet_walk, plane_arvo, plane_dir, plane_rope, plane_seq,
    plane_seq_1985, plane_sung, plane_ta_a, plane_ta_b, plane_ta_b_1997, plane_ta_b_poly,
    plane_wide,
};
use fearless_simd::Level;
use std::marker::PhantomData;

/// How batches of rays are walked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Batches {
    /// As the layout walks single rays, or its own tiles.
    Own,
    /// Camera rays, and shadow rays from their light, in tiles of 8 x 8.
    Eight,
    /// Camera rays in four such tiles at once.
    Sixteen,
    /// Several rays in flight through wide nodes.
    Wide,
    /// Through boxes around what planes part.
    Boxes,
    /// Packets of so many, whatever the order of the rays; shadow rays only in packets of 16.
    Packets(u32),
    /// Camera rays in tiles, shadow rays in tiles from their light, other rays to the nearest hit in streams, through
    /// boxes; of a tree that rays build only tiles; rays that are counted as the layout walks single rays.
    Auto,
}

impl Batches {
    pub(super) fn new(config: &Config) -> Self {
        let chosen = config.values().find(|(name, _)| *name == "traversal");
        match chosen {
            Some((_, Value::Choice("tile8"))) => Self::Eight,
            Some((_, Value::Choice("tile16"))) => Self::Sixteen,
            Some((_, Value::Choice("wide"))) => Self::Wide,
            Some((_, Value::Choice("boxes"))) => Self::Boxes,
            Some((_, Value::Choice("p4"))) => Self::Packets(4),
            Some((_, Value::Choice("p8"))) => Self::Packets(8),
            Some((_, Value::Choice("p16"))) => Self::Packets(16),
            Some((_, Value::Choice("auto"))) => Self::Auto,
            _ => Self::Own,
        }
    }
}

impl Structure {
    pub(super) fn batch<'a>(&'a self, level: Level, rays: &'a [Ray]) -> Batch<'a> {
        self.batch_of((&self.built, &self.built.blocks), level, rays)
    }

    /// Rays for the walk of [`Self::with_walk`], with the leaves that it tests.
    pub(super) fn batch_walked<'a>(
        &'a self,
        built: &'a Built,
        level: Level,
        rays: &'a [Ray],
    ) -> Batch<'a> {
        self.batch_of((built, self.leaves_walked(built)), level, rays)
    }

    /// Rays for a walk of one of the layouts, with the leaves of that.
    pub(super) fn batch_of<'a>(
        &'a self,
        (built, blocks): (&'a Built, &'a Blocks),
        level: Level,
        rays: &'a [Ray],
    ) -> Batch<'a> {
        Batch {
            scene: &self.scene,
            frame: &built.frame,
            blocks,
            rays,
            level,
            shadow_cache: self.config.choice("shadow") == "cache",
            placed: None,
        }
    }

    /// The leaves that the walk of [`Self::with_walk`] tests.
    pub(crate) fn leaves_walked<'a>(&'a self, built: &'a Built) -> &'a Blocks {
        (self.walked()).map_or(&built.blocks, |boxes| &boxes.blocks)
    }

    /// Walks rays that were brought into the space of an instance of this mesh, one by one.
    pub(crate) fn walk_placed<Q: Query>(
        &self,
        level: Level,
        (rays, placed): (&[Ray], &[FrameRay<'_>]),
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let job = Batch {
            shadow_cache: false,
            placed: Some(placed),
            ..self.batch(level, rays)
        };
        let quickest = self.batches == Batches::Auto && counters.is_none();
        if let (true, Some((tree, blocks))) = (quickest, self.flown()) {
            let job = Batch { blocks, ..job };
            return job.walk::<_, Q>(&box_tree::Walk(tree), write, None);
        }
        self.walk::<Q>(&job, write, counters);
    }

    fn walk<Q: Query>(
        &self,
        job: &Batch<'_>,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        struct Trace<'a, Q>(
            &'a Batch<'a>,
            Write<'a>,
            Option<&'a mut [RayCounters]>,
            PhantomData<Q>,
        );
        impl<Q: Query> WithWalk for Trace<'_, Q> {
            type Output = ();
            fn with<W: Walk>(self, walk: &W) {
                self.0.walk::<_, Q>(walk, self.1, self.2);
            }
        }
        if let Layout::Brute = &self.built.layout {
            return job.brute::<Q>(self.built.shape.references, write, counters);
        }
        let blocks = self.leaves_walked(&self.built);
        let job = Batch { blocks, ..*job };
        self.with_walk(&self.built, Trace::<Q>(&job, write, counters, PhantomData));
    }

    pub(super) fn trace<Q: Query, T>(
        &self,
        level: Level,
        rays: &[Ray],
        answers: &mut [T],
        counters: Option<&mut [RayCounters]>,
        answer: impl Fn(Hit) -> T + Copy,
    ) {
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        let job = self.batch(level, rays);
        let mut write = |i: usize, hit: Hit| answers[i] = answer(hit);
        if Q::ANY && self.config.choice("shadow") == "beam" {
            return self.shadow_beams(&job, write, counters);
        }
        if let (Some(wide), None) = (&self.wide, &counters) {
            return job.fly::<_, Q>(&plane_wide::Walk(wide), write);
        }
        // Under `Auto` only shadow rays come here that are counted or ask the shadow cache: they go as the layout walks
        // single rays.
        let together = self.batches == Batches::Wide || !Q::ANY;
        if let (Some((tree, blocks)), None, true) = (self.flown(), &counters, together) {
            let job = Batch { blocks, ..job };
            if self.batches == Batches::Auto {
                return job.streams(tree, write);
            }
            return job.fly::<_, Q>(&box_flight::Walk(tree), write);
        }
        self.walk::<Q>(&job, &mut write, counters);
    }

    /// The tree of boxes that rays walk in flight, or in streams and tiles under `Auto`, if that is chosen, and its leaves.
    pub(crate) fn flown(&self) -> Option<(&BoxTree<8>, &Blocks)> {
        match (&self.built.layout, self.batches) {
            (Layout::Objects(Objects::Boxes8(tree)), Batches::Auto | Batches::Wide) => {
                Some((tree, &self.built.blocks))
            }
            (_, Batches::Auto) => (self.boxes.as_ref()).map(|boxes| (&boxes.tree, &boxes.blocks)),
            _ => None,
        }
    }

    /// The boxes that single rays walk in place of planes, if that is chosen.
    pub(crate) fn walked(&self) -> Option<&PlaneBoxes> {
        (self.boxes.as_ref()).filter(|_| self.batches == Batches::Boxes)
    }

    /// Walks rays to their nearest hits in packets.
    ///
    /// # Panics
    /// For structures that do not offer it.
    pub(super) fn packets<L: Width>(
        &self,
        job: &Batch<'_>,
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
    ) {
        let write = |i: usize, hit: Hit| hits[i] = hit;
        match &self.built.layout {
            Layout::Plane(tree, _) => {
                job.tiles(&Packets::<_, Closest, L>::new(tree), write, counters);
            }
            Layout::Objects(Objects::Boxes8(tree)) => {
                job.tiles(&Packets::<_, Closest, L>::new(tree), write, counters);
            }
            _ => unreachable!("only trees of planes and of eight boxes to a node offer packets"),
        }
    }

    /// Hands the way of walking single rays to `then`.
    ///
    /// # Panics
    /// For brute force, which walks nothing.
    pub(super) fn with_walk<F: WithWalk>(&self, built: &Built, then: F) -> F::Output {
        if let Some(wide) = &self.wide {
            return then.with(&Alone(&plane_wide::Walk(wide)));
        }
        if let Some(boxes) = self.walked() {
            return then.with(&box_tree::Walk(&boxes.tree));
        }
        match &built.layout {
            Layout::Brute => unreachable!("brute force has no tree to walk"),
            Layout::Lazy(tree) => then.with(&plane_dir::Walk(tree)),
            Layout::Plane(tree, walk) => match walk {
                PlaneWalk::Dir | PlaneWalk::Beams(_) => then.with(&plane_dir::Walk(tree)),
                PlaneWalk::TaB => then.with(&plane_ta_b::Walk(tree)),
                PlaneWalk::TaB1997 => then.with(&plane_ta_b_1997::Walk(tree)),
                PlaneWalk::TaBPoly => then.with(&plane_ta_b_poly::Walk(tree)),
                PlaneWalk::Seq => then.with(&plane_seq::Walk(tree)),
                PlaneWalk::Seq1985 => {
                    then.with(&plane_seq_1985::Walk(tree, self.built.frame.bounds()))
                }
                PlaneWalk::Rope => then.with(&plane_rope::Walk::<false>(tree, self.linked())),
                PlaneWalk::Rope1990 => then.with(&plane_rope::Walk::<true>(tree, self.linked())),
                PlaneWalk::TaA => then.with(&plane_ta_a::Walk::<false>(tree)),
                PlaneWalk::TaA1997 => then.with(&plane_ta_a::Walk::<true>(tree)),
                PlaneWalk::Sung => then.with(&plane_sung::Walk::<false>(tree)),
                PlaneWalk::Sung1992 => then.with(&plane_sung::Walk::<true>(tree)),
                PlaneWalk::Arvo => then.with(&plane_arvo::Walk::<false>(tree)),
                PlaneWalk::Arvo1988 => then.with(&plane_arvo::Walk::<true>(tree)),
            },
            Layout::Objects(tree) => tree.with_walk(self.built.frame.bounds(), then),
            Layout::Grid(grid) => then.with(&grid_step::Walk(grid)),
            Layout::OctreeParam(tree) => then.with(&octree_param::Walk(tree)),
            Layout::OctreeNet(tree) | Layout::OctreeBeam(tree, _) => {
                then.with(&octree_step::Walk(tree, octree_net::Links))
            }
            Layout::OctreeSamet(tree) => then.with(&octree_step::Walk(tree, octree_samet::Ascent)),
            Layout::OctreeGlassner(tree) => {
                then.with(&octree_step::Walk(tree, octree_glassner::Location))
            }
        }
    }

    /// Walks shadow rays in tiles or packets of 16, where that is chosen; says whether it was. What is counted goes
    /// singly: nobody reads its speed, and every walk that counts is compiled once more.
    pub(super) fn shadow_groups(
        &self,
        level: Level,
        rays: &[Ray],
        occluded: &mut [bool],
        counted: bool,
    ) -> bool {
        use Batches::{Auto, Eight, Packets, Sixteen};
        let job = self.batch(level, rays);
        if counted || job.shadow_cache || self.config.choice("shadow") == "beam" {
            return false;
        }
        let write = |i: usize, hit: Hit| occluded[i] = hit.is_hit();
        let lately = Some(&self.lately[1]);
        if let (Auto, Some((tree, blocks))) = (self.batches, self.flown()) {
            let job = Batch { blocks, ..job };
            job.quick_tiles(&ShadowTiles::<_, 4>(tree, lately), write);
            return true;
        }
        match (&self.built.layout, self.batches) {
            (Layout::Plane(tree, _), Eight | Sixteen) => {
                job.quick_tiles(&ShadowTiles::<_, 4>(tree, lately), write);
            }
            (Layout::Lazy(tree), Auto | Eight) => {
                job.quick_tiles(&ShadowTiles::<_, 4>(tree, lately), write);
            }
            (Layout::Objects(Objects::Boxes8(tree)), Eight | Sixteen) => {
                job.quick_tiles(&ShadowTiles::<_, 4>(tree, lately), write);
            }
            (Layout::Plane(tree, _), Packets(16)) => {
                job.quick_tiles(
                    &packet_walk::Packets::<_, Any, packet::Sixteen>::new(tree),
                    write,
                );
            }
            (Layout::Objects(Objects::Boxes8(tree)), Packets(16)) => {
                job.quick_tiles(
                    &packet_walk::Packets::<_, Any, packet::Sixteen>::new(tree),
                    write,
                );
            }
            _ => return false,
        }
        true
    }

    /// The ropes of a tree that is walked by them.
    fn linked(&self) -> &Ropes {
        self.ropes.as_ref().expect("built with the tree")
    }

    /// Walks shadow rays through a tree that divides space as beams.
    ///
    /// # Panics
    /// For other structures, which do not offer it.
    fn shadow_beams(
        &self,
        job: &Batch<'_>,
        write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        match &self.built.layout {
            Layout::OctreeParam(tree) => {
                job.shadow_beams((tree, &octree_param::Walk(tree)), write, counters);
            }
            Layout::OctreeNet(tree) | Layout::OctreeBeam(tree, _) => {
                let walk = octree_step::Walk(tree, octree_net::Links);
                job.shadow_beams((tree, &walk), write, counters);
            }
            Layout::OctreeSamet(tree) => {
                let walk = octree_step::Walk(tree, octree_samet::Ascent);
                job.shadow_beams((tree, &walk), write, counters);
            }
            Layout::OctreeGlassner(tree) => {
                let walk = octree_step::Walk(tree, octree_glassner::Location);
                job.shadow_beams((tree, &walk), write, counters);
            }
            Layout::Plane(tree, _) => {
                job.shadow_beams((tree, &plane_dir::Walk(tree)), write, counters);
            }
            _ => unreachable!("only trees that divide space offer shadow beams"),
        }
    }
}
