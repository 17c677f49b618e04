// SPDX-License-Identifier: GPL-3.0-or-later
//! Data that vary over the triangles of a scene: layers of corner attributes and texture coordinates of objects.
//! Instances share the rows of their mesh; each is an object of its own.

use std::sync::Arc;

use crate::check::{Error, Result, finite};
use crate::values::voxels::Voxels;

/// Where the data of a triangle are: a flattened scene has a row for each triangle, an instanced one for each triangle
/// of each mesh, mesh after mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// Index of the row; `usize::MAX` for the background.
    pub index: usize,
    /// The instance; 0 in a flattened scene.
    pub instance: usize,
    /// Whether the second and the third corner of the triangle are the third and the second of its mesh.
    pub mirrored: bool,
}

impl Row {
    /// No triangle at all.
    pub const BACKGROUND: Self = Self::flattened(usize::MAX);

    /// The row of a triangle of a flattened scene.
    pub const fn flattened(index: usize) -> Self {
        Self {
            index,
            instance: 0,
            mirrored: false,
        }
    }

    /// The corners of the row, in the order of the triangle's.
    pub fn corners(self) -> [usize; 3] {
        if self.mirrored { [0, 2, 1] } else { [0, 1, 2] }
    }
}

/// Values at the corners of all triangles: a UV map, a colour or tangents.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layer {
    /// Numbers per corner, 2 to 4.
    pub width: usize,
    /// Triangle by triangle, corner by corner; empty = missing everywhere.
    pub values: Arc<Vec<f32>>,
}

/// Texture coordinates and other values of an object.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectFrame {
    /// Scene to object transform; rows.
    pub to_object: [[f32; 4]; 3],
    /// Offset and then factor that map a position in object space to 0..1 within the object's box.
    pub generated: [[f32; 3]; 2],
    /// Other values, by the numbers that programs use; missing ones are 0.
    pub values: Vec<[f32; 4]>,
}

/// Data that vary over the triangles, other than geometry and normals.
#[derive(Debug, Clone, Default)]
pub struct Varying {
    /// Layers, by the indices that programs use.
    pub layers: Vec<Layer>,
    /// Texture coordinates of the objects.
    pub objects: Vec<ObjectFrame>,
    /// Object of each triangle of a flattened scene; empty = all belong to the first. Each instance is an object.
    pub object_index: Vec<u32>,
    /// World position of the scene frame's origin.
    pub origin: [f32; 3],
    /// Voxels in the spaces of objects, by the numbers that programs compute.
    pub grids: Vec<Voxels>,
}

impl Varying {
    /// Checks the sizes for this number of rows, and replaces layer values that are not finite by 0. `instances`: their
    /// number, or `None` for a flattened scene.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] with the name of the array at fault.
    pub fn check(&mut self, rows: usize, instances: Option<usize>) -> Result<()> {
        for (i, layer) in self.layers.iter_mut().enumerate() {
            // A layer is either empty or has a value at every corner.
            let want = rows * 3 * layer.width;
            if !(2..=4).contains(&layer.width) || ![0, want].contains(&layer.values.len()) {
                return Err(Error::Shape(format!(
                    "layers[{i}]: expected one entry of 2 to 4 numbers per corner of {rows} \
                     triangles, got {} numbers",
                    layer.values.len()
                )));
            }
            // Only copy shared values to repair them.
            if !layer.values.iter().all(|v| v.is_finite()) {
                let values = Arc::make_mut(&mut layer.values);
                let wrong = values.iter_mut().filter(|v| !v.is_finite());
                wrong.for_each(|v| *v = 0.0);
            }
        }
        for (i, object) in self.objects.iter().enumerate() {
            finite(object.to_object.as_flattened(), || {
                format!("objects[{i}]['to_object']")
            })?;
            finite(object.generated.as_flattened(), || {
                format!("objects[{i}]['generated']")
            })?;
            finite(object.values.as_flattened(), || {
                format!("objects[{i}]['values']")
            })?;
        }
        let objects = self.objects.len();
        if let Some(instances) = instances {
            if !self.object_index.is_empty() || ![0, instances].contains(&objects) {
                return Err(Error::Shape(format!(
                    "objects: expected one for each of {instances} instances and no object_index, got {objects}"
                )));
            }
        } else if ![0, rows].contains(&self.object_index.len()) {
            return Err(Error::Shape(format!(
                "object_index must have one entry per triangle: {rows}, got {}",
                self.object_index.len()
            )));
        }
        if let Some(i) = (self.object_index.iter()).position(|&o| o as usize >= objects) {
            return Err(Error::Shape(format!(
                "object_index[{i}] is out of range for {objects} objects"
            )));
        }
        finite(&self.origin, || "origin".into())
    }
}
