// SPDX-License-Identifier: GPL-3.0-or-later
//! Voxels: numbers or colours on a regular lattice in the space of an object.

use crate::check::{Error, Result, finite};
use crate::math::vector::Vec3;
use crate::values::program::Value;

/// Voxels along each axis of a block.
const BLOCK: usize = 8;

/// A dense lattice of values. Outside of it, values are 0.
#[derive(Debug, Clone, Default)]
pub struct Voxels {
    /// Number of voxels along each axis.
    size: [usize; 3],
    /// Numbers of each voxel, 1 or 3.
    channels: usize,
    /// Voxel by voxel; the last axis is contiguous.
    values: Vec<f32>,
    /// The largest value of each block of voxels, by channel.
    blocks: Vec<Vec3>,
    /// Object space to the lattice, whose voxels lie at whole numbers; rows.
    to_index: [[f32; 4]; 3],
}

impl Voxels {
    /// A lattice of these values; those that are not finite become 0. `name`: for messages.
    ///
    /// # Errors
    /// [`Error::Shape`] if the numbers do not match the size, [`Error::NonFinite`] for the matrix.
    pub fn new(
        size: [usize; 3],
        channels: usize,
        mut values: Vec<f32>,
        to_index: [[f32; 4]; 3],
        name: &str,
    ) -> Result<Self> {
        let count = size.iter().try_fold(channels, |n, &k| n.checked_mul(k));
        if count != Some(values.len()) || ![1, 3].contains(&channels) {
            return Err(Error::Shape(format!(
                "{name}['values']: expected {size:?} voxels of 1 or 3 numbers, got {} numbers",
                values.len()
            )));
        }
        finite(to_index.as_flattened(), || format!("{name}['to_index']"))?;
        values
            .iter_mut()
            .filter(|v| !v.is_finite())
            .for_each(|v| *v = 0.0);
        let mut voxels = Self {
            size,
            channels,
            values,
            to_index,
            blocks: Vec::new(),
        };
        voxels.find_blocks();
        Ok(voxels)
    }

    /// Finds the largest value of each block.
    fn find_blocks(&mut self) {
        let [l, m, n] = self.size.map(|k| k.div_ceil(BLOCK));
        let mut blocks = vec![Vec3::splat(f32::MIN); l * m * n];
        for x in 0..self.size[0] {
            for y in 0..self.size[1] {
                for z in 0..self.size[2] {
                    let block = &mut blocks[((x / BLOCK) * m + y / BLOCK) * n + z / BLOCK];
                    *block = larger(*block, self.value([x, y, z]));
                }
            }
        }
        self.blocks = blocks;
    }

    /// Returns the value at a position in object space, interpolated between the eight voxels around it; the fourth
    /// component is 1.
    pub fn at(&self, p: Vec3) -> Value {
        let place = self.place(p);
        let base = place.map(f32::floor);
        let mut sum = Vec3::ZERO;
        // Add up the corners of the cell by their weights.
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = [0.0; 3];
            for axis in 0..3 {
                let share = place[axis] - base[axis];
                let upper = corner >> axis & 1 == 1;
                weight *= if upper { share } else { 1.0 - share };
                index[axis] = base[axis] + f32::from(u8::from(upper));
            }
            if weight > 0.0 {
                sum += self.voxel(index) * weight;
            }
        }
        [sum.x, sum.y, sum.z, 1.0]
    }

    /// Returns the largest value, by channel, near a position in object space: within the share `1 / parts` of the
    /// lattice's extent to both sides along each axis.
    pub fn largest(&self, p: Vec3, parts: f32) -> Value {
        let place = self.place(p);
        let mut largest = Vec3::splat(f32::MIN);
        let mut range = [(0, 0); 3];
        for axis in 0..3 {
            let reach = self.size[axis] as f32 / parts + 1.0;
            let end = self.size[axis] as f32;
            let low = (place[axis] - reach).floor().clamp(0.0, end) as usize;
            let high = (place[axis] + reach).ceil().clamp(-1.0, end - 1.0) + 1.0;
            range[axis] = (low, high as usize);
            // Outside, values are 0.
            if place[axis] - reach < 0.0 || place[axis] + reach > end - 1.0 {
                largest = Vec3::ZERO;
            }
        }
        // Whole blocks stand for their voxels, of which some lie a little farther away.
        let blocks = range.map(|(low, high)| (low / BLOCK)..high.div_ceil(BLOCK));
        let [.., m, n] = self.size.map(|k| k.div_ceil(BLOCK));
        for x in blocks[0].clone() {
            for y in blocks[1].clone() {
                for z in blocks[2].clone() {
                    largest = larger(largest, self.blocks[(x * m + y) * n + z]);
                }
            }
        }
        [largest.x, largest.y, largest.z, 1.0]
    }

    /// Returns a position in the lattice; far outside for one that is not finite.
    fn place(&self, p: Vec3) -> [f32; 3] {
        self.to_index
            .map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3])
            .map(|x| if x.is_finite() { x } else { -1e6 })
    }

    /// Returns a voxel by whole numbers; 0 outside.
    fn voxel(&self, index: [f32; 3]) -> Vec3 {
        let inside = (0..3).all(|k| (0.0..self.size[k] as f32).contains(&index[k]));
        if inside {
            self.value(index.map(|x| x as usize))
        } else {
            Vec3::ZERO
        }
    }

    /// Returns a voxel.
    fn value(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        let first = ((x * self.size[1] + y) * self.size[2] + z) * self.channels;
        match &self.values[first..first + self.channels] {
            [r, g, b] => Vec3::from([*r, *g, *b]),
            [v, ..] => Vec3::splat(*v),
            [] => Vec3::ZERO,
        }
    }
}

/// Returns the larger value of each channel.
fn larger(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::from([a.x.max(b.x), a.y.max(b.y), a.z.max(b.z)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    fn voxels(channels: usize) -> Voxels {
        let size = [2, 3, 4];
        let values = (0..24 * channels).map(|i| i as f32).collect();
        let to_index = [
            [2.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        Voxels::new(size, channels, values, to_index, "grids[0]").unwrap()
    }

    #[test]
    fn values_are_interpolated_and_end_at_the_edges() {
        let one = voxels(1);
        // Index (1, 1, 2) is number (1 * 3 + 1) * 4 + 2.
        assert_eq!(one.at(vec3(0.5, 0.0, 2.0)), [18.0, 18.0, 18.0, 1.0]);
        assert_eq!(one.at(vec3(0.25, 0.5, 2.5))[0], 6.0 + 6.0 + 2.0 + 0.5);
        assert_eq!(one.at(vec3(0.75, 0.0, 2.0))[0], 9.0);
        assert_eq!(one.at(vec3(9.0, f32::NAN, 0.0)), [0.0, 0.0, 0.0, 1.0]);
        let three = voxels(3);
        assert_eq!(three.at(vec3(0.0, -1.0, 1.0)), [3.0, 4.0, 5.0, 1.0]);
    }

    #[test]
    fn no_interpolated_value_nearby_exceeds_the_largest() {
        let one = voxels(1);
        for i in 0..200 {
            let p = vec3(
                (i % 7) as f32 * 0.15 - 0.2,
                (i % 11) as f32 * 0.4 - 1.5,
                i as f32 * 0.03 - 1.0,
            );
            let [largest, ..] = one.largest(p, 8.0);
            for shift in [-0.12, 0.0, 0.12] {
                let near = p + vec3(shift, shift * 2.0, shift * 3.0);
                assert!(one.at(near)[0] <= largest, "{p:?}");
            }
        }
    }

    #[test]
    fn wrong_sizes_are_named() {
        let wrong = Voxels::new([2, 2, 2], 1, vec![0.0; 7], [[0.0; 4]; 3], "grids[4]");
        assert!(
            wrong
                .unwrap_err()
                .to_string()
                .contains("grids[4]['values']")
        );
        let huge = Voxels::new([usize::MAX, 2, 2], 1, vec![], [[0.0; 4]; 3], "g");
        assert!(huge.is_err());
    }
}
