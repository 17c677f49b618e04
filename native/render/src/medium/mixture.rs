// SPDX-License-Identifier: GPL-3.0-or-later
//! The media at a point, added up.

use crate::math::vector::Vec3;
use crate::medium::phase;

/// A part of a mixture that scatters.
#[derive(Debug, Clone, Copy)]
pub struct Lobe {
    /// Scattering coefficient.
    pub scattering: Vec3,
    /// Anisotropy within the limits of [`phase::clamped`].
    pub anisotropy: f32,
}

/// The media at a point, added up.
#[derive(Debug, Clone, Default)]
pub struct Mixture {
    /// Extinction coefficient.
    pub extinction: Vec3,
    /// Radiance emitted per unit of length.
    pub emission: Vec3,
    scattering: Vec3,
    lobes: Vec<Lobe>,
}

impl Mixture {
    /// Empties the mixture and keeps its memory.
    pub fn clear(&mut self) {
        self.extinction = Vec3::ZERO;
        self.emission = Vec3::ZERO;
        self.scattering = Vec3::ZERO;
        self.lobes.clear();
    }

    /// Adds a lobe, whose extinction has to be added separately.
    pub fn scatter(&mut self, lobe: Lobe) {
        if lobe.scattering != Vec3::ZERO {
            self.scattering += lobe.scattering;
            self.lobes.push(lobe);
        }
    }

    /// Returns the scattering coefficient.
    pub fn scattering(&self) -> Vec3 {
        self.scattering
    }

    /// Returns the share of extinction that is scattered, by channel.
    pub fn albedo(&self) -> Vec3 {
        divided(self.scattering, self.extinction)
    }

    /// Returns the phase function at this cosine, by channel, and the density with which [`Self::sample`] finds it.
    pub fn phase(&self, cos: f32) -> (Vec3, f32) {
        // A single lobe, which most media have, is its own density exactly.
        if let [lobe] = self.lobes[..] {
            let density = phase::density(lobe.anisotropy, cos);
            return (Vec3::splat(density), density);
        }
        let (mut value, mut density) = (Vec3::ZERO, 0.0);
        for lobe in &self.lobes {
            let p = phase::density(lobe.anisotropy, cos);
            value += lobe.scattering * p;
            density += lobe.scattering.mean() * p;
        }
        let total = self.scattering.mean().max(f32::MIN_POSITIVE);
        (divided(value, self.scattering), density / total)
    }

    /// Returns a direction after scattering of the unit direction `d`. `choice`, `u`: random numbers in [0, 1).
    pub fn sample(&self, d: Vec3, choice: f32, u: [f32; 2]) -> Vec3 {
        // Choose a lobe by its mean coefficient; rounding at the end keeps the last one.
        let mut left = choice * self.scattering.mean();
        let mut anisotropy = 0.0;
        for lobe in &self.lobes {
            anisotropy = lobe.anisotropy;
            left -= lobe.scattering.mean();
            if left < 0.0 {
                break;
            }
        }
        phase::sample(anisotropy, d, u)
    }
}

/// Divides by channel; 0 / 0 is 0.
pub fn divided(a: Vec3, b: Vec3) -> Vec3 {
    let ratio = |a: f32, b: f32| if b > 0.0 { a / b } else { 0.0 };
    Vec3::from([ratio(a.x, b.x), ratio(a.y, b.y), ratio(a.z, b.z)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    #[test]
    fn samples_of_two_lobes_have_the_density_of_both() {
        let mut mixture = Mixture::default();
        for (scattering, anisotropy) in [(vec3(1.0, 0.5, 0.0), 0.7), (vec3(0.2, 0.2, 2.0), -0.4)] {
            mixture.scatter(Lobe {
                scattering,
                anisotropy,
            });
        }
        // The expected ratio of value to density is 1 in every channel.
        let d = vec3(0.0, 0.6, 0.8);
        let n = 256;
        let mut sum = Vec3::ZERO;
        for i in 0..n {
            for j in 0..n {
                let u = [(i as f32 + 0.5) / n as f32, 0.25];
                let to = mixture.sample(d, (j as f32 + 0.5) / n as f32, u);
                let (value, density) = mixture.phase(to.dot(d));
                sum += value * (1.0 / (density * (n * n) as f32));
            }
        }
        for channel in sum.array() {
            assert!((channel - 1.0).abs() < 5e-3, "{sum:?}");
        }
        assert_eq!(Mixture::default().albedo(), Vec3::ZERO);
    }
}
