// SPDX-License-Identifier: GPL-3.0-or-later
//! The Radial Tiling node: polar coordinates in which a polygon with rounded corners is a circle.
//!
//! The plane is divided into segments around the origin, one for each side of a regular polygon; the last one is
//! smaller if the number of sides is not whole. In each segment one coordinate is the size of the polygon through the
//! point, the other the position along its side. The definitions are those of Blender 5's node.

use std::f32::consts::{PI, TAU};

use crate::math::vector::{Vec3, vec3};
use crate::values::math_nodes::named;

named! {
    /// Outputs of the node.
    RadialOutput {
        Coordinates = "Segment Coordinates", Id = "Segment ID", Width = "Segment Width",
        Rotation = "Segment Rotation",
    }
}

/// Half of a segment, with the rounded corner at its end.
#[derive(Debug, Clone, Copy)]
struct Half {
    /// Angle from the segment's middle to its end.
    angle: f32,
    /// Angle from the end of the segment to where the corner becomes straight.
    corner: f32,
    /// Roundness of the corner.
    round: f32,
    /// Size of the polygon per size of the segment's own side.
    scale: f32,
}

impl Half {
    /// Half of a segment whose corner begins where a circle of radius `round` touches the side.
    fn new(angle: f32, round: f32, scale: f32) -> Self {
        // The sides of a polygon of two are parallel: the tangent of their half has either sign.
        let corner = angle - ((1.0 - round) * angle.tan()).abs().atan();
        Self {
            angle,
            corner,
            round,
            scale,
        }
    }

    /// The same half with a corner of this angle, as round as that makes it.
    fn with_corner(self, corner: f32) -> Self {
        let round = 1.0 - (self.angle - corner).tan() / self.angle.tan();
        Self {
            corner,
            round,
            ..self
        }
    }

    /// The angle over which positions change from lengths to angles.
    fn blend(self) -> f32 {
        (1.0 - self.round) * self.corner
    }

    /// The length of the side of the size `size`, from its middle to its end.
    fn length(self, size: f32) -> f32 {
        let blend = self.blend();
        size * (self.angle - self.corner).tan()
            + blend * (0.5 * size + 0.5)
            + self.round * self.corner
    }

    /// Half of the width of the segment of the unit polygon.
    fn width(self) -> f32 {
        self.scale * self.length(1.0 / self.scale)
    }

    /// The size of the polygon through a point on the straight part and its position. `r`: distance from the origin;
    /// `off`: angle from the middle; `measure`: the half that positions are divided by, if they are.
    fn straight(self, r: f32, off: f32, measure: Option<Self>) -> [f32; 2] {
        let size = r * off.cos();
        let along = self.scale * size * off.tan();
        let unit = measure.map_or(1.0, |half| self.scale * half.length(size));
        [self.scale * size, along / unit]
    }

    /// The same at the corner. `size`: that of the segment's own side; `from_end`: angle from the end of the segment.
    fn rounded(self, r: f32, size: f32, from_end: f32, normalize: bool) -> [f32; 2] {
        let (blend, beyond) = (self.blend(), self.corner - from_end);
        let (sin, cos) = (self.angle - self.corner).sin_cos();
        // The position goes on with the straight part's slope, which falls to that of an angle.
        let bent = if beyond < blend {
            r * cos * beyond + 0.5 * (1.0 - r * cos) * beyond * beyond / blend
        } else {
            blend * (0.5 * r * cos - 0.5) + beyond
        };
        let mut along = r * sin + bent;
        if normalize {
            let (inner, outer) = (self.length(size), self.length(r * cos));
            along /= inner + (outer - inner) * (beyond / self.corner);
        }
        // Both the position and what it is divided by grow with the scale.
        let scale = if normalize { 1.0 } else { self.scale };
        [self.scale * size, scale * along]
    }
}

/// A point in polar coordinates, and the segments around it.
struct Tiling {
    /// Distance from the origin, and counterclockwise angle from the x axis, 0 to a turn.
    r: f32,
    turn: f32,
    /// Angle from the start of the point's segment.
    offset: f32,
    /// Angle at which the segment starts.
    start: f32,
    /// Half of each full segment.
    half: Half,
    normalize: bool,
}

/// Size of the polygon, position along its side from the middle, half of the segment's width, angle of its middle.
type Found = [f32; 4];

impl Tiling {
    fn new(p: Vec3, sides: f32, round: f32, normalize: bool) -> Self {
        let turn = turn_of(p);
        let half = Half::new(PI / sides, round, 1.0);
        let start = (turn / (2.0 * half.angle)).floor() * 2.0 * half.angle;
        Self {
            r: p.x.hypot(p.y),
            turn,
            offset: turn - start,
            start,
            half,
            normalize,
        }
    }

    /// Adds what only depends on the segment. `middle`: angle from its start.
    fn found(&self, half: Half, [size, along]: [f32; 2], width: f32, middle: f32) -> Found {
        let sign = if self.offset < half.angle { -1.0 } else { 1.0 };
        [size, sign * along, width, self.start + middle]
    }

    /// Angle from the middle of a segment of this half angle.
    fn off(&self, angle: f32) -> f32 {
        (angle - self.offset).abs()
    }

    /// A point of a full segment whose corners are those of a regular polygon. `measure`: see [`Half::straight`].
    fn regular(&self, measure: Half) -> Found {
        let half = self.half;
        let from_end = self.offset.min(2.0 * half.angle - self.offset);
        if from_end >= half.corner {
            let measure = self.normalize.then_some(measure);
            let parts = half.straight(self.r, self.off(half.angle), measure);
            return self.found(half, parts, half.width(), half.angle);
        }
        // The corner's circle around a point of the line between two segments.
        let centre = (1.0 - half.round) / half.angle.cos();
        let size = self.r / reach([centre, 0.0], half.round, from_end);
        let parts = half.rounded(self.r, size, from_end, self.normalize);
        self.found(half, parts, half.width(), half.angle)
    }

    /// A point in or next to the last segment, which is smaller. `sides`: not whole.
    fn irregular(&self, sides: f32) -> Found {
        let half = self.half;
        let angle = PI - sides.floor() * half.angle;
        let scale = half.angle.cos() / angle.cos();
        let last = Half::new(angle, half.round, scale);
        // One circle touches the last side and, with another angle, its neighbour.
        let radius = half.round * angle.tan() / (0.5 * (half.angle + angle)).tan();
        let far = 1.0 / (angle - last.corner).cos();
        let centre = [
            last.corner.cos() * far - radius * angle.cos(),
            radius * angle.sin() - last.corner.sin() * far,
        ];
        let (sin, cos) = half.angle.sin_cos();
        let [x, y] = [centre[0] + radius * cos, centre[1] + radius * sin];
        let outer = half.with_corner((y / x).atan());
        // The last segment begins here; both of its ends are corners of that kind.
        let begin = TAU - 2.0 * angle;
        if self.turn >= outer.corner && self.turn < begin - outer.corner {
            let beside = self.turn >= begin - half.angle || self.turn < half.angle;
            if !beside {
                return self.regular(half);
            }
            let straight = half.straight(
                self.r,
                self.off(half.angle),
                self.normalize.then_some(outer),
            );
            return self.found(half, straight, half.width(), half.angle);
        }
        if self.turn >= begin + last.corner && self.turn < TAU - last.corner {
            let straight = last.straight(self.r, self.off(angle), self.normalize.then_some(last));
            return self.found(last, straight, last.width(), angle);
        }
        // Angles from the nearest end of the last segment, positive outside of it.
        let mut from_end = if self.turn > PI {
            self.turn - TAU
        } else {
            self.turn
        };
        if self.turn >= begin - outer.corner && self.turn < TAU - angle {
            from_end = -(from_end + 2.0 * angle);
        }
        let size = self.r / reach(centre, radius, from_end);
        if from_end < 0.0 {
            let parts = last.rounded(self.r, size, -from_end, self.normalize);
            return self.found(last, parts, last.width(), angle);
        }
        let parts = outer.rounded(self.r, scale * size, from_end, self.normalize);
        self.found(half, parts, half.width(), half.angle)
    }
}

/// Returns the counterclockwise angle from the x axis, 0 to a turn.
fn turn_of(p: Vec3) -> f32 {
    let angle = p.y.atan2(p.x);
    if p.y < 0.0 { angle + TAU } else { angle }
}

/// Returns the distance from the origin to the far side of a circle, in a direction of this angle.
fn reach([x, y]: [f32; 2], radius: f32, angle: f32) -> f32 {
    let (sin, cos) = angle.sin_cos();
    let middle = sin * y + cos * x;
    middle
        + (middle * middle + radius * radius - x * x - y * y)
            .max(0.0)
            .sqrt()
}

/// Returns an output of the node. `sides`: of the polygon, at least 2; `round`: roundness of its corners, 0..1;
/// `normalize`: whether positions along the sides are 0..1.
pub fn radial_tiling(
    output: RadialOutput,
    normalize: bool,
    p: Vec3,
    sides: f32,
    round: f32,
) -> Vec3 {
    let (sides, round) = (sides.max(2.0), round.clamp(0.0, 1.0));
    if output == RadialOutput::Id {
        let turn = p.y.atan2(p.x) / TAU + f32::from(u8::from(p.y < 0.0));
        return Vec3::splat((sides * turn).floor());
    }
    // Two parallel sides have no end.
    let endless = sides == 2.0 && round == 0.0;
    let tiling = Tiling::new(p, sides, round, normalize && !endless);
    let [size, along, width, middle] = if sides.fract() == 0.0 {
        tiling.regular(tiling.half)
    } else {
        tiling.irregular(sides)
    };
    match output {
        RadialOutput::Width => Vec3::splat(if endless { 0.0 } else { width }),
        RadialOutput::Rotation => Vec3::splat(middle),
        _ => {
            let along = if p.x == 0.0 && p.y == 0.0 { 0.0 } else { along };
            if normalize {
                vec3(0.5 * along + 0.5, size, 0.0)
            } else {
                vec3(along, size - 1.0, 0.0)
            }
        }
    }
}
