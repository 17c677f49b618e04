// SPDX-License-Identifier: GPL-3.0-or-later
//! How many pieces lie on each side of a plane, without asking all of them.
//!
//! Boxes around eight consecutive pieces, around eight of those, and so on. The pieces of a build are
//! sorted along a curve once, and parting them keeps their order, so consecutive ones stay close:
//! the hierarchy of a node costs one pass over its pieces, and nothing is sorted again.

use super::cell::Plane;
use super::piece::Piece;
use crate::geom::Aabb;
use crate::traverse::frame::U;

/// Pieces, or boxes, per box.
const FAN: usize = 8;

/// Room for rounding in the heights of boxes, as a share of the scene's size.
const ROOM: f32 = 32.0 * U;

/// Boxes around the pieces of a node.
#[derive(Debug, Default)]
pub struct Groups {
    /// The lowest level first: a box per eight pieces.
    levels: Vec<Vec<Aabb>>,
    room: f32,
}

/// Pieces that reach below a plane, that reach above it, and that lie in it.
pub type Sides = [usize; 3];

impl Groups {
    /// Groups the pieces of a node; `magnitude` is the scene's largest coordinate.
    pub fn fill<P: Piece>(&mut self, pieces: &[P], magnitude: f32) {
        self.room = ROOM * magnitude;
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
        while let Some(last) = self.levels.last().filter(|level| level.len() > 1) {
            let union = |group: &[Aabb]| group.iter().fold(Aabb::EMPTY, |sum, b| sum.union(b));
            let next = last.chunks(FAN).map(union).collect();
            self.levels.push(next);
        }
    }

    /// Counts the pieces, those that [`Self::fill`] was given, on both sides of a plane.
    pub fn count<P: Piece>(&self, pieces: &[P], plane: Plane) -> Sides {
        let mut sides = [0; 3];
        self.descend(pieces, plane, (self.levels.len() - 1, 0), &mut sides);
        sides
    }

    fn descend<P: Piece>(
        &self,
        pieces: &[P],
        plane: Plane,
        (level, index): (usize, usize),
        sides: &mut Sides,
    ) {
        let size = FAN.pow(u32::try_from(level).expect("few levels") + 1);
        let (first, end) = (index * size, ((index + 1) * size).min(pieces.len()));
        let (low, high) = ends(&self.levels[level][index], plane);
        if high + self.room < plane.offset {
            sides[0] += end - first;
        } else if low - self.room > plane.offset {
            sides[1] += end - first;
        } else if level == 0 {
            for piece in &pieces[first..end] {
                let (min, max) = piece.interval(plane.direction);
                let (below, above) = (min < plane.offset, max > plane.offset);
                sides[0] += usize::from(below);
                sides[1] += usize::from(above);
                sides[2] += usize::from(!below && !above);
            }
        } else {
            let children = index * FAN..((index + 1) * FAN).min(self.levels[level - 1].len());
            for child in children {
                self.descend(pieces, plane, (level - 1, child), sides);
            }
        }
    }
}

/// The ends of a box along a plane's normal.
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
    use crate::build::cell::Direction;
    use crate::build::piece::Whole;
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
