// SPDX-License-Identifier: GPL-3.0-or-later
//! Fresnel reflectance of dielectrics.

use std::sync::LazyLock;

/// Returns the unpolarised reflectance of a smooth dielectric boundary and the cosine of the refracted ray (0 under
/// total reflection). `eta`: index of the far side over that of the near side.
#[inline(always)]
pub fn dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let c = cos_i.abs().min(1.0);
    // Snell's law; a negative squared cosine means total reflection.
    let cos2_t = 1.0 - (1.0 - c * c) / (eta * eta);
    if cos2_t <= 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = cos2_t.sqrt();
    // Amplitudes of the s and p waves; unpolarised light takes the mean of their squares.
    let s = (c - eta * cos_t) / (c + eta * cos_t);
    let p = (eta * c - cos_t) / (eta * c + cos_t);
    (0.5 * (s * s + p * p), cos_t)
}

/// Lower bound of the reflectance where the reflection is tinted. For indices above 2 + √3 (or below the inverse)
/// the reflectance has a minimum between normal and grazing incidence; Cycles replaces values below that of normal
/// incidence by it.
pub fn min_reflectance(eta: f32) -> f32 {
    if (1.0 / TURN..=TURN).contains(&eta) {
        0.0
    } else {
        f0_from_ior(eta)
    }
}

/// Just below 2 + √3, where the minimum described at [`min_reflectance`] appears (derived from the Fresnel equations).
const TURN: f32 = 3.732;

/// Returns the reflectance of a dielectric at normal incidence.
pub fn f0_from_ior(eta: f32) -> f32 {
    let r = (eta - 1.0) / (eta + 1.0);
    r * r
}

/// Returns the index of refraction (at least 1) with this reflectance at normal incidence.
pub fn ior_from_f0(f0: f32) -> f32 {
    let r = f0.clamp(0.0, 0.99).sqrt();
    (1.0 + r) / (1.0 - r)
}

/// Returns the cosine-weighted mean of [`dielectric`] over the hemisphere, by the midpoint rule.
pub fn dielectric_mean(eta: f32) -> f32 {
    let n = 1024;
    let sum: f64 = (0..n)
        .map(|i| {
            let c = (f64::from(i) + 0.5) / f64::from(n);
            2.0 * c * f64::from(dielectric(c as f32, eta).0)
        })
        .sum();
    (sum / f64::from(n)) as f32
}

/// Like [`dielectric_mean`], interpolated from a table, for indices that vary from point to point; error below
/// 1e-3.
pub fn dielectric_mean_quick(eta: f32) -> f32 {
    // Even steps in (eta - 1) / (eta + 1), the amplitude at normal incidence; one table for each side of index 1.
    const LEVELS: usize = 512;
    static MEANS: LazyLock<[Vec<f32>; 2]> = LazyLock::new(|| {
        [false, true].map(|inverse| {
            (0..=LEVELS)
                .map(|i| {
                    let s = 0.99 * i as f32 / LEVELS as f32;
                    let eta = (1.0 + s) / (1.0 - s);
                    dielectric_mean(if inverse { 1.0 / eta } else { eta })
                })
                .collect()
        })
    });
    // Indices beyond the table's end use its last entry.
    let table = &MEANS[usize::from(eta < 1.0)];
    let x = ((eta - 1.0) / (eta + 1.0)).abs().min(0.99) / 0.99 * LEVELS as f32;
    let i = (x as usize).min(LEVELS - 1);
    table[i] + (x - i as f32) * (table[i + 1] - table[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_forms_hold() {
        assert!((dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-6);
        assert_eq!(dielectric(0.0, 1.5).0, 1.0);
        // At Brewster's angle only the s wave is reflected: ((eta² - 1)/(eta² + 1))² / 2.
        let brewster = 1.5_f32.atan().cos();
        let s = (1.25_f32 / 3.25).powi(2) * 0.5;
        assert!((dielectric(brewster, 1.5).0 - s).abs() < 1e-6);
        // Total reflection beyond the critical angle.
        assert_eq!(dielectric(0.5, 1.0 / 1.5), (1.0, 0.0));
        assert!((ior_from_f0(f0_from_ior(1.45)) - 1.45).abs() < 1e-5);
        // Both sides of a boundary reflect the same fraction.
        let (f, cos_t) = dielectric(0.6, 1.5);
        assert!((dielectric(cos_t, 1.0 / 1.5).0 - f).abs() < 1e-6);
    }

    #[test]
    fn the_quick_mean_is_the_mean() {
        for eta in [0.4, 0.7, 0.999, 1.001, 1.33, 1.5, 2.4] {
            let (quick, mean) = (dielectric_mean_quick(eta), dielectric_mean(eta));
            assert!((quick - mean).abs() < 1e-3, "{eta}: {quick} {mean}");
        }
    }

    #[test]
    fn the_mean_of_a_dielectric_agrees_with_the_closed_form_of_walsh_1926() {
        for eta in [1.1_f32, 1.3, 1.5, 2.0] {
            let n = f64::from(eta);
            let (n2, n4) = (n * n, n.powi(4));
            let walsh = 0.5
                + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
                + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
                - 2.0 * n.powi(3) * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
                + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
            let mean = f64::from(dielectric_mean(eta));
            assert!((mean - walsh).abs() < 1e-5, "{eta}: {mean} {walsh}");
            // The reflectance from inside follows from that within the critical cone: n² (1 - F) is equal on both
            // sides.
            let inside = f64::from(dielectric_mean(1.0 / eta));
            assert!(
                (inside - (1.0 - (1.0 - walsh) / n2)).abs() < 1e-3,
                "{eta}: {inside}"
            );
        }
    }
}
