// SPDX-License-Identifier: GPL-3.0-or-later
//! How much of the light a rough lobe sends on, as a table over the viewing angle.
//!
//! A single bounce off GGX facets loses what the facets shadow. Following Kulla and Conty 2017 (as
//! simplified in Cycles) the lobe is divided by its own albedo; to do so it must be known. The
//! tables are computed per material by a fixed quadrature, so they are the same on every run.

use super::fresnel;
use super::ggx::Ggx;
use super::vector::{Vec3, vec3};

const NODES: usize = 48;
/// Points of the quadrature and the generator of its lattice: neighbours in Fibonacci's sequence.
const POINTS: u32 = 1597;
const STEP: u32 = 987;

/// A function of the cosine of the viewing angle. Nodes are denser towards grazing angles.
#[derive(Debug, Clone)]
pub struct Table {
    values: Vec<f32>,
}

impl Table {
    fn of(f: impl Fn(f32) -> f32) -> Self {
        let values = (0..NODES)
            .map(|i| {
                let x = i as f32 / (NODES - 1) as f32;
                f((x * x).max(1e-4))
            })
            .collect();
        Self { values }
    }

    /// The value at a cosine, linear between nodes.
    #[inline(always)]
    pub fn at(&self, cos: f32) -> f32 {
        let x = cos.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        let f = x - i as f32;
        self.values[i] + f * (self.values[i + 1] - self.values[i])
    }

    /// The cosine-weighted mean over the hemisphere.
    pub fn mean(&self) -> f32 {
        let n = 1000;
        let sum: f32 = (0..n)
            .map(|i| {
                let c = (i as f32 + 0.5) / n as f32;
                2.0 * c * self.at(c)
            })
            .sum();
        sum / n as f32
    }

    /// The albedo of facets that reflect everything.
    pub fn reflection(ggx: Ggx) -> Self {
        Self::of(|cos| facets(ggx, cos, |_| 1.0))
    }

    /// The albedo of facets that reflect as the boundary of a dielectric.
    pub fn dielectric_reflection(ggx: Ggx, eta: f32) -> Self {
        Self::of(|cos| facets(ggx, cos, |c| fresnel::dielectric(c, eta).0))
    }

    /// The albedo of rough glass, reflection and refraction together, seen from the side where
    /// the far side has relative index `eta`.
    pub fn glass(ggx: Ggx, eta: f32) -> Self {
        Self::of(|cos| {
            facets(ggx, cos, |c| fresnel::dielectric(c, eta).0) + refracted(ggx, cos, eta)
        })
    }
}

fn view(cos: f32) -> Vec3 {
    vec3((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos)
}

/// A rank-1 lattice over the unit square.
fn lattice() -> impl Iterator<Item = [f32; 2]> {
    (0..POINTS).map(|i| {
        let n = POINTS as f32;
        [
            (i as f32 + 0.5) / n,
            (((i * STEP) % POINTS) as f32 + 0.5) / n,
        ]
    })
}

/// Mean over visible normals of reflectance(wi·h) × G2/G1.
fn facets(ggx: Ggx, cos: f32, reflectance: impl Fn(f32) -> f32) -> f32 {
    if ggx.is_smooth() {
        return reflectance(cos);
    }
    let wi = view(cos);
    let lambda_i = ggx.lambda(cos);
    let sum: f32 = lattice()
        .map(|u| {
            let h = ggx.sample_visible(wi, u);
            let c = wi.dot(h);
            let wo = h * (2.0 * c) - wi;
            if wo.z <= 0.0 {
                return 0.0;
            }
            reflectance(c) * (1.0 + lambda_i) / (1.0 + lambda_i + ggx.lambda(wo.z))
        })
        .sum();
    sum / POINTS as f32
}

/// Mean over visible normals of (1 - F) × G2/G1 for the refracted direction.
fn refracted(ggx: Ggx, cos: f32, eta: f32) -> f32 {
    if ggx.is_smooth() {
        return 1.0 - fresnel::dielectric(cos, eta).0;
    }
    let wi = view(cos);
    let lambda_i = ggx.lambda(cos);
    let sum: f32 = lattice()
        .map(|u| {
            let h = ggx.sample_visible(wi, u);
            let c = wi.dot(h);
            let (f, cos_t) = fresnel::dielectric(c, eta);
            let wo = h * (c / eta - cos_t) - wi * (1.0 / eta);
            if f >= 1.0 || wo.z >= 0.0 {
                return 0.0;
            }
            (1.0 - f) * (1.0 + lambda_i) / (1.0 + lambda_i + ggx.lambda(wo.z))
        })
        .sum();
    sum / POINTS as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The albedo of reflecting facets, integrated over uniform directions instead of facets.
    fn by_solid_angle(ggx: Ggx, cos: f32) -> f64 {
        let (wi, n) = (view(cos), 1000);
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let z = (i as f32 + 0.5) / n as f32;
                let (sin, cos_phi) =
                    (std::f32::consts::TAU * (j as f32 + 0.5) / n as f32).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let h = (wi + vec3(r * cos_phi, r * sin, z)).normalized();
                let g2 = 1.0 / (1.0 + ggx.lambda(cos) + ggx.lambda(z));
                sum += f64::from(ggx.d(h) * g2 / (4.0 * cos)) * std::f64::consts::TAU;
            }
        }
        sum / f64::from(n * n)
    }

    #[test]
    fn a_smooth_surface_loses_nothing_and_a_rough_one_what_the_integral_says() {
        assert!((Table::reflection(Ggx::new(0.0)).at(0.3) - 1.0).abs() < 1e-6);
        for roughness in [0.5, 0.8, 1.0] {
            let ggx = Ggx::new(roughness);
            let table = Table::reflection(ggx);
            for cos in [0.15, 0.5, 0.9] {
                let (a, b) = (f64::from(table.at(cos)), by_solid_angle(ggx, cos));
                assert!(
                    (a - b).abs() < 2e-3,
                    "roughness {roughness} cos {cos}: {a} {b}"
                );
            }
        }
    }

    #[test]
    fn smooth_glass_sends_on_everything() {
        for eta in [1.5, 1.0 / 1.5] {
            let table = Table::glass(Ggx::new(0.0), eta);
            for cos in [0.05, 0.5, 1.0] {
                assert!((table.at(cos) - 1.0).abs() < 1e-5);
            }
        }
    }
}
