// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps along few normals, and along many random directions where they found no plane.

use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, ParamSpec, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::trees::bsp::hybrid::Hybrid;
use crate::trees::bsp::normals::Arbitrary;
use crate::trees::bsp::{Variant, build, params};

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bsp-hybrid-plus-kd",
    code: 21,
    label: "BSP, hybrid + Kd",
    family: "space",
    summary: "Planes along the axes and few normals; random directions only where those found no good plane.",
    paper: "Our own, after Hoobergs 2019",
    params: &SPEC_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const SPEC_PARAMS: [ParamSpec; params::KD] = params::kd(params::k(3, 5));

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let seed = config.integer("seed") as u64;
    build(scene, config, monitor, variant, |normals| {
        Hybrid(Arbitrary {
            normals,
            seed,
            by_area: false,
        })
    })
}
