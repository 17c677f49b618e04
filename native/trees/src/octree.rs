// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees: one build, and one row for each way in which rays find the next cell.

use crate::leaf_tests::{self, BLOCKS, NO_BEAMS, SCALAR, leaves as leaf_tests_of, singly};
use crate::left_out;
use crate::list::List;
use crate::params::{BEAM_LEAST, least};
use crate::ways::{distinct, every_way, only_singly, together, traversal, way};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_beam as beam;
use halfspace_builders::octree::{self, Params};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octants::{Cube, MAX_DEPTH};
use halfspace_nodes::octree_nodes::Octree;
use halfspace_papers::alone;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single::octants::{glassner, net, param, samet};
use halfspace_structure::row::{
    Family, Group, Kind, Menu, Named, Need, Only, ParamSpec, StructureSpec,
};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::{Rays, Way};
use halfspace_structure::{Built, Plan};
use halfspace_trace::kernel::SingleRays;
use std::sync::Arc;

/// Depth limit.
pub const MAX_DEPTH_PARAM: ParamSpec = ParamSpec {
    name: "max_depth",
    label: "Depth Limit",
    doc: "Leaves lie no deeper; 0 chooses by the number of triangles. Each level more may cost four \
          times the memory, and splits what small leaves could not",
    unit: "levels",
    kind: Kind::Integer {
        min: 0,
        max: MAX_DEPTH as i64,
    },
    default: Value::Integer(0),
    group: Group::Builder,
    needs: &[],
};

/// Leaf size.
pub const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Cells of at most this many triangles are not halved. Around a corner that more triangles \
          share, cells go down to the depth limit",
    unit: "triangles",
    kind: Kind::Integer { min: 0, max: 64 },
    default: Value::Integer(2),
    group: Group::Builder,
    needs: &[],
};

/// Largest number of references per triangle.
pub const REFERENCES: ParamSpec = ParamSpec {
    name: "references",
    label: "References",
    doc: "Places in leaves per triangle that the tree may use; large scenes stop halving there. More \
          costs memory in proportion, and soon more time in fetching it than it saves",
    unit: "per triangle",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Value::Integer(3),
    group: Group::Builder,
    needs: &[],
};

/// The depth limit where the user gives none: enough for triangles of uneven size.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small"
)]
fn default_depth(triangles: usize) -> u32 {
    (5.0 + 0.5 * (triangles.max(1) as f64).log2()).round() as u32
}

/// How rays traverse an octree. All traversals but the first step from leaf to leaf, so the build widens their leaves
/// by the rounding of the steps; links are built only where rays follow them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Traversal {
    /// From the root down.
    FromRoot,
    /// From leaf to leaf by the common ancestor.
    Ascent,
    /// From leaf to leaf, each located from the root.
    Location,
    /// From leaf to leaf by stored links.
    Links,
    /// By links too, and tiles of camera rays as beams.
    Beams,
}

/// The same threshold of beams that begin with the whole image.
const POLYGON_LEAST: ParamSpec = ParamSpec {
    name: "beam_min",
    label: "Smallest Polygon",
    doc: "Rays of a polygon go on singly when fewer than this are left together. More ends beams earlier",
    kind: Kind::Integer { min: 1, max: 4096 },
    default: Value::Integer(16),
    needs: &[Need {
        key: "traversal",
        only: Only::Options(&["polygon"]),
    }],
    ..BEAM_LEAST
};

/// Ways from the root down.
const FROM_ROOT: [Way; 5] = every_way("octants", "param");

const FROM_ROOT_OPTIONS: List<Named> = distinct(&FROM_ROOT);

const FROM_ROOT_TRAVERSAL: ParamSpec = traversal(FROM_ROOT_OPTIONS.slice());

const SINGLY: [Way; 1] = only_singly("octants");

/// Ways of the octree with beams (T.Haces, for Trazado de haces): beams, or the single rays with which beams end.
const BEAM_WAYS: [Way; 3] = [
    way(
        "octants",
        "beam",
        "Beams",
        Rays::Beam,
        "camera rays in tiles of 64 that go through the cells as one beam, other rays as net",
    ),
    way(
        "octants",
        "polygon",
        "Polygons",
        Rays::Beam,
        "camera rays as published, in beams that begin with the whole image, of a pinhole or of an orthographic camera: \
         polygons that each cell clips and hands on; other rays as net",
    ),
    way(
        "octants",
        "net",
        "By Links",
        Rays::Single,
        "one by one, from leaf to leaf by links",
    ),
];

const BEAM_OPTIONS: List<Named> = distinct(&BEAM_WAYS);

const BEAM_TRAVERSAL: ParamSpec = traversal(BEAM_OPTIONS.slice());

/// The parameter `leaves` of octrees whose rays all go one by one.
const LEAVES: ParamSpec = leaf_tests_of(&[
    BLOCKS,
    Named {
        needs: &[NO_BEAMS],
        ..SCALAR
    },
]);

/// The same from the root down.
const FROM_ROOT_LEAVES: ParamSpec = leaf_tests_of(&[
    BLOCKS,
    Named {
        needs: &[singly(&["auto", "param"]), NO_BEAMS],
        ..SCALAR
    },
]);

/// The same with beams.
const BEAM_LEAVES: ParamSpec = leaf_tests_of(&[
    BLOCKS,
    Named {
        needs: &[singly(&["net"]), NO_BEAMS],
        ..SCALAR
    },
]);

/// The registry's row: from the root down.
pub const PARAM: StructureSpec = StructureSpec {
    id: "octree-param",
    code: 60,
    label: "Octree, from the top",
    family: Family::Octants,
    summary: "Cubes halved along all axes; rays go down from the root, octants in the order of the direction.",
    paper: "Revelles, Ureña and Lastra 2000, An efficient parametric algorithm for octree traversal; Arvo 1988, \
            Linear-time voxel walking for octrees (Ray Tracing News 1)",
    params: &[
        LEAF_SIZE,
        REFERENCES,
        FROM_ROOT_TRAVERSAL,
        MAX_DEPTH_PARAM,
        FROM_ROOT_LEAVES,
    ],
    ways: &FROM_ROOT,
    no_groups: "",
    menu: Menu::Octrees,
    literature: &[("Octree, parametric", ""), ("Octree, Arvo", "")],
    sweep: false,
    claims: &["octrees-beat-boxes"],
    build: |scene, config, monitor| build(scene, config, monitor, Traversal::FromRoot),
};

/// The registry's row: neighbours by stored links (Samet-Net in the paper).
pub const NET: StructureSpec = StructureSpec {
    id: "octree-net",
    code: 62,
    label: "Octree with links",
    summary: "Cubes halved along all axes; rays go from leaf to leaf by six stored links each.",
    paper: "Endl and Sommer 1994, Classification of ray-generators in uniform subdivisions and octrees for ray tracing",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM, LEAVES],
    ways: &SINGLY,
    no_groups: "its rays go from leaf to leaf, each by its own neighbours; groups that share cells from the root down are those of octree-param",
    literature: &[("Samet-Net", "")],
    claims: &[
        "shadow-cache",
        "octrees-beat-boxes",
        "boxes-beat-octrees",
        "links-gain",
        "teapot-*",
    ],
    build: |scene, config, monitor| build(scene, config, monitor, Traversal::Links),
    ..PARAM
};

/// The registry's row: beams on the octree with links.
pub const BEAM: StructureSpec = StructureSpec {
    id: "octree-beam",
    code: 65,
    label: "Octree with beams",
    summary: "The octree with links, on which 64 camera rays of a tile go as one beam until they part.",
    paper: "González López and Gisbert Canto, Trazado de haces de rayos en escenas estructuradas espacialmente mediante árboles octales",
    params: &[
        LEAF_SIZE,
        REFERENCES,
        BEAM_TRAVERSAL,
        MAX_DEPTH_PARAM,
        BEAM_LEAVES,
        BEAM_LEAST,
        POLYGON_LEAST,
    ],
    ways: &BEAM_WAYS,
    no_groups: "its rays go from leaf to leaf, each by its own neighbours; groups that share cells from the root down are those of octree-param",
    literature: &[("T.Haces", "")],
    claims: &[
        "beams-*",
        "shadow-beams",
        "shadow-polygons",
        "mirrored-beams",
        "refracted-beams",
        "octrees-beat-boxes",
    ],
    build: |scene, config, monitor| build(scene, config, monitor, Traversal::Beams),
    ..PARAM
};

/// The registry's row: neighbours by the common ancestor.
pub const SAMET: StructureSpec = StructureSpec {
    id: "octree-samet",
    code: 63,
    label: "Octree with ascent",
    summary: "Cubes halved along all axes; rays find the next leaf by going up to the common ancestor and down again.",
    paper: "Samet 1989, Implementing ray tracing with octrees and neighbor finding",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM, LEAVES],
    ways: &SINGLY,
    no_groups: "its rays go from leaf to leaf, each by its own neighbours; groups that share cells from the root down are those of octree-param",
    literature: &[("Samet-Standard", "")],
    claims: &[
        "octrees-beat-boxes",
        "boxes-beat-octrees",
        "neighbour-search",
        "teapot-*",
    ],
    build: |scene, config, monitor| build(scene, config, monitor, Traversal::Ascent),
    ..PARAM
};

/// The registry's row: the first octree for rays.
pub const GLASSNER: StructureSpec = StructureSpec {
    id: "octree-glassner",
    code: 64,
    label: "Octree with point location",
    summary: "Cubes halved along all axes; rays locate every next leaf from the root.",
    paper: "Glassner 1984, Space subdivision for fast ray tracing",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM, LEAVES],
    ways: &SINGLY,
    no_groups: "its rays go from leaf to leaf, each by its own neighbours; groups that share cells from the root down are those of octree-param",
    literature: &[("Octree, Glassner", "")],
    build: |scene, config, monitor| build(scene, config, monitor, Traversal::Location),
    ..PARAM
};

/// Builds an octree, and makes its plan.
fn build(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    traversal: Traversal,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let depth = match config.integer("max_depth") {
        0 => default_depth(scene.live().len()),
        depth => u32::try_from(depth).expect("in range"),
    };
    let steps = traversal != Traversal::FromRoot;
    let cube = Cube::new(&frame, depth, steps);
    let params = Params {
        cube,
        leaf_size: config.integer("leaf_size"),
        budget: config.integer("references"),
        margin: if steps { cube.step_margin(&frame) } else { 0.0 },
    };
    let octants = octree::build(scene, &frame, &params, monitor)?;
    let mut blocks = Blocks::new();
    let mut tree = Octree::new(
        &octants,
        cube,
        FramedScene {
            scene,
            frame: &frame,
        },
        &mut blocks,
    )?;
    if matches!(traversal, Traversal::Links | Traversal::Beams) {
        tree = tree.with_links();
    }
    let shape = tree.shape(&frame);
    let (tree, leaves) = (Arc::new(tree), Arc::new(blocks));
    Ok(Built {
        frame,
        plan: plan(&tree, &leaves, config, traversal),
        tree: Some(tree),
        leaves,
        derived: Vec::new(),
        left_out: left_out::levels(&shape, depth as usize, params.leaf_size, params.budget)
            .into_iter()
            .collect(),
        shape,
        growing: None,
        refit: None,
    })
}

/// Makes the kernel of single rays.
type Single = fn(&Arc<Octree>, &Arc<Blocks>) -> Arc<dyn SingleRays>;

fn plan(tree: &Arc<Octree>, leaves: &Arc<Blocks>, config: &Config, traversal: Traversal) -> Plan {
    let (name, eight, scalar): (_, Single, Single) = match traversal {
        Traversal::FromRoot => ("param", param::param, alone::param),
        Traversal::Links | Traversal::Beams => ("net", net::net, alone::net),
        Traversal::Ascent => ("samet", samet::samet, alone::samet),
        Traversal::Location => ("glassner", glassner::glassner, alone::glassner),
    };
    let choice = config.choice("shadow");
    if leaf_tests::alone(config) {
        let plan = Plan::single("octants", name, scalar(tree, leaves));
        return plan.with_shadow(choice, None);
    }
    let mut plan = Plan::single("octants", name, eight(tree, leaves));
    if traversal == Traversal::Beams && config.way().rays == Rays::Beam {
        if config.way().traversal == "polygon" {
            plan.cases = &halfspace_polybeam::NAMES;
            plan = plan.with_tiles(
                Rays::Beam,
                halfspace_polybeam::octants(tree, leaves, least(config, &POLYGON_LEAST)),
            );
        } else {
            let beams = beam::kernel::octants(tree, leaves, least(config, &BEAM_LEAST));
            plan = plan.with_tiles(Rays::Beam, beams);
        }
    }
    if traversal == Traversal::FromRoot {
        let groups = together!(tree, leaves, octants, shadow_octants);
        plan = groups.plan(plan, config.way().rays);
    }
    if choice == "beam" && config.way().traversal == "polygon" {
        let least = least(config, &POLYGON_LEAST);
        let beams = halfspace_polybeam::shadow_octants(tree, leaves, least);
        return plan.with_shadow(choice, Some(beams));
    }
    let beams = match traversal {
        Traversal::FromRoot => beam::kernel::shadow_param,
        Traversal::Links | Traversal::Beams => beam::kernel::shadow_net,
        Traversal::Ascent => beam::kernel::shadow_samet,
        Traversal::Location => beam::kernel::shadow_glassner,
    };
    plan.with_shadow(choice, (choice == "beam").then(|| beams(tree, leaves)))
}
