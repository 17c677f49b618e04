// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps along the normals of triangles drawn in proportion to their area.

use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, ParamSpec, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::trees::bsp::normals::Arbitrary;
use crate::trees::bsp::{Variant, build, params};

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bsp-wn-area-plus-kd",
    code: 20,
    label: "BSP, area normals + Kd",
    family: "space",
    summary: "Planes along the axes and the normals of some triangles of each node, large ones likelier.",
    paper: "Our own, after Hoobergs 2019",
    params: &SPEC_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const SPEC_PARAMS: [ParamSpec; params::KD] = params::kd(params::k(3, 6));

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let seed = config.integer("seed") as u64;
    build(scene, config, monitor, variant, |normals| Arbitrary {
        normals,
        seed,
        by_area: true,
    })
}
