// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding volume hierarchy from the leaves up: triangles are united, each with a neighbour
//! on a space-filling curve. Nodes and traversals are those of `bvh-sah`.

use crate::{bvh_sah, params};
use halfspace_builders::ploc::{self, Clustering, FARTHEST};
use halfspace_nodes::cost::Costs;
use halfspace_ray::frame::Frame;
use halfspace_structure::row::{Group, Kind, ParamSpec, StructureSpec};
use halfspace_structure::spec::Value;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bvh-ploc",
    code: 32,
    label: "Clustered boxes",
    summary: "Boxes united with their neighbours on a space-filling curve, from the leaves up.",
    paper: "Meister and Bittner 2018, Parallel locally-ordered clustering for bounding volume hierarchy construction",
    params: &[
        bvh_sah::WIDTH,
        bvh_sah::TRAVERSAL,
        bvh_sah::ANY_ORDER,
        RADIUS,
        params::ROBUST,
        bvh_sah::LEAVES,
        params::step_cost(Costs::BOXES),
        params::leaf_cost(Costs::BOXES),
        params::triangle_cost(Costs::BOXES),
        params::LEAF_MAX,
    ],
    literature: &[("PLOC (Meister and Bittner)", "")],
    claims: &[],
    build: |scene, config, monitor| {
        let frame = Frame::new(scene.bounds());
        let clustering = Clustering {
            radius: config.integer(RADIUS.name),
            heuristic: params::surface_area(config, Costs::BOXES),
        };
        let binary = ploc::build(scene, &frame, &clustering, monitor)?;
        bvh_sah::whole(scene, config, frame, binary)
    },
    ..bvh_sah::SPEC
};

const RADIUS: ParamSpec = ParamSpec {
    name: "radius",
    label: "Search Radius",
    doc: "Neighbours on the curve, to each side, among which a box finds the one to unite with. More gives a better tree \
          and a longer build",
    unit: "boxes",
    kind: Kind::Integer {
        min: 1,
        max: FARTHEST as i64,
    },
    default: Value::Integer(16),
    group: Group::Builder,
    needs: &[],
};
