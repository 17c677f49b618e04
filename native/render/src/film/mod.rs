// SPDX-License-Identifier: GPL-3.0-or-later
//! The film: sums of samples, tile by tile, readable while the render runs.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::film::adaptive::Noise;
use crate::settings::{Mist, Pass, Settings};

pub mod adaptive;
mod area;
mod batch;
pub mod catcher;
mod light_parts;
mod matte;
mod read;
mod sample;

use crate::film::area::TILE;
pub use crate::film::area::{BLOCK, TileArea};
pub use crate::film::batch::Batch;
use crate::film::catcher::SUMS;
pub use crate::film::light_parts::{LightParts, Shares};
pub use crate::film::matte::Identities;
use crate::film::matte::Mattes;
pub use crate::film::sample::PixelSample;

/// One tile with its own lock, so that threads that work on different tiles do not wait for each other.
struct Tile {
    area: TileArea,
    sums: Mutex<Sums>,
}

/// Sums and progress of a tile.
struct Sums {
    /// Samples per pixel of the blocks that are still active.
    done: u32,
    /// Samples per pixel of each block.
    samples: Vec<u32>,
    /// Whether each block is still sampled.
    active: Vec<bool>,
    /// Estimate of the noise, if sampling is adaptive.
    noise: Option<Noise>,
    /// The surfaces in each pixel, if a matte is filled.
    mattes: Mattes,
    /// Per pixel, all channels of all passes one after the other. The sums are f64, so that the mean of any number
    /// of samples keeps the precision of f32.
    values: Vec<f64>,
}

/// Value that a copy writes to pixels without samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unsampled {
    /// Zero.
    Zero,
    /// Nothing: they keep their values.
    Kept,
}

/// The film of one render.
pub struct Film {
    /// Half-open range of pixels: x0, y0, x1, y1.
    region: [u32; 4],
    /// Passes without repetitions, in the order of their channels: first those of the settings, then those that they
    /// are computed from.
    passes: Vec<Pass>,
    /// Number of passes of the settings.
    shown: usize,
    /// Sums per pixel.
    stride: usize,
    /// Number of values that materials output.
    outputs: usize,
    /// Number of light groups.
    groups: usize,
    /// Whether a pass is filled for which [`Batch`] has an array of its own.
    extra: bool,
    /// Whether shadow catchers are in the scene; their sums are the last ones of each pixel.
    catches: bool,
    /// Whether camera rays do not see the background.
    transparent: bool,
    mist: Mist,
    /// Factor on the colours of the combined pass.
    exposure: f32,
    tiles: Vec<Tile>,
}

impl Film {
    /// Returns an upper bound of the memory of a film with these settings, in bytes. `catches`: see [`Self::new`].
    pub fn bytes(settings: &Settings, catches: bool) -> u64 {
        let [x0, y0, x1, y1] = settings.region();
        let (passes, _) = stored(&settings.passes);
        let mut channels: usize = passes.iter().map(|p| p.sums()).sum();
        if catches {
            channels += SUMS;
        }
        // Adaptive sampling keeps two sums of RGB per pixel.
        if settings.noise_threshold > 0.0 {
            channels += 6;
        }
        u64::from(x1 - x0) * u64::from(y1 - y0) * (channels * size_of::<f64>()) as u64
    }

    /// A film without samples. `catches`: whether shadow catchers are in the scene.
    pub fn new(settings: &Settings, catches: bool) -> Self {
        let region @ [x0, y0, x1, y1] = settings.region();
        let (passes, shown) = stored(&settings.passes);
        let stride = passes.iter().map(|p| p.sums()).sum::<usize>() + usize::from(catches) * SUMS;
        let count = |last: Option<u8>| last.map_or(0, |last| usize::from(last) + 1);
        let outputs = count(passes.iter().filter_map(|p| p.output()).max());
        let groups = count(passes.iter().filter_map(|p| p.group()).max());
        let extra = catches || passes.iter().any(|p| p.is_extra());
        let mattes = || passes.iter().filter_map(|p| p.matte());
        // Divide the region into tiles, cut off at its upper and right edge.
        let mut tiles = Vec::new();
        for y in (y0..y1).step_by(TILE as usize) {
            for x in (x0..x1).step_by(TILE as usize) {
                let area = TileArea {
                    x,
                    y,
                    width: TILE.min(x1 - x),
                    height: TILE.min(y1 - y),
                };
                // Blocks at the edge of a tile may be smaller, but count as blocks.
                let (across, up) = area.blocks();
                let blocks = (across * up) as usize;
                let noise = (settings.noise_threshold > 0.0).then(|| Noise::new(area.pixels()));
                tiles.push(Tile {
                    area,
                    sums: Mutex::new(Sums {
                        done: 0,
                        samples: vec![0; blocks],
                        active: vec![true; blocks],
                        noise,
                        mattes: Mattes::new(mattes(), area.pixels()),
                        values: vec![0.0; area.pixels() * stride],
                    }),
                });
            }
        }
        Self {
            region,
            passes,
            shown,
            stride,
            outputs,
            groups,
            extra,
            catches,
            transparent: settings.film_transparent,
            mist: settings.mist,
            exposure: settings.exposure,
            tiles,
        }
    }

    /// Returns the number of tiles.
    pub fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Returns the pixels of a tile.
    pub fn area(&self, tile: usize) -> TileArea {
        self.tiles[tile].area
    }

    /// Returns the passes that are filled.
    pub fn passes(&self) -> &[Pass] {
        &self.passes[..self.shown]
    }

    /// Whether a light pass is filled.
    pub fn divides_light(&self) -> bool {
        self.passes.iter().any(|p| matches!(p, Pass::Light(_)))
    }

    /// Whether a pass is filled for which [`Batch`] has an array of its own.
    pub fn wants_extra(&self) -> bool {
        self.extra
    }

    /// Whether shadow catchers are in the scene.
    pub fn catches(&self) -> bool {
        self.catches
    }

    /// Whether a matte is filled.
    pub fn identifies(&self) -> bool {
        self.passes.iter().any(|p| matches!(p, Pass::Matte(_)))
    }

    /// Returns the number of light groups.
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// Returns the number of values that materials output for passes.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Whether a pass needs counted traversal.
    pub fn counts(&self) -> bool {
        self.fills(Pass::TraversalSteps) || self.fills(Pass::TriangleTests)
    }

    /// Whether a pass is filled.
    pub fn fills(&self, pass: Pass) -> bool {
        self.passes.contains(&pass)
    }

    /// Copies the flags of a tile's active blocks to `out`. Returns whether any is set.
    pub fn active(&self, tile: usize, out: &mut Vec<bool>) -> bool {
        out.clone_from(&self.sums(tile).active);
        out.contains(&true)
    }

    /// Locks the sums of a tile. A panic in another thread leaves them usable.
    fn sums(&self, tile: usize) -> MutexGuard<'_, Sums> {
        self.tiles[tile]
            .sums
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds `count` samples per pixel to a tile; those of pixels of inactive blocks are ignored. The caller adds a
    /// tile's samples in order.
    pub fn add(&self, tile: usize, batch: &Batch, count: u32, settings: &Settings) {
        let area = self.tiles[tile].area;
        let mut sums = self.sums(tile);
        let sums = &mut *sums;
        // Add the samples in the order of their indices.
        for (number, chunk) in batch.samples.chunks_exact(area.pixels()).enumerate() {
            let index = sums.done + number as u32;
            for (pixel, sample) in chunk.iter().enumerate() {
                // Pixels of stopped blocks were not rendered.
                if sums.active[area.block_of(pixel)] {
                    let slot = number * area.pixels() + pixel;
                    let out = &mut sums.values[pixel * self.stride..(pixel + 1) * self.stride];
                    self.add_pixel(out, batch, slot, index == 0);
                    if self.extra
                        && let Some(identities) = batch.identities.get(slot)
                    {
                        sums.mattes.add(pixel, identities);
                    }
                    if let Some(noise) = &mut sums.noise {
                        noise.add(pixel, index, sample.color);
                    }
                }
            }
        }
        // Count the samples of the active blocks, and stop those whose noise is low enough.
        sums.done += count;
        for (samples, _) in sums
            .samples
            .iter_mut()
            .zip(&sums.active)
            .filter(|(_, a)| **a)
        {
            *samples += count;
        }
        if let Some(noise) = &sums.noise
            && adaptive::is_due(settings, sums.done)
        {
            noise.stop_quiet_blocks(area, sums.done, settings, &mut sums.active);
        }
    }

    /// Counts `count` samples of a tile as done without adding any, because none of its blocks is active.
    pub fn skip(&self, tile: usize, count: u32) {
        self.sums(tile).done += count;
    }

    /// Returns the number of samples per pixel that every tile has, or does not need.
    pub fn samples_done(&self) -> u32 {
        (0..self.tiles.len())
            .map(|t| self.sums(t).done)
            .min()
            .unwrap_or(0)
    }

    /// Adds one sample of a batch to the sums of a pixel. `first`: whether it is the pixel's first one.
    fn add_pixel(&self, out: &mut [f64], batch: &Batch, slot: usize, first: bool) {
        let sample = &batch.samples[slot];
        // The closure writes to successive channels, in the order of the passes. Light that overflowed counts as 0, as
        // in Cycles: one such sample would hide all others.
        let mut out = out.iter_mut();
        let mut sum = |values: &[f32]| {
            for (&v, o) in values.iter().zip(&mut out) {
                *o += if v.is_finite() { f64::from(v) } else { 0.0 };
            }
        };
        // Passes of the first sample alone add 0 for all others, so that the sum stays its value.
        let once = |value: f32| [if first { value } else { 0.0 }];
        for pass in &self.passes {
            match pass {
                Pass::Combined => {
                    sum(&sample.color);
                    sum(&[sample.alpha]);
                }
                Pass::Mist => sum(&[self.mist.at(sample.distance)]),
                Pass::Normal => sum(&sample.normal),
                Pass::Uv => sum(&sample.uv),
                Pass::Albedo => sum(&sample.albedo),
                Pass::Depth => sum(&once(sample.depth)),
                Pass::Position => sum(if first { &sample.position } else { &[0.0; 3] }),
                Pass::ObjectIndex => sum(&once(sample.object)),
                Pass::MaterialIndex => sum(&once(sample.material)),
                Pass::TraversalSteps => sum(&[sample.steps as f32]),
                Pass::TriangleTests => sum(&[sample.tests as f32]),
                Pass::LeafDepth => sum(&[sample.leaf_depth as f32]),
                Pass::Roughness => sum(&[sample.roughness]),
                Pass::SampleCount => sum(&[1.0]),
                Pass::Light(pass) => sum(batch.parts[slot].at(*pass)),
                Pass::Vector => sum(&batch.motion[slot]),
                Pass::Group(number) => {
                    sum(&batch.groups_of(slot, self.groups)[usize::from(*number)]);
                }
                Pass::Output(number) => {
                    sum(&batch.outputs_of(slot, self.outputs)[usize::from(*number)]);
                }
                // These count identities instead of adding values, or are computed from other sums.
                Pass::Matte(_) | Pass::ShadowCatcher => {}
            }
        }
        if self.catches {
            sum(&batch.caught[slot].values(sample));
        }
    }
}

/// Returns the passes to store for these: each once, then those that they are computed from. Also the number of the
/// first kind.
fn stored(wanted: &[Pass]) -> (Vec<Pass>, usize) {
    let mut passes = Vec::new();
    let mut shown = 0;
    for pass in wanted.iter().copied() {
        if !passes.contains(&pass) {
            passes.push(pass);
        }
        shown = passes.len();
    }
    for pass in wanted.iter().filter_map(|pass| pass.source()) {
        if !passes.contains(&pass) {
            passes.push(pass);
        }
    }
    (passes, shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings {
            width: 50,
            height: 40,
            border: Some([5, 3, 45, 40]),
            samples: 2,
            passes: vec![Pass::Combined, Pass::Depth, Pass::SampleCount],
            ..Default::default()
        }
    }

    #[test]
    fn pixels_of_a_border_keep_their_positions() {
        let film = Film::new(&settings(), false);
        for tile in 0..film.tiles() {
            let area = film.area(tile);
            for second in [0.0, 2.0] {
                let samples: Vec<_> = (0..area.height)
                    .flat_map(|y| (0..area.width).map(move |x| (area.x + x, area.y + y)))
                    .map(|(x, y)| PixelSample {
                        color: [x as f32 + second, y as f32, 0.0],
                        depth: 7.0 + second,
                        ..PixelSample::EMPTY
                    })
                    .collect();
                let batch = Batch {
                    samples,
                    ..Default::default()
                };
                film.add(tile, &batch, 1, &settings());
            }
        }
        assert_eq!(film.samples_done(), 2);
        let mut out = vec![0.0; 40 * 37 * 4];
        film.copy_into(Pass::Combined, Unsampled::Zero, &mut out)
            .unwrap();
        for (i, p) in out.chunks_exact(4).enumerate() {
            assert_eq!(p[..2], [(i % 40 + 5) as f32 + 1.0, (i / 40 + 3) as f32]);
        }
        let mut depth = vec![0.0; 40 * 37];
        film.copy_into(Pass::Depth, Unsampled::Zero, &mut depth)
            .unwrap();
        assert!(
            depth.iter().all(|&d| d == 7.0),
            "depth is the first sample's, not a mean"
        );
        let wrong = film
            .copy_into(Pass::Depth, Unsampled::Zero, &mut out)
            .unwrap_err()
            .to_string();
        assert!(
            wrong.contains("40 x 37 x 1 = 1480 elements, got 5920"),
            "{wrong}"
        );
        assert!(
            film.copy_into(Pass::Normal, Unsampled::Zero, &mut out)
                .unwrap_err()
                .to_string()
                .contains("Depth")
        );
    }

    #[test]
    fn pixels_without_samples_are_zero_or_keep_their_values() {
        let film = Film::new(&settings(), false);
        let area = film.area(0);
        let mut batch = Batch::default();
        batch.reset(&film, area.pixels());
        film.add(0, &batch, 1, &settings());
        let sampled = area.pixels() * 4;
        for (unsampled, want) in [
            (Unsampled::Zero, 0),
            (Unsampled::Kept, 40 * 37 * 4 - sampled),
        ] {
            let mut out = vec![9.0; 40 * 37 * 4];
            film.copy_into(Pass::Combined, unsampled, &mut out).unwrap();
            let kept = out.iter().filter(|&&v| v == 9.0).count();
            assert_eq!(kept, want, "{unsampled:?}");
        }
    }
}
