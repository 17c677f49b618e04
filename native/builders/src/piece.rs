// SPDX-License-Identifier: GPL-3.0-or-later
//! The data that a node keeps per triangle during the build.

use crate::sweep::Scratch;
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_geom::clip::clipped_bounds;
use halfspace_geom::vec3::{Vec3, add_scaled, dot, sub, widen};
use halfspace_ray::FramedScene;

/// The data that a node keeps per triangle during the build.
///
/// A triangle belongs to every closed cell that the piece meets, up to rounding: rounding may add cells without
/// limit, but may omit cells only within the error bounds of the traversals.
pub trait Piece: Copy + Send + Sync {
    /// Makes the piece of a whole triangle, its vertices in the structure's frame.
    fn new(id: u32, corners: [[f32; 3]; 3]) -> Self;

    /// Returns the triangle's number.
    fn id(&self) -> u32;

    /// Returns the ends of the piece along a direction.
    fn interval(&self, direction: Direction) -> (f32, f32);

    /// Returns a box around the piece.
    fn bounds(&self) -> Aabb;

    /// Returns the pieces on both sides of a plane that crosses this one.
    fn cut(self, plane: Plane, framed: FramedScene<'_>) -> (Option<Self>, Option<Self>);

    /// Writes the ends of all pieces along a direction to `scratch`, for the sweep.
    #[inline(always)]
    fn project(pieces: &[Self], direction: Direction, scratch: &mut Scratch) {
        // Two passes over the pieces: extending from an iterator of known length needs no capacity checks.
        scratch.min.clear();
        scratch.max.clear();
        let ends = |piece: &Self| piece.interval(direction);
        if let Direction::Axis(_) = direction {
            scratch.min.extend(pieces.iter().map(|piece| ends(piece).0));
            scratch.max.extend(pieces.iter().map(|piece| ends(piece).1));
            return;
        }
        scratch.min.resize(pieces.len(), 0.0);
        scratch.max.resize(pieces.len(), 0.0);
        let lists = scratch.min.iter_mut().zip(&mut scratch.max);
        for (piece, (min, max)) in pieces.iter().zip(lists) {
            (*min, *max) = ends(piece);
        }
    }
}

/// The bounds of a whole triangle, for axis-aligned planes.
#[derive(Debug, Clone, Copy)]
pub struct Boxed {
    bounds: Aabb,
    id: u32,
}

impl Piece for Boxed {
    fn new(id: u32, corners: [[f32; 3]; 3]) -> Self {
        Self {
            bounds: Aabb::of_triangle(corners),
            id,
        }
    }

    #[inline(always)]
    fn id(&self) -> u32 {
        self.id
    }

    #[inline(always)]
    fn interval(&self, direction: Direction) -> (f32, f32) {
        let Direction::Axis(k) = direction else {
            unreachable!("boxes are for axis-aligned planes");
        };
        (self.bounds.min[k], self.bounds.max[k])
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn cut(self, _: Plane, _: FramedScene<'_>) -> (Option<Self>, Option<Self>) {
        (Some(self), Some(self))
    }
}

/// The bounds of the part of a triangle inside the node's cell, for axis-aligned planes.
#[derive(Debug, Clone, Copy)]
pub struct ClippedBox(Boxed);

impl Piece for ClippedBox {
    fn new(id: u32, corners: [[f32; 3]; 3]) -> Self {
        Self(Boxed::new(id, corners))
    }

    #[inline(always)]
    fn id(&self) -> u32 {
        self.0.id
    }

    #[inline(always)]
    fn interval(&self, direction: Direction) -> (f32, f32) {
        self.0.interval(direction)
    }

    fn bounds(&self) -> Aabb {
        self.0.bounds
    }

    fn cut(self, plane: Plane, framed: FramedScene<'_>) -> (Option<Self>, Option<Self>) {
        let FramedScene { scene, frame } = framed;
        let Direction::Axis(axis) = plane.direction else {
            unreachable!("boxes are for axis-aligned planes");
        };
        let corners = scene.corners(self.0.id).map(|p| frame.point(p));
        // Clip the triangle itself, not the piece, so that errors do not accumulate.
        let (mut low, mut high) = (self.0.bounds, self.0.bounds);
        low.max[axis] = plane.offset;
        high.min[axis] = plane.offset;
        let magnitude = frame.bounds().magnitude();
        let piece = |bounds: Aabb| Self(Boxed { bounds, ..self.0 });
        let part = |cell: &Aabb| clipped_bounds(corners, cell, magnitude).map(piece);
        match (part(&low), part(&high)) {
            // Rounding lost both parts: keep the boxes on both sides.
            (None, None) => (Some(piece(low)), Some(piece(high))),
            parts => parts,
        }
    }
}

/// A whole triangle, for planes of any direction.
#[derive(Debug, Clone, Copy)]
pub struct Whole {
    corners: [[f32; 3]; 3],
    id: u32,
}

impl Piece for Whole {
    fn new(id: u32, corners: [[f32; 3]; 3]) -> Self {
        // Adding 0.0 turns -0.0 to 0.0, as in the bounds of boxes.
        Self {
            corners: corners.map(|p| p.map(|x| x + 0.0)),
            id,
        }
    }

    #[inline(always)]
    fn id(&self) -> u32 {
        self.id
    }

    #[inline(always)]
    fn interval(&self, direction: Direction) -> (f32, f32) {
        // Written out, because calls through `map` are not always inlined.
        let [a, b, c] = self.corners;
        let (a, b, c) = (
            direction.height(a),
            direction.height(b),
            direction.height(c),
        );
        (a.min(b).min(c), a.max(b).max(c))
    }

    fn bounds(&self) -> Aabb {
        Aabb::of_triangle(self.corners)
    }

    fn cut(self, _: Plane, _: FramedScene<'_>) -> (Option<Self>, Option<Self>) {
        (Some(self), Some(self))
    }
}

/// Largest number of vertices kept: that of a triangle clipped by three planes. Further cuts that need more are
/// omitted, which is rare because most new vertices replace old ones.
const CORNERS: usize = 6;

/// The part of a triangle inside the node's cell, for planes of any direction: perfect splits (Havran and Bittner
/// 2002; Ize, Wald and Parker 2008, section 4.1).
///
/// Clipping uses f64 and planes moved outwards by 2^-40 of the scene's largest coordinate, far above the rounding
/// of f64 and far below the error bounds of traversals. A cut that would need too many vertices is omitted, which
/// keeps more of the triangle than necessary.
#[derive(Debug, Clone, Copy)]
pub struct Clipped {
    /// Bounds of the vertices, rounded as heights are: most directions of a sweep are axes.
    bounds: Aabb,
    corners: [Vec3; CORNERS],
    count: u32,
    id: u32,
}

impl Clipped {
    /// Returns the part where `sign * (n . x - offset) >= -margin`; `None` if it is empty.
    fn part(&self, sign: f64, n: Vec3, offset: f64, margin: f64) -> Option<Self> {
        let count = self.count as usize;
        let mut out = Self {
            count: 0,
            bounds: Aabb::EMPTY,
            ..*self
        };
        let mut room = true;
        // Append a vertex while there is a free slot.
        let mut push = |p: Vec3| {
            if let Some(corner) = out.corners.get_mut(out.count as usize) {
                *corner = p;
                out.count += 1;
            } else {
                room = false;
            }
        };
        // Clip by Sutherland and Hodgman.
        let height = |p: Vec3| sign * (dot(n, p) - offset) + margin;
        for i in 0..count {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % count]);
            let (ha, hb) = (height(a), height(b));
            if ha >= 0.0 {
                push(a);
            }
            if (ha < 0.0) != (hb < 0.0) {
                push(add_scaled(a, ha / (ha - hb), sub(b, a)));
            }
        }
        // Keep the whole piece rather than lose a vertex.
        if !room {
            return Some(*self);
        }
        out.enclose();
        (out.count > 0).then_some(out)
    }

    /// Recomputes the bounds.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "planes have f32 heights; the traversals allow for the rounding"
    )]
    fn enclose(&mut self) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in &self.corners[..self.count as usize] {
            for k in 0..3 {
                low[k] = if p[k] < low[k] { p[k] } else { low[k] };
                high[k] = if p[k] > high[k] { p[k] } else { high[k] };
            }
        }
        // Adding 0.0 turns -0.0 to 0.0, as in the bounds of boxes.
        self.bounds = Aabb {
            min: low.map(|x| x as f32 + 0.0),
            max: high.map(|x| x as f32 + 0.0),
        };
    }
}

impl Piece for Clipped {
    fn new(id: u32, corners: [[f32; 3]; 3]) -> Self {
        let mut out = Self {
            bounds: Aabb::of_triangle(corners),
            corners: [[0.0; 3]; CORNERS],
            count: 3,
            id,
        };
        for (corner, p) in out.corners.iter_mut().zip(corners) {
            *corner = widen(p);
        }
        out
    }

    #[inline(always)]
    fn id(&self) -> u32 {
        self.id
    }

    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "planes have f32 heights; the traversals allow for the rounding"
    )]
    fn interval(&self, direction: Direction) -> (f32, f32) {
        let n = match direction {
            Direction::Axis(k) => return (self.bounds.min[k], self.bounds.max[k]),
            Direction::Oblique(n) => widen(n),
        };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &p in &self.corners[..self.count as usize] {
            let height = dot(n, p);
            low = if height < low { height } else { low };
            high = if height > high { height } else { high };
        }
        // Adding 0.0 turns -0.0 to 0.0, as in the bounds of boxes.
        (low as f32 + 0.0, high as f32 + 0.0)
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn cut(self, plane: Plane, framed: FramedScene<'_>) -> (Option<Self>, Option<Self>) {
        let n = widen(plane.direction.vector());
        let offset = f64::from(plane.offset);
        let margin = f64::from(framed.frame.bounds().magnitude()) / (1_u64 << 40) as f64;
        let parts = (
            self.part(-1.0, n, offset, margin),
            self.part(1.0, n, offset, margin),
        );
        match parts {
            (None, None) => (Some(self), Some(self)),
            parts => parts,
        }
    }
}
