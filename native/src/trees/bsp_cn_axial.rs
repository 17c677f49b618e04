// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps along clustered normals, taken as lines: no border of the half space, equal normals merged, triangles
//! weighted by area.

use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, ParamSpec, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::trees::bsp::clusters::{Clusters, Geometry};
use crate::trees::bsp::{Variant, build, params};

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bsp-cn-axial-plus-kd",
    code: 19,
    label: "BSP, axial clusters + Kd",
    family: "space",
    summary: "Planes along the axes and the centres of clusters of normals, taken as lines and weighted by area.",
    paper: "Our own, after Hoobergs 2019",
    params: &SPEC_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const SPEC_PARAMS: [ParamSpec; params::KD] = params::kd(params::k(3, 6));

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let seed = config.integer("seed") as u64;
    build(scene, config, monitor, variant, |normals| Clusters {
        normals,
        seed,
        geometry: Geometry::Lines,
    })
}
