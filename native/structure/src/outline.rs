// SPDX-License-Identifier: GPL-3.0-or-later
//! Data about the triangles of a mesh that its instances share, computed once per mesh.

use halfspace_geom::Aabb;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

/// Approximate number of boxes that together contain all triangles with area (chosen): with 64 the transformed boxes of
/// a rotated instance stay close to the mesh.
const BOXES: usize = 64;

/// Largest number of triangles without area per box (chosen).
const GROUP: usize = 16;

/// Some triangles of a mesh.
#[derive(Debug, Clone)]
pub struct TriangleGroup {
    /// Their box, in the mesh's space.
    pub bounds: Aabb,
    /// Their numbers.
    pub ids: Vec<u32>,
}

/// Coarse bounds of a mesh and the list of its triangles without area.
#[derive(Debug, Clone)]
pub struct Outline {
    /// Boxes, in the mesh's space, that together contain every triangle that can be hit in some instance.
    pub boxes: Vec<Aabb>,
    /// Triangles without area. No tree contains them, but rounding of their transformed vertices may give them an area
    /// in an instance.
    pub flat: Vec<TriangleGroup>,
    /// Frame around all groups of `flat`.
    pub flat_frame: Frame,
    /// Mean over the triangles with area of the largest extent along an axis; 0 without any.
    pub detail: f64,
}

impl Outline {
    /// Groups the triangles of a mesh and computes their boxes.
    pub fn new(scene: &Triangles) -> Self {
        // Collect the triangles without area that an instance may turn into triangles with area.
        let mut flat = Vec::new();
        let mut live = scene.live().iter().copied().peekable();
        for id in (0..).take(scene.len()) {
            if live.next_if_eq(&id).is_none() && can_open(scene.corners(id)) {
                flat.push(id);
            }
        }
        // Divide a list of triangles into groups of at most `most`, each with its box.
        let grouped = |ids: &[u32], most: usize| {
            let mut pieces: Vec<_> = (ids.iter())
                .map(|&id| (Aabb::of_triangle(scene.corners(id)), id))
                .collect();
            let mut groups = Vec::new();
            each_group(&mut pieces, most.max(1), &mut |group| {
                groups.push(TriangleGroup {
                    bounds: around(group),
                    ids: group.iter().map(|piece| piece.1).collect(),
                });
            });
            groups
        };
        // The boxes must also contain the triangles without area.
        let flat = grouped(&flat, GROUP);
        let mut boxes: Vec<_> = (grouped(scene.live(), scene.live().len().div_ceil(BOXES)).iter())
            .map(|group| group.bounds)
            .collect();
        boxes.extend(flat.iter().map(|group| group.bounds));
        let extent = |&id: &u32| {
            let bounds = Aabb::of_triangle(scene.corners(id));
            bounds.extent(0).max(bounds.extent(1)).max(bounds.extent(2))
        };
        let extents: f64 = scene.live().iter().map(extent).sum();
        let around = flat
            .iter()
            .fold(Aabb::EMPTY, |all, group| all.union(&group.bounds));
        Self {
            boxes,
            flat,
            flat_frame: Frame::new(around),
            detail: extents / scene.live().len().max(1) as f64,
        }
    }
}

/// Returns whether a triangle without area may have one after its vertices are transformed and rounded: its
/// vertices are finite and pairwise distinct.
fn can_open([a, b, c]: [[f32; 3]; 3]) -> bool {
    let finite = [a, b, c].as_flattened().iter().all(|x| x.is_finite());
    finite && a != b && b != c && c != a
}

/// Returns the union of the boxes of `pieces`.
fn around(pieces: &[(Aabb, u32)]) -> Aabb {
    (pieces.iter()).fold(Aabb::EMPTY, |all, piece| all.union(&piece.0))
}

/// Splits the pieces at the median of their centres along the longest axis, recursively, until no group has more
/// than `most`, and calls `see` for each group.
fn each_group(pieces: &mut [(Aabb, u32)], most: usize, see: &mut impl FnMut(&[(Aabb, u32)])) {
    if pieces.is_empty() {
        return;
    }
    if pieces.len() <= most {
        return see(pieces);
    }
    let all = around(pieces);
    // Split along the longest axis of the box.
    let longer = |a: usize, b: usize| if all.extent(b) > all.extent(a) { b } else { a };
    let axis = longer(longer(0, 1), 2);
    let middle = |piece: &(Aabb, u32)| 0.5 * piece.0.min[axis] + 0.5 * piece.0.max[axis];
    let half = pieces.len() / 2;
    // Order equal centres by number, so that the result is deterministic.
    pieces.select_nth_unstable_by(half, |a, b| {
        middle(a).total_cmp(&middle(b)).then(a.1.cmp(&b.1))
    });
    let (below, above) = pieces.split_at_mut(half);
    each_group(below, most, see);
    each_group(above, most, see);
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
        assert_eq!(outline.flat[0].ids, [0]);
        assert!(
            (40..=65).contains(&outline.boxes.len()),
            "{}",
            outline.boxes.len()
        );
        let all = outline.boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        assert_eq!((all.min, all.max), ([0.0; 3], [300.0, 3.0, 9.0]));
    }
}
