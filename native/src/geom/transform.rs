// SPDX-License-Identifier: GPL-3.0-or-later
//! Where a mesh stands: an affine map from its own space to the scene's, and back with a bound on the
//! error.

use super::vec3::{Vec3, widen};

/// Columns shorter or longer than these powers of two are no scale that a scene has.
const SCALES: std::ops::RangeInclusive<f64> = 7.9e-31..=1.3e30;

/// Where the computed inverse is farther off than this, relative to it, the map counts as singular.
const WORST: f64 = 1.0 / 256.0;

/// Room for the roundings of a product of a matrix and a vector that is itself a difference.
const PRODUCT: f64 = 4.0 * f64::EPSILON;

/// `p -> linear p + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// The linear part, row by row.
    pub linear: [Vec3; 3],
    /// Where the origin goes.
    pub offset: Vec3,
}

impl Transform {
    /// From the upper three rows of a 4 x 4 matrix.
    pub fn from_rows(rows: [[f64; 4]; 3]) -> Self {
        Self {
            linear: rows.map(|row| [row[0], row[1], row[2]]),
            offset: rows.map(|row| row[3]),
        }
    }

    /// A point in the scene: computed in f64 in this very order, then rounded once. It is the definition
    /// of where an instance's corners are; whoever copies a mesh into the scene must round alike.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = widen(p);
        let coordinate = |k: usize| {
            let row = self.linear[k];
            (((x * row[0] + y * row[1]) + z * row[2]) + self.offset[k]) as f32
        };
        [coordinate(0), coordinate(1), coordinate(2)]
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let mut numbers = self.linear.as_flattened().iter().chain(&self.offset);
        numbers.all(|x| x.is_finite())
    }

    /// Whether front and back change places.
    pub fn is_mirrored(&self) -> bool {
        determinant(&self.columns().0) < 0.0
    }

    /// The linear part with columns of ordinary length, and the powers of two that they were divided by.
    fn columns(&self) -> ([Vec3; 3], Vec3) {
        let scale = [0, 1, 2].map(|k| {
            let longest = (self.linear.iter()).fold(0.0_f64, |most, row| most.max(row[k].abs()));
            power_of_two(longest)
        });
        let even = self.linear.map(|row| [0, 1, 2].map(|k| row[k] / scale[k]));
        (even, scale)
    }

    /// The way back; `None` where the map is singular or as good as that, or its scale is absurd.
    pub fn inverse(&self) -> Option<Inverse> {
        if !self.is_finite() || self.offset.iter().any(|x| x.abs() > f64::from(f32::MAX)) {
            return None;
        }
        let (even, scale) = self.columns();
        if !scale.iter().all(|s| SCALES.contains(s)) {
            return None;
        }
        let determinant = determinant(&even);
        let cofactor = |i: usize, j: usize| {
            let (a, b) = (&even[(j + 1) % 3], &even[(j + 2) % 3]);
            a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]
        };
        let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(i, j) / determinant));
        // How far rows * even is from one, and that again for the roundings of asking.
        let mut off = 0.0_f64;
        for (i, row) in rows.iter().enumerate() {
            let (mut sum, mut size) = (0.0, 0.0);
            for j in [0, 1, 2] {
                let terms = [0, 1, 2].map(|k| row[k] * even[k][j]);
                let one = f64::from(u8::from(i == j));
                sum += (one - terms.iter().sum::<f64>()).abs();
                size += terms.iter().map(|x| x.abs()).sum::<f64>() + one;
            }
            let lacks = sum + 4.0 * f64::EPSILON * size;
            if lacks.is_nan() || lacks > WORST {
                return None;
            }
            off = off.max(lacks);
        }
        // A^-1 = (1 - R)^-1 rows, where R is what rows * even lacks.
        let doubt = off / (1.0 - off);
        Some(Inverse { rows, scale, doubt })
    }
}

/// The way back of a [`Transform`]'s linear part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inverse {
    rows: [Vec3; 3],
    /// Powers of two by which the coordinates are divided in the end.
    scale: Vec3,
    /// A bound on the error of `rows` times any vector, relative to its largest component.
    doubt: f64,
}

impl Inverse {
    /// The vector that goes to `q`, and per coordinate a bound on its error; `q` may itself be a rounded
    /// difference.
    #[inline(always)]
    pub fn vector(&self, q: Vec3) -> (Vec3, Vec3) {
        let (mut out, mut size) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            let row = self.rows[k];
            let terms = [row[0] * q[0], row[1] * q[1], row[2] * q[2]];
            out[k] = terms[0] + terms[1] + terms[2];
            size[k] = terms[0].abs() + terms[1].abs() + terms[2].abs();
        }
        let common = self.doubt * out[0].abs().max(out[1].abs()).max(out[2].abs());
        let mut error = [0.0; 3];
        for k in 0..3 {
            out[k] /= self.scale[k];
            error[k] = (common * (1.0 + 1e-6) + PRODUCT * size[k]) / self.scale[k];
        }
        (out, error)
    }

    /// How far the vectors that go to vectors of at most these components can reach.
    pub fn reach(&self, most: Vec3) -> Vec3 {
        let sums = self.rows.map(|row| {
            let terms = [0, 1, 2].map(|k| row[k].abs() * most[k]);
            terms.iter().sum::<f64>()
        });
        let common = self.doubt * sums[0].max(sums[1]).max(sums[2]);
        [0, 1, 2].map(|k| (sums[k] + common) * (1.0 + 1e-6) / self.scale[k])
    }
}

fn determinant([a, b, c]: &[Vec3; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// The largest power of two not above `x`, for normal numbers; 0 for all others.
#[inline(always)]
pub fn power_of_two(x: f64) -> f64 {
    if x.is_normal() && x > 0.0 {
        f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::vec3::dot;
    use proptest::prelude::*;

    fn entry() -> impl Strategy<Value = f64> {
        prop_oneof![(-2i8..3).prop_map(f64::from), -1.0f64..1.0]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(10_000))]
        #[test]
        fn the_way_back_is_within_its_bound(
            rows in [[entry(), entry(), entry()], [entry(), entry(), entry()], [entry(), entry(), entry()]],
            powers in [-14i32..14, -14i32..14, -14i32..14],
            p in [-100i32..100, -100i32..100, -100i32..100],
        ) {
            // The forward products are exact: few bits, or rounded to few.
            let linear = rows.map(|row| [0, 1, 2].map(|k| {
                (row[k] * 1024.0).round() / 1024.0 * 2.0_f64.powi(powers[k])
            }));
            let transform = Transform { linear, offset: [0.0; 3] };
            let p = p.map(f64::from);
            if let Some(inverse) = transform.inverse() {
                let (found, error) = inverse.vector(linear.map(|row| dot(row, p)));
                for k in 0..3 {
                    prop_assert!((found[k] - p[k]).abs() <= error[k], "{found:?} {p:?} {error:?}");
                }
            }
        }
    }

    #[test]
    fn the_singular_and_the_absurd_have_no_way_back() {
        let with = |linear| Transform {
            linear,
            offset: [0.0; 3],
        };
        let diagonal = |a, b, c| with([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]);
        assert!(diagonal(1e-4, 1.0, 1e4).inverse().is_some());
        assert!(diagonal(1.0, 0.0, 1.0).inverse().is_none());
        assert!(diagonal(1.0, 1e-60, 1.0).inverse().is_none());
        assert!(diagonal(f64::NAN, 1.0, 1.0).inverse().is_none());
        assert!(diagonal(f64::INFINITY, 1.0, 1.0).inverse().is_none());
        let flat = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [5.0, 7.0, 9.0]];
        assert!(with(flat).inverse().is_none());
        let nearly = [[1.0, 0.0, 0.0], [0.0, 0.1, 0.3], [0.0, 0.2, 0.6 + 1e-15]];
        assert!(with(nearly).inverse().is_none());
    }
}
