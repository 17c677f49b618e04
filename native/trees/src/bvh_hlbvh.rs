// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding volume hierarchy that is built quickest: triangles are sorted along a space-filling curve, whose bits
//! divide them. Nodes and traversals are those of `bvh-sah`.

use crate::{bvh_sah, params};
use halfspace_builders::hlbvh;
use halfspace_nodes::cost::Costs;
use halfspace_ray::frame::Frame;
use halfspace_structure::row::StructureSpec;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bvh-hlbvh",
    code: 33,
    label: "Sorted boxes",
    summary: "Boxes around triangles that are sorted along a space-filling curve: the quickest build.",
    paper: "Pantaleoni and Luebke 2010, HLBVH: hierarchical LBVH construction for real-time ray tracing of dynamic \
            geometry; Lauterbach et al. 2009, Fast BVH construction on GPUs",
    params: &[
        bvh_sah::WIDTH,
        bvh_sah::TRAVERSAL,
        bvh_sah::ANY_ORDER,
        params::ROBUST,
        bvh_sah::LEAVES,
        params::step_cost(Costs::BOXES),
        params::leaf_cost(Costs::BOXES),
        params::triangle_cost(Costs::BOXES),
        params::LEAF_MAX,
    ],
    literature: &[("HLBVH (Pantaleoni and Luebke)", "")],
    claims: &[],
    build: |scene, config, monitor| {
        let frame = Frame::new(scene.bounds());
        let heuristic = params::surface_area(config, Costs::BOXES);
        let binary = hlbvh::build(scene, &frame, &heuristic, monitor)?;
        bvh_sah::whole(scene, config, frame, binary)
    },
    ..bvh_sah::SPEC
};
