// SPDX-License-Identifier: GPL-3.0-or-later
//! The bounding volume hierarchy of today's renderers: binned surface area heuristic, wide nodes, ordered traversal.
//! All other structures are compared with it.

use crate::boxes::{self, Boxes};
use crate::leaf_tests::{self, BLOCKS, SCALAR, leaves, singly};
use crate::list::List;
use crate::refit::{Layers, MakePlan};
use crate::ways::{all, distinct, together, traversal};
use crate::{left_out, objects, params, refit};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::{hlbvh, object, spatial};
use halfspace_leaf::keep::Keep;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::nested;
use halfspace_nodes::object_tree::ObjectTree;
use halfspace_nodes::plane_boxes::PlaneBoxTree;
use halfspace_papers::alone;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single::objects::boxes::{boxes2, boxes4};
use halfspace_stream::order::Rule;
use halfspace_structure::row::{
    Family, Group, Kind, Menu, Named, Need, Only, ParamSpec, StructureSpec, named,
};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::Way;
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::SingleRays;
use std::sync::Arc;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "bvh-sah",
    code: 30,
    label: "Bounding volume hierarchy",
    family: Family::Objects,
    summary: "Boxes around boxes by the surface area heuristic: what most renderers use today.",
    paper: "Wald 2007, On fast construction of SAH-based bounding volume hierarchies; Wald, Benthin and \
            Boulos 2008, Getting rid of packets; for splits, Stich, Friedrich and Dietrich 2009",
    params: &[
        WIDTH,
        TRAVERSAL,
        ANY_ORDER,
        QUALITY,
        params::ROBUST,
        LEAVES,
        params::step_cost(Costs::BOXES),
        params::leaf_cost(Costs::BOXES),
        params::triangle_cost(Costs::BOXES),
        params::LEAF_MAX,
        params::SPLITS,
    ],
    ways: WAYS.slice(),
    no_groups: "",
    menu: Menu::Boxes,
    literature: &[
        ("BVH", ""),
        ("BVH, two boxes a node", "width=2"),
        ("SBVH (Stich, Friedrich and Dietrich)", "splits=0.3"),
    ],
    sweep: false,
    claims: &[
        "moving-*",
        "any-hits-*",
        "mirrored-beams",
        "refracted-beams",
        "planes-*",
    ],
    build,
};

const WAYS: List<Way> = all(&boxes::TRAVERSALS);

const OPTIONS: List<Named> = distinct(WAYS.slice());

pub(crate) const TRAVERSAL: ParamSpec = traversal(OPTIONS.slice());

pub(crate) const WIDTH: ParamSpec = ParamSpec {
    name: "width",
    label: "Width",
    doc: "Boxes per node, all tested at once. More makes fewer, dearer steps; 2 is the textbook's tree",
    unit: "boxes",
    kind: Kind::Choice(&[named("8", "8"), named("4", "4"), named("2", "2")]),
    default: Value::Choice("8"),
    group: Group::Main,
    needs: &[Need {
        key: "traversal",
        only: Only::Options(&["auto", "ordered", "stream", "tile", "packet"]),
    }],
};

/// Ize and Hansen 2011 (`cost`) and Nah and Manocha 2014 (`area`) order two children for single rays.
pub(crate) const ANY_ORDER: ParamSpec = ParamSpec {
    name: "any_order",
    label: "Any-Hit Order",
    doc: "Which child of a node any-hit streams visit first: the likeliest blocker for the expected work, the largest box, \
          or the child nearest to where the rays come from, as for nearest hits",
    unit: "",
    kind: Kind::Choice(&[
        named("cost", "Expected Cost"),
        named("area", "Largest Box"),
        named("near", "Nearest"),
    ]),
    default: Value::Choice("cost"),
    group: Group::Builder,
    needs: &[
        Need {
            key: "traversal",
            only: Only::Options(&["auto", "stream"]),
        },
        Need {
            key: "width",
            only: Only::Options(&["8"]),
        },
        Need {
            key: leaf_tests::LEAVES,
            only: Only::Options(&[BLOCKS.name]),
        },
    ],
};

pub(crate) const LEAVES: ParamSpec = leaves(&[
    BLOCKS,
    Named {
        needs: &[
            singly(&["auto", "ordered"]),
            Need {
                key: "width",
                only: Only::Options(&["8", "2"]),
            },
        ],
        ..SCALAR
    },
]);

/// Levels of other libraries (bvh by madmann91, obvhs) for the builders of this row and of `bvh-hlbvh`.
const QUALITY: ParamSpec = ParamSpec {
    name: "quality",
    label: "Build Quality",
    doc: "How much work the build spends on a tree that is traced faster",
    unit: "",
    kind: Kind::Choice(&[
        Named {
            doc: "every node by the heuristic, cutting triangles only as splits permits",
            ..named("medium", "Medium")
        },
        Named {
            doc: "as bvh-hlbvh, along a space-filling curve, with the heuristic only near the root and for leaves",
            ..named("fast", "Fast")
        },
        Named {
            doc: "as splits=0.3, with triangles cut",
            needs: &[Need {
                key: "width",
                only: Only::Options(&["8"]),
            }],
            ..named("high", "High")
        },
    ]),
    default: Value::Choice("medium"),
    group: Group::Builder,
    needs: &[],
};

/// Spatial splits of the highest quality, as in the row's entry of the literature.
const HIGH_SPLITS: f32 = 0.3;

fn any_order(config: &Config) -> Rule {
    config.pick(
        "any_order",
        [
            ("cost", Rule::Cost),
            ("area", Rule::Area),
            ("near", Rule::Near),
        ],
    )
}

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = params::surface_area(config, Costs::BOXES);
    // Build over whole triangles, unless planes may cut them.
    let share = match config.choice(QUALITY.name) {
        "fast" => {
            let binary = hlbvh::build(scene, &frame, &policy, monitor)?;
            return whole(scene, config, frame, binary);
        }
        "high" => HIGH_SPLITS,
        _ => config.float(params::SPLITS.name),
    };
    let needless = (share > 0.0)
        .then(|| left_out::needless_splits(scene, &frame))
        .flatten();
    if share == 0.0 || needless.is_some() {
        let binary = object::build(scene, &frame, &policy, monitor)?;
        let mut built = whole(scene, config, frame, binary)?;
        built.left_out.extend(needless);
        return Ok(built);
    }
    let framed = FramedScene {
        scene,
        frame: &frame,
    };
    let binary = spatial::build(framed, share, &policy, monitor)?;
    if binary.ids.len() > scene.live().len() {
        return of_parts(framed, config, &binary);
    }
    let mut built = whole(scene, config, frame, binary)?;
    if !scene.live().is_empty() {
        let reason = "spatial splits: at every node a partition of whole triangles was cheapest";
        built.left_out.push(reason.to_owned());
    }
    Ok(built)
}

/// The structure over whole triangles, each in one leaf, with the nodes that `width` and `traversal` choose.
pub(crate) fn whole(
    scene: &Triangles,
    config: &Config,
    frame: Frame,
    binary: ObjectTree,
) -> Result<Built> {
    let (traversal, width) = (config.way().traversal, config.choice("width"));
    let order = Ordered {
        scene,
        config,
        frame,
        binary,
    };
    match width {
        "2" => order.lay_out(
            |tree| tree,
            |config, tree, leaves, _| {
                if leaf_tests::alone(config) {
                    return ordered(alone::boxes2(tree, leaves, config.robust()));
                }
                let single = ordered(boxes2(tree, leaves));
                let groups = together!(tree, leaves, boxes2, shadow_boxes2);
                groups.plan(single, config.way().rays)
            },
        ),
        "4" => order.lay_out(
            |tree| tree,
            |config, tree, leaves, _| {
                let single = ordered(boxes4(tree, leaves));
                let groups = together!(tree, leaves, boxes4, shadow_boxes4);
                groups.plan(single, config.way().rays)
            },
        ),
        _ => {
            // The same nodes for all groups of rays.
            let by_corners = traversal != "ordered";
            order.lay_out(
                |tree| if by_corners { tree.by_corners() } else { tree },
                |config, tree, leaves, _| {
                    let boxes = Boxes {
                        tree: tree.clone(),
                        leaves: leaves.clone(),
                        any_order: any_order(config),
                    };
                    boxes.plan(config)
                },
            )
        }
    }
}

/// The structure over parts of triangles. Its boxes cannot be fitted to moved triangles, because fitted boxes would
/// contain the triangles whole.
fn of_parts(framed: FramedScene<'_>, config: &Config, binary: &ObjectTree) -> Result<Built> {
    let FramedScene { scene, frame } = framed;
    let mut leaves = Leaves::new(Keep::Corners);
    let tree = BoxTree::new(binary, &mut leaves)?;
    let boxes = Boxes {
        tree: Arc::new(if config.way().traversal == "ordered" {
            tree
        } else {
            tree.by_corners()
        }),
        leaves: Arc::new(leaves.write(scene, frame, &binary.ids)),
        any_order: any_order(config),
    };
    let plan = boxes.plan(config);
    let shape = nested::shape(&*boxes.tree, frame.bounds());
    let tree = Arc::new(PlaneBoxTree(boxes.tree));
    Ok(objects::built(
        config,
        *frame,
        tree,
        boxes.leaves,
        plan,
        shape,
    ))
}

fn ordered(kernel: Arc<dyn SingleRays>) -> Plan {
    Plan::single("boxes", "ordered", kernel)
}

/// Triangles in the order of a binary tree over them.
struct Ordered<'a> {
    scene: &'a Triangles,
    config: &'a Config,
    frame: Frame,
    binary: ObjectTree,
}

impl Ordered<'_> {
    /// Lays the tree out with `W` boxes per node, puts the boxes of each node in the order of `place`, writes the
    /// leaves and makes the plan.
    fn lay_out<const W: usize>(
        &self,
        place: impl FnOnce(BoxTree<W>) -> BoxTree<W>,
        plan: MakePlan<BoxTree<W>>,
    ) -> Result<Built> {
        let mut leaves = Leaves::new(Keep::Corners);
        let tree = Arc::new(place(BoxTree::new(&self.binary, &mut leaves)?));
        let leaves = Arc::new(leaves.write(self.scene, &self.frame, &self.binary.ids));
        let shape = nested::shape(&*tree, self.frame.bounds());
        let layers = Layers {
            frame: self.frame,
            tree,
            leaves,
            shape,
        };
        Ok(refit::built(self.config, layers, plan))
    }
}
