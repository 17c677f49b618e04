// SPDX-License-Identifier: GPL-3.0-or-later
//! The kd-tree of Hoobergs 2019: pbrt's, without its bonus for empty sides. Whole triangles, none cut; one per
//! leaf; a triangle costs 80 steps. The baseline of that thesis, and so of everything compared with it.

use crate::kd::{Axes, plane_tree};
use crate::params;
use crate::planes::rows::{AXIS_TRAVERSAL, AXIS_WAYS};
use crate::planes::scalar::{AXIS_LEAVES, MAILBOX};
use crate::ways::PLANE_NODES;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::piece::Boxed;
use halfspace_builders::space::{ObliqueStep, Params, Stop};
use halfspace_builders::sweep::Ties;
use halfspace_nodes::cost::Costs;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Family, Menu, StructureSpec};
use halfspace_structure::spec::Config;
use std::marker::PhantomData;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "kd-sah",
    code: 2,
    label: "kd-tree (thesis)",
    family: Family::Space,
    summary: "That of the thesis on BSP trees, pbrt's without its bonus for empty sides: whole triangles, one per leaf.",
    paper: "Pharr, Jakob and Humphreys, Physically Based Rendering, 3rd ed., section 4.4; Hoobergs 2019",
    params: &[
        PLANE_NODES,
        AXIS_TRAVERSAL,
        params::ROBUST,
        AXIS_LEAVES,
        MAILBOX,
        params::step_cost(Costs::THESIS),
        params::triangle_cost(Costs::THESIS),
        params::empty_factor(Costs::THESIS),
        params::STOP,
        params::BETA,
        params::LEAF_SIZE,
        params::MAX_DEPTH,
    ],
    ways: AXIS_WAYS,
    no_groups: "",
    menu: Menu::Kd,
    literature: &[("Kd, as in the thesis", "")],
    sweep: false,
    claims: &["ta-b-*", "medians-*"],
    build,
};

/// The depth limit of the thesis: round(2 + 1.6 floor(log2 n)).
pub fn thesis_depth(triangles: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most 53"
    )]
    let depth = (2.0 + 1.6 * f64::from(triangles.max(1).ilog2())).round() as usize;
    depth
}

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let params = Params {
        costs: Costs {
            step: config.float("step_cost"),
            triangle: config.float("triangle_cost"),
            empty: config.float("empty_factor"),
            ..Costs::THESIS
        },
        oblique: ObliqueStep::Fixed(f32::INFINITY),
        ties: Ties::StartsFirst,
        slab: 0.0,
        leaf_size: config.integer("leaf_size"),
        leaf_most: usize::MAX,
        area_stop: 0.0,
        max_depth: match config.integer("max_depth") {
            0 => thesis_depth(scene.live().len()),
            depth => depth,
        },
        stop: params::stop(config, Stop::Tolerant(3)),
        sorted: false,
        early: false,
        enough: 0.0,
    };
    plane_tree(scene, config, Axes::<Boxed>(PhantomData), &params, monitor)
}

#[cfg(test)]
mod tests {
    #[test]
    fn depths_are_those_of_the_thesis() {
        let depths = [33_264, 123_651, 227_309, 1_462_840].map(super::thesis_depth);
        assert_eq!(depths, [26, 28, 29, 34]);
    }
}
