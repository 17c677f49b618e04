// SPDX-License-Identifier: GPL-3.0-or-later
//! Transform of an instance: an affine map from the mesh's space to the scene's, and its inverse with an error bound.

use crate::vec3::{Vec3, widen};

/// Accepted scales of columns, about 2^-100 to 2^100 (chosen): no scene has others.
const SCALES: std::ops::RangeInclusive<f64> = 7.9e-31..=1.3e30;

/// Largest residual of the computed inverse (chosen); a map with a larger one counts as singular.
const SINGULAR: f64 = 1.0 / 256.0;

/// Relative rounding error of a product of a matrix and a vector that is itself a rounded difference.
const PRODUCT: f64 = 4.0 * f64::EPSILON;

/// The affine map `p -> linear p + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Linear part, by rows.
    pub linear: [Vec3; 3],
    /// Image of the origin.
    pub offset: Vec3,
}

impl Transform {
    /// Makes a transform from the upper three rows of a 4 x 4 matrix.
    pub fn from_rows(rows: [[f64; 4]; 3]) -> Self {
        Self {
            linear: rows.map(|row| [row[0], row[1], row[2]]),
            offset: rows.map(|row| row[3]),
        }
    }

    /// Transforms a point to the scene: computed in f64 in exactly this order, then rounded once. This defines the
    /// vertices of an instance; code that copies a mesh into the scene must round the same way.
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

    /// Returns whether all entries are finite.
    pub fn is_finite(&self) -> bool {
        let mut numbers = self.linear.as_flattened().iter().chain(&self.offset);
        numbers.all(|x| x.is_finite())
    }

    /// Returns whether the map swaps front and back.
    pub fn is_mirrored(&self) -> bool {
        determinant(&self.columns().0) < 0.0
    }

    /// Returns the linear part with each column divided by a power of two, so that its largest entry lies in [1, 2),
    /// and these powers.
    fn columns(&self) -> ([Vec3; 3], Vec3) {
        // Powers of two scale exactly.
        let scale = [0, 1, 2].map(|k| {
            let largest = (self.linear.iter()).fold(0.0_f64, |most, row| most.max(row[k].abs()));
            power_of_two(largest)
        });
        let scaled = self.linear.map(|row| [0, 1, 2].map(|k| row[k] / scale[k]));
        (scaled, scale)
    }

    /// Returns the inverse; `None` if the map is nearly singular, not finite, or its scale is out of range.
    pub fn inverse(&self) -> Option<Inverse> {
        if !self.is_finite() || self.offset.iter().any(|x| x.abs() > f64::from(f32::MAX)) {
            return None;
        }
        let (scaled, scale) = self.columns();
        if !scale.iter().all(|s| SCALES.contains(s)) {
            return None;
        }
        // Invert the scaled matrix by cofactors.
        let determinant = determinant(&scaled);
        let cofactor = |i: usize, j: usize| {
            let (a, b) = (&scaled[(j + 1) % 3], &scaled[(j + 2) % 3]);
            a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]
        };
        let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(i, j) / determinant));
        // Bound the residual 1 - rows * scaled in the maximum norm, its own rounding error included.
        let mut largest = 0.0_f64;
        for (i, row) in rows.iter().enumerate() {
            let (mut sum, mut size) = (0.0, 0.0);
            for j in [0, 1, 2] {
                let terms = [0, 1, 2].map(|k| row[k] * scaled[k][j]);
                let one = f64::from(u8::from(i == j));
                sum += (one - terms.iter().sum::<f64>()).abs();
                size += terms.iter().map(|x| x.abs()).sum::<f64>() + one;
            }
            let residual = sum + 4.0 * f64::EPSILON * size;
            if residual.is_nan() || residual > SINGULAR {
                return None;
            }
            largest = largest.max(residual);
        }
        // The exact inverse is (1 - R)^-1 rows, where R is the residual, so it differs from `rows` by at most the
        // factor |R| / (1 - |R|).
        let error = largest / (1.0 - largest);
        Some(Inverse {
            rows,
            unscale: scale.map(|s| 1.0 / s),
            error,
        })
    }
}

/// Inverse of the linear part of a [`Transform`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inverse {
    rows: [Vec3; 3],
    /// Powers of two by which the coordinates are finally multiplied.
    unscale: Vec3,
    /// Bound on the error of the product of `rows` and any vector, relative to the product's largest component.
    error: f64,
}

impl Inverse {
    /// Returns the vector that the map transforms to `q`, and its error bound per coordinate. `q` may itself be a
    /// rounded difference.
    #[inline(always)]
    pub fn vector(&self, q: Vec3) -> (Vec3, Vec3) {
        let (mut out, mut size) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            let row = self.rows[k];
            // Sum of the terms, and of their sizes for the error bound.
            let terms = [row[0] * q[0], row[1] * q[1], row[2] * q[2]];
            out[k] = terms[0] + terms[1] + terms[2];
            size[k] = terms[0].abs() + terms[1].abs() + terms[2].abs();
        }
        // Add the error of the inverse and that of the product.
        let common = self.error * out[0].abs().max(out[1].abs()).max(out[2].abs());
        let mut error = [0.0; 3];
        for k in 0..3 {
            out[k] *= self.unscale[k];
            error[k] = (common * (1.0 + 1e-6) + PRODUCT * size[k]) * self.unscale[k];
        }
        (out, error)
    }

    /// Returns bounds on the absolute components of all vectors that the map transforms to vectors with absolute
    /// components of at most `most`.
    pub fn reach(&self, most: Vec3) -> Vec3 {
        let sums = self.rows.map(|row| {
            let terms = [0, 1, 2].map(|k| row[k].abs() * most[k]);
            terms.iter().sum::<f64>()
        });
        let common = self.error * sums[0].max(sums[1]).max(sums[2]);
        [0, 1, 2].map(|k| (sums[k] + common) * (1.0 + 1e-6) * self.unscale[k])
    }
}

/// Returns the determinant of three rows.
fn determinant([a, b, c]: &[Vec3; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// Returns the largest power of two that is at most `x`, for positive normal numbers; 0 for all others.
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
    use crate::vec3::dot;
    use proptest::prelude::*;

    fn entry() -> impl Strategy<Value = f64> {
        prop_oneof![(-2i8..3).prop_map(f64::from), -1.0f64..1.0]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(10_000))]
        #[test]
        fn the_inverse_is_within_its_error_bound(
            rows in [[entry(), entry(), entry()], [entry(), entry(), entry()], [entry(), entry(), entry()]],
            powers in [-14i32..14, -14i32..14, -14i32..14],
            p in [-100i32..100, -100i32..100, -100i32..100],
        ) {
            // The products with the map are exact: all factors have few bits.
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
    fn singular_and_extreme_transforms_have_no_inverse() {
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
