// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of a scene: vertices and indices in the caller's arrays.

use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_geom::vec3::{map, widen};
use halfspace_geom::{Aabb, exact};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Number of moved triangles that one task checks (chosen).
const TASK: u32 = 4096;

/// An indexed triangle soup. The number of a triangle is its index in the input, dropped triangles included.
#[derive(Debug, Clone)]
pub struct Triangles {
    vertices: Vec<[f32; 3]>,
    /// Shared with the same triangles at other times.
    indices: Arc<Vec<[u32; 3]>>,
    /// Numbers of the triangles that can be hit, ascending.
    live: Vec<u32>,
    /// Box of the live triangles.
    bounds: Aabb,
}

impl Triangles {
    /// Checks the arrays and takes ownership. Triangles with a vertex that is not finite, or without area (decided
    /// exactly), can never be hit; [`Self::live`] omits them.
    ///
    /// # Errors
    /// [`Error::Shape`] when an index is out of range, or when there are more than 2^29 triangles.
    pub fn new(vertices: Vec<[f32; 3]>, indices: Vec<[u32; 3]>) -> Result<Self> {
        if indices.len() > 1 << 29 {
            return Err(Error::Shape(format!(
                "triangles: at most {} are possible, got {}",
                1 << 29,
                indices.len()
            )));
        }
        let outside = |&&v: &&u32| v as usize >= vertices.len();
        // Compare the largest index in one pass; search for the first wrong one only if there is any.
        if indices
            .as_flattened()
            .iter()
            .max()
            .filter(outside)
            .is_some()
        {
            let wrong = |triangle: &[u32; 3]| triangle.iter().any(|v| outside(&v));
            let i = indices.iter().position(wrong).expect("one of them");
            let index = indices[i].iter().find(outside).expect("one of the three");
            return Err(Error::Shape(format!(
                "triangles[{i}]: index {index} is out of range for {} vertices",
                vertices.len()
            )));
        }
        let mut scene = Self {
            vertices,
            live: Vec::new(),
            indices: Arc::new(indices),
            bounds: Aabb::EMPTY,
        };
        let count = u32::try_from(scene.indices.len()).expect("checked above");
        (scene.live, scene.bounds) = scene.hittable(0..count);
        scene.live.shrink_to_fit();
        Ok(scene)
    }

    /// Returns the same triangles with moved vertices, checked as by [`Self::new`], in the current rayon pool.
    ///
    /// # Errors
    /// [`Error::Shape`] when the number of vertices differs; [`Error::Cancelled`].
    pub fn moved(&self, vertices: Vec<[f32; 3]>, monitor: &Monitor) -> Result<Self> {
        if vertices.len() != self.vertices.len() {
            return Err(Error::Shape(format!(
                "vertices: expected {} as before the motion, got {}",
                self.vertices.len(),
                vertices.len()
            )));
        }
        let mut scene = Self {
            vertices,
            indices: self.indices.clone(),
            live: Vec::with_capacity(self.indices.len()),
            bounds: Aabb::EMPTY,
        };
        // Check the triangles task by task.
        let count = u32::try_from(scene.indices.len()).expect("checked when they were made");
        let parts: Vec<_> = (0..count.div_ceil(TASK))
            .into_par_iter()
            .map(|part| {
                monitor.check()?;
                Ok(scene.hittable(part * TASK..count.min((part + 1) * TASK)))
            })
            .collect::<Result<_>>()?;
        for (live, bounds) in parts {
            scene.live.extend(live);
            scene.bounds = scene.bounds.union(&bounds);
        }
        Ok(scene)
    }

    /// Returns those of these triangles that can be hit, ascending, and their box.
    fn hittable(&self, ids: Range<u32>) -> (Vec<u32>, Aabb) {
        let (mut live, mut bounds) = (Vec::with_capacity(ids.len()), Aabb::EMPTY);
        for id in ids {
            let corners = self.corners(id);
            if can_be_hit(corners) {
                live.push(id);
                bounds = bounds.union(&Aabb::of_triangle(corners));
            }
        }
        (live, bounds)
    }

    /// Returns whether both have the same triangles, by the indices of their vertices.
    pub fn same_topology(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.indices, &other.indices)
            || (self.vertices.len() == other.vertices.len() && self.indices == other.indices)
    }

    /// Returns the number of triangles in the input, dropped ones included.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Returns whether the input has no triangle.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// Returns the indices of the triangles that can be hit, ascending.
    pub fn live(&self) -> &[u32] {
        &self.live
    }

    /// Returns the number of dropped triangles: those without area or not finite.
    pub fn dropped(&self) -> usize {
        self.indices.len() - self.live.len()
    }

    /// Returns the box of all live triangles, in the scene's space.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Returns the vertex positions, shape (n, 3), in the scene's space.
    pub fn vertices(&self) -> &[[f32; 3]] {
        &self.vertices
    }

    /// Returns the vertex indices of each triangle, shape (m, 3).
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// Returns the three vertices of triangle `id`, in the scene's space.
    #[inline(always)]
    pub fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        map(self.indices[id as usize], |v| self.vertices[v as usize])
    }
}

/// Returns whether a triangle is finite and has an area.
fn can_be_hit(v: [[f32; 3]; 3]) -> bool {
    // Infinity and NaN multiplied by zero are NaN.
    v.as_flattened().iter().map(|x| x * 0.0).sum::<f32>() == 0.0
        && !exact::is_degenerate(v.map(widen))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_triangles_are_dropped_and_the_rest_keep_their_numbers() {
        let vertices = vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [f32::NAN, 0.0, 0.0],
            [2.0, 0.0, 0.0],
        ];
        let scene =
            Triangles::new(vertices, vec![[0, 1, 3], [0, 1, 4], [0, 1, 2], [1, 1, 2]]).unwrap();
        assert_eq!(
            (scene.live(), scene.dropped(), scene.len()),
            (&[2_u32][..], 3, 4)
        );
        assert_eq!(scene.bounds().max, [1.0, 1.0, 0.0]);
    }

    #[test]
    fn moved_triangles_are_checked_as_new_ones() {
        let count = 3 * TASK as usize + 5;
        let vertices: Vec<_> = (0..3 * count)
            .map(|i| [(i / 3) as f32, (i % 3) as f32, (i % 3 / 2) as f32])
            .collect();
        let indices: Vec<_> = (0..u32::try_from(count).unwrap())
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        let scene = Triangles::new(vertices.clone(), indices.clone()).unwrap();
        // Move all, one to infinity, and collapse another.
        let mut moved: Vec<_> = vertices.iter().map(|v| map(*v, |x| 2.0 - x)).collect();
        moved[3 * TASK as usize + 1][1] = f32::INFINITY;
        moved[8] = moved[7];
        let (at_once, new) = (
            scene.moved(moved.clone(), &Monitor::new()),
            Triangles::new(moved, indices),
        );
        let (at_once, new) = (at_once.unwrap(), new.unwrap());
        assert_eq!(
            (at_once.live(), at_once.bounds()),
            (new.live(), new.bounds())
        );
        assert!(scene.same_topology(&at_once) && scene.same_topology(&new));
        assert_eq!(
            scene
                .moved(vec![[0.0; 3]; 2], &Monitor::new())
                .unwrap_err()
                .to_string(),
            format!(
                "vertices: expected {} as before the motion, got 2",
                3 * count
            )
        );
    }

    #[test]
    fn an_index_out_of_range_names_the_triangle() {
        let error = Triangles::new(vec![[0.0; 3]; 3], vec![[0, 1, 2], [0, 1, 3]]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "triangles[1]: index 3 is out of range for 3 vertices"
        );
    }
}
