// SPDX-License-Identifier: GPL-3.0-or-later
//! Importance sampling of the directions of a background.

use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Vec3, vec3};
use crate::values::image::projection::direction_to_uv;

/// Fraction of the mean brightness added to every texel for sampling, so that each has a positive density.
const MIN_SHARE: f32 = 0.02;

/// An importance map over longitude and latitude, with density in proportion to brightness.
#[derive(Debug)]
pub struct DirectionMap {
    width: usize,
    height: usize,
    /// Normalized running sums of each row: `width + 1` numbers from 0 to 1 per row.
    rows: Vec<f32>,
    /// Where to begin the search in each row, [`guides`] numbers per row.
    row_guides: Vec<u32>,
    /// Normalized running sum over the rows: `height + 1` numbers from 0 to 1.
    column: Vec<f32>,
    /// Where to begin the search in it.
    column_guides: Vec<u32>,
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
        let mut row_guides = Vec::with_capacity(guides(width) * height);
        for row in rows.chunks_exact(width + 1) {
            append_guides(&mut row_guides, row);
        }
        let mut column_guides = Vec::with_capacity(guides(height));
        append_guides(&mut column_guides, &column);
        Some(Self {
            width,
            height,
            rows,
            row_guides,
            column,
            column_guides,
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
        let (y, fy) = invert(&self.column, &self.column_guides, u[1]);
        let count = guides(self.width);
        let row_guides = &self.row_guides[y * count..(y + 1) * count];
        let (x, fx) = invert(self.row(y), row_guides, u[0]);
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
    sin_cos_turns(0.75 + 0.5 * v).1.max(0.0)
}

/// Inverse of [`direction_to_uv`].
fn uv_to_direction([u, v]: [f32; 2]) -> Vec3 {
    // The longitude is half a turn less u turns, the latitude half as many turns as v is above the middle.
    let (sin_longitude, cos_longitude) = sin_cos_turns(1.5 - u);
    let (sin_latitude, flat) = sin_cos_turns(0.75 + 0.5 * v);
    vec3(flat * cos_longitude, flat * sin_longitude, sin_latitude)
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

/// Number of cells per guide: the mean number of steps of a search, all within one or two cache lines.
const CELLS_PER_GUIDE: usize = 4;

/// Returns the number of guides of a running sum over `cells` cells.
fn guides(cells: usize) -> usize {
    cells.div_ceil(CELLS_PER_GUIDE)
}

/// Appends the guides of a running sum: for equal intervals of 0..1 the cell that contains the lower end (Chen and Asau
/// 1974, "On Generating Random Variates from an Empirical Distribution").
fn append_guides(out: &mut Vec<u32>, running: &[f32]) {
    let cells = running.len() - 1;
    let count = guides(cells);
    let mut cell = 0;
    for k in 0..count {
        let low = k as f32 / count as f32;
        while cell + 1 < cells && running[cell + 1] <= low {
            cell += 1;
        }
        out.push(cell as u32);
    }
}

/// Finds the cell of a running sum that contains `u`, and the position within the cell.
fn invert(running: &[f32], guides: &[u32], u: f32) -> (usize, f32) {
    // Begin at the guide; rounding may have chosen the next one.
    let n = running.len() - 1;
    let guide = ((u * guides.len() as f32) as usize).min(guides.len() - 1);
    let mut i = guides[guide] as usize;
    while i > 0 && running[i] > u {
        i -= 1;
    }
    while i + 1 < n && running[i + 1] <= u {
        i += 1;
    }
    // An empty cell returns its middle.
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
    fn guided_searches_find_the_cell_of_a_binary_search() {
        let sampler = PixelSampler::new(4, 5, 6);
        for cells in [1_u32, 2, 5, 64, 333] {
            // Dark stretches, empty cells and one bright cell.
            let value = |i: u32| match i % 7 {
                0 => 0.0,
                _ if i == cells / 2 => 1e4,
                _ => f64::from(sampler.pair(i, 2)[0]),
            };
            let mut running = Vec::new();
            append_running(&mut running, (0..cells).map(value));
            let mut guides = Vec::new();
            append_guides(&mut guides, &running);
            let ends = running.iter().copied().filter(|&c| c < 1.0);
            for u in ends.chain((0..2000).map(|i| sampler.pair(i, 3)[0])) {
                let inner = &running[1..cells as usize];
                let expected = inner.partition_point(|&c| c <= u);
                assert_eq!(invert(&running, &guides, u).0, expected, "{cells} {u}");
            }
        }
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
