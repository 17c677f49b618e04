// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of the dictionaries of volumes.

use crate::args::arrays::{check_copy, converted};
use crate::args::keys::{Keys, list};
use crate::args::shader;
use halfspace_base::error::Result;
use halfspace_render::medium::{VolumeClosure, VolumeParams};
use halfspace_render::values::program::Operand;
use halfspace_render::values::voxels::Voxels;
use numpy::{PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Reads grids: dictionaries of `values`, (x, y, z, 1 or 3) float32, and `to_index`, (3, 4), object space to indices.
pub fn grids(value: Option<&Bound<'_, PyAny>>) -> Result<Vec<Voxels>> {
    list("grids", value, |dict, index| {
        let keys = Keys::new(dict, format!("grids[{index}]"), &["values", "to_index"])?;
        // Check the shape, and copy the values if they fit into memory.
        let values = keys.need("values")?;
        let wrong = || keys.wrong("values", "an (x, y, z, 1 or 3) float32 array", &values);
        let array: PyReadonlyArray4<'_, f32> = values.extract().map_err(|_| wrong())?;
        let [x, y, z, channels] = *array.shape() else {
            return Err(wrong());
        };
        check_copy("grids", &*array, size_of::<f32>())?;
        let flat = array.as_slice().map_err(|_| wrong())?;
        let flat = converted(values.py(), flat.len(), || flat.to_vec());
        let to_index = shader::rows(&keys, "to_index")?;
        Voxels::new([x, y, z], channels, flat, to_index, &keys.name)
    })
}

/// Reads the key "volume" of a material or background: closures and their program; no volume by default.
pub fn volume(keys: &Keys<'_, '_>) -> Result<VolumeParams> {
    let Some(value) = keys.find("volume") else {
        return Ok(VolumeParams::default());
    };
    let name = format!("{}['volume']", keys.name);
    let dict = value
        .cast::<PyDict>()
        .map_err(|_| keys.wrong("volume", "a dictionary", &value))?;
    let keys = Keys::new(dict, name.clone(), &["closures", "program"])?;
    let known = ["scattering", "absorption", "emission", "anisotropy"];
    let name = format!("{name}['closures']");
    let closures = list(&name, keys.find("closures").as_ref(), |dict, index| {
        let keys = Keys::new(dict, format!("{name}[{index}]"), &known)?;
        let default = Operand::number(0.0);
        let input = |key: &str| match keys.find(key) {
            None => Ok(default),
            Some(value) => shader::operand(&keys, key, &value),
        };
        Ok(VolumeClosure {
            scattering: input("scattering")?,
            absorption: input("absorption")?,
            emission: input("emission")?,
            anisotropy: input("anisotropy")?,
        })
    })?;
    Ok(VolumeParams {
        closures,
        program: shader::program(&keys)?,
    })
}
