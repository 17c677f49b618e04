// SPDX-License-Identifier: GPL-3.0-or-later
//! The restricted BSP tree: planes along K directions, the same everywhere (Kammaje and Mora 2007; Budge et
//! al. 2008).

use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, Kind, ParamSpec, StructureSpec};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::trees::bsp::fixed::{Fixed, cube, spiral};
use crate::trees::bsp::{Variant, build, params};

const PAPER: &str =
    "Kammaje and Mora 2007, A study of restricted BSP trees for ray tracing; Budge et al. 2008";

/// The registry's row: all nodes alike.
pub const PLAIN: StructureSpec = StructureSpec {
    id: "rbsp",
    code: 22,
    label: "RBSP",
    family: "space",
    summary: "Planes along K directions that are the same at every node.",
    paper: PAPER,
    params: &PLAIN_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plain),
};

/// The registry's row: with the axes as cheap nodes.
pub const KD: StructureSpec = StructureSpec {
    id: "rbsp-kd",
    code: 23,
    label: "RBSP + Kd",
    family: "space",
    summary: "Planes along K directions that are the same at every node; the axes among them are cheap to walk.",
    paper: "Kammaje and Mora 2007; Budge et al. 2008; Hoobergs 2019",
    params: &KD_PARAMS,
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const SET: ParamSpec = ParamSpec {
    name: "set",
    label: "Directions",
    doc: "cube: the axes, the cube's diagonals and its faces' (Klosowski et al. 1998), up to 13, and a spiral \
          beyond. spiral: always even over the sphere (Kammaje and Mora 2007)",
    unit: "",
    kind: Kind::Choice(&["cube", "spiral"]),
    default: Value::Choice("cube"),
};

const K: ParamSpec = ParamSpec {
    kind: Kind::Integer { min: 3, max: 26 },
    ..params::k(3, 13)
};

const PLAIN_PARAMS: [ParamSpec; params::USUAL] = with_set(params::usual(K), 2);
const KD_PARAMS: [ParamSpec; params::KD] = with_set(params::kd(K), 3);

/// Fixed directions need no seed: its place takes the set. Their first few are no choice of the node's, so small
/// nodes try as many as others.
const fn with_set<const N: usize>(mut params: [ParamSpec; N], seed: usize) -> [ParamSpec; N] {
    params[seed] = SET;
    params[seed + 1] = ParamSpec {
        default: Value::Float(1.0),
        ..params::K_SMALL
    };
    params
}

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let k = config.integer("k");
    let set = if config.choice("set") == "cube" && k <= cube().len() {
        cube()
    } else if variant == Variant::PlusKd {
        let mut set = cube();
        set.truncate(3);
        set.extend(spiral(k - 3));
        set
    } else {
        spiral(k)
    };
    build(scene, config, monitor, variant, |_| Fixed(set))
}
