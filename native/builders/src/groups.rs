// SPDX-License-Identifier: GPL-3.0-or-later
//! A hierarchy of boxes that counts the pieces on each side of a plane without testing each of them.
//!
//! It has a box for each eight consecutive pieces, one for each eight of those boxes, and so on. The pieces of a build
//! are sorted along a curve once, and splits keep their order, so consecutive ones stay close: the hierarchy of a node
//! needs one pass over its pieces, without another sort.

use crate::piece::Piece;
use halfspace_geom::Aabb;
use halfspace_geom::cell::Plane;
use halfspace_ray::frame::U;

/// Number of pieces, or boxes, per box.
const FAN: usize = 8;

/// Error margin of the heights of boxes, per unit of the scene's largest coordinate. Derived: twice the rounding errors
/// of three products and two sums, for the box and for a piece.
const ROOM: f32 = 32.0 * U;

/// A hierarchy of boxes around the pieces of a node.
#[derive(Debug, Default)]
pub struct Groups {
    /// Levels of boxes, the lowest first: one box per eight pieces.
    levels: Vec<Vec<Aabb>>,
    /// Error margin of the heights of boxes.
    room: f32,
}

/// Numbers of pieces that extend below a plane, that extend above it, and that lie in it. A piece that the plane cuts
/// is in the first two.
pub type Sides = [usize; 3];

impl Groups {
    /// Builds the hierarchy over the pieces of a node; `magnitude` is the scene's largest coordinate.
    pub fn fill<P: Piece>(&mut self, pieces: &[P], magnitude: f32) {
        self.room = ROOM * magnitude;
        // Keep the memory of the lowest level, which is the largest.
        self.levels.truncate(1);
        if self.levels.is_empty() {
            self.levels.push(Vec::new());
        }
        let bounds = |group: &[P]| {
            group
                .iter()
                .fold(Aabb::EMPTY, |sum, piece| sum.union(&piece.bounds()))
        };
        self.levels[0].clear();
        self.levels[0].extend(pieces.chunks(FAN).map(bounds));
        // Add levels until one box is left.
        while let Some(last) = self.levels.last().filter(|level| level.len() > 1) {
            let union = |group: &[Aabb]| group.iter().fold(Aabb::EMPTY, |sum, b| sum.union(b));
            let next = last.chunks(FAN).map(union).collect();
            self.levels.push(next);
        }
    }

    /// Counts the pieces on both sides of a plane. `pieces` must be those given to [`Self::fill`].
    pub fn count<P: Piece>(&self, pieces: &[P], plane: Plane) -> Sides {
        let mut sides = [0; 3];
        self.descend(pieces, plane, self.levels.len() - 1, 0, &mut sides);
        sides
    }

    /// Adds the counts of the box with this index on this level; descends only into boxes that the plane may cut.
    fn descend<P: Piece>(
        &self,
        pieces: &[P],
        plane: Plane,
        level: usize,
        index: usize,
        sides: &mut Sides,
    ) {
        let size = FAN.pow(u32::try_from(level).expect("few levels") + 1);
        let (first, end) = (index * size, ((index + 1) * size).min(pieces.len()));
        // Count all pieces of a box that lies on one side by more than the error margin.
        let (low, high) = ends(&self.levels[level][index], plane);
        if high + self.room < plane.offset {
            sides[0] += end - first;
        } else if low - self.room > plane.offset {
            sides[1] += end - first;
        } else if level == 0 {
            // On the lowest level, compare the pieces themselves.
            for piece in &pieces[first..end] {
                let (min, max) = piece.interval(plane.direction);
                let (below, above) = (min < plane.offset, max > plane.offset);
                sides[0] += usize::from(below);
                sides[1] += usize::from(above);
                sides[2] += usize::from(!below && !above);
            }
        } else {
            // Otherwise descend to the boxes of the next lower level.
            let children = index * FAN..((index + 1) * FAN).min(self.levels[level - 1].len());
            for child in children {
                self.descend(pieces, plane, level - 1, child, sides);
            }
        }
    }
}

/// Returns the ends of a box along a plane's normal.
fn ends(bounds: &Aabb, plane: Plane) -> (f32, f32) {
    let n = plane.direction.vector();
    let (mut low, mut high) = (0.0, 0.0);
    for (n, (min, max)) in n.into_iter().zip(bounds.min.into_iter().zip(bounds.max)) {
        let (a, b) = (n * min, n * max);
        low += a.min(b);
        high += a.max(b);
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piece::Whole;
    use halfspace_geom::cell::Direction;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn groups_count_what_counting_one_by_one_finds(
            corners in prop::collection::vec(prop::array::uniform9(-8_i8..9), 1..200),
            n in prop::array::uniform3(-2_i8..3),
            offset in -8_i8..9,
        ) {
            let pieces: Vec<_> = corners
                .iter()
                .zip(0..)
                .map(|(c, id)| {
                    let c = c.map(f32::from);
                    Whole::new(id, [[c[0], c[1], c[2]], [c[3], c[4], c[5]], [c[6], c[7], c[8]]])
                })
                .collect();
            let plane = Plane {
                direction: Direction::Oblique(n.map(|x| f32::from(x) / 4.0)),
                offset: f32::from(offset) / 4.0,
            };
            let mut groups = Groups::default();
            groups.fill(&pieces, 8.0);
            let mut expected = [0; 3];
            for piece in &pieces {
                let (min, max) = piece.interval(plane.direction);
                expected[0] += usize::from(min < plane.offset);
                expected[1] += usize::from(max > plane.offset);
                expected[2] += usize::from(min == plane.offset && max == plane.offset);
            }
            prop_assert_eq!(groups.count(&pieces, plane), expected);
        }
    }
}
