// SPDX-License-Identifier: GPL-3.0-or-later
//! Split planes relative to the eye of a beam, and the depths at which beams cross them.

use crate::bundle::lanes;
use crate::planes::Tile;
use halfspace_geom::bound::keep_min;
use halfspace_geom::vec3::{Vec3, dot, widen};
use halfspace_geom::view::{Line, Polygon};

/// An interval of depths along the axis of a tile.
#[derive(Clone, Copy)]
pub(super) struct Depths {
    pub(super) enter: f64,
    pub(super) leave: f64,
}

/// Distance from the eye along the normal of a plane.
#[derive(Clone, Copy)]
struct Gap {
    distance: f64,
    /// Its error bound.
    pad: f64,
}

/// A split plane relative to the eye.
pub(super) struct Seen {
    /// The child on the eye's side.
    pub(super) near: u32,
    /// Bits of the empty children.
    empty: u32,
    /// Speed of the directions towards the plane, an affine function of the pixel.
    speed: Line,
    /// The eye's distance; `None` if the eye may lie in the plane.
    gap: Option<Gap>,
}

impl Seen {
    /// Whether a child is an empty leaf.
    #[inline(always)]
    pub(super) fn is_empty(&self, child: u32) -> bool {
        self.empty >> (child & 1) & 1 == 1
    }

    /// The interval of depths in which the directions of a polygon cross the plane, rounded outwards.
    #[inline(always)]
    pub(super) fn crossing(&self, polygon: &Polygon) -> Depths {
        let Some(Gap { distance, pad }) = self.gap else {
            return Depths {
                enter: f64::NEG_INFINITY,
                leave: f64::INFINITY,
            };
        };
        let (slowest, quickest) = polygon.range(&self.speed);
        let at = |distance: f64, speed: f64| {
            if speed > 0.0 {
                distance / speed
            } else {
                f64::INFINITY
            }
        };
        Depths {
            enter: at(distance - pad, quickest) * (1.0 - 1e-9),
            leave: at(distance + pad, slowest) * (1.0 + 1e-9),
        }
    }
}

impl Tile<'_> {
    /// A plane across an axis, relative to the eye.
    #[inline(always)]
    pub(super) fn see_axis(&self, axis: usize, split: f32, children: u32, empty: u32) -> Seen {
        let mut normal = [0.0; 3];
        normal[axis] = 1.0;
        self.see(normal, split, self.axis_pads[axis], children, empty)
    }

    /// An oblique plane relative to the eye.
    #[inline(always)]
    pub(super) fn see_oblique(
        &self,
        normal: [f32; 3],
        offset: f32,
        children: u32,
        empty: u32,
    ) -> Seen {
        self.see(widen(normal), offset, self.oblique_pad, children, empty)
    }

    /// A plane relative to the eye. `pad`: error bound of the eye's distance.
    #[inline(always)]
    fn see(&self, normal: Vec3, offset: f32, pad: f32, children: u32, empty: u32) -> Seen {
        let gap = f64::from(offset) - dot(normal, widen(self.eye));
        let up = gap > 0.0;
        let turned = if up { normal } else { normal.map(|x| -x) };
        let (distance, pad) = (gap.abs(), f64::from(pad));
        Seen {
            near: children + u32::from(!up),
            empty,
            speed: self.view.speed(turned),
            gap: (distance > pad).then_some(Gap { distance, pad }),
        }
    }

    /// Mask of those `pixels` whose best hit does not certainly lie before the plane.
    #[inline(always)]
    pub(super) fn open(&self, plane: &Seen, pixels: u64) -> u64 {
        let Some(Gap { distance, pad }) = plane.gap else {
            return pixels;
        };
        let behind = lanes(pixels).filter(|&i| {
            let reach = f64::from(keep_min(self.best[i].reach, self.rows.reach[i])) * self.depth[i];
            let speed = plane.speed.at(self.at[i]);
            // A ray that moves away from the plane, or along it, never crosses it.
            (distance - pad) * (1.0 - 1e-9) > reach * speed.max(0.0) * (1.0 + 1e-9) + reach * 1e-11
        });
        behind.fold(pixels, |pixels, i| pixels & !(1 << i))
    }
}
