// SPDX-License-Identifier: GPL-3.0-or-later
//! The background: a colour, or a program of the direction with a map for importance sampling.

use std::sync::Arc;

use crate::check::{Error, Result, finite, within};
use crate::image::Image;
use crate::place::{Place, RayKind, Varying};
use crate::program::{Op, Operand, Program, Step, Value, direction_to_uv, read, rgb};
use crate::vector::{Vec3, vec3};
use crate::visibility::Visibility;

/// Parameters of a background.
#[derive(Debug, Clone)]
pub struct WorldParams {
    /// Radiance if there is no program.
    pub color: [f32; 3],
    /// Program that computes the radiance from the direction.
    pub program: Vec<Step>,
    /// Result of the program.
    pub radiance: Option<Operand>,
    /// The kinds of rays that see the background.
    pub visible: Visibility,
}

impl Default for WorldParams {
    /// Black.
    fn default() -> Self {
        Self {
            color: [0.0; 3],
            program: Vec::new(),
            radiance: None,
            visible: Visibility::ALL,
        }
    }
}

impl From<[f32; 3]> for WorldParams {
    fn from(color: [f32; 3]) -> Self {
        Self {
            color,
            ..Self::default()
        }
    }
}

/// A background prepared for rendering.
#[derive(Debug)]
pub struct World {
    /// The kinds of rays that see the background.
    pub visible: Visibility,
    program: Program,
    radiance: Operand,
    /// Map for importance sampling; none for a constant colour, for which scattered rays suffice.
    map: Option<DirectionMap>,
}

impl World {
    /// Checks and compiles a background.
    ///
    /// # Errors
    /// If a colour is negative or not finite, or the program is invalid.
    pub fn new(params: &WorldParams, images: &[Image], varying: &Varying) -> Result<Self> {
        // Check the colour and compile the program; without one the result is the colour.
        finite(&params.color, || "world['color']".into())?;
        for &c in &params.color {
            within(c.into(), 0.0, 1e30, || "world['color']".into())?;
        }
        let mut roots = [params.radiance.unwrap_or(Operand::color(params.color))];
        let program = Program::compile(&params.program, &mut roots, "world")?;
        let mut world = Self {
            visible: params.visible,
            program,
            radiance: roots[0],
            map: None,
        };
        // The map has the resolution of the largest image, or a default without images.
        let pictures = |op: &Op| matches!(op, Op::Image { .. });
        let mut size = if world.program.ops().any(pictures) {
            [32, 16]
        } else {
            [256, 128]
        };
        for op in world.program.ops() {
            match op {
                Op::Image { image, .. } => {
                    // Images must exist; attributes of corners cannot.
                    let image = images.get(usize::from(*image)).ok_or_else(|| {
                        Error::Shape(format!("world['program']: image {image} is not there"))
                    })?;
                    size = [size[0].max(image.size()[0]), size[1].max(image.size()[1])];
                }
                Op::Attribute(_) | Op::NormalMap(_) => {
                    return Err(Error::Spec(
                        "world['program']: a background has no corners".into(),
                    ));
                }
                _ => {}
            }
        }
        // Tabulate a background that varies, as diffuse rays see it.
        if world.constant().is_none() {
            let size = size.map(|n| n.min(MOST_TEXELS));
            let mut registers = Vec::new();
            world.map = DirectionMap::new(size, |direction| {
                world.radiance(images, varying, direction, RayKind::Diffuse, &mut registers)
            });
        }
        Ok(world)
    }

    /// Returns the radiance if it is the same in all directions.
    pub fn constant(&self) -> Option<Vec3> {
        self.radiance.constant().map(|c| c.map(|x| x.max(0.0)))
    }

    /// Whether the radiance is 0 in all directions.
    pub fn is_black(&self) -> bool {
        self.constant() == Some(Vec3::ZERO)
    }

    /// Returns the radiance of a unit direction. `registers`: scratch memory.
    #[inline]
    pub fn radiance(
        &self,
        images: &[Image],
        varying: &Varying,
        direction: Vec3,
        kind: RayKind,
        registers: &mut Vec<Value>,
    ) -> Vec3 {
        if let Some(constant) = self.constant() {
            return constant;
        }
        // Run the program; negative radiance counts as 0.
        let place = Place::background(varying, direction, kind);
        self.program.run(images, &place, registers);
        rgb(read(self.radiance, registers)).map(|x| x.max(0.0))
    }

    /// Moves the map for sampling out; the lights own it from then on.
    pub fn take_map(&mut self) -> Option<Arc<DirectionMap>> {
        self.map.take().map(Arc::new)
    }
}

/// Largest width and height of the map. In larger panoramas the points of evaluation may miss single bright texels;
/// these are sampled less often than ideal, but without bias.
const MOST_TEXELS: usize = 1024;

/// Fraction of the mean brightness added to every texel for sampling, so that each has a positive density.
const FLOOR: f32 = 0.02;

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
    fn new([width, height]: [usize; 2], mut radiance: impl FnMut(Vec3) -> Vec3) -> Option<Self> {
        let mut values = Vec::with_capacity(width * height);
        let mut total = 0.0_f64;
        let mut area = 0.0_f64;
        // Mean radiance at a position of the map.
        let mut at = |x: f32, y: f32| {
            let uv = [x / width as f32, y / height as f32];
            radiance(uv_to_direction(uv)).mean()
        };
        // Images are interpolated between texel centres, so take the largest value of a texel's corners and its
        // centre; narrow lights are then not missed.
        let mut corners = Vec::with_capacity(height + 1);
        for y in 0..=height {
            let row: Vec<f32> = (0..=width).map(|x| at(x as f32, y as f32)).collect();
            corners.push(row);
        }
        for y in 0..height {
            let cosine = latitude_cosine((y as f32 + 0.5) / height as f32);
            let low = std::mem::take(&mut corners[y]);
            let high = &corners[y + 1];
            for x in 0..width {
                let value = at(x as f32 + 0.5, y as f32 + 0.5)
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
                .map(|v| f64::from(v + FLOOR * mean));
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
    use super::super::sampler::PixelSampler;
    use super::*;

    fn spot(d: Vec3) -> Vec3 {
        let bright = d.dot(vec3(0.6, 0.0, 0.8)) > 0.97;
        Vec3::splat(if bright { 50.0 } else { 0.1 })
    }

    #[test]
    fn samples_have_the_density_that_is_said_and_integrate_the_map() {
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

    #[test]
    fn a_program_without_anything_varying_is_a_colour() {
        let params = WorldParams {
            color: [1.0, 2.0, 3.0],
            ..Default::default()
        };
        let mut world = World::new(&params, &[], &Varying::default()).unwrap();
        assert_eq!(world.constant(), Some(vec3(1.0, 2.0, 3.0)));
        assert!(world.take_map().is_none());
    }
}
