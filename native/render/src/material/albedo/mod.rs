// SPDX-License-Identifier: GPL-3.0-or-later
//! Directional albedo of rough lobes, tabulated over the viewing angle.
//!
//! Single scattering off GGX facets loses the energy that the facets shadow. Following Kulla and Conty 2017 (as
//! simplified in Cycles) each lobe is divided by its own albedo, which these tables provide. They are computed per
//! material by a fixed quadrature, so every run has the same ones; a grid of tables covers all values where
//! roughness or index come from a texture.

use std::f32::consts::FRAC_PI_2;

use crate::material::ggx::Ggx;
use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};

mod axis;
mod grids;

pub use crate::material::albedo::axis::Axis;
use crate::material::albedo::axis::{axis_to_index, index_to_axis};
pub use crate::material::albedo::grids::Grids;

/// Nodes of a table on each side of its edge. With [`FINE`], tables are within 2e-3 of the integral (tested).
const NODES: usize = 48;
/// Quadrature of single tables: number of lattice points and generator, two successive Fibonacci numbers.
const FINE: [u32; 2] = [1597, 987];
/// Quadrature of grids, which consist of many tables: a smaller lattice of the same kind.
const COARSE: [u32; 2] = [233, 144];

/// A function of the cosine of the viewing angle, tabulated. Nodes are denser towards grazing angles, and just
/// above the edge: the cosine, if there is one, where the function jumps or bends.
#[derive(Debug, Clone)]
pub struct Table {
    /// Values below the edge, and from the edge up.
    values: [[f32; NODES]; 2],
    /// Cosine of the critical angle; 0 = no edge.
    edge: f32,
}

impl Table {
    /// Tabulates `f`. `edge`: the cosine where `f` jumps or bends; 0 = none.
    fn of(edge: f32, f: impl Fn(f32) -> f32) -> Self {
        let x = |i: usize| i as f32 / (NODES - 1) as f32;
        // Put more nodes towards both ends, and keep the last one just below the edge.
        let below = |i: usize| {
            let share = (x(i) * FRAC_PI_2).sin().powi(2);
            f((edge * share).max(1e-4) * (1.0 - 1e-6))
        };
        Self {
            values: [
                if edge > 0.0 {
                    std::array::from_fn(below)
                } else {
                    [0.0; NODES]
                },
                std::array::from_fn(|i| f((edge + (1.0 - edge) * x(i) * x(i)).max(1e-4))),
            ],
            edge,
        }
    }

    /// Returns the value at a cosine, interpolated linearly between nodes.
    #[inline(always)]
    pub fn at(&self, cos: f32) -> f32 {
        self.at_edge(cos, self.edge)
    }

    /// Returns the value at a cosine as if the edge lay at `edge`: each side of the table is stretched to fit.
    #[inline(always)]
    fn at_edge(&self, cos: f32, edge: f32) -> f32 {
        let cos = cos.clamp(0.0, 1.0);
        // Invert the spacing of the nodes: sin² below the edge, a square above it.
        let (values, position) = if cos < edge {
            let position = (cos / edge).sqrt().asin() / FRAC_PI_2;
            (&self.values[0], position)
        } else {
            let position = ((cos - edge) / (1.0 - edge)).sqrt();
            (&self.values[1], position)
        };
        let x = position * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        let f = x - i as f32;
        // Interpolate linearly between the two nearest nodes.
        values[i] + f * (values[i + 1] - values[i])
    }

    /// Returns the cosine-weighted mean over the hemisphere.
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

    /// Albedo of facets that reflect all light.
    pub fn reflection(ggx: Ggx, points: Points) -> Self {
        Self::of(0.0, |cos| facets(ggx, cos, points, |_| 1.0))
    }

    /// Albedo of facets that reflect by the Fresnel equations of a dielectric of relative index `eta`, as Cycles
    /// estimates it for what a layer leaves to those below: the albedo of white facets times the mean reflectance of the
    /// facets that are seen. It is mostly above the integral of the product, by up to 0.01, since facets that reflect much are
    /// those whose light others catch. Below an index of 1, where most facets reflect all light, it is the integral.
    pub fn dielectric_reflection(ggx: Ggx, eta: f32, points: Points) -> Self {
        let (own, lower_bound) = (fresnel::f0_from_ior(eta), fresnel::min_reflectance(eta));
        let above = |c: f32| fresnel::dielectric(c, eta).0.max(lower_bound) - own;
        Self::of(critical_cosine(eta), |cos| {
            if eta < 1.0 {
                return facets(ggx, cos, points, |c| own + above(c));
            }
            let white = facets(ggx, cos, points, |_| 1.0);
            white * (own + seen(ggx, cos, points, above))
        })
    }

    /// Albedo of rough glass, reflection plus refraction. `eta`: index of the far side over that of the near side;
    /// `lower_bound`: lower bound of the reflectance.
    pub fn glass(ggx: Ggx, eta: f32, lower_bound: f32, points: Points) -> Self {
        Self::of(0.0, |cos| {
            facets(ggx, cos, points, |c| {
                fresnel::dielectric(c, eta).0.max(lower_bound)
            }) + refracted(ggx, cos, eta, lower_bound, points)
        })
    }
}

/// Returns the cosine below which a boundary of this index reflects all light; 0 for indices of 1 and above.
#[inline(always)]
fn critical_cosine(eta: f32) -> f32 {
    (1.0 - eta * eta).max(0.0).sqrt().min(1.0 - 1e-3)
}

/// The lobe that a [`Grid`] tabulates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Lobe {
    /// [`Table::reflection`].
    Reflection,
    /// [`Table::dielectric_reflection`].
    Dielectric,
    /// [`Table::glass`] from outside.
    Glass,
    /// [`Table::glass`] from inside.
    GlassInside,
    /// [`Table::glass`] from outside, with a reflectance of at least [`fresnel::min_reflectance`].
    BoundedGlass,
    /// [`Table::glass`] from inside, with the same lower bound.
    BoundedGlassInside,
}

/// The albedo of a rough lobe.
#[derive(Debug, Clone, Copy)]
pub struct Albedo {
    /// At the viewing direction.
    pub directional: f32,
    /// Cosine-weighted mean over the hemisphere.
    pub mean: f32,
}

impl Albedo {
    /// That of a lobe that loses nothing.
    pub const ONE: Self = Self {
        directional: 1.0,
        mean: 1.0,
    };
}

/// Tables over the ranges of roughness and index that a material can have.
#[derive(Debug)]
pub struct Grid {
    /// Range of the roughness.
    roughness: Axis,
    /// Range of the index, in units of [`index_to_axis`]; a fixed one holds the index itself.
    index: Axis,
    /// One table and its mean per pair of levels, roughness varying fastest.
    tables: Vec<(Table, f32)>,
}

impl Grid {
    /// Computes all tables.
    fn new(lobe: Lobe, roughness: Axis, index: Axis) -> Self {
        let mut tables = Vec::with_capacity(roughness.levels * index.levels);
        // A single table can afford the finer quadrature.
        let points = if roughness.levels * index.levels == 1 {
            FINE
        } else {
            COARSE
        };
        for i in 0..index.levels {
            let level = index.level(i);
            // A fixed axis stores the index, a varying one its position on the axis.
            let eta = if index.levels == 1 {
                level
            } else {
                axis_to_index(level)
            };
            for r in 0..roughness.levels {
                let ggx = Ggx::new(roughness.level(r));
                let table = match lobe {
                    Lobe::Reflection => Table::reflection(ggx, points),
                    Lobe::Dielectric => Table::dielectric_reflection(ggx, eta, points),
                    Lobe::Glass => Table::glass(ggx, eta, 0.0, points),
                    Lobe::GlassInside => Table::glass(ggx, 1.0 / eta, 0.0, points),
                    Lobe::BoundedGlass => {
                        Table::glass(ggx, eta, fresnel::min_reflectance(eta), points)
                    }
                    Lobe::BoundedGlassInside => {
                        Table::glass(ggx, 1.0 / eta, fresnel::min_reflectance(eta), points)
                    }
                };
                // The mean over the hemisphere belongs to each table: it enters the compensation.
                let mean = table.mean();
                tables.push((table, mean));
            }
        }
        Self {
            roughness,
            index,
            tables,
        }
    }

    /// Returns the albedo at a cosine, interpolated bilinearly between tables.
    #[inline(always)]
    pub fn at(&self, roughness: f32, eta: f32, cos: f32) -> Albedo {
        // Common case: both inputs are constant.
        if self.tables.len() == 1 {
            let (table, mean) = &self.tables[0];
            return Albedo {
                directional: table.at(cos),
                mean: *mean,
            };
        }
        // Find the cell of the grid, and the critical angle of this index.
        let (r, fr) = self.roughness.find(roughness);
        // Only a varying index moves the critical angle from table to table.
        let varies = self.index.levels > 1;
        let (i, fi, edge) = if varies {
            let (i, fi) = self.index.find(index_to_axis(eta));
            (i, fi, critical_cosine(eta))
        } else {
            (0, 0.0, 0.0)
        };
        let width = self.roughness.levels;
        let mut out = Albedo {
            directional: 0.0,
            mean: 0.0,
        };
        // Sum over the four tables around (roughness, index).
        for (di, wi) in [(0, 1.0 - fi), (1, fi)] {
            for (dr, wr) in [(0, 1.0 - fr), (1, fr)] {
                let weight = wi * wr;
                if weight > 0.0 {
                    let (table, mean) = &self.tables[(i + di) * width + r + dr];
                    // Align the critical angle of the table with that of `eta`, so that the jump is not blurred.
                    let edge = if varies && table.edge > 0.0 {
                        edge
                    } else {
                        table.edge
                    };
                    out.directional += weight * table.at_edge(cos, edge);
                    out.mean += weight * mean;
                }
            }
        }
        out
    }
}

/// The viewing direction with this cosine, in the xz plane.
fn view(cos: f32) -> Vec3 {
    vec3((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos)
}

/// A rank-1 lattice over the unit square: its number of points and its generator.
pub type Points = [u32; 2];

/// Points of the lattice, offset by half a step.
fn lattice([points, step]: Points) -> impl Iterator<Item = [f32; 2]> {
    (0..points).map(move |i| {
        let n = points as f32;
        [
            (i as f32 + 0.5) / n,
            (((i * step) % points) as f32 + 0.5) / n,
        ]
    })
}

/// Mean over the visible normals h of reflectance(wi·h) × G2/G1: the albedo of reflecting facets.
fn facets(ggx: Ggx, cos: f32, points: Points, reflectance: impl Fn(f32) -> f32) -> f32 {
    if ggx.is_smooth() {
        return reflectance(cos);
    }
    // Facets sampled by D·G1 leave the weight F·G2/G1; directions below the surface are lost.
    let wi = view(cos);
    let lambda_i = ggx.lambda(cos);
    let sum: f32 = lattice(points)
        .map(|u| {
            // Reflect at a visible facet.
            let h = ggx.sample_visible(wi, u);
            let c = wi.dot(h);
            let wo = h * (2.0 * c) - wi;
            if wo.z <= 0.0 {
                return 0.0;
            }
            reflectance(c) * (1.0 + lambda_i) / (1.0 + lambda_i + ggx.lambda(wo.z))
        })
        .sum();
    sum / points[0] as f32
}

/// Mean of `f` over the visible normals; 0 where their reflection does not leave the surface.
fn seen(ggx: Ggx, cos: f32, points: Points, f: impl Fn(f32) -> f32) -> f32 {
    if ggx.is_smooth() {
        return f(cos);
    }
    let wi = view(cos);
    let sum: f32 = lattice(points)
        .map(|u| {
            let h = ggx.sample_visible(wi, u);
            let c = wi.dot(h);
            if 2.0 * c * h.z <= cos { 0.0 } else { f(c) }
        })
        .sum();
    sum / points[0] as f32
}

/// Mean over the visible normals of (1 - F) × G2/G1 in the refracted direction, where F is at least `lower_bound`.
fn refracted(ggx: Ggx, cos: f32, eta: f32, lower_bound: f32, points: Points) -> f32 {
    if ggx.is_smooth() {
        return 1.0 - fresnel::dielectric(cos, eta).0.max(lower_bound);
    }
    let wi = view(cos);
    let lambda_i = ggx.lambda(cos);
    let sum: f32 = lattice(points)
        .map(|u| {
            // Refract at a visible facet.
            let h = ggx.sample_visible(wi, u);
            let c = wi.dot(h);
            let (f, cos_t) = fresnel::dielectric(c, eta);
            // Refract about the facet; total reflection and directions back above the surface pass nothing.
            let wo = h * (c / eta - cos_t) - wi * (1.0 / eta);
            if f >= 1.0 || wo.z >= 0.0 {
                return 0.0;
            }
            (1.0 - f.max(lower_bound)) * (1.0 + lambda_i) / (1.0 + lambda_i + ggx.lambda(wo.z))
        })
        .sum();
    sum / points[0] as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same albedo integrated over uniform outgoing directions instead of visible normals.
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
    fn albedos_of_reflection_equal_the_integral() {
        assert!((Table::reflection(Ggx::new(0.0), FINE).at(0.3) - 1.0).abs() < 1e-6);
        for roughness in [0.5, 0.8, 1.0] {
            let ggx = Ggx::new(roughness);
            let table = Table::reflection(ggx, FINE);
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
    fn layers_reflect_what_cycles_estimates() {
        // By a Monte Carlo integration in f64 of 400,000 facets each: the estimate, and the integral of the product.
        for (roughness, cos, estimate, product) in [
            (0.5, 0.707, 0.04660, 0.04614),
            (0.5, 0.3, 0.10985, 0.10545),
            (0.7, 0.3, 0.06715, 0.06378),
            (0.5, 1.0, 0.03713, 0.03704),
        ] {
            let ggx = Ggx::new(roughness);
            let own = Table::dielectric_reflection(ggx, 1.5, FINE).at(cos);
            assert!((own - estimate).abs() < 3e-4, "{roughness} {cos}: {own}");
            let exact = facets(ggx, cos, FINE, |c| fresnel::dielectric(c, 1.5).0);
            assert!((exact - product).abs() < 3e-4, "{roughness} {cos}: {exact}");
        }
    }

    #[test]
    fn a_grid_agrees_with_the_table_between_its_levels() {
        let mut grids = Grids::default();
        let grid = grids.get(Lobe::Dielectric, Axis::roughness(), Axis::index(1.0, 2.0));
        for (roughness, eta) in [(0.33, 1.2), (0.61, 1.5), (0.95, 1.05)] {
            let table = Table::dielectric_reflection(Ggx::new(roughness), eta, FINE);
            for cos in [0.2, 0.6, 1.0] {
                let (a, b) = (grid.at(roughness, eta, cos).directional, table.at(cos));
                assert!((a - b).abs() < 4e-3, "{roughness} {eta} {cos}: {a} {b}");
            }
        }
    }

    #[test]
    fn smooth_glass_absorbs_nothing() {
        for eta in [1.5, 1.0 / 1.5] {
            let table = Table::glass(Ggx::new(0.0), eta, 0.0, FINE);
            for cos in [0.05, 0.5, 1.0] {
                assert!((table.at(cos) - 1.0).abs() < 1e-5);
            }
        }
    }
}
