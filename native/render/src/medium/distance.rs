// SPDX-License-Identifier: GPL-3.0-or-later
//! Distances to the next event in a uniform mixture, in closed form.
//!
//! The channel whose extinction gives the distance is chosen in proportion to what the path would scatter in it, and
//! the result is weighted by the density over all channels: the balance heuristic (Veach and Guibas 1995) over
//! wavelengths, called spectral multiple importance sampling by Wilkie et al. 2014, "Hero wavelength spectral
//! sampling".
//!
//! Points that receive light from lamps are chosen apart from the next event, in half of the cases by the angle under
//! which the chosen lamp sees the segment (see [`crate::light::Segment`]), so that light reaches each segment, also
//! where the path does not scatter.

use crate::light::Angles;
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
    // A medium that only absorbs attenuates without chance.
    let Some(share) = shares(mixture, throughput) else {
        return Event {
            distance: None,
            weight: transmittance(extinction, end),
        };
    };
    let chosen = channel(extinction, share, choice);
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

/// Returns the probabilities of the channels: what the path would scatter in each. `None` if that is nothing.
fn shares(mixture: &Mixture, throughput: Vec3) -> Option<Vec3> {
    let share = (throughput * mixture.albedo()).map(f32::abs);
    let total = share.x + share.y + share.z;
    (total > 0.0 && total.is_finite()).then(|| share * (1.0 / total))
}

/// Chooses a channel by its share. Returns its extinction.
fn channel(extinction: Vec3, share: Vec3, choice: f32) -> f32 {
    if choice < share.x {
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
    }
}

/// A point of a segment where light from lamps is scattered.
#[derive(Debug, Clone, Copy)]
pub struct LitPoint {
    /// Distance from the start of the segment.
    pub distance: f32,
    /// Factor on the throughput: scattering coefficient and transmittance over the density.
    pub weight: Vec3,
}

/// Samples the point of a segment that receives light. `start`, `end`: of the part that the light reaches, distances from
/// the start of the segment; `angles`: under which the light sees that part, `None` for light from afar. `choice`, `u`:
/// random numbers in [0, 1). Returns `None` where nothing scatters.
pub fn sample_lit(
    mixture: &Mixture,
    throughput: Vec3,
    [start, end]: [f32; 2],
    angles: Option<Angles>,
    [choice, u]: [f32; 2],
) -> Option<LitPoint> {
    let extinction = mixture.extinction;
    let arriving = throughput * transmittance(extinction, start);
    let share = shares(mixture, arriving)?;
    // Choose the technique, and use the number again for the distance.
    let by_angle = angles.filter(|_| u >= 0.5);
    let u = if angles.is_some() {
        (2.0 * u).fract()
    } else {
        u
    };
    // Exponential distances within the part; its share of all distances is the mass below its end.
    let length = end - start;
    let mass = |c: f32| -(-c * length).exp_m1();
    let distance = match by_angle {
        Some(angles) => angles.sample(u),
        None => {
            let chosen = channel(extinction, share, choice);
            (start - (-u * mass(chosen)).ln_1p() / chosen).min(end)
        }
    };
    // Weigh by the density over all channels and both techniques: the balance heuristic.
    let through = transmittance(extinction, distance - start);
    let density = |share: f32, c: f32, through: f32| {
        if share > 0.0 {
            share * c * through / mass(c)
        } else {
            0.0
        }
    };
    let by_distance = density(share.x, extinction.x, through.x)
        + density(share.y, extinction.y, through.y)
        + density(share.z, extinction.z, through.z);
    let density = match angles {
        Some(angles) => 0.5 * (by_distance + angles.density(distance)),
        None => by_distance,
    };
    let through = transmittance(extinction, distance);
    let weight = mixture.scattering() * through * (1.0 / density);
    (distance.is_finite() && density > 0.0 && density.is_finite() && weight.is_finite())
        .then_some(LitPoint { distance, weight })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Segment;
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

    #[test]
    fn lit_points_integrate_what_a_segment_scatters() {
        // The mean of weight · f is the integral of scattering · transmittance · f, here with f = 1 and 1 / distance².
        let medium = mixture(vec3(0.7, 0.2, 0.0), vec3(0.0, 0.1, 0.5));
        let centre = vec3(0.0, 0.3, 0.4);
        for (begin, length, near) in [
            (0.0, 2.0, false),
            (0.0, 2.0, true),
            (0.0, f32::INFINITY, true),
            (0.0, 1e-4, true),
            (0.3, 2.0, false),
            (0.3, 2.0, true),
            (0.9, f32::INFINITY, true),
        ] {
            let segment = Segment {
                origin: Vec3::ZERO,
                direction: vec3(0.0, 0.0, 1.0),
                length,
                extinction: medium.extinction.mean(),
            };
            let span = [begin * length.min(1.0), length];
            let angles = near.then(|| segment.angles(centre, 0.05, span));
            let arrives = |t: f32| {
                let away = (centre - segment.direction * t).length2();
                if near { 1.0 / away } else { 1.0 }
            };
            let n = 400;
            let (mut mean, mut integral) = (Vec3::ZERO, Vec3::ZERO);
            for i in 0..n * n {
                let random = [i % n, i / n].map(|k| (k as f32 + 0.5) / n as f32);
                let lit = sample_lit(&medium, vec3(1.0, 0.8, 0.5), span, angles, random);
                let LitPoint { distance, weight } = lit.unwrap();
                assert!((span[0]..=span[1]).contains(&distance));
                mean += weight * (arrives(distance) / (n * n) as f32);
            }
            let (steps, end) = (100_000, length.min(60.0) - span[0]);
            for i in 0..steps {
                let t = span[0] + end * (i as f32 + 0.5) / steps as f32;
                let through = transmittance(medium.extinction, t);
                integral += medium.scattering() * through * (arrives(t) * end / steps as f32);
            }
            let error = (mean - integral).max_abs() / integral.max_abs();
            assert!(error < 3e-3, "{length} {near}: {mean:?} {integral:?}");
        }
    }

    #[test]
    fn nothing_is_lit_where_nothing_scatters_or_on_no_way() {
        let random = [0.3, 0.7];
        let black = mixture(Vec3::ZERO, Vec3::ONE);
        assert!(sample_lit(&black, Vec3::ONE, [0.0, 1.0], None, random).is_none());
        let fog = mixture(Vec3::ONE, Vec3::ZERO);
        assert!(sample_lit(&fog, Vec3::ZERO, [0.0, 1.0], None, random).is_none());
        assert!(sample_lit(&fog, Vec3::ONE, [0.0, 0.0], None, random).is_none());
    }
}
