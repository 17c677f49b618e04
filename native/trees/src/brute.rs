// SPDX-License-Identifier: GPL-3.0-or-later
//! Brute force: every ray against every triangle. The oracle that all other structures must equal.

use crate::ways::only_singly;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_scene::Triangles;
use halfspace_structure::row::{Family, Menu, StructureSpec};
use halfspace_structure::spec::Config;
use halfspace_structure::way::Way;
use halfspace_structure::{Built, work};

const WAYS: [Way; 1] = only_singly("none");

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "brute",
    code: 0,
    label: "Brute force",
    family: Family::Oracle,
    summary: "Tests every triangle against every ray: no tree, no doubt. What all others must equal.",
    paper: "Whitted 1980, An improved illumination model for shaded display",
    params: &[],
    ways: &WAYS,
    no_groups: "there are no nodes to share",
    menu: Menu::Others,
    literature: &[("Whitted: all rays against all objects", "")],
    sweep: false,
    claims: &[],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    work::whole(scene, config.choice("shadow"), monitor)
}
