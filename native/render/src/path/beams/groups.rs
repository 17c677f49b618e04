// SPDX-License-Identifier: GPL-3.0-or-later
//! Puts the rays of a wavefront in the order of their beams.

use crate::film::Shares;
use crate::path::beams::source::Source;
use crate::path::state::Path;
use halfspace_ray::{Order, Ray};
use std::ops::Range;

/// Smallest number of rays that are traced as a beam (chosen: a packet's).
const LEAST: usize = 16;

/// Consecutive rays of one beam, or of none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Indices of the rays.
    pub rays: Range<usize>,
    /// How they are traced: in tiles if they are a beam.
    pub order: Order,
}

/// The order of the rays, and the memory to put them into it.
#[derive(Default)]
pub struct Groups {
    order: Vec<(u128, u32)>,
    rays: Vec<Ray>,
    paths: Vec<Path>,
    shares: Vec<Shares>,
    groups: Vec<Group>,
}

impl Groups {
    /// Reorders rays, paths and, unless there are none, their shares by their sources, and returns the groups, which cover all rays. Rays of one source keep
    /// their order, which is that of the pixels, 8 by 8.
    pub fn sort(
        &mut self,
        rays: &mut Vec<Ray>,
        paths: &mut Vec<Path>,
        shares: &mut Vec<Shares>,
        sources: &mut [Source],
    ) -> &[Group] {
        // Sort by source; the index keeps the order of equal ones.
        self.order.clear();
        self.order
            .extend((0..).zip(&*sources).map(|(i, source)| (source.key(), i)));
        self.order.sort_unstable();
        let permuted = |i: &(u128, u32)| i.1 as usize;
        self.rays.clear();
        self.rays
            .extend(self.order.iter().map(|i| rays[permuted(i)]));
        self.paths.clear();
        self.paths
            .extend(self.order.iter().map(|i| paths[permuted(i)]));
        if !shares.is_empty() {
            self.shares.clear();
            self.shares
                .extend(self.order.iter().map(|i| shares[permuted(i)]));
            std::mem::swap(shares, &mut self.shares);
        }
        std::mem::swap(rays, &mut self.rays);
        std::mem::swap(paths, &mut self.paths);
        sources.sort_unstable_by_key(|source| source.key());
        // Cut the rays where the source changes; join what is in no beam or in a small one.
        self.groups.clear();
        for run in self.order.chunk_by(|a, b| a.0 == b.0) {
            let order = if run.len() >= LEAST && run[0].0 != Source::None.key() {
                Order::Tiles
            } else {
                Order::None
            };
            match self.groups.last_mut() {
                Some(last) if last.order == Order::None && order == Order::None => {
                    last.rays.end += run.len();
                }
                last => {
                    let start = last.map_or(0, |last| last.rays.end);
                    self.groups.push(Group {
                        rays: start..start + run.len(),
                        order,
                    });
                }
            }
        }
        &self.groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::PixelSampler;
    use crate::math::vector::{Vec3, vec3};

    #[test]
    fn beams_are_contiguous_and_keep_their_order() {
        let eye = |x| Source::Point(vec3(x, 0.0, 0.0));
        // Alternate two beams, one of them small, with rays of none.
        let mut sources: Vec<_> = (0..100)
            .map(|i| match i % 4 {
                0 | 1 => eye(1.0),
                2 if i < 20 => eye(2.0),
                _ => Source::None,
            })
            .collect();
        let before = sources.clone();
        let ray = |i: u32| Ray {
            o: [i as f32, 0.0, 0.0],
            d: [0.0, 0.0, 1.0],
            t_min: 0.0,
            t_max: 1.0,
        };
        let mut rays: Vec<_> = (0..100).map(ray).collect();
        let from = Ray {
            o: [0.0; 3],
            d: [0.0; 3],
            t_min: 0.0,
            t_max: 0.0,
        };
        let path = |i| Path::from_camera(&from, PixelSampler::new(0, 0, 0), 0, i);
        let mut paths: Vec<_> = (0..100).map(path).collect();
        let share = |i: f32| Shares::of(Vec3::splat(i), Vec3::ZERO, Vec3::ONE);
        let mut shares: Vec<_> = (0..100).map(|i| share(i as f32)).collect();
        let mut groups = Groups::default();
        let groups = groups
            .sort(&mut rays, &mut paths, &mut shares, &mut sources)
            .to_vec();
        let tiles: Vec<_> = groups.iter().filter(|g| g.order == Order::Tiles).collect();
        assert_eq!(tiles.len(), 1);
        assert_eq!(tiles[0].rays.len(), 50);
        // Every ray is in one group, with its own path and source.
        let mut end = 0;
        for group in &groups {
            assert_eq!(group.rays.start, end);
            end = group.rays.end;
        }
        assert_eq!(end, 100);
        for (k, (ray, path)) in rays.iter().zip(&paths).enumerate() {
            let index = path.slot as usize;
            assert_eq!(ray.o[0], index as f32);
            assert_eq!(sources[k], before[index]);
            assert_eq!(shares[k], share(index as f32));
        }
        let beam = tiles[0].rays.clone();
        assert!(paths[beam].windows(2).all(|w| w[0].slot < w[1].slot));
    }
}
