// SPDX-License-Identifier: GPL-3.0-or-later
//! Candidate rotations of the boxes of a node, and heights of points along their rows.

use halfspace_geom::vec3::{Vec3, cross, length, sub};
use halfspace_nodes::obb_tree::Rotation;

/// Number of rotations in the fixed set.
pub const FIXED: usize = 26;

/// The fixed set: first the rotations about one axis, then those about diagonals of faces, then of the cube.
pub fn fixed() -> Vec<Rotation> {
    let steps = || -1..=1_i8;
    let all = steps().flat_map(|i| steps().flat_map(move |j| steps().map(move |k| [i, j, k])));
    let nonzero = |v: &[i8; 3]| v.iter().filter(|x| **x != 0).count();
    let mut vectors: Vec<_> = all.filter(|v| nonzero(v) > 0).collect();
    vectors.sort_by_key(nonzero);
    vectors.into_iter().map(by_quaternion).collect()
}

/// The rotation by the quaternion `(4, x, y, z)`.
fn by_quaternion(v: [i8; 3]) -> Rotation {
    let (w, [x, y, z]) = (4.0, v.map(f64::from));
    let s = 2.0 / (w * w + x * x + y * y + z * z);
    rounded([
        [
            1.0 - s * (y * y + z * z),
            s * (x * y - w * z),
            s * (x * z + w * y),
        ],
        [
            s * (x * y + w * z),
            1.0 - s * (x * x + z * z),
            s * (y * z - w * x),
        ],
        [
            s * (x * z - w * y),
            s * (y * z + w * x),
            1.0 - s * (x * x + y * y),
        ],
    ])
}

/// The rotation to a triangle: its longest edge, the perpendicular direction in its plane, and its normal. `None` if
/// the triangle is so small or so narrow that f64 finds no normal.
pub fn to_triangle([a, b, c]: [Vec3; 3]) -> Option<Rotation> {
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let longest = edges
        .into_iter()
        .reduce(|e, f| if length(f) > length(e) { f } else { e })?;
    let along = unit(longest)?;
    let normal = unit(cross(edges[0], edges[1]))?;
    let across = unit(cross(normal, along))?;
    Some(rounded([along, across, cross(along, across)]))
}

fn unit(v: Vec3) -> Option<Vec3> {
    let size = length(v);
    (size.is_normal()).then(|| v.map(|x| x / size))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "bounds hold for the rows as rounded"
)]
fn rounded(rows: [Vec3; 3]) -> Rotation {
    Rotation::new(rows.map(|row| row.map(|x| x as f32)))
}

/// The rows of some rotations, stored component by component, so that one loop computes all heights of a point.
pub struct Rows {
    /// The rotations.
    pub rotations: Vec<Rotation>,
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Rows {
    /// The rows of these rotations.
    pub fn new(rotations: &[Rotation]) -> Self {
        let component = |i: usize| {
            let rows = rotations
                .iter()
                .flat_map(|r| [r.row(0), r.row(1), r.row(2)]);
            rows.map(|row| f64::from(row[i])).collect()
        };
        Self {
            rotations: rotations.to_vec(),
            x: component(0),
            y: component(1),
            z: component(2),
        }
    }

    /// The heights of no points.
    pub fn nothing(&self) -> Heights {
        Heights {
            low: vec![f64::INFINITY; self.x.len()],
            high: vec![f64::NEG_INFINITY; self.x.len()],
        }
    }

    /// Extends intervals of heights to those of a point.
    pub fn grow(&self, heights: &mut Heights, [x, y, z]: Vec3) {
        let rows = self.x.iter().zip(&self.y).zip(&self.z);
        let ends = heights.low.iter_mut().zip(&mut heights.high);
        for (((a, b), c), (low, high)) in rows.zip(ends) {
            let height = a * x + b * y + c * z;
            *low = if height < *low { height } else { *low };
            *high = if height > *high { height } else { *high };
        }
    }
}

/// Intervals of heights along the rows of some rotations, in f64.
#[derive(Clone)]
pub struct Heights {
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Heights {
    /// Extends the intervals to those of `other`.
    pub fn join(&mut self, other: &Self) {
        for (low, x) in self.low.iter_mut().zip(&other.low) {
            *low = low.min(*x);
        }
        for (high, x) in self.high.iter_mut().zip(&other.high) {
            *high = high.max(*x);
        }
    }

    /// The intervals along the three rows of rotation `i`.
    pub fn of(&self, i: usize) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|k: usize| [self.low[3 * i + k], self.high[3 * i + k]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_geom::vec3::{dot, widen};

    fn angles_are_right(rotation: &Rotation) -> bool {
        let rows = [0, 1, 2].map(|k: usize| widen(rotation.row(k)));
        rotation.is_sound()
            && (0..3).all(|i| {
                let (same, next) = (dot(rows[i], rows[i]), dot(rows[i], rows[(i + 1) % 3]));
                (same - 1.0).abs() < 1e-6 && next.abs() < 1e-6
            })
    }

    #[test]
    fn the_fixed_set_holds_rotations_that_differ() {
        let all = fixed();
        assert_eq!(all.len(), FIXED);
        for (i, rotation) in all.iter().enumerate() {
            assert!(angles_are_right(rotation), "{rotation:?}");
            assert!(*rotation != Rotation::AXES && !all[..i].contains(rotation));
        }
    }

    #[test]
    fn a_triangle_lies_flat_in_its_own_rotation() {
        let corners = [[1.0, 2.0, 3.0], [7.0, 2.5, 5.0], [3.0, 6.0, 4.0]];
        let rotation = to_triangle(corners).unwrap();
        assert!(angles_are_right(&rotation));
        let heights = corners.map(|p| dot(widen(rotation.row(2)), p));
        assert!(heights.iter().all(|h| (h - heights[0]).abs() < 1e-5));
        assert!(to_triangle([corners[0]; 3]).is_none());
    }
}
