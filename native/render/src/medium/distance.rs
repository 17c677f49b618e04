// SPDX-License-Identifier: GPL-3.0-or-later
//! Distances to the next event in a uniform mixture, in closed form.
//!
//! The channel whose extinction gives the distance is chosen in proportion to what the path would scatter in it, and
//! the result is weighted by the density over all channels: the balance heuristic (Veach and Guibas 1995) over
//! wavelengths, called spectral multiple importance sampling by Wilkie et al. 2014, "Hero wavelength spectral
//! sampling".

use crate::math::vector::Vec3;
use crate::medium::mixture::Mixture;

/// An event on the way through a medium.
#[derive(Debug, Clone, Copy)]
pub struct Event {
    /// Distance to the scattering point; `None` if the end is reached.
    pub distance: Option<f32>,
    /// Factor on the throughput.
    pub weight: Vec3,
}

/// Returns the transmittance over a distance, which may be infinite.
pub fn transmittance(extinction: Vec3, distance: f32) -> Vec3 {
    // Vacuum transmits over any distance, also an infinite one, where 0 · ∞ is not a number.
    extinction.map(|c| if c > 0.0 { (-c * distance).exp() } else { 1.0 })
}

/// Returns the radiance that a uniform mixture emits towards the start of a ray of this length.
pub fn emitted(mixture: &Mixture, distance: f32) -> Vec3 {
    // The integral of the transmittance; where little is absorbed, its series keeps the digits.
    let length = mixture.extinction.map(|c| {
        let depth = c * distance;
        if depth > 1e-3 {
            (1.0 - (-depth).exp()) / c
        } else {
            distance * (1.0 - depth * (0.5 - depth * (1.0 / 6.0)))
        }
    });
    let light = mixture.emission * length;
    // A glowing medium without end or extinction has no finite radiance.
    light.map(|c| if c.is_finite() { c } else { 0.0 })
}

/// Samples the next event before `end`. `throughput`: of the path; `choice`, `u`: random numbers in [0, 1).
pub fn sample(mixture: &Mixture, throughput: Vec3, end: f32, [choice, u]: [f32; 2]) -> Event {
    let extinction = mixture.extinction;
    // Choose a channel by what it would scatter. A medium that only absorbs attenuates without chance.
    let share = (throughput * mixture.albedo()).map(f32::abs);
    let total = share.x + share.y + share.z;
    if !(total > 0.0 && total.is_finite()) {
        return Event {
            distance: None,
            weight: transmittance(extinction, end),
        };
    }
    let share = share * (1.0 / total);
    let chosen = if choice < share.x {
        extinction.x
    } else if choice < share.x + share.y || share.z == 0.0 {
        // Rounding may leave a channel that scatters nothing; take one that does.
        if share.y > 0.0 {
            extinction.y
        } else {
            extinction.x
        }
    } else {
        extinction.z
    };
    // Weigh by the density over all channels.
    let distance = -(1.0 - u).ln() / chosen;
    if distance < end {
        let through = transmittance(extinction, distance);
        let density = (share * extinction).dot(through);
        return Event {
            distance: Some(distance),
            weight: mixture.scattering() * through * (1.0 / density),
        };
    }
    let through = transmittance(extinction, end);
    Event {
        distance: None,
        weight: through * (1.0 / share.dot(through).max(f32::MIN_POSITIVE)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;
    use crate::medium::mixture::Lobe;

    fn mixture(scattering: Vec3, absorption: Vec3) -> Mixture {
        let mut mixture = Mixture::default();
        mixture.extinction = scattering + absorption;
        mixture.scatter(Lobe {
            scattering,
            anisotropy: 0.0,
        });
        mixture
    }

    #[test]
    fn events_have_the_expected_weights_in_every_channel() {
        // The means are those of the integrals: scattered σs/σt (1 - T), passed T.
        for (scattering, absorption) in [
            (vec3(1.0, 0.3, 2.0), vec3(0.5, 0.0, 1.0)),
            (vec3(0.7, 0.7, 0.7), Vec3::ZERO),
            (vec3(0.0, 0.0, 1.5), vec3(0.4, 3.0, 0.0)),
        ] {
            let mixture = mixture(scattering, absorption);
            let (n, end) = (512, 1.3);
            let (mut scattered, mut passed) = (Vec3::ZERO, Vec3::ZERO);
            for i in 0..n {
                for j in 0..n {
                    let random = [i, j].map(|k| (k as f32 + 0.5) / n as f32);
                    let event = sample(&mixture, vec3(1.0, 0.8, 0.5), end, random);
                    let part = event.weight * (1.0 / (n * n) as f32);
                    match event.distance {
                        Some(distance) => {
                            assert!((0.0..end).contains(&distance));
                            scattered += part;
                        }
                        None => passed += part,
                    }
                }
            }
            let through = transmittance(mixture.extinction, end);
            let expected = mixture.albedo() * (Vec3::ONE - through);
            assert!((scattered - expected).max_abs() < 6e-3, "{scattered:?}");
            assert!((passed - through).max_abs() < 6e-3, "{passed:?}");
        }
    }

    #[test]
    fn a_grey_medium_without_absorption_keeps_the_throughput() {
        for density in [1e-6, 0.3, 40.0, 1e9] {
            let mixture = mixture(Vec3::splat(density), Vec3::ZERO);
            for u in [0.0, 0.2, 0.999_999_94] {
                let weight = sample(&mixture, Vec3::ONE, 2.0, [0.5, u]).weight;
                assert!(
                    (weight - Vec3::ONE).max_abs() < 1e-5,
                    "{density} {u}: {weight:?}"
                );
            }
        }
    }

    #[test]
    fn infinite_and_empty_media_stay_finite() {
        let vacuum = Mixture::default();
        let event = sample(&vacuum, Vec3::ONE, f32::INFINITY, [0.1, 0.9]);
        assert!(event.distance.is_none() && event.weight == Vec3::ONE);
        let fog = mixture(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0));
        let passed = transmittance(fog.extinction, f32::INFINITY);
        assert_eq!(passed.array(), [0.0, 0.0, 1.0]);
        let mut glowing = mixture(Vec3::ZERO, vec3(2.0, 1e-6, 0.0));
        glowing.emission = Vec3::ONE;
        let light = emitted(&glowing, 3.0);
        assert!((light.x - (1.0 - (-6.0_f32).exp()) / 2.0).abs() < 1e-6);
        assert!((light.y - 3.0).abs() < 1e-4 && light.z == 3.0);
        assert!(emitted(&glowing, f32::INFINITY).is_finite());
    }
}
