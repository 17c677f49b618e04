// SPDX-License-Identifier: GPL-3.0-or-later
//! All boxes of a node against a whole group of rays at once, by interval arithmetic (Boulos, Wald and Shirley 2006,
//! Geometric and arithmetic culling methods for entire ray packets). Boxes that no ray of the group can hit are left
//! out before the others are tested ray by ray.
//!
//! The sides of entry are compared with the origin farthest along the axis and the sides of exit with the one farthest
//! behind, both multiplied by the least and by the largest reciprocal. Differences and products round monotonically, so
//! the result bounds `(p - o) * inv` as computed for each ray of the group, and the largest error bound of a distance
//! in the group covers the rest ([`crate::packet::Packet::slack`]).

use crate::packet::fill::ends;
use crate::packet::{Group, Packet};
use crate::tile;
use fearless_simd::{Simd, SimdFloat, SimdMask, f32x4, f32x8, mask32x16};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_nodes::box_tree::Wide;

/// One axis of a bundle.
#[derive(Clone, Copy)]
struct Axis {
    /// Whether the rays descend along the axis: 1 if they do.
    back: usize,
    /// The origins for sides of entry and for sides of exit.
    origins: [f32; 2],
    /// Least and largest reciprocal of the directions.
    inv: [f32; 2],
    /// Largest error bound of a distance.
    slack: f32,
}

/// Bounds of the rays of a group, which have common direction signs.
pub struct Bundle {
    axes: [Axis; 3],
    /// Smallest distance at which a ray starts.
    start: f32,
}

impl Bundle {
    /// The bounds of a group.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, packet: &Packet, group: Group) -> Self {
        let lanes = mask32x16::from_bitmask(simd, group.lanes);
        let [least, most] = packet.origins;
        let (_, span) = ends(simd, lanes, tile::load(simd, &packet.span));
        let mut axes = [Axis {
            back: 0,
            origins: [0.0; 2],
            inv: [0.0; 2],
            slack: f32::INFINITY,
        }; 3];
        for (k, axis) in axes.iter_mut().enumerate() {
            let back = group.signs >> k & 1 == 1;
            axis.back = usize::from(back);
            let (slow, fast) = ends(simd, lanes, tile::load(simd, &packet.inv[k]));
            let (_, slack) = ends(simd, lanes, tile::load(simd, &packet.slack[k]));
            // If a product with some coordinate may overflow, this axis bounds nothing.
            if (span * slow.abs().max(fast.abs())).is_finite() && slack.is_finite() {
                let (low, high) = (least[k], most[k]);
                axis.origins = if back { [low, high] } else { [high, low] };
                axis.inv = [slow, fast];
                axis.slack = slack;
            }
        }
        let (start, _) = ends(simd, lanes, tile::load(simd, &packet.start));
        Self { axes, start }
    }

    /// Mask of the boxes that some ray of the group may hit before `far`.
    #[inline(always)]
    pub fn meets<S: Simd, const W: usize>(&self, simd: S, node: &Wide<W>, far: f32) -> u64 {
        match W {
            8 => self.met::<S, f32x8<S>, W>(simd, &node.bounds, far),
            4 => self.met::<S, f32x4<S>, W>(simd, &node.bounds, far),
            _ => (1 << W) - 1,
        }
    }

    /// [`Self::meets`] with one box per lane of `V`.
    #[inline(always)]
    fn met<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        bounds: &[[f32; W]; 6],
        far: f32,
    ) -> u64 {
        let (mut enter, mut leave) = (V::splat(simd, self.start), V::splat(simd, far));
        for (k, axis) in self.axes.iter().enumerate() {
            let [soonest, latest] = axis.origins.map(|o| V::splat(simd, o));
            let near = V::from_slice(simd, &bounds[k + 3 * axis.back]) - soonest;
            let away = V::from_slice(simd, &bounds[k + 3 * (1 - axis.back)]) - latest;
            let [slow, fast] = axis.inv.map(|inv| V::splat(simd, inv));
            let slack = V::splat(simd, axis.slack);
            enter = keep_max_each((near * slow).min(near * fast) - slack, enter);
            leave = keep_min_each((away * slow).max(away * fast) + slack, leave);
        }
        enter.simd_le(leave).to_bitmask()
    }
}

/// Largest `reach` of the rays of a group.
#[inline(always)]
pub fn farthest<S: Simd>(simd: S, packet: &Packet, group: Group) -> f32 {
    let lanes = mask32x16::from_bitmask(simd, group.lanes);
    let (_, far) = ends(simd, lanes, tile::load(simd, &packet.reach));
    far
}
