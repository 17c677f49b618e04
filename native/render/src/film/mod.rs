// SPDX-License-Identifier: GPL-3.0-or-later
//! The film: sums of samples, tile by tile, readable while the render runs.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::check::{Error, Result};
use crate::film::adaptive::Noise;
use crate::settings::{Mist, Pass, Settings};

pub mod adaptive;
mod area;
mod sample;

use crate::film::area::TILE;
pub use crate::film::area::{BLOCK, TileArea};
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
    /// Per pixel, all channels of all passes one after the other. The sums are f64, so that the mean of any number
    /// of samples keeps the precision of f32.
    values: Vec<f64>,
}

/// What a copy writes to pixels without samples.
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
    /// Passes without repetitions, in the order of their channels.
    passes: Vec<Pass>,
    /// Channels per pixel.
    stride: usize,
    mist: Mist,
    /// Factor on the colours of the combined pass.
    exposure: f32,
    tiles: Vec<Tile>,
}

impl Film {
    /// Returns an upper bound of the memory of a film with these settings, in bytes.
    pub fn bytes(settings: &Settings) -> u64 {
        let [x0, y0, x1, y1] = settings.region();
        // Passes given twice are counted twice here but stored once.
        let mut channels: usize = settings.passes.iter().map(|p| p.channels()).sum();
        // Adaptive sampling keeps two sums of RGB per pixel.
        if settings.noise_threshold > 0.0 {
            channels += 6;
        }
        u64::from(x1 - x0) * u64::from(y1 - y0) * (channels * size_of::<f64>()) as u64
    }

    /// A film without samples.
    pub fn new(settings: &Settings) -> Self {
        let region @ [x0, y0, x1, y1] = settings.region();
        // Keep each pass once.
        let mut passes = Vec::new();
        for &pass in &settings.passes {
            if !passes.contains(&pass) {
                passes.push(pass);
            }
        }
        let stride = passes.iter().map(|p| p.channels()).sum();
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
                        values: vec![0.0; area.pixels() * stride],
                    }),
                });
            }
        }
        Self {
            region,
            passes,
            stride,
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
        &self.passes
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

    /// Adds `count` samples per pixel to a tile. `samples`: for each of them all pixels of the tile, row by row;
    /// pixels of inactive blocks are ignored. The caller adds a tile's samples in order.
    pub fn add(&self, tile: usize, samples: &[PixelSample], count: u32, settings: &Settings) {
        let area = self.tiles[tile].area;
        let mut sums = self.sums(tile);
        let sums = &mut *sums;
        // Add the samples in the order of their indices.
        for (index, chunk) in (sums.done..).zip(samples.chunks_exact(area.pixels())) {
            let pixels = sums.values.chunks_exact_mut(self.stride.max(1)).zip(chunk);
            for (pixel, (out, sample)) in pixels.enumerate() {
                // Pixels of stopped blocks were not rendered.
                if sums.active[area.block_of(pixel)] {
                    self.add_pixel(out, sample, index == 0);
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

    /// Writes the mean of the samples so far to `out`, rows from the bottom up. `unsampled`: what becomes of pixels
    /// without samples.
    ///
    /// # Errors
    /// [`Error::Spec`] if the pass is not filled, [`Error::Shape`] if `out` does not have width × height × channels
    /// elements.
    pub fn copy_into(&self, pass: Pass, unsampled: Unsampled, out: &mut [f32]) -> Result<()> {
        // Find the pass's channels and check the size of `out`.
        let Some(at) = self.passes.iter().position(|&p| p == pass) else {
            let filled: Vec<_> = self.passes.iter().map(|p| p.name()).collect();
            return Err(Error::Spec(format!(
                "name: pass '{}' is not filled; this render fills {}",
                pass.name(),
                filled.join(", ")
            )));
        };
        let offset: usize = self.passes[..at].iter().map(|p| p.channels()).sum();
        let channels = pass.channels();
        let [x0, y0, x1, y1] = self.region;
        let (width, height) = ((x1 - x0) as usize, (y1 - y0) as usize);
        if out.len() != width * height * channels {
            return Err(Error::Shape(format!(
                "out: '{}' needs {width} x {height} x {channels} = {} elements, got {}",
                pass.name(),
                width * height * channels,
                out.len()
            )));
        }
        // Copy tile by tile, dividing sums by the number of samples of their block.
        for (index, tile) in self.tiles.iter().enumerate() {
            // Depth, position and indices come from the first sample alone; the sample count is a sum.
            let sums = self.sums(index);
            let mean = !matches!(
                pass,
                Pass::Depth
                    | Pass::Position
                    | Pass::ObjectIndex
                    | Pass::MaterialIndex
                    | Pass::SampleCount
            );
            // Rows of the tile lie apart in `out`.
            let TileArea { x, y, width: w, .. } = tile.area;
            let mut pixels = sums.values.chunks_exact(self.stride).enumerate();
            for row in 0..tile.area.height {
                let start = (((y - y0 + row) as usize) * width + (x - x0) as usize) * channels;
                // The pixels of a tile are stored row by row, so one iterator passes through all rows.
                for pixel in out[start..start + w as usize * channels].chunks_exact_mut(channels) {
                    let Some((number, values)) = pixels.next() else {
                        break;
                    };
                    let samples = sums.samples[tile.area.block_of(number)];
                    if samples == 0 && unsampled == Unsampled::Kept {
                        continue;
                    }
                    let samples = if mean { samples.max(1) } else { 1 };
                    let scale = 1.0 / f64::from(samples);
                    for (o, v) in pixel.iter_mut().zip(&values[offset..]) {
                        *o = (v * scale) as f32;
                    }
                    if pass == Pass::Combined {
                        pixel[..3].iter_mut().for_each(|c| *c *= self.exposure);
                    }
                }
            }
        }
        Ok(())
    }

    /// Adds one sample to the channels of a pixel. `first`: whether it is the pixel's first one.
    fn add_pixel(&self, out: &mut [f64], sample: &PixelSample, first: bool) {
        // The closure writes to successive channels, in the order of the passes.
        let mut out = out.iter_mut();
        let mut sum = |values: &[f32]| {
            for (&v, o) in values.iter().zip(&mut out) {
                *o += f64::from(v);
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
                Pass::SampleCount => sum(&[1.0]),
            }
        }
    }
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
        let film = Film::new(&settings());
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
                film.add(tile, &samples, 1, &settings());
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
        let film = Film::new(&settings());
        let area = film.area(0);
        film.add(0, &vec![PixelSample::EMPTY; area.pixels()], 1, &settings());
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
