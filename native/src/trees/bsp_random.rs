// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps along random directions, drawn afresh at every node (Hoobergs 2019).

use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, ParamSpec, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::trees::bsp::random::Uniform;
use crate::trees::bsp::{Variant, build, params};

/// The registry's row: plain.
pub const PLAIN: StructureSpec = StructureSpec {
    id: "bsp-random",
    code: 10,
    label: "BSP, random",
    family: "space",
    summary: "Planes along random directions, new at every node.",
    paper: PAPER,
    params: &PLAIN_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plain),
};

const PLAIN_PARAMS: [ParamSpec; params::USUAL] = params::usual(params::k(1, 10));

/// The registry's row: with the axes.
pub const PLUS: StructureSpec = StructureSpec {
    id: "bsp-random-plus",
    code: 11,
    label: "BSP, random +",
    family: "space",
    summary: "Planes along the axes and random directions, new at every node.",
    paper: PAPER,
    params: &PLUS_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plus),
};

const PLUS_PARAMS: [ParamSpec; params::PLUS] = params::plus(params::k(3, 10));

/// The registry's row: with the axes as cheap nodes.
pub const PLUS_KD: StructureSpec = StructureSpec {
    id: "bsp-random-plus-kd",
    code: 12,
    label: "BSP, random + Kd",
    family: "space",
    summary: "Planes along the axes, cheap to walk, and random directions, new at every node.",
    paper: PAPER,
    params: &PLUS_KD_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const PLUS_KD_PARAMS: [ParamSpec; params::KD] = params::kd(params::k(3, 10));

const PAPER: &str = "Hoobergs 2019, Bomen voor binaire ruimtepartitie (master thesis, KU Leuven)";

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let seed = config.integer("seed") as u64;
    build(scene, config, monitor, variant, |_| Uniform { seed })
}
