// SPDX-License-Identifier: GPL-3.0-or-later
//! Brute force: every ray against every triangle. The oracle that all other structures must equal.

use crate::ways::only_singly;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::shape::Measure;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::row::StructureSpec;
use halfspace_structure::spec::Config;
use halfspace_structure::way::Way;
use halfspace_structure::{Built, Plan};
use halfspace_trace::single::brute::brute;
use std::sync::Arc;

const WAYS: [Way; 1] = only_singly("none");

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "brute",
    code: 0,
    label: "Brute force",
    family: "oracle",
    summary: "Tests every triangle against every ray: no tree, no doubt. What all others must equal.",
    paper: "Whitted 1980, An improved illumination model for shaded display",
    params: &[],
    ways: &WAYS,
    no_groups: "there are no nodes to share",
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    monitor.check()?;
    let frame = Frame::new(scene.bounds());
    let mut blocks = Blocks::new();
    blocks.push_leaf(scene, &frame, scene.live());
    blocks.seal();
    let mut measure = Measure::default();
    measure.leaf(scene.live().len(), 0, 1.0);
    let leaves = Arc::new(blocks);
    let plan = Plan::single("none", "all", brute(&leaves, scene.live().len()));
    Ok(Built {
        frame,
        tree: None,
        leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(config.choice("shadow"), None),
        shape: measure.finish(),
        left_out: Vec::new(),
        growing: None,
        refit: None,
    })
}
