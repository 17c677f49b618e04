// SPDX-License-Identifier: GPL-3.0-or-later
//! Per-surface data that only passes need: object and material indices, and UVs.

use crate::check::{Error, Result};
use crate::film::Identities;
use crate::math::vector::Vec3;
use crate::values::varying::Row;
use halfspace_geom::vec3::widen;

/// Corners of all triangles in another picture. Instances store those of each mesh, and the transforms.
#[derive(Debug, Clone, Default)]
pub struct Moved {
    /// Corners of the triangles, in the space of their mesh if there are places; empty = not known.
    pub corners: Vec<[[f32; 3]; 3]>,
    /// The place of each instance; empty for a flattened scene.
    pub places: Vec<MovedPlace>,
}

/// An instance in another picture.
#[derive(Debug, Clone, Copy)]
pub struct MovedPlace {
    /// Offset from a row's index to its corners, see [`Row`].
    pub shift: i64,
    /// Transform to the frame of the scene, rows.
    pub to_scene: [[f64; 4]; 3],
}

impl Moved {
    /// The corners of a row, or `None` if they are not known.
    fn of(&self, row: Row) -> Option<[Vec3; 3]> {
        let place = self.places.get(row.instance);
        let shifted = row.index as i64 + place.map_or(0, |place| place.shift);
        let corners = self.corners.get(usize::try_from(shifted).ok()?)?;
        Some(row.corners().map(|corner| {
            let p = corners[corner];
            // Transform in f64 and round once, as the vertices of a flattened scene are.
            Vec3::from(place.map_or(p, |place| {
                let [x, y, z] = widen(p);
                (place.to_scene).map(|r| (x * r[0] + y * r[1] + z * r[2] + r[3]) as f32)
            }))
        }))
    }
}

/// Object and material indices, and UVs. All are 0 by default.
#[derive(Debug, Clone, Default)]
pub struct Indices {
    /// First triangle of each run of triangles that belong to one object, ascending from 0.
    pub first: Vec<u32>,
    /// Index of each run's object.
    pub object: Vec<f32>,
    /// Index of each material.
    pub material: Vec<f32>,
    /// Identities of each run's object, and of that with all its children; empty without mattes.
    pub identities: Vec<[u32; 2]>,
    /// Identity of each material.
    pub material_identities: Vec<u32>,
    /// Light group of each run's object, counted from 1; empty without light groups.
    pub groups: Vec<u8>,
    /// The picture before this one and the one after.
    pub motion: [Moved; 2],
    /// UVs of the corners of each row (see [`Row`]), NaN for triangles without; empty if there are none at all.
    pub uvs: Vec<[[f32; 2]; 3]>,
}

impl Indices {
    /// Checks the arrays against each other, the number of rows (see [`Row`]) and that of instances, `None` for a
    /// flattened scene.
    ///
    /// # Errors
    /// [`Error::Shape`] if a length does not match or the runs do not ascend.
    pub fn check(&self, rows: usize, instances: Option<usize>) -> Result<()> {
        if !self.uvs.is_empty() && self.uvs.len() != rows {
            return Err(Error::Shape(format!(
                "indices['uvs'] must have one entry per triangle: {rows}, got {}",
                self.uvs.len()
            )));
        }
        for moved in self.motion.iter().filter(|moved| !moved.corners.is_empty()) {
            let (corners, places) = (moved.corners.len(), moved.places.len());
            if places != instances.unwrap_or(0) || (places == 0 && corners != rows) {
                return Err(Error::Shape(format!(
                    "indices['motion'] must have one entry per triangle: {rows}, got {corners}, \
                     and a place per instance: {}, got {places}",
                    instances.unwrap_or(0)
                )));
            }
        }
        if self.first.len() != self.object.len() {
            return Err(Error::Shape(format!(
                "indices: {} runs, but {} objects",
                self.first.len(),
                self.object.len()
            )));
        }
        let optional = [
            ("identities", self.identities.len()),
            ("groups", self.groups.len()),
        ];
        for (name, len) in optional {
            if len != 0 && len != self.first.len() {
                return Err(Error::Shape(format!(
                    "indices: {} runs, but {len} {name}",
                    self.first.len()
                )));
            }
        }
        if self.first.first().is_some_and(|&first| first != 0) || !self.first.is_sorted() {
            return Err(Error::Shape(
                "indices['first'] must ascend from 0".to_owned(),
            ));
        }
        Ok(())
    }

    /// Returns the indices of a triangle's object and material.
    #[inline]
    pub fn of(&self, triangle: usize, material: u32) -> (f32, f32) {
        let object = self.run(triangle).map_or(0.0, |run| self.object[run]);
        let material = self.material.get(material as usize);
        (object, material.copied().unwrap_or(0.0))
    }

    /// Returns the identities of a triangle's object, material and asset, by [`crate::settings::MatteKind`].
    pub fn identities(&self, triangle: usize, material: u32) -> Identities {
        let run = self.run(triangle);
        let [object, asset] = run
            .and_then(|run| self.identities.get(run))
            .copied()
            .unwrap_or_default();
        let material = self.material_identities.get(material as usize);
        [object, material.copied().unwrap_or(0), asset]
    }

    /// Returns where a point of a triangle was in the picture before this one, and will be in the one after; `None` if
    /// that is not known. `u`, `v`: weights of its second and third corner.
    pub fn moved(&self, row: Row, u: f32, v: f32) -> [Option<Vec3>; 2] {
        self.motion.each_ref().map(|moved| {
            let [a, b, c] = moved.of(row)?;
            Some(a * (1.0 - u - v) + b * u + c * v)
        })
    }

    /// Returns the light group of a triangle's object; 0 = none.
    pub fn group(&self, triangle: usize) -> u8 {
        let group = self.run(triangle).and_then(|run| self.groups.get(run));
        group.copied().unwrap_or(0)
    }

    /// Returns the last run that begins at or before the triangle; empty runs are skipped.
    #[inline]
    fn run(&self, triangle: usize) -> Option<usize> {
        self.first
            .partition_point(|&first| first as usize <= triangle)
            .checked_sub(1)
    }

    /// Returns the UV at barycentric coordinates (u, v) of a triangle and 1, or zeros if it has no UVs.
    #[inline]
    pub fn uv(&self, row: Row, u: f32, v: f32) -> [f32; 3] {
        let Some(corners) = self.uvs.get(row.index) else {
            return [0.0; 3];
        };
        let [a, b, c] = row.corners().map(|corner| corners[corner]);
        // NaN marks triangles without UVs.
        if a[0].is_nan() {
            return [0.0; 3];
        }
        let at = |k: usize| a[k] * (1.0 - u - v) + b[k] * u + c[k] * v;
        [at(0), at(1), 1.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_triangle_has_the_index_of_its_run_and_its_own_uv() {
        let indices = Indices {
            first: vec![0, 3, 3, 10],
            object: vec![5.0, 6.0, 7.0, 8.0],
            material: vec![1.0, 2.0],
            identities: vec![[10, 11], [20, 21], [30, 31], [40, 41]],
            material_identities: vec![1, 2],
            groups: vec![0, 1, 2, 3],
            motion: [
                Moved::default(),
                Moved {
                    corners: vec![[[0.0; 3], [4.0; 3], [8.0; 3]]; 2],
                    places: Vec::new(),
                },
            ],
            uvs: vec![[[0.0, 1.0], [4.0, 1.0], [0.0, 3.0]], [[f32::NAN; 2]; 3]],
        };
        indices.check(2, None).unwrap();
        assert_eq!(indices.identities(3, 1), [30, 2, 31]);
        assert_eq!(indices.identities(2, 5), [10, 0, 11]);
        assert_eq!(Indices::default().identities(2, 5), [0; 3]);
        let moved = indices.moved(Row::flattened(1), 0.25, 0.5);
        assert_eq!(moved, [None, Some(Vec3::from([5.0; 3]))]);
        assert_eq!((indices.group(2), indices.group(10)), (0, 3));
        assert_eq!(Indices::default().group(2), 0);
        assert!(indices.check(3, None).is_err());
        let uv = |index, mirrored| {
            let row = Row {
                mirrored,
                ..Row::flattened(index)
            };
            indices.uv(row, 0.25, 0.5)
        };
        assert_eq!(uv(0, false), [1.0, 2.0, 1.0]);
        assert_eq!(uv(0, true), [2.0, 1.5, 1.0]);
        assert_eq!((uv(1, false), uv(2, false)), ([0.0; 3], [0.0; 3]));
        for (triangle, object) in [(0, 5.0), (2, 5.0), (3, 7.0), (9, 7.0), (10, 8.0), (99, 8.0)] {
            assert_eq!(indices.of(triangle, 1), (object, 2.0));
        }
        assert_eq!(Indices::default().of(4, 0), (0.0, 0.0));
        assert_eq!(indices.of(0, 9).1, 0.0);
    }

    #[test]
    fn runs_that_do_not_ascend_are_refused() {
        for first in [vec![1, 2], vec![0, 5, 4]] {
            let object = vec![0.0; first.len()];
            let wrong = Indices {
                first,
                object,
                ..Default::default()
            };
            assert!(
                wrong
                    .check(0, None)
                    .unwrap_err()
                    .to_string()
                    .contains("ascend")
            );
        }
    }
}
