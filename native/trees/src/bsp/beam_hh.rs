// SPDX-License-Identifier: GPL-3.0-or-later
//! Heckbert and Hanrahan's beams: the tree of `bsp-wn-plus-kd`, seen from the front to the back by beams that the
//! polygons cut. Its planes are chosen by cost, along the axes and some of the polygons' normals, and not one
//! through every polygon as those of Fuchs, Kedem and Naylor 1980: its fragments would outgrow memory on real scenes.

use crate::bsp::normals::{Arbitrary, Draw};
use crate::bsp::{Settings, Variant, build as build_bsp, params};
use crate::list::List;
use crate::params::BEAM_LEAST;
use crate::planes::rows::{BEAM_TRAVERSAL, BEAM_WAYS};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Family, Menu, ParamSpec, StructureSpec};
use halfspace_structure::spec::Config;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "beam-hh",
    code: 80,
    label: "BSP with beams",
    family: Family::Space,
    summary: "A tree of swept planes, through which 64 camera rays go as one beam that each polygon cuts.",
    paper: "Heckbert and Hanrahan 1984, Beam tracing polygonal objects; Fuchs, Kedem and Naylor 1980, for the order; \
            Weiler and Atherton 1977, for the cuts",
    params: PARAMS.slice(),
    ways: BEAM_WAYS,
    no_groups: "",
    menu: Menu::Bsp,
    literature: &[("Beams of Heckbert and Hanrahan", "")],
    sweep: false,
    claims: &["mirrored-beams", "refracted-beams"],
    build,
};

/// The parameters of [`params::kd`], without the choice of nodes, which are always planes, that of leaf tests, which are
/// those of beams, and that of a lazy build; with the threshold of beams.
const PARAMS: List<ParamSpec> = params::kd(params::k(3, 6))
    .without("nodes")
    .without("leaves")
    .without("lazy")
    .replace("traversal", BEAM_TRAVERSAL)
    .insert_after("traversal", BEAM_LEAST);

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let source = |settings: &Settings, normals| Arbitrary {
        normals,
        seed: settings.seed,
        draw: Draw::Distinct,
    };
    build_bsp(scene, config, monitor, Variant::PlusKd, source)
}
