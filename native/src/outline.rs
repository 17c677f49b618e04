// SPDX-License-Identifier: GPL-3.0-or-later
//! What the instances of a mesh need to know of its triangles, worked out once per mesh.

use crate::geom::Aabb;
use crate::scene::Triangles;
use crate::traverse::frame::Frame;

/// Boxes around all triangles, together: enough of them that a turned mesh is held closely.
const BOXES: usize = 64;

/// Flat triangles per box.
const GROUP: usize = 16;

/// The shape of a mesh, roughly.
#[derive(Debug, Clone)]
pub struct Outline {
    /// Boxes that together hold every triangle that may be hit in some place.
    pub boxes: Vec<Aabb>,
    /// Triangles without area, in groups with their boxes. No tree holds them; but where they stand in the
    /// scene their corners are rounded, and then some do have an area.
    pub flat: Vec<(Aabb, Vec<u32>)>,
    /// A frame around those.
    pub flat_frame: Frame,
}

impl Outline {
    /// Of these triangles.
    pub fn new(scene: &Triangles) -> Self {
        let mut flat = Vec::new();
        let mut live = scene.live().iter().copied().peekable();
        for id in (0..).take(scene.len()) {
            if live.next_if_eq(&id).is_none() && can_open(scene.corners(id)) {
                flat.push(id);
            }
        }
        let parted = |ids: &[u32], most: usize| {
            let mut pieces: Vec<_> = (ids.iter())
                .map(|&id| (Aabb::of_triangle(scene.corners(id)), id))
                .collect();
            let mut groups = Vec::new();
            part(&mut pieces, most.max(1), &mut |group| {
                groups.push((around(group), group.iter().map(|piece| piece.1).collect()));
            });
            groups
        };
        let flat: Vec<(Aabb, Vec<u32>)> = parted(&flat, GROUP);
        let mut boxes: Vec<_> = (parted(scene.live(), scene.live().len().div_ceil(BOXES)).iter())
            .map(|group| group.0)
            .collect();
        boxes.extend(flat.iter().map(|group| group.0));
        let around = flat
            .iter()
            .fold(Aabb::EMPTY, |all, group| all.union(&group.0));
        Self {
            boxes,
            flat,
            flat_frame: Frame::new(around),
        }
    }
}

/// Whether a triangle without area may have one after its corners were moved and rounded: three different
/// finite points.
fn can_open([a, b, c]: [[f32; 3]; 3]) -> bool {
    let finite = [a, b, c].as_flattened().iter().all(|x| x.is_finite());
    finite && a != b && b != c && c != a
}

fn around(pieces: &[(Aabb, u32)]) -> Aabb {
    (pieces.iter()).fold(Aabb::EMPTY, |all, piece| all.union(&piece.0))
}

/// Halves the pieces along the longest axis of their box until no group has more than `most`.
fn part(pieces: &mut [(Aabb, u32)], most: usize, see: &mut impl FnMut(&[(Aabb, u32)])) {
    if pieces.is_empty() {
        return;
    }
    if pieces.len() <= most {
        return see(pieces);
    }
    let all = around(pieces);
    let longer = |a: usize, b: usize| if all.extent(b) > all.extent(a) { b } else { a };
    let axis = longer(longer(0, 1), 2);
    let middle = |piece: &(Aabb, u32)| 0.5 * piece.0.min[axis] + 0.5 * piece.0.max[axis];
    let half = pieces.len() / 2;
    pieces.select_nth_unstable_by(half, |a, b| {
        middle(a).total_cmp(&middle(b)).then(a.1.cmp(&b.1))
    });
    let (below, above) = pieces.split_at_mut(half);
    part(below, most, see);
    part(above, most, see);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_triangles_are_kept_apart_and_all_are_boxed() {
        let mut vertices = vec![[0.0; 3], [1.0, 1.0, 1.0], [3.0, 3.0, 3.0], [f32::NAN; 3]];
        let mut indices = vec![[0, 1, 2], [0, 0, 1], [0, 1, 3]];
        for i in 0..300_u16 {
            let x = f32::from(i);
            let first = u32::try_from(vertices.len()).unwrap();
            vertices.extend([[x, 0.0, 9.0], [x + 1.0, 0.0, 9.0], [x, 2.0, 9.0]]);
            indices.push([first, first + 1, first + 2]);
        }
        let scene = Triangles::new(vertices, indices).unwrap();
        let outline = Outline::new(&scene);
        assert_eq!(outline.flat.len(), 1);
        assert_eq!(outline.flat[0].1, [0]);
        assert!(
            (40..=65).contains(&outline.boxes.len()),
            "{}",
            outline.boxes.len()
        );
        let all = outline.boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        assert_eq!((all.min, all.max), ([0.0; 3], [300.0, 3.0, 9.0]));
    }
}
