// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps along the normals of arbitrary triangles of the node (Hoobergs 2019).

use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, ParamSpec, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::trees::bsp::normals::Arbitrary;
use crate::trees::bsp::{Variant, build, params};

/// The registry's row: plain.
pub const PLAIN: StructureSpec = StructureSpec {
    id: "bsp-wn",
    code: 13,
    label: "BSP, normals",
    family: "space",
    summary: "Planes along the normals of some triangles of each node.",
    paper: PAPER,
    params: &PLAIN_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plain),
};

const PLAIN_PARAMS: [ParamSpec; params::USUAL] = params::usual(params::k(1, 6));

/// The registry's row: with the axes.
pub const PLUS: StructureSpec = StructureSpec {
    id: "bsp-wn-plus",
    code: 14,
    label: "BSP, normals +",
    family: "space",
    summary: "Planes along the axes and the normals of some triangles of each node.",
    paper: PAPER,
    params: &PLUS_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plus),
};

const PLUS_PARAMS: [ParamSpec; params::PLUS] = params::plus(params::k(3, 6));

/// The registry's row: with the axes as cheap nodes.
pub const PLUS_KD: StructureSpec = StructureSpec {
    id: "bsp-wn-plus-kd",
    code: 15,
    label: "BSP, normals + Kd",
    family: "space",
    summary: "Planes along the axes, cheap to walk, and the normals of some triangles of each node.",
    paper: PAPER,
    params: &PLUS_KD_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const PLUS_KD_PARAMS: [ParamSpec; params::KD] = params::kd(params::k(3, 6));

const PAPER: &str = "Hoobergs 2019, Bomen voor binaire ruimtepartitie (master thesis, KU Leuven)";

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let seed = config.integer("seed") as u64;
    build(scene, config, monitor, variant, |normals| Arbitrary {
        normals,
        seed,
        by_area: false,
    })
}
