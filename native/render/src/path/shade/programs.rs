// SPDX-License-Identifier: GPL-3.0-or-later
//! Programs of the surfaces that the rays of a wavefront have hit, run before the hits are shaded: those of one
//! material together, in the lanes of registers. Which hits run together changes no value.

use std::ops::Range;

use fearless_simd::Level;
use halfspace_base::simd;
use halfspace_ray::{Hit, Ray};

use crate::film::catcher::Catch;
use crate::math::vector::Vec3;
use crate::path::state::Path;
use crate::path::walk::RandomWalk;
use crate::path::wavefront::Context;
use crate::scene::ahead::Ahead;
use crate::scene::surface::Surface;
use crate::values::program::{LANES, Value, Wide};
use crate::values::shading_point::ShadingPoint;

/// Number of hits whose programs run before they are shaded (chosen: the values of a hundred steps take 400 KiB).
const BLOCK: usize = 256;

/// Smallest number of hits of a material that run together (chosen).
const FEW: usize = 3;

/// Memory that is used again from wavefront to wavefront.
#[derive(Default)]
pub struct Buffers {
    /// Material and hit, sorted.
    order: Vec<(u32, u32)>,
    /// The index of each hit of the block in [`Programs::ran`]; `None` where its program has not run.
    places: Vec<Option<u32>>,
    /// Registers of all programs that have run, one program after the other.
    values: Vec<Value>,
    wide: Vec<Wide>,
}

/// The programs of a block of hits that run ahead of shading.
pub(super) struct Programs<'a, 'b> {
    /// Whether the program of any material runs ahead.
    active: bool,
    level: Level,
    buffers: &'b mut Buffers,
    ran: Vec<Ran<'a>>,
}

/// A surface whose program has run.
struct Ran<'a> {
    surface: Surface<'a>,
    /// Where its registers begin and end.
    registers: Range<usize>,
}

/// The rays of a wavefront.
#[derive(Clone, Copy)]
pub(super) struct Wave<'a> {
    pub(super) rays: &'a [Ray],
    pub(super) hits: &'a [Hit],
    pub(super) paths: &'a [Path],
    /// The walks below surfaces that the rays are part of; empty if the scene has none.
    pub(super) walks: &'a [Option<RandomWalk>],
}

impl<'a, 'b> Programs<'a, 'b> {
    /// An empty block. No program runs ahead in media, in which paths may end before their hits.
    pub(super) fn new(context: &Context<'a>, buffers: &'b mut Buffers) -> Self {
        let features = context.scene.features();
        Self {
            active: features.programs_ahead && !features.media,
            level: simd::level(),
            buffers,
            ran: Vec::new(),
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
            let block = i..wave.hits.len().min(i + BLOCK);
            self.run::<SMOOTH>(context, block, wave);
        }
        let ran = &self.ran[self.buffers.places[i % BLOCK]? as usize];
        registers.clear();
        registers.extend_from_slice(&self.buffers.values[ran.registers.clone()]);
        Some(ran.surface)
    }

    /// Runs the programs of the hits of a block, in place of those of the last one.
    fn run<const SMOOTH: bool>(
        &mut self,
        context: &Context<'a>,
        block: Range<usize>,
        wave: Wave<'_>,
    ) {
        let scene = context.scene;
        let Buffers {
            order,
            places,
            values,
            wide,
        } = &mut *self.buffers;
        self.ran.clear();
        values.clear();
        places.clear();
        places.resize(block.len(), None);
        collect(context, block.clone(), wave, order);
        // Run each program for eight hits at a time. Free lanes repeat the last hit.
        for of_material in order.chunk_by(|a, b| a.0 == b.0) {
            let program = &scene.materials[of_material[0].0 as usize].program;
            for group in of_material.chunks(LANES).filter(|group| group.len() >= FEW) {
                let hit = |lane: usize| group[lane.min(group.len() - 1)].1 as usize;
                let direction = |lane: usize| Vec3::from(wave.rays[hit(lane)].d);
                let surfaces: [Surface<'a>; LANES] = std::array::from_fn(|lane| {
                    let ray = Some(&wave.rays[hit(lane)]);
                    Surface::at::<SMOOTH>(scene, &wave.hits[hit(lane)], direction(lane), ray)
                });
                let points = std::array::from_fn(|lane| {
                    let (distance, path) = (wave.hits[hit(lane)].t, &wave.paths[hit(lane)]);
                    point(context, &surfaces[lane], direction(lane), distance, path)
                });
                program.run_wide(self.level, &scene.images, &points, wide);
                // Store the registers hit by hit.
                for (lane, surface) in surfaces.into_iter().enumerate().take(group.len()) {
                    let begin = values.len();
                    values.extend(wide.iter().map(|wide| wide.map(|lanes| lanes[lane])));
                    places[hit(lane) - block.start] = Some(self.ran.len() as u32);
                    let registers = begin..values.len();
                    self.ran.push(Ran { surface, registers });
                }
            }
        }
    }
}

/// Collects the hits of a block whose programs run ahead, sorted by material. Leaves out what shading may not need: rays
/// below surfaces, and surfaces that rays pass.
fn collect(
    context: &Context<'_>,
    block: Range<usize>,
    wave: Wave<'_>,
    order: &mut Vec<(u32, u32)>,
) {
    let scene = context.scene;
    let ahead = Ahead::new(scene);
    order.clear();
    for i in block {
        ahead.fetch(wave.hits, i);
        let (hit, path) = (&wave.hits[i], &wave.paths[i]);
        if !hit.is_hit() || wave.walks.get(i).is_some_and(Option::is_some) {
            continue;
        }
        let index = scene.attributes.at(hit.triangle).material();
        let material = &scene.materials[index];
        let seen = material.visible.to(path.kind)
            && (material.catcher || path.catch != Catch::OnlyCatchers);
        if material.runs_ahead && seen {
            order.push((index as u32, i as u32));
        }
    }
    order.sort_unstable();
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
