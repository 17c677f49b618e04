// SPDX-License-Identifier: GPL-3.0-or-later
//! How much of the light a rough lobe sends on, as a table over the viewing angle.
//!
//! A single bounce off GGX facets loses what the facets shadow. Following Kulla and Conty 2017 (as
//! simplified in Cycles) the lobe is divided by its own albedo; to do so it must be known. The
//! tables are computed per material by a fixed quadrature, so they are the same on every run. Where
//! roughness or index come from a texture, a grid of tables covers all their values.

use std::collections::HashMap;
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

use super::fresnel;
use super::ggx::Ggx;
use super::vector::{Vec3, vec3};

mod axis;

pub use self::axis::Axis;
use self::axis::{index_at, place_of_index};

const NODES: usize = 48;
/// Points of the quadrature and the generator of its lattice: neighbours in Fibonacci's sequence.
const FINE: [u32; 2] = [1597, 987];
/// The same for grids, which have many tables.
const COARSE: [u32; 2] = [233, 144];
/// A function of the cosine of the viewing angle. Nodes are denser towards grazing angles, and above an edge where the
/// function jumps or bends, if there is one.
#[derive(Debug, Clone)]
pub struct Table {
    /// Below the edge, and from it on.
    values: [[f32; NODES]; 2],
    edge: f32,
}

impl Table {
    /// With an edge at a cosine; 0 = none.
    fn of(edge: f32, f: impl Fn(f32) -> f32) -> Self {
        let x = |i: usize| i as f32 / (NODES - 1) as f32;
        // Denser towards both ends; the last one lies on this side of the edge.
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

    /// The value at a cosine, linear between nodes.
    #[inline(always)]
    pub fn at(&self, cos: f32) -> f32 {
        self.at_edge(cos, self.edge)
    }

    /// The value where the edge lies elsewhere, as far from it in proportion.
    #[inline(always)]
    fn at_edge(&self, cos: f32, edge: f32) -> f32 {
        let cos = cos.clamp(0.0, 1.0);
        let (values, place) = if cos < edge {
            let place = (cos / edge).sqrt().asin() / FRAC_PI_2;
            (&self.values[0], place)
        } else {
            let place = ((cos - edge) / (1.0 - edge)).sqrt();
            (&self.values[1], place)
        };
        let x = place * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        let f = x - i as f32;
        values[i] + f * (values[i + 1] - values[i])
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
    pub fn reflection(ggx: Ggx, points: Points) -> Self {
        Self::of(0.0, |cos| facets(ggx, cos, points, |_| 1.0))
    }

    /// The albedo of facets that reflect as the boundary of a dielectric.
    pub fn dielectric_reflection(ggx: Ggx, eta: f32, points: Points) -> Self {
        let least = fresnel::least(eta);
        Self::of(critical_cosine(eta), |cos| {
            facets(ggx, cos, points, |c| {
                fresnel::dielectric(c, eta).0.max(least)
            })
        })
    }

    /// The albedo of rough glass, reflection and refraction together, seen from the side where
    /// the far side has relative index `eta`. It reflects at least `least`.
    pub fn glass(ggx: Ggx, eta: f32, least: f32, points: Points) -> Self {
        Self::of(0.0, |cos| {
            facets(ggx, cos, points, |c| {
                fresnel::dielectric(c, eta).0.max(least)
            }) + refracted(ggx, cos, eta, least, points)
        })
    }
}

/// The cosine below which a boundary of this index reflects everything; 0 from 1 on.
#[inline(always)]
fn critical_cosine(eta: f32) -> f32 {
    (1.0 - eta * eta).max(0.0).sqrt().min(1.0 - 1e-3)
}

/// Which lobe a [`Grid`] is about.
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
    /// From outside, where it reflects at least [`fresnel::least`].
    HeldGlass,
    /// The same from inside.
    HeldGlassInside,
}

/// Tables for all values of roughness and index that a material can have.
#[derive(Debug)]
pub struct Grid {
    roughness: Axis,
    /// Over [`place_of_index`]; a fixed one holds the index itself.
    index: Axis,
    tables: Vec<(Table, f32)>,
}

impl Grid {
    fn new(lobe: Lobe, roughness: Axis, index: Axis) -> Self {
        let mut tables = Vec::with_capacity(roughness.levels * index.levels);
        let points = if roughness.levels * index.levels == 1 {
            FINE
        } else {
            COARSE
        };
        for i in 0..index.levels {
            let level = index.level(i);
            let eta = if index.levels == 1 {
                level
            } else {
                index_at(level)
            };
            for r in 0..roughness.levels {
                let ggx = Ggx::new(roughness.level(r));
                let table = match lobe {
                    Lobe::Reflection => Table::reflection(ggx, points),
                    Lobe::Dielectric => Table::dielectric_reflection(ggx, eta, points),
                    Lobe::Glass => Table::glass(ggx, eta, 0.0, points),
                    Lobe::GlassInside => Table::glass(ggx, 1.0 / eta, 0.0, points),
                    Lobe::HeldGlass => Table::glass(ggx, eta, fresnel::least(eta), points),
                    Lobe::HeldGlassInside => {
                        Table::glass(ggx, 1.0 / eta, fresnel::least(eta), points)
                    }
                };
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

    /// Albedo at a cosine, and its mean over the hemisphere.
    #[inline(always)]
    pub fn at(&self, roughness: f32, eta: f32, cos: f32) -> (f32, f32) {
        if self.tables.len() == 1 {
            let (table, mean) = &self.tables[0];
            return (table.at(cos), *mean);
        }
        let (r, fr) = self.roughness.find(roughness);
        let varies = self.index.levels > 1;
        let (i, fi, edge) = if varies {
            let (i, fi) = self.index.find(place_of_index(eta));
            (i, fi, critical_cosine(eta))
        } else {
            (0, 0.0, 0.0)
        };
        let width = self.roughness.levels;
        let mut out = (0.0, 0.0);
        for (di, wi) in [(0, 1.0 - fi), (1, fi)] {
            for (dr, wr) in [(0, 1.0 - fr), (1, fr)] {
                let weight = wi * wr;
                if weight > 0.0 {
                    let (table, mean) = &self.tables[(i + di) * width + r + dr];
                    // What jumps at an edge is looked up as far from its own edge as the cosine is from this index's.
                    let edge = if varies && table.edge > 0.0 {
                        edge
                    } else {
                        table.edge
                    };
                    out.0 += weight * table.at_edge(cos, edge);
                    out.1 += weight * mean;
                }
            }
        }
        out
    }
}

/// The grids of a scene, each computed once.
#[derive(Debug, Default)]
pub struct Grids(HashMap<(Lobe, [u32; 3], [u32; 3]), Arc<Grid>>);

impl Grids {
    /// The grid of a lobe over these values.
    pub fn get(&mut self, lobe: Lobe, roughness: Axis, index: Axis) -> Arc<Grid> {
        let index = if lobe == Lobe::Reflection {
            Axis::fixed(1.0)
        } else {
            index
        };
        let key = (lobe, roughness.key(), index.key());
        let grid = self
            .0
            .entry(key)
            .or_insert_with(|| Arc::new(Grid::new(lobe, roughness, index)));
        Arc::clone(grid)
    }
}

fn view(cos: f32) -> Vec3 {
    vec3((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos)
}

/// A rank-1 lattice over the unit square: its number of points and its generator.
pub type Points = [u32; 2];

fn lattice([points, step]: Points) -> impl Iterator<Item = [f32; 2]> {
    (0..points).map(move |i| {
        let n = points as f32;
        [
            (i as f32 + 0.5) / n,
            (((i * step) % points) as f32 + 0.5) / n,
        ]
    })
}

/// Mean over visible normals of reflectance(wi·h) × G2/G1.
fn facets(ggx: Ggx, cos: f32, points: Points, reflectance: impl Fn(f32) -> f32) -> f32 {
    if ggx.is_smooth() {
        return reflectance(cos);
    }
    let wi = view(cos);
    let lambda_i = ggx.lambda(cos);
    let sum: f32 = lattice(points)
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
    sum / points[0] as f32
}

/// Mean over visible normals of (1 - F) × G2/G1 for the refracted direction, where F is at least `least`.
fn refracted(ggx: Ggx, cos: f32, eta: f32, least: f32, points: Points) -> f32 {
    if ggx.is_smooth() {
        return 1.0 - fresnel::dielectric(cos, eta).0.max(least);
    }
    let wi = view(cos);
    let lambda_i = ggx.lambda(cos);
    let sum: f32 = lattice(points)
        .map(|u| {
            let h = ggx.sample_visible(wi, u);
            let c = wi.dot(h);
            let (f, cos_t) = fresnel::dielectric(c, eta);
            let wo = h * (c / eta - cos_t) - wi * (1.0 / eta);
            if f >= 1.0 || wo.z >= 0.0 {
                return 0.0;
            }
            (1.0 - f.max(least)) * (1.0 + lambda_i) / (1.0 + lambda_i + ggx.lambda(wo.z))
        })
        .sum();
    sum / points[0] as f32
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
    fn a_grid_agrees_with_the_table_between_its_levels() {
        let mut grids = Grids::default();
        let grid = grids.get(Lobe::Dielectric, Axis::roughness(), Axis::index(1.0, 2.0));
        for (roughness, eta) in [(0.33, 1.2), (0.61, 1.5), (0.95, 1.05)] {
            let table = Table::dielectric_reflection(Ggx::new(roughness), eta, FINE);
            for cos in [0.2, 0.6, 1.0] {
                let (a, b) = (grid.at(roughness, eta, cos).0, table.at(cos));
                assert!((a - b).abs() < 4e-3, "{roughness} {eta} {cos}: {a} {b}");
            }
        }
    }

    #[test]
    fn smooth_glass_sends_on_everything() {
        for eta in [1.5, 1.0 / 1.5] {
            let table = Table::glass(Ggx::new(0.0), eta, 0.0, FINE);
            for cos in [0.05, 0.5, 1.0] {
                assert!((table.at(cos) - 1.0).abs() < 1e-5);
            }
        }
    }
}
