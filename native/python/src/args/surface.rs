// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of per-triangle and per-instance data: materials, normals, UVs, indices.

use crate::args::arrays::{blocks, check_copy, describe, elements};
use crate::args::keys::{Keys, list};
use halfspace_base::error::{Error, Result};
use halfspace_render::scene::attributes::{InstanceAttributes, MeshAttributes};
use halfspace_render::scene::indices::{Indices, Moved, MovedPlace};
use halfspace_structure::instances::Instances;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Reads the attributes of instances and their meshes; `None` = the first material and flat.
pub fn surfaces(
    dict: Option<&Bound<'_, PyDict>>,
    instances: &Instances,
) -> Result<(Vec<MeshAttributes>, InstanceAttributes)> {
    let Some(dict) = dict else {
        // The default: one material per instance, identity normal matrices.
        let count = instances.len();
        let meshes = instances.meshes().iter();
        let one = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        return Ok((
            meshes.map(|_| MeshAttributes::default()).collect(),
            InstanceAttributes {
                materials: vec![0; count],
                first_material: (0..).take(count + 1).collect(),
                normal_matrix: vec![one; count],
                keeps_length: vec![true; count],
            },
        ));
    };
    let known = [
        "meshes",
        "materials",
        "first_material",
        "normal_matrix",
        "keeps_length",
    ];
    let keys = Keys::new(dict, "surfaces".into(), &known)?;
    let meshes = list(
        "surfaces['meshes']",
        keys.find("meshes").as_ref(),
        |dict, i| {
            let known = ["material_index", "corner_normals"];
            let keys = Keys::new(dict, format!("surfaces['meshes'][{i}]"), &known)?;
            let (index, normals) = (keys.find("material_index"), keys.find("corner_normals"));
            Ok(MeshAttributes {
                material_index: index.as_ref().map(material_index).transpose()?,
                corner_normals: normals.as_ref().map(corner_normals).transpose()?,
            })
        },
    )?;
    // The length of the arrays is checked where the scene is made.
    let flags = keys.need("keeps_length")?;
    let keeps_length: PyReadonlyArray1<'_, bool> =
        (flags.extract()).map_err(|_| keys.wrong("keeps_length", "a (k,) bool array", &flags))?;
    let first: Vec<i32> = material_index(&keys.need("first_material")?)?;
    Ok((
        meshes,
        InstanceAttributes {
            materials: material_index(&keys.need("materials")?)?,
            first_material: first.into_iter().map(i32::cast_unsigned).collect(),
            // The layout of (k, 3, 3) matrices equals that of corner normals.
            normal_matrix: corner_normals(&keys.need("normal_matrix")?)?,
            keeps_length: elements(&keeps_length),
        },
    ))
}

/// Reads the material of each triangle: (m,) int32.
pub fn material_index(value: &Bound<'_, PyAny>) -> Result<Vec<i32>> {
    let array: PyReadonlyArray1<'_, i32> = value.extract().map_err(|_| {
        Error::Shape(format!(
            "material_index: expected an (m,) int32 array, got {}",
            describe(value)
        ))
    })?;
    check_copy("material_index", &*array, size_of::<i32>())?;
    Ok(elements(&array))
}

/// Reads shading normals: (m, 3, 3) float32.
pub fn corner_normals(value: &Bound<'_, PyAny>) -> Result<Vec<[[f32; 3]; 3]>> {
    let wrong = || {
        Error::Shape(format!(
            "corner_normals: expected an (m, 3, 3) float32 array, got {}",
            describe(value)
        ))
    };
    let array: PyReadonlyArray3<'_, f32> = value.extract().map_err(|_| wrong())?;
    check_copy("corner_normals", &*array, size_of::<f32>())?;
    blocks(&array).ok_or_else(wrong)
}

/// Reads where the triangles are in the pictures before and after.
fn motion(keys: &Keys<'_, '_>) -> Result<[Moved; 2]> {
    let Some(value) = keys.find("motion") else {
        return Ok(Default::default());
    };
    let what = "two (m, 3, 3) float32 arrays, or for instances two tuples of such an array, (k,) int64 and (k, 3, 4) float64";
    let wrong = || keys.wrong("motion", what, &value);
    // A flattened scene has corners alone.
    if let Ok([before, after]) = value.extract::<[PyReadonlyArray3<'_, f32>; 2]>() {
        let [before, after] = [blocks(&before), blocks(&after)];
        return Ok(
            [before.ok_or_else(wrong)?, after.ok_or_else(wrong)?].map(|corners| Moved {
                corners,
                places: Vec::new(),
            }),
        );
    }
    let sides: [MovedInstances<'_>; 2] = value.extract().map_err(|_| wrong())?;
    let read = |(moved, shifts, matrices): &MovedInstances<'_>| {
        let (shifts, matrices) = (elements(shifts), blocks(matrices)?);
        if matrices.len() != shifts.len() {
            return None;
        }
        let places = shifts.into_iter().zip(matrices);
        Some(Moved {
            corners: blocks(moved)?,
            places: places
                .map(|(shift, to_scene)| MovedPlace { shift, to_scene })
                .collect(),
        })
    };
    let [before, after] = sides.each_ref().map(read);
    Ok([before.ok_or_else(wrong)?, after.ok_or_else(wrong)?])
}

/// Corners of triangles, shifts of rows and transforms of instances.
type MovedInstances<'py> = (
    PyReadonlyArray3<'py, f32>,
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray3<'py, f64>,
);

/// Reads object and material indices, and UVs.
pub fn indices(dict: Option<&Bound<'_, PyDict>>) -> Result<Indices> {
    let Some(dict) = dict else {
        return Ok(Indices::default());
    };
    let keys = Keys::new(
        dict,
        "indices".into(),
        &[
            "first",
            "object",
            "material",
            "uvs",
            "identities",
            "material_identities",
            "groups",
            "motion",
        ],
    )?;
    /// Reads a required one-dimensional array.
    fn array<T: numpy::Element + Copy + Send + Sync>(
        keys: &Keys<'_, '_>,
        key: &str,
        what: &str,
    ) -> Result<Vec<T>> {
        let value = keys.need(key)?;
        let array: PyReadonlyArray1<'_, T> =
            value.extract().map_err(|_| keys.wrong(key, what, &value))?;
        Ok(elements(&array))
    }
    let first: Vec<i32> = array(&keys, "first", "an (n,) int32 array")?;
    Ok(Indices {
        // A negative value becomes a huge one, which the check of the ascending order reports.
        first: first.into_iter().map(i32::cast_unsigned).collect(),
        object: array(&keys, "object", "an (n,) float32 array")?,
        material: array(&keys, "material", "an (n,) float32 array")?,
        identities: match keys.find("identities") {
            None => Vec::new(),
            Some(value) => {
                let wrong = || keys.wrong("identities", "an (n, 2) uint32 array", &value);
                let array: PyReadonlyArray2<'_, u32> = value.extract().map_err(|_| wrong())?;
                if array.shape()[1] != 2 {
                    return Err(wrong());
                }
                let rows = array.as_array();
                rows.outer_iter().map(|row| [row[0], row[1]]).collect()
            }
        },
        motion: motion(&keys)?,
        groups: match keys.find("groups") {
            None => Vec::new(),
            Some(_) => array(&keys, "groups", "an (n,) uint8 array")?,
        },
        material_identities: match keys.find("material_identities") {
            None => Vec::new(),
            Some(_) => array(&keys, "material_identities", "an (n,) uint32 array")?,
        },
        uvs: match keys.find("uvs") {
            None => Vec::new(),
            Some(value) => {
                let wrong = || keys.wrong("uvs", "an (m, 3, 2) float32 array", &value);
                let array: PyReadonlyArray3<'_, f32> = value.extract().map_err(|_| wrong())?;
                blocks(&array).ok_or_else(wrong)?
            }
        },
    })
}
