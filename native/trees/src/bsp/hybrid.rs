// SPDX-License-Identifier: GPL-3.0-or-later
//! Few normals first, and many random directions only where these find no split: the tree that Hoobergs 2019
//! suggests as future work.

use crate::bsp::normals::{Arbitrary, Draw};
use crate::bsp::random::{direction, generator};
use crate::bsp::{Source, Triangulated, Variant, add_distinct, build, params};
use crate::planes::rows::ANY_WAYS;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Family, Menu, StructureSpec};
use halfspace_structure::spec::Config;

/// Number of random directions of the second attempt.
const MORE: usize = 16;

/// Directions from normals, and random ones for nodes that would otherwise be leaves.
pub struct Hybrid(pub Arbitrary);

impl Source for Hybrid {
    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    fn directions(&self, node: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>) {
        self.0.directions(node, k, out);
    }

    fn more(&self, node: &Triangulated<'_>, out: &mut Vec<[f32; 3]>) {
        // The inverted seed gives random numbers independent of the first attempt's.
        let mut random = generator(!self.0.seed, node.key);
        for _ in 0..MORE {
            add_distinct(out, direction(&mut random));
        }
    }
}

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bsp-hybrid-plus-kd",
    code: 21,
    label: "BSP, hybrid + Kd",
    family: Family::Space,
    summary: "Planes along the axes and few normals; random directions only where those found no good plane.",
    paper: "Our own, after Hoobergs 2019",
    params: const { &params::kd(params::k(3, 5)) }.slice(),
    ways: ANY_WAYS,
    no_groups: "",
    menu: Menu::Bsp,
    literature: &[("BSP_hybrid+^Kd", "")],
    sweep: true,
    claims: &["three-directions-are-kd"],
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    build(scene, config, monitor, variant, |settings, normals| {
        Hybrid(Arbitrary {
            normals,
            seed: settings.seed,
            draw: Draw::Distinct,
        })
    })
}
