// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding volume hierarchy of today's renderers: binned surface area heuristic, wide nodes,
//! ordered walk. The yardstick that all other structures are held against.

use crate::build::Monitor;
use crate::build::binned::SurfaceArea;
use crate::build::cost::Costs;
use crate::build::leaves::Leaves;
use crate::build::object;
use crate::error::{Error, Result};
use crate::registry::{Built, Kind, ParamSpec, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;
use crate::traverse::box_tree::BoxTree;
use crate::traverse::frame::Frame;
use crate::traverse::keep::Keep;
use crate::traverse::nested;
use crate::traverse::objects::Objects;
use crate::trees::NO_PLANES;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bvh-sah",
    code: 30,
    label: "Bounding volume hierarchy",
    family: "objects",
    summary: "Boxes around boxes by the surface area heuristic: what most renderers use today.",
    paper: "Wald 2007, On fast construction of SAH-based bounding volume hierarchies; Wald, Benthin and \
            Boulos 2008, Getting rid of packets",
    params: &[
        TRAVERSAL,
        WIDTH,
        params::ROBUST,
        params::step_cost(Costs::BOXES),
        params::leaf_cost(Costs::BOXES),
        params::triangle_cost(Costs::BOXES),
        params::LEAF_MAX,
    ],
    build,
};

const TRAVERSAL: ParamSpec = ParamSpec {
    name: "traversal",
    label: "Traversal",
    doc: "How rays walk the tree. ordered: one by one, the nearest box first. wide: several rays in flight, boxes in \
          the order of the direction's octant, many in random order sorted by where they start. auto: whatever is quickest \
          for a batch: tile8 for camera rays and for shadow rays, for others streams, of which each node is visited once for all rays that meet it. tile8, tile16: camera rays in tiles \
          of 64 or 256, shadow rays of one light in tiles of 64 from the light; tiles whose rays drift apart are \
          split into packets. p4, p8, p16: packets of 4, 8 or 16 rays, one to a lane, \
          shadow rays always in packets of 16. Shadow rays are counted as ordered walks them. All but ordered need eight \
          boxes to a node. The answer is the same",
    unit: "",
    kind: Kind::Choice(&[
        "ordered", "auto", "wide", "tile8", "tile16", "p4", "p8", "p16",
    ]),
    default: Value::Choice("ordered"),
};

const WIDTH: ParamSpec = ParamSpec {
    name: "width",
    label: "Width",
    doc: "Boxes per node, all tested at once. More makes fewer, dearer steps; 2 is the textbook's tree",
    unit: "boxes",
    kind: Kind::Choice(&["8", "4", "2"]),
    default: Value::Choice("8"),
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let (traversal, width) = (config.choice("traversal"), config.choice("width"));
    if traversal != "ordered" && width != "8" {
        return Err(Error::Spec(format!(
            "traversal={traversal} needs width=8, got width={width}"
        )));
    }
    let frame = Frame::new(scene.bounds());
    let policy = SurfaceArea::configured(config, Costs::BOXES);
    let binary = object::build(scene, &frame, &policy, monitor)?;
    let mut leaves = Leaves::new(Keep::Corners);
    let tree = match config.choice("width") {
        "2" => Objects::Boxes2(BoxTree::new(&binary, &mut leaves)?),
        "4" => Objects::Boxes4(BoxTree::new(&binary, &mut leaves)?),
        _ => {
            let tree = BoxTree::new(&binary, &mut leaves)?;
            let by_corners = matches!(traversal, "wide" | "auto");
            Objects::Boxes8(if by_corners { tree.by_corners() } else { tree })
        }
    };
    let blocks = leaves.write(scene, &frame, &binary.ids);
    let shape = nested::shape(tree.nested(), frame.bounds());
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        blocks,
        layout: Layout::Objects(tree),
        shape,
        left_out: vec![NO_PLANES.to_owned()],
    })
}
