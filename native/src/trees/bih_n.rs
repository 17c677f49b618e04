// SPDX-License-Identifier: GPL-3.0-or-later
//! An interval hierarchy of more than two children a node, all along one axis, each between two planes
//! of its own and all tested at once.

use super::interval::{self, EMPTY, LEAF_SIZE, LEAVES};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, Kind, ParamSpec, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::traverse::objects::Objects;
use crate::traverse::slab_wide::WideSlabs;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bih-n",
    code: 45,
    label: "Interval hierarchy, wide",
    family: "objects",
    summary: "Several intervals a node along one axis, tested at once.",
    paper: "Wächter and Keller 2006, Instant ray tracing: the bounding interval hierarchy; \
            Wächter 2008, Quasi-Monte Carlo light transport simulation by efficient ray tracing",
    params: &[WAYS, LEAF_SIZE, EMPTY, LEAVES, params::ROBUST],
    build,
};

const WAYS: ParamSpec = ParamSpec {
    name: "n",
    label: "Width",
    doc: "Intervals per node, all tested at once. More makes fewer, dearer steps; 2 is bih4",
    unit: "intervals",
    kind: Kind::Choice(&["4", "2", "8"]),
    default: Value::Choice("4"),
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let n = config.choice("n");
    let ways = n.parse().expect("a choice of numbers");
    interval::by_grid((scene, config, monitor), ways, |binary, bounds, leaves| {
        let tighten = interval::tighten(config);
        Ok(match n {
            "2" => Objects::Slabs2(WideSlabs::new(binary, bounds, tighten, leaves)?),
            "8" => Objects::Slabs8(WideSlabs::new(binary, bounds, tighten, leaves)?),
            _ => Objects::Slabs4(WideSlabs::new(binary, bounds, tighten, leaves)?),
        })
    })
}
