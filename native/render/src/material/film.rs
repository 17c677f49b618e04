// SPDX-License-Identifier: GPL-3.0-or-later
//! Interference in a thin film over a boundary: Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for
//! the Modeling of Varying Iridescence". The reflectance is the Airy sum as a series of cosines of the phase, each
//! integrated over the spectrum by a table of the Fourier transform of the colour matching functions.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};
use crate::values::spectrum::coherence;

/// Thinnest film that counts, in nm, as in Cycles.
pub const THINNEST: f32 = 0.1;

/// Terms of the series; each is smaller by the amplitude of one more passage.
const TERMS: usize = 3;

/// A complex number.
#[derive(Debug, Clone, Copy)]
struct Complex {
    re: f32,
    im: f32,
}

impl Complex {
    const fn real(re: f32) -> Self {
        Self { re, im: 0.0 }
    }

    /// The square root in the right half plane.
    fn sqrt(self) -> Self {
        let length = self.re.hypot(self.im);
        let re = (0.5 * (length + self.re)).max(0.0).sqrt();
        let im = (0.5 * (length - self.re)).max(0.0).sqrt().copysign(self.im);
        Self { re, im }
    }

    fn length2(self) -> f32 {
        self.re * self.re + self.im * self.im
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self {
            re: self.re + b.re,
            im: self.im + b.im,
        }
    }
}

impl Neg for Complex {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            re: -self.re,
            im: -self.im,
        }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Self {
            re: self.re * b.re - self.im * b.im,
            im: self.re * b.im + self.im * b.re,
        }
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let scale = 1.0 / b.length2().max(1e-30);
        let conjugate = Self {
            re: b.re * scale,
            im: -b.im * scale,
        };
        self * conjugate
    }
}

/// A thin film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Film {
    /// Thickness in nm.
    pub thickness: f32,
    /// Index of refraction relative to the side of the viewer.
    pub index: f32,
}

/// Amplitudes of reflection of the s and p waves at a boundary, and the cosine behind it. `from` and `to`: indices of
/// both sides; `to` may be complex.
fn amplitudes(cos: Complex, from: f32, to: Complex) -> ([Complex; 2], Complex) {
    let one = Complex::real(1.0);
    let from = Complex::real(from);
    let ratio = from / to;
    let cos_t = (one - ratio * ratio * (one - cos * cos)).sqrt();
    let s = (from * cos - to * cos_t) / (from * cos + to * cos_t);
    let p = (to * cos - from * cos_t) / (to * cos + from * cos_t);
    ([s, p], cos_t)
}

impl Film {
    /// A film seen from a side of index 1.
    pub fn new(thickness: f32, index: f32) -> Self {
        Self {
            thickness: thickness.min(1e6),
            index: index.clamp(1e-3, 1e3),
        }
    }

    /// Returns the reflectance of the film over a dielectric of index `eta`, relative to the viewer's side, at a cosine.
    pub fn over_dielectric(&self, cos: f32, eta: f32) -> Vec3 {
        let (below, _) = self.below(cos, Complex::real(eta));
        self.series(cos, |_| below)
    }

    /// Like [`Self::over_dielectric`], multiplied by `tint` as far as the reflectance does not exceed that of the bare
    /// boundary at normal incidence, as in Cycles.
    pub fn tinted(&self, cos: f32, eta: f32, tint: Vec3) -> Vec3 {
        let f = self.over_dielectric(cos, eta);
        if tint == Vec3::ONE {
            return f;
        }
        let own = fresnel::f0_from_ior(eta);
        let white = f.map(|f| ((f - own) / (1.0 - own).max(1e-6)).clamp(0.0, 1.0));
        (f * (tint * (Vec3::ONE - white) + white)).map(|f| f.min(1.0))
    }

    /// Returns the reflectance of the film over a conductor of indices `n` and extinction coefficients `k`.
    pub fn over_conductor(&self, cos: f32, n: Vec3, k: Vec3) -> Vec3 {
        let ([n, k], mut below) = ([n.array(), k.array()], [[Complex::real(0.0); 2]; 3]);
        for c in 0..3 {
            (below[c], _) = self.below(cos, Complex { re: n[c], im: k[c] });
        }
        self.series(cos, |c| below[c])
    }

    /// Returns the amplitudes at the lower boundary, and the cosine within the film; 0 under total reflection.
    fn below(&self, cos: f32, base: Complex) -> ([Complex; 2], f32) {
        let inside = self.inside(cos);
        let (amplitudes, _) = amplitudes(Complex::real(inside), self.index, base);
        (amplitudes, inside)
    }

    /// Returns the cosine within the film; 0 under total reflection at its upper boundary.
    fn inside(&self, cos: f32) -> f32 {
        let ratio = 1.0 / self.index;
        (1.0 - ratio * ratio * (1.0 - cos * cos)).max(0.0).sqrt()
    }

    /// Sums the series. `below`: amplitudes at the lower boundary for each channel.
    fn series(&self, cos: f32, below: impl Fn(usize) -> [Complex; 2]) -> Vec3 {
        let cos = cos.abs().clamp(1e-4, 1.0);
        let inside = self.inside(cos);
        if inside <= 0.0 {
            return Vec3::ONE;
        }
        let (above, _) = amplitudes(Complex::real(cos), 1.0, Complex::real(self.index));
        // Difference of the optical paths of successive reflections, in nm.
        let difference = 2.0 * self.index * self.thickness * inside;
        let spectra: [[[f32; 2]; 3]; TERMS] =
            std::array::from_fn(|m| coherence(difference * (m + 1) as f32));
        let channel = |c: usize| {
            let mut total = 0.0;
            for (above, below) in above.iter().zip(below(c)) {
                // Energies of the upper and lower boundary, and the phasor of one more passage.
                let (r12, r23) = (above.re * above.re, below.length2().min(1.0));
                let passage = -*above * below;
                let t = 1.0 - r12;
                let back = t * t * r23 / (1.0 - r12 * r23).max(1e-6);
                let mut sum = r12 + back;
                let mut phasor = Complex::real(1.0);
                for spectrum in &spectra {
                    phasor = phasor * passage;
                    let [re, im] = spectrum[c];
                    // C_m = R_s - T121 for the amplitudes' product of power m.
                    sum += 2.0 * (back - t) * (phasor.re * re - phasor.im * im);
                }
                total += 0.5 * sum;
            }
            total.clamp(0.0, 1.0)
        };
        vec3(channel(0), channel(1), channel(2))
    }
}

/// Returns indices and extinction coefficients of a conductor with the reflectance `f0` at normal incidence: Gulbrandsen
/// 2014, "Artist Friendly Metallic Fresnel", eq. 5 and 6, with the reflectance at the edge as its edge tint, as in
/// Cycles.
pub fn indices_of(f0: Vec3, edge: Vec3) -> [Vec3; 2] {
    let mut found = [[0.0; 3]; 2];
    for (c, (f0, edge)) in f0.array().into_iter().zip(edge.array()).enumerate() {
        let (r, edge) = (f0.clamp(0.0, 0.9999), edge.clamp(0.0, 1.0));
        let (least, most) = ((1.0 - r) / (1.0 + r), (1.0 + r.sqrt()) / (1.0 - r.sqrt()));
        let n = edge * least + (1.0 - edge) * most;
        let k2 = (r * (n + 1.0) * (n + 1.0) - (n - 1.0) * (n - 1.0)) / (1.0 - r);
        (found[0][c], found[1][c]) = (n, k2.max(0.0).sqrt());
    }
    found.map(Vec3::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::closure::conductor;

    #[test]
    fn a_film_of_the_index_of_a_side_changes_nothing() {
        for cos in [0.2, 0.7, 1.0] {
            let bare = fresnel::dielectric(cos, 1.5).0;
            for index in [1.0, 1.5] {
                let film = Film::new(400.0, index).over_dielectric(cos, 1.5);
                assert!(
                    (film - Vec3::splat(bare)).max_abs() < 2e-3,
                    "{cos} {index}: {film:?}"
                );
            }
            let thin = Film::new(0.2, 1.8).over_dielectric(cos, 1.5);
            assert!(
                (thin - Vec3::splat(bare)).max_abs() < 5e-3,
                "{cos}: {thin:?}"
            );
        }
    }

    #[test]
    fn a_quarter_wave_of_the_geometric_mean_hardly_reflects() {
        // 550 nm / 4 / √1.5 over glass; green is dark, and the mean over the spectrum above it.
        let film = Film::new(112.3, 1.5_f32.sqrt());
        let [r, g, b] = film.over_dielectric(1.0, 1.5).array();
        assert!(g < 0.004 && r > g && b > g, "{r} {g} {b}");
        // Incoherent thick films add energies: R12 + T² R23 / (1 - R12 R23).
        let thick = Film::new(5e5, 1.3).over_dielectric(1.0, 2.0);
        let (a, b) = (fresnel::f0_from_ior(1.3), fresnel::f0_from_ior(2.0 / 1.3));
        let want = a + (1.0 - a).powi(2) * b / (1.0 - a * b);
        assert!((thick - Vec3::splat(want)).max_abs() < 1e-4);
    }

    #[test]
    fn a_conductor_below_no_film_is_bare_and_indices_are_found() {
        let (n, k) = (vec3(0.2, 0.9, 1.5), vec3(3.9, 2.4, 1.9));
        for cos in [0.1, 0.5, 1.0] {
            let film = Film::new(300.0, 1.0).over_conductor(cos, n, k);
            assert!(
                (film - conductor(cos, n, k)).max_abs() < 2e-3,
                "{cos}: {film:?}"
            );
        }
        let f0 = vec3(0.9, 0.5, 0.04);
        for edge in [0.0, 0.4, 1.0] {
            let [n, k] = indices_of(f0, Vec3::splat(edge));
            assert!(
                (conductor(1.0, n, k) - f0).max_abs() < 1e-4,
                "{edge}: {n:?} {k:?}"
            );
        }
    }

    #[test]
    fn odd_films_reflect_between_nothing_and_all() {
        for thickness in [0.0, 1e-3, 35.0, 1e9, f32::INFINITY] {
            for index in [0.0, 0.5, 1.0, 1e6] {
                for cos in [0.0, 1e-3, 0.5, 1.0] {
                    let film = Film::new(thickness, index);
                    for f in [
                        film.over_dielectric(cos, 0.4),
                        film.over_dielectric(cos, 50.0),
                        film.over_conductor(cos, Vec3::ZERO, Vec3::splat(1e4)),
                    ] {
                        assert!(f.array().iter().all(|x| (0.0..=1.0).contains(x)), "{f:?}");
                    }
                }
            }
        }
    }
}
