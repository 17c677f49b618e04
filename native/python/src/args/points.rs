// SPDX-License-Identifier: GPL-3.0-or-later
//! Points of surfaces that pixels show.

use crate::args::arrays::elements;
use crate::args::keys::Keys;
use halfspace_base::error::Result;
use halfspace_render::path::points::{Points, Seen, SurfacePoint};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Reads the points; their number is checked with that of the pixels.
pub fn points(dict: &Bound<'_, PyDict>) -> Result<Points> {
    let known = ["triangle", "place", "seen", "origin"];
    let keys = Keys::new(dict, "points".into(), &known)?;
    let triangle = keys.need("triangle")?;
    let triangles = (triangle.extract::<PyReadonlyArray1<'_, u32>>().ok())
        .filter(|array| array.is_contiguous())
        .map(|array| elements(&array))
        .ok_or_else(|| keys.wrong("triangle", "an (n,) uint32 array", &triangle))?;
    let place = keys.need("place")?;
    let rows = (place.extract::<PyReadonlyArray2<'_, f32>>().ok())
        .filter(|array| array.shape()[1] == 6 && array.is_c_contiguous())
        .map(|array| elements(&array))
        .ok_or_else(|| keys.wrong("place", "an (n, 6) float32 array", &place))?;
    let places = rows.chunks_exact(6).map(|row| SurfacePoint {
        at: [row[0], row[1]],
        right: [row[2], row[3]],
        up: [row[4], row[5]],
    });
    let seen = match keys.find("seen") {
        None => Seen::Above,
        Some(value) => match keys.text("seen")?.as_str() {
            "above" => Seen::Above,
            "camera" => Seen::Camera,
            "background" => Seen::Background(origin(&keys)?),
            _ => return Err(keys.wrong("seen", "above, camera or background", &value)),
        },
    };
    Ok(Points {
        triangles,
        places: places.collect(),
        seen,
    })
}

/// Reads the position of the world's origin; zeros by default.
fn origin(keys: &Keys<'_, '_>) -> Result<[f32; 3]> {
    let Some(value) = keys.find("origin") else {
        return Ok([0.0; 3]);
    };
    let read: Option<[f32; 3]> = value.extract().ok();
    read.filter(|point| point.iter().all(|x| x.is_finite()))
        .ok_or_else(|| keys.wrong("origin", "three finite numbers", &value))
}
