// SPDX-License-Identifier: GPL-3.0-or-later
//! Voronoi cells in one to four dimensions, with the values of Blender's Voronoi Texture: Worley 1996 ("A Cellular
//! Texture Basis Function"); smooth cells and distances to edges after Quilez.

use crate::math::vector::Vec3;
use crate::values::math_nodes::named;
use crate::values::texture::hash::{cell_color, cell_point, color, earlier_cell_point};

named! {
    /// Quantity that the texture measures.
    Feature {
        Nearest = "F1", Second = "F2", Smooth = "SMOOTH_F1", Edge = "DISTANCE_TO_EDGE",
        Radius = "N_SPHERE_RADIUS",
    }
}

named! {
    /// How distances to points are measured.
    Metric {
        Euclidean = "EUCLIDEAN", Manhattan = "MANHATTAN", Chebychev = "CHEBYCHEV",
        Minkowski = "MINKOWSKI",
    }
}

/// Parameters of the texture.
#[derive(Debug, Clone, Copy)]
pub struct Voronoi {
    /// Quantity that the texture measures.
    pub feature: Feature,
    /// How distances to points are measured.
    pub metric: Metric,
    /// Whether distances and colours are scaled to 0..1.
    pub normalize: bool,
    /// Frequency of the cells; positions are divided by it.
    pub scale: f32,
    /// Number of octaves after the first, 0..15; a fraction blends in the last one.
    pub detail: f32,
    /// Amplitude of each octave divided by that of the previous one, 0..1.
    pub roughness: f32,
    /// Frequency of each octave divided by that of the previous one.
    pub lacunarity: f32,
    /// Width over which smooth cells blend, 0..1.
    pub smoothness: f32,
    /// Exponent of Minkowski's distance.
    pub exponent: f32,
    /// Share of the way from a cell's corner to its random point, 0..1.
    pub randomness: f32,
    /// Whether points and colours are those of Blender before 5.0.
    pub earlier: bool,
}

/// The cell found at a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell<const N: usize> {
    /// Distance to its point.
    pub distance: f32,
    /// Colour.
    pub color: Vec3,
    /// Its point.
    pub position: [f32; N],
}

/// A cell's point: its offset from the cell of the shaded position, and its place relative to that cell's corner.
#[derive(Clone, Copy)]
struct Seed<const N: usize> {
    offset: [i32; N],
    place: [f32; N],
}

impl Voronoi {
    /// The parameters in their ranges.
    fn clamped(self) -> Self {
        Self {
            detail: self.detail.clamp(0.0, 15.0),
            roughness: self.roughness.clamp(0.0, 1.0),
            smoothness: (self.smoothness / 2.0).clamp(0.0, 0.5),
            randomness: self.randomness.clamp(0.0, 1.0),
            ..self
        }
    }

    /// Returns the cell at a position, which is scaled first; features without cells return an empty one with their
    /// distance or radius.
    pub fn at<const N: usize>(self, p: [f32; N]) -> Cell<N> {
        let settings = self.clamped();
        let p = p.map(|x| x * settings.scale);
        if p.iter().any(|x| !x.is_finite()) {
            return Cell::empty(0.0);
        }
        match self.feature {
            Feature::Edge => Cell::empty(settings.edge_octaves(p)),
            Feature::Radius => Cell::empty(settings.radius(p)),
            _ => settings.octaves(p),
        }
    }

    /// The distance between two points.
    fn distance<const N: usize>(&self, a: [f32; N], b: [f32; N]) -> f32 {
        let apart = |k: usize| (a[k] - b[k]).abs();
        let axes = 0..N;
        match self.metric {
            Metric::Euclidean => axes.map(|k| apart(k) * apart(k)).sum::<f32>().sqrt(),
            Metric::Manhattan => axes.map(apart).sum(),
            Metric::Chebychev => axes.map(apart).fold(0.0, f32::max),
            Metric::Minkowski => {
                let sum: f32 = axes.map(|k| apart(k).powf(self.exponent)).sum();
                sum.powf(1.0 / self.exponent)
            }
        }
    }

    /// The points of all cells within `reach` cells of `center`, relative to the corner of `cell`.
    fn seeds<const N: usize>(
        &self,
        cell: [i32; N],
        center: [i32; N],
        reach: i32,
    ) -> impl Iterator<Item = Seed<N>> + '_ {
        let side = (2 * reach + 1) as usize;
        (0..side.pow(N as u32)).map(move |number| {
            // The digits of the number are the steps along the axes.
            let offset: [i32; N] = std::array::from_fn(|k| {
                center[k] + (number / side.pow(k as u32) % side) as i32 - reach
            });
            let at = std::array::from_fn::<i32, N, _>(|k| cell[k].wrapping_add(offset[k]));
            let hashed = if self.earlier {
                earlier_cell_point(at)
            } else {
                cell_point(at)
            };
            let place = std::array::from_fn(|k| offset[k] as f32 + hashed[k] * self.randomness);
            Seed { offset, place }
        })
    }

    /// The colour of the cell at an offset from another.
    fn color<const N: usize>(&self, cell: [i32; N], offset: [i32; N]) -> Vec3 {
        let at = std::array::from_fn::<i32, N, _>(|k| cell[k].wrapping_add(offset[k]));
        if self.earlier {
            color(at.map(|x| x as f32))
        } else {
            cell_color(at)
        }
    }

    /// Adds octaves of cells of falling size.
    fn octaves<const N: usize>(&self, p: [f32; N]) -> Cell<N> {
        let single = self.detail == 0.0 || self.roughness == 0.0;
        let (mut amplitude, mut most, mut scale) = (1.0_f32, 0.0_f32, 1.0_f32);
        let mut sum = Cell::<N>::empty(0.0);
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        for i in 0..=self.detail.ceil() as u32 {
            let octave = self.octave(p.map(|x| x * scale));
            if single {
                (most, sum) = (1.0, octave);
                break;
            }
            // The last octave may be a fraction of one.
            let whole = i as f32 <= self.detail;
            let share = if whole { 1.0 } else { self.detail.fract() };
            most += amplitude * share;
            sum.distance += octave.distance * amplitude * share;
            sum.color += octave.color * (amplitude * share);
            for (k, at) in sum.position.iter_mut().enumerate() {
                *at = mix(*at, octave.position[k] / scale, amplitude * share);
            }
            scale *= self.lacunarity;
            amplitude *= self.roughness;
        }
        if self.normalize {
            let corner = [0.5 + 0.5 * self.randomness; N];
            let farthest = self.distance([0.0; N], corner);
            let twice = if self.feature == Feature::Second {
                2.0
            } else {
                1.0
            };
            sum.distance /= most * farthest * twice;
            sum.color *= 1.0 / most;
        }
        let unscaled = |x: f32| {
            if self.scale == 0.0 {
                0.0
            } else {
                x / self.scale
            }
        };
        sum.position = sum.position.map(unscaled);
        sum
    }

    /// One octave.
    fn octave<const N: usize>(&self, p: [f32; N]) -> Cell<N> {
        let (cell, local) = split(p);
        if self.feature == Feature::Smooth && self.smoothness != 0.0 {
            return self.smooth(cell, local);
        }
        // Find the nearest two points.
        let mut found = [(f32::MAX, None::<Seed<N>>); 2];
        for seed in self.seeds(cell, [0; N], 1) {
            let distance = self.distance(seed.place, local);
            if distance < found[0].0 {
                found = [(distance, Some(seed)), found[0]];
            } else if distance < found[1].0 {
                found[1] = (distance, Some(seed));
            }
        }
        let (distance, seed) = found[usize::from(self.feature == Feature::Second)];
        let Some(seed) = seed else {
            return Cell::empty(0.0);
        };
        Cell {
            distance,
            color: self.color(cell, seed.offset),
            position: std::array::from_fn(|k| seed.place[k] + cell[k] as f32),
        }
    }

    /// The nearest cell, blended with its neighbours where they are about as near.
    fn smooth<const N: usize>(&self, cell: [i32; N], local: [f32; N]) -> Cell<N> {
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let mut blend = Cell::<N>::empty(0.0);
        for (number, seed) in self.seeds(cell, [0; N], 2).enumerate() {
            let distance = self.distance(seed.place, local);
            // Quilez' polynomial minimum, over the points one after the other.
            let t = 0.5 + 0.5 * (blend.distance - distance) / self.smoothness;
            let t = t.clamp(0.0, 1.0);
            let h = if number == 0 {
                1.0
            } else {
                t * t * (3.0 - 2.0 * t)
            };
            let correction = self.smoothness * h * (1.0 - h);
            blend.distance = mix(blend.distance, distance, h) - correction;
            let correction = correction / (1.0 + 3.0 * self.smoothness);
            let color = self.color(cell, seed.offset);
            blend.color = blend.color + (color - blend.color) * h - Vec3::splat(correction);
            for (at, place) in blend.position.iter_mut().zip(seed.place) {
                *at = mix(*at, place, h) - correction;
            }
        }
        blend.position = std::array::from_fn(|k| blend.position[k] + cell[k] as f32);
        blend
    }

    /// Combines octaves of the distance to the nearest edge.
    fn edge_octaves<const N: usize>(&self, p: [f32; N]) -> f32 {
        const FAR: f32 = 8.0; // beyond all edges
        let single = self.detail == 0.0 || self.roughness == 0.0;
        let farthest = 0.5 + 0.5 * self.randomness;
        let (mut amplitude, mut most, mut scale) = (1.0_f32, farthest, 1.0_f32);
        let mut nearest = FAR;
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        for i in 0..=self.detail.ceil() as u32 {
            let octave = edge(self, p.map(|x| x * scale));
            if single {
                nearest = octave;
                break;
            }
            let with = mix(nearest, nearest.min(octave / scale), amplitude);
            let larger = mix(most, farthest / scale, amplitude);
            if i as f32 <= self.detail {
                (nearest, most) = (with, larger);
                scale *= self.lacunarity;
                amplitude *= self.roughness;
            } else {
                let part = self.detail.fract();
                most = mix(most, larger, part);
                nearest = mix(nearest, nearest.min(with), part);
            }
        }
        if self.normalize {
            nearest / most
        } else {
            nearest
        }
    }

    /// Half of the distance between the nearest point and the point nearest to it.
    fn radius<const N: usize>(&self, p: [f32; N]) -> f32 {
        let (cell, local) = split(p);
        let nearer = |a: &Seed<N>, b: &Seed<N>, to: [f32; N]| {
            length2(a.place, to).total_cmp(&length2(b.place, to))
        };
        let nearest = self
            .seeds(cell, [0; N], 1)
            .min_by(|a, b| nearer(a, b, local));
        let Some(nearest) = nearest else { return 0.0 };
        let next = self
            .seeds(cell, nearest.offset, 1)
            .filter(|seed| seed.offset != nearest.offset)
            .min_by(|a, b| nearer(a, b, nearest.place));
        next.map_or(0.0, |next| length2(next.place, nearest.place).sqrt() / 2.0)
    }
}

/// The distance to the nearest edge between two cells.
fn edge<const N: usize>(settings: &Voronoi, p: [f32; N]) -> f32 {
    let (cell, local) = split(p);
    let nearest = settings
        .seeds(cell, [0; N], 1)
        .map(|seed| seed.place)
        .min_by(|&a, &b| length2(a, local).total_cmp(&length2(b, local)));
    let Some(nearest) = nearest else { return 0.0 };
    // The edge lies halfway between the nearest point and another, perpendicular to their connection.
    settings
        .seeds(cell, [0; N], 1)
        .filter_map(|seed| {
            let apart = length2(seed.place, nearest);
            let along = |k: usize| {
                (0.5 * (nearest[k] + seed.place[k]) - local[k]) * (seed.place[k] - nearest[k])
            };
            (apart > 1e-4).then(|| (0..N).map(along).sum::<f32>() / apart.sqrt())
        })
        .fold(f32::MAX, f32::min)
}

/// The cell of a position, and the position relative to its corner.
fn split<const N: usize>(p: [f32; N]) -> ([i32; N], [f32; N]) {
    let floor = p.map(f32::floor);
    (
        floor.map(|x| x as i32),
        std::array::from_fn(|k| p[k] - floor[k]),
    )
}

/// The squared distance of two points.
fn length2<const N: usize>(a: [f32; N], b: [f32; N]) -> f32 {
    (0..N).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

impl<const N: usize> Cell<N> {
    /// No cell, with a distance.
    fn empty(distance: f32) -> Self {
        Self {
            distance,
            color: Vec3::ZERO,
            position: [0.0; N],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Voronoi = Voronoi {
        feature: Feature::Nearest,
        metric: Metric::Euclidean,
        normalize: false,
        scale: 1.0,
        detail: 0.0,
        roughness: 0.5,
        lacunarity: 2.0,
        smoothness: 1.0,
        exponent: 0.5,
        randomness: 1.0,
        earlier: false,
    };

    fn places() -> impl Iterator<Item = [f32; 3]> {
        (0..500).map(|i| [0.37, 0.11, -0.23].map(|step| i as f32 * step))
    }

    #[test]
    fn the_distance_is_that_to_the_position_of_the_cell() {
        for p in places() {
            for (feature, earlier) in [
                (Feature::Nearest, false),
                (Feature::Second, false),
                (Feature::Nearest, true),
            ] {
                let cells = Voronoi {
                    feature,
                    earlier,
                    ..BASE
                };
                let cell = cells.at(p);
                assert!((length2(cell.position, p).sqrt() - cell.distance).abs() < 1e-4);
            }
            let [first, second] = [Feature::Nearest, Feature::Second]
                .map(|feature| Voronoi { feature, ..BASE }.at(p).distance);
            assert!(first <= second);
            let edge = Voronoi {
                feature: Feature::Edge,
                ..BASE
            }
            .at(p)
            .distance;
            assert!(edge >= -1e-6 && edge <= 0.5 * (first + second) + 1e-4);
        }
    }

    #[test]
    fn without_randomness_the_points_are_the_corners() {
        let grid = Voronoi {
            randomness: 0.0,
            ..BASE
        };
        assert_eq!(grid.at([2.2_f32, 3.4]).position, [2.0, 3.0]);
        assert!((grid.at([2.25_f32]).distance - 0.25).abs() < 1e-6);
        let radius = Voronoi {
            feature: Feature::Radius,
            ..grid
        }
        .at([2.2_f32, 3.4, 0.1, 0.9]);
        assert_eq!(radius.distance, 0.5);
        let edge = Voronoi {
            feature: Feature::Edge,
            ..grid
        }
        .at([2.2_f32, 3.4]);
        assert!((edge.distance - 0.1).abs() < 1e-6);
    }

    #[test]
    fn metrics_agree_along_an_axis_and_a_fraction_of_an_octave_blends() {
        let grid = Voronoi {
            randomness: 0.0,
            ..BASE
        };
        for &(name, metric) in Metric::NAMED {
            let found = Voronoi { metric, ..grid }.at([2.25_f32, 0.0, 0.0]);
            assert!((found.distance - 0.25).abs() < 1e-5, "{name}");
        }
        for p in places().take(50) {
            for &(name, feature) in Feature::NAMED {
                let of = |detail| {
                    Voronoi {
                        feature,
                        detail,
                        ..BASE
                    }
                    .at(p)
                    .distance
                };
                assert!((of(2.0) - of(2.0005)).abs() < 1e-2, "{name}");
            }
        }
    }
}
