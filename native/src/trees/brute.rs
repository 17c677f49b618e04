// SPDX-License-Identifier: GPL-3.0-or-later
//! Brute force: every ray against every triangle. The oracle that all other structures must equal.

use crate::build::Monitor;
use crate::build::shape::Measure;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "brute",
    code: 0,
    label: "Brute force",
    family: "oracle",
    summary: "Tests every triangle against every ray: no tree, no doubt. What all others must equal.",
    paper: "Whitted 1980, An improved illumination model for shaded display",
    params: &[],
    build,
};

fn build(scene: &Triangles, _: &Config, monitor: &Monitor) -> Result<Built> {
    monitor.check()?;
    let frame = Frame::new(scene.bounds());
    let mut blocks = Blocks::new();
    blocks.push_leaf(scene, &frame, scene.live());
    blocks.seal();
    let mut measure = Measure::default();
    measure.leaf(scene.live().len(), 0, 1.0);
    Ok(Built {
        frame,
        blocks,
        layout: Layout::Brute,
        shape: measure.finish(),
        left_out: Vec::new(),
    })
}
