// SPDX-License-Identifier: GPL-3.0-or-later
//! Reading of the film: the means of the samples so far.

use crate::check::{Error, Result};
use crate::film::catcher::{Means, SUMS};
use crate::film::light_parts::divided;
use crate::film::{Film, TileArea, Unsampled};
use crate::settings::Pass;

impl Film {
    /// Writes the mean of the samples so far to `out`, rows from the bottom up. `unsampled`: what becomes of pixels
    /// without samples.
    ///
    /// # Errors
    /// [`Error::Spec`] if the pass is not filled, [`Error::Shape`] if `out` does not have width × height × channels
    /// elements.
    pub fn copy_into(&self, pass: Pass, unsampled: Unsampled, out: &mut [f32]) -> Result<()> {
        // Find the pass's channels and check the size of `out`.
        let Some(offset) = self.offset(pass) else {
            let filled: Vec<_> = self.passes().iter().map(|p| p.name()).collect();
            return Err(Error::Spec(format!(
                "name: pass '{}' is not filled; this render fills {}",
                pass.name(),
                filled.join(", ")
            )));
        };
        let divisor = pass.divisor().and_then(|color| self.offset(color));
        let exposed = match pass {
            Pass::Combined | Pass::Group(_) => true,
            Pass::Light(pass) => pass.is_exposed(),
            _ => false,
        };
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
            let mut number = 0;
            for row in 0..tile.area.height {
                let start = (((y - y0 + row) as usize) * width + (x - x0) as usize) * channels;
                // The pixels of a tile are stored row by row, so one number counts through all rows.
                for pixel in out[start..start + w as usize * channels].chunks_exact_mut(channels) {
                    let values = &sums.values[number * self.stride..(number + 1) * self.stride];
                    let samples = sums.samples[tile.area.block_of(number)];
                    number += 1;
                    if samples == 0 && unsampled == Unsampled::Kept {
                        continue;
                    }
                    let scale = if pass == Pass::Vector {
                        1.0 / values[offset + 4].max(1.0)
                    } else if mean {
                        1.0 / f64::from(samples.max(1))
                    } else {
                        1.0
                    };
                    if self.catches && matches!(pass, Pass::Combined | Pass::ShadowCatcher) {
                        self.write_catcher(pass, values, scale, pixel);
                    } else if pass == Pass::ShadowCatcher {
                        pixel.fill(1.0);
                    } else if let Pass::Matte(pass) = pass {
                        let ranks = sums.mattes.ranks(pass, number - 1, samples);
                        pixel.copy_from_slice(&ranks);
                    } else if let Some(color) = divisor {
                        let of = |at: usize| [values[at], values[at + 1], values[at + 2]];
                        let quotient = divided(of(offset), of(color));
                        pixel.copy_from_slice(&quotient.map(|q| q as f32));
                    } else {
                        for (o, v) in pixel.iter_mut().zip(&values[offset..]) {
                            *o = (v * scale) as f32;
                        }
                    }
                    if exposed {
                        pixel[..3].iter_mut().for_each(|c| *c *= self.exposure);
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes a pixel of the combined pass or of the shadow, of a scene with shadow catchers. `values`: its sums;
    /// `scale`: of the mean.
    fn write_catcher(&self, pass: Pass, values: &[f64], scale: f64, pixel: &mut [f32]) {
        let mean = |at: usize| values.get(at).map_or(0.0, |sum| sum * scale);
        let first = self.stride - SUMS;
        let combined = self.offset(Pass::Combined);
        let means = Means {
            combined: [0, 1, 2, 3].map(|k| combined.map_or(0.0, |at| mean(at + k))),
            caught: std::array::from_fn(|k| mean(first + k)),
        };
        let apart = self.fills(Pass::ShadowCatcher);
        if pass == Pass::ShadowCatcher {
            (pixel.iter_mut().zip(means.pass())).for_each(|(o, v)| *o = v as f32);
        } else {
            let picture = means.picture(apart, self.transparent);
            (pixel.iter_mut().zip(picture)).for_each(|(o, v)| *o = v as f32);
        }
    }

    /// Returns the first channel of a pass, if it is stored.
    fn offset(&self, pass: Pass) -> Option<usize> {
        let at = self.passes.iter().position(|&p| p == pass)?;
        Some(self.passes[..at].iter().map(|p| p.sums()).sum())
    }
}
