// SPDX-License-Identifier: GPL-3.0-or-later
//! The parameter that chooses how rays test the triangles of a leaf.

use halfspace_structure::row::{Group, Kind, Named, Need, Only, ParamSpec, named};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::TRAVERSAL;

/// Name of the parameter.
pub const LEAVES: &str = "leaves";

/// The option of blocks, the default.
pub const BLOCKS: Named = named("blocks", "Eight at Once");

/// The option of single triangles.
pub const SCALAR: Named = named("scalar", "One by One");

/// Where no shadow rays go in beams, which test eight triangles at once.
pub const NO_BEAMS: Need = Need {
    key: "shadow",
    only: Only::Options(&["none", "cache"]),
};

/// The need of ways that send rays one by one.
pub const fn singly(ways: &'static [&'static str]) -> Need {
    Need {
        key: TRAVERSAL,
        only: Only::Options(ways),
    }
}

/// The parameter with these options.
pub const fn leaves(options: &'static [Named]) -> ParamSpec {
    ParamSpec {
        name: LEAVES,
        label: "Leaf Tests",
        doc: "How rays test the triangles of a leaf. blocks: eight at once. scalar: one after another, as the programs of \
              the papers did, always by single rays; robust=none then decides hits in f32 by pbrt's test. Slower; costs=thesis \
              was meant for it",
        unit: "",
        kind: Kind::Choice(options),
        default: Value::Choice(options[0].name),
        group: Group::Numerics,
        needs: &[],
    }
}

/// Returns whether leaves test one triangle at a time.
pub fn alone(config: &Config) -> bool {
    config.find(LEAVES) == Some(&Value::Choice(SCALAR.name))
}
