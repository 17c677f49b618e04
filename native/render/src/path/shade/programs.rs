// SPDX-License-Identifier: GPL-3.0-or-later
//! Programs of the surfaces that the rays of a wavefront have hit, run before the hits are shaded: those of one
//! material together, in the lanes of registers. Which hits run together changes no value.

use std::ops::Range;

use fearless_simd::Level;
use halfspace_base::simd;
use halfspace_ray::{Hit, Ray};

use crate::math::vector::Vec3;
use crate::path::state::Path;
use crate::path::walk::RandomWalk;
use crate::path::wavefront::Context;
use crate::scene::ahead::Ahead;
use crate::scene::surface::Surface;
use crate::values::program::{LANES, Value, Wide};
use crate::values::shading_point::ShadingPoint;

/// Number of hits whose programs run before they are shaded (chosen: their values fit into the second cache).
const BLOCK: usize = 256;

/// Smallest number of hits of a material that run together (chosen: lanes take about as long as three hits in turn).
const FEW: usize = 3;

/// The hits of a block, and the results of their programs.
pub(super) struct Programs<'a> {
    /// Whether any runs ahead.
    active: bool,
    level: Level,
    /// Material and hit, sorted.
    order: Vec<(u32, u32)>,
    /// The place of each hit in `ran`; none where its program has not run.
    places: Vec<Option<u32>>,
    ran: Vec<Ran<'a>>,
    /// The registers of one after the other.
    values: Vec<Value>,
    wide: Vec<Wide>,
}

/// A surface whose program has run.
struct Ran<'a> {
    surface: Surface<'a>,
    /// Where its registers begin and end.
    registers: Range<usize>,
}

/// The rays of a wavefront, what they have hit, their paths, and the walks that they are part of, if the scene has any.
pub(super) type Wave<'a> = (&'a [Ray], &'a [Hit], &'a [Path], &'a [Option<RandomWalk>]);

impl<'a> Programs<'a> {
    /// An empty block. No program runs ahead of shading in media, in which paths may end before their hits.
    pub(super) fn new(context: &Context<'a>) -> Self {
        let scene = context.scene;
        Self {
            active: !scene.features().media && scene.materials.iter().any(|m| m.runs_ahead),
            level: simd::level(),
            order: Vec::new(),
            places: Vec::new(),
            ran: Vec::new(),
            values: Vec::new(),
            wide: Vec::new(),
        }
    }

    /// Copies the results for hit `i`, which is shaded next. At the beginning of a block, runs the programs of its hits
    /// first. Returns the surface if its program has run.
    #[inline(always)]
    pub(super) fn ready<const SMOOTH: bool>(
        &mut self,
        context: &Context<'a>,
        i: usize,
        wave: Wave<'_>,
        registers: &mut Vec<Value>,
    ) -> Option<Surface<'a>> {
        if !self.active {
            return None;
        }
        if i.is_multiple_of(BLOCK) {
            let block = i..wave.1.len().min(i + BLOCK);
            self.run::<SMOOTH>(context, block, wave);
        }
        let ran = &self.ran[self.places[i % BLOCK]? as usize];
        registers.clear();
        registers.extend_from_slice(&self.values[ran.registers.clone()]);
        Some(ran.surface)
    }

    /// Runs the programs of the hits of a block, in place of those of the last one.
    fn run<const SMOOTH: bool>(
        &mut self,
        context: &Context<'a>,
        block: Range<usize>,
        (rays, hits, paths, walks): Wave<'_>,
    ) {
        let scene = context.scene;
        self.order.clear();
        self.values.clear();
        self.ran.clear();
        self.places.clear();
        self.places.resize(block.len(), None);
        // Sort the hits by material. Programs that trace rays, and rays below surfaces, are left to shading.
        let ahead = Ahead::new(scene);
        for i in block.clone() {
            ahead.fetch(hits, i);
            let hit = &hits[i];
            if !hit.is_hit() || walks.get(i).is_some_and(Option::is_some) {
                continue;
            }
            let number = scene.attributes.at(hit.triangle).material();
            let material = &scene.materials[number];
            if material.runs_ahead {
                self.order.push((number as u32, i as u32));
            }
        }
        self.order.sort_unstable();
        // Run each program for eight hits at a time. Free lanes repeat the last hit.
        for same in self.order.chunk_by(|a, b| a.0 == b.0) {
            let program = &scene.materials[same[0].0 as usize].program;
            for some in same.chunks(LANES).filter(|some| some.len() >= FEW) {
                let surfaces: [Surface<'a>; LANES] = std::array::from_fn(|lane| {
                    let i = some[lane.min(some.len() - 1)].1 as usize;
                    Surface::at::<SMOOTH>(scene, &hits[i], Vec3::from(rays[i].d))
                });
                let points = std::array::from_fn(|lane| {
                    let i = some[lane.min(some.len() - 1)].1 as usize;
                    let d = Vec3::from(rays[i].d);
                    point(context, &surfaces[lane], d, hits[i].t, &paths[i])
                });
                program.run_wide(self.level, &scene.images, &points, &mut self.wide);
                for (lane, (&(_, i), surface)) in some.iter().zip(surfaces).enumerate() {
                    let begin = self.values.len();
                    let values = self.wide.iter().map(|wide| wide.map(|lanes| lanes[lane]));
                    self.values.extend(values);
                    self.places[i as usize - block.start] = Some(self.ran.len() as u32);
                    let registers = begin..self.values.len();
                    self.ran.push(Ran { surface, registers });
                }
            }
        }
    }
}

/// The point of a surface that a path's ray along the unit direction `d` reaches at this distance, as input of a
/// program.
#[inline(always)]
pub(super) fn point<'a>(
    context: &Context<'a>,
    surface: &Surface<'a>,
    d: Vec3,
    distance: f32,
    path: &Path,
) -> ShadingPoint<'a> {
    let mut point = surface.shading_point(context.scene, d, path.kind);
    // Reflected rays see about as much of a surface as a camera at their origin would.
    point.footprint = context.camera.pixel_width(path.passed + distance);
    point.view = Some(context.camera.view());
    point.history = path.history(distance);
    point
}
