// SPDX-License-Identifier: GPL-3.0-or-later
//! Importance sampling of the directions of a background.

use crate::math::vector::{Vec3, vec3};
use crate::values::program::direction_to_uv;

/// Fraction of the mean brightness added to every texel for sampling, so that each has a positive density.
const MIN_SHARE: f32 = 0.02;

/// An importance map over longitude and latitude, with density in proportion to brightness.
#[derive(Debug)]
pub struct DirectionMap {
    width: usize,
    height: usize,
    /// Normalized running sums of each row: `width + 1` numbers from 0 to 1 per row.
    rows: Vec<f32>,
    /// Normalized running sum over the rows: `height + 1` numbers from 0 to 1.
    column: Vec<f32>,
    /// Mean radiance over the sphere.
    pub mean: f32,
}

impl DirectionMap {
    /// The map of `radiance`, or `None` if it is black everywhere.
    pub(super) fn new(
        [width, height]: [usize; 2],
        mut radiance: impl FnMut(Vec3) -> Vec3,
    ) -> Option<Self> {
        let mut values = Vec::with_capacity(width * height);
        let mut total = 0.0_f64;
        let mut area = 0.0_f64;
        // Mean radiance at a position of the map.
        let mut brightness = |x: f32, y: f32| {
            let uv = [x / width as f32, y / height as f32];
            radiance(uv_to_direction(uv)).mean_abs()
        };
        // Images are interpolated between texel centres, so take the largest value of a texel's corners and its
        // centre; narrow lights are then not missed.
        let mut corners = Vec::with_capacity(height + 1);
        for y in 0..=height {
            let row: Vec<f32> = (0..=width)
                .map(|x| brightness(x as f32, y as f32))
                .collect();
            corners.push(row);
        }
        for y in 0..height {
            let cosine = latitude_cosine((y as f32 + 0.5) / height as f32);
            let low = std::mem::take(&mut corners[y]);
            let high = &corners[y + 1];
            for x in 0..width {
                let value = brightness(x as f32 + 0.5, y as f32 + 0.5)
                    .max(low[x])
                    .max(low[x + 1])
                    .max(high[x])
                    .max(high[x + 1]);
                total += f64::from(value * cosine);
                area += f64::from(cosine);
                values.push(value);
            }
        }
        // A background that is black everywhere needs no light samples.
        let mean = (total / area) as f32;
        if !(mean > 0.0 && mean.is_finite()) {
            return None;
        }
        // Build the running sums of the rows, weighted by the cosine of the latitude.
        let mut rows = Vec::with_capacity((width + 1) * height);
        let mut sums = Vec::with_capacity(height);
        for y in 0..height {
            let cosine = latitude_cosine((y as f32 + 0.5) / height as f32);
            let row = values[y * width..(y + 1) * width]
                .iter()
                .map(|v| f64::from(v + MIN_SHARE * mean));
            sums.push(append_running(&mut rows, row) * f64::from(cosine));
        }
        let mut column = Vec::with_capacity(height + 1);
        append_running(&mut column, sums.into_iter());
        Some(Self {
            width,
            height,
            rows,
            column,
            mean,
        })
    }

    /// The running sum of row `y`.
    fn row(&self, y: usize) -> &[f32] {
        &self.rows[y * (self.width + 1)..(y + 1) * (self.width + 1)]
    }

    /// Samples a direction in proportion to brightness, with two random numbers. Returns it with its density per
    /// solid angle.
    pub fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        // Choose the row, then the cell within it.
        let (y, fy) = invert(&self.column, u[1]);
        let (x, fx) = invert(self.row(y), u[0]);
        let uv = [
            (x as f32 + fx) / self.width as f32,
            (y as f32 + fy) / self.height as f32,
        ];
        (uv_to_direction(uv), self.density(x, y, uv[1]))
    }

    /// Returns the density of [`Self::sample`] in a direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        // Find the cell; rounding at the border stays inside the map.
        let [u, v] = direction_to_uv(direction);
        let cell = |t: f32, n: usize| ((t * n as f32).max(0.0) as usize).min(n - 1);
        self.density(cell(u, self.width), cell(v, self.height), v)
    }

    /// The density of cell (x, y) per solid angle, at height `v` of the map.
    fn density(&self, x: usize, y: usize, v: f32) -> f32 {
        use std::f32::consts::PI;
        let row = self.row(y);
        let share = (row[x + 1] - row[x]) * (self.column[y + 1] - self.column[y]);
        let cells = (self.width * self.height) as f32;
        // The map's unit square covers 2π² cos(latitude) of solid angle per unit of area.
        share * cells / (2.0 * PI * PI * latitude_cosine(v).max(1e-6))
    }
}

/// Cosine of the latitude at height `v`.
fn latitude_cosine(v: f32) -> f32 {
    (std::f32::consts::PI * (v - 0.5)).cos().max(0.0)
}

/// Inverse of [`direction_to_uv`].
fn uv_to_direction([u, v]: [f32; 2]) -> Vec3 {
    use std::f32::consts::{PI, TAU};
    let (longitude, latitude) = ((0.5 - u) * TAU, (v - 0.5) * PI);
    let flat = latitude.cos();
    vec3(
        flat * longitude.cos(),
        flat * longitude.sin(),
        latitude.sin(),
    )
}

/// Appends the running sum of `values`, normalized to 0..1, and returns their sum.
fn append_running(out: &mut Vec<f32>, values: impl Iterator<Item = f64> + Clone) -> f64 {
    let total: f64 = values.clone().sum();
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    let mut sum = 0.0;
    out.push(0.0);
    for value in values {
        sum += value;
        out.push((sum * scale) as f32);
    }
    if let Some(last) = out.last_mut() {
        *last = 1.0;
    }
    total
}

/// Finds the cell of a running sum that contains `u`, and the position within the cell.
fn invert(running: &[f32], u: f32) -> (usize, f32) {
    // Find the cell by binary search; an empty cell returns its middle.
    let n = running.len() - 1;
    let i = running[1..n].partition_point(|&c| c <= u);
    let (low, high) = (running[i], running[i + 1]);
    let f = if high > low {
        (u - low) / (high - low)
    } else {
        0.5
    };
    (i, f.clamp(0.0, 1.0 - f32::EPSILON))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::PixelSampler;

    fn spot(d: Vec3) -> Vec3 {
        let bright = d.dot(vec3(0.6, 0.0, 0.8)) > 0.97;
        Vec3::splat(if bright { 50.0 } else { 0.1 })
    }

    #[test]
    fn samples_have_the_stated_density_and_integrate_the_map() {
        let map = DirectionMap::new([64, 32], spot).unwrap();
        let sampler = PixelSampler::new(1, 2, 3);
        let n = 1 << 14;
        let (mut integral, mut reference) = (0.0_f64, 0.0_f64);
        for i in 0..n {
            let (d, pdf) = map.sample(sampler.pair(i, 0));
            let again = map.pdf(d);
            assert!((pdf - again).abs() < 0.02 * pdf, "{pdf} {again}");
            integral += f64::from(spot(d).x / pdf) / f64::from(n);
            let [u, v] = sampler.pair(i, 1);
            let z = 1.0 - 2.0 * v;
            let (sin, cos) = (std::f32::consts::TAU * u).sin_cos();
            let r = (1.0 - z * z).sqrt();
            reference += f64::from(spot(vec3(r * cos, r * sin, z)).x) * 4.0 * std::f64::consts::PI
                / f64::from(n);
        }
        assert!(
            (integral / reference - 1.0).abs() < 0.02,
            "{integral} {reference}"
        );
        assert!(DirectionMap::new([8, 4], |_| Vec3::ZERO).is_none());
    }
}
