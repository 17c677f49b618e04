// SPDX-License-Identifier: GPL-3.0-or-later
//! The kd-tree: axis-aligned planes where the surface area heuristic is lowest, triangles cut to their cells (Wald and
//! Havran 2006).

use crate::planes::rows::{AXIS_TRAVERSAL, AXIS_WAYS};
use crate::planes::scalar::{AXIS_LEAVES, MAILBOX};
use crate::ways::PLANE_NODES;
use crate::{lazy, left_out, params, planes};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::piece::{ClippedBox, Piece};
use halfspace_builders::space::{Node, ObliqueStep, Params, PlanePolicy, Stop};
use halfspace_builders::sweep::Ties;
use halfspace_geom::Aabb;
use halfspace_geom::cell::{BoxCell, Direction};
use halfspace_nodes::cost::Costs;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Family, Menu, StructureSpec};
use halfspace_structure::spec::Config;
use std::marker::PhantomData;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "kd",
    code: 1,
    label: "kd-tree",
    family: Family::Space,
    summary: "Axis-aligned split planes by the surface area heuristic, triangles cut to their cells.",
    paper: "Wald and Havran 2006, On building fast kd-trees for ray tracing, and on doing that in O(N log N)",
    params: &[
        PLANE_NODES,
        AXIS_TRAVERSAL,
        params::ROBUST,
        AXIS_LEAVES,
        MAILBOX,
        params::step_cost(Costs::PLANES),
        params::leaf_cost(Costs::PLANES),
        params::triangle_cost(Costs::PLANES),
        params::empty_factor(Costs::PLANES),
        params::AREA_STOP,
        params::STOP,
        params::BETA,
        params::MAX_DEPTH,
        params::LAZY,
    ],
    ways: AXIS_WAYS,
    no_groups: "",
    menu: Menu::Kd,
    literature: &[
        ("Kd", ""),
        ("Kd, TA-B", "traversal=ta-b"),
        ("Kd, TA-A", "traversal=ta-a"),
        ("Kd, Sung", "traversal=sung"),
        ("Kd, Arvo", "traversal=arvo"),
        ("Kd, by distances", "traversal=dir"),
    ],
    sweep: false,
    claims: &[
        "ta-b-*",
        "growth-*",
        "moving-*",
        "mailboxes",
        "shadow-cache",
        "mirrored-beams",
        "refracted-beams",
        "planes-*",
    ],
    build,
};

/// The policy of a kd-tree: the three axes at every node, for pieces of this type.
#[derive(Debug, Clone, Copy)]
pub struct Axes<P>(pub PhantomData<P>);

impl<P: Piece> PlanePolicy for Axes<P> {
    type Cell = BoxCell;
    type Piece = P;

    fn root(&self, bounds: Aabb) -> BoxCell {
        BoxCell(bounds)
    }

    fn directions(&self, _: &Node<'_, P>, out: &mut Vec<Direction>) {
        out.extend((0..3).map(Direction::Axis));
    }
}

/// The depth limit where the user gives none. Costs end nearly all paths well before.
pub fn default_depth(triangles: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most 62"
    )]
    let depth = (12.0 + 1.7 * (triangles.max(1) as f64).log2()).round() as usize;
    depth.min(MAX_DEPTH)
}

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let params = Params {
        costs: params::costs(config),
        oblique: ObliqueStep::Fixed(f32::INFINITY),
        ties: Ties::Clean,
        slab: 0.0,
        leaf_size: 0,
        leaf_most: usize::MAX,
        area_stop: config.float("area_stop"),
        max_depth: match config.integer("max_depth") {
            0 => default_depth(scene.live().len()),
            depth => depth,
        },
        stop: params::stop(config, Stop::Cheapest),
        sorted: false,
        early: false,
        enough: 0.0,
    };
    let policy = Axes::<ClippedBox>(PhantomData);
    plane_tree(scene, config, policy, &params, monitor)
}

/// Lists what the scene does not need of an axis-aligned tree.
fn lines(scene: &Triangles, config: &Config, frame: &Frame) -> lazy::LeftOut {
    let (count, bounds) = (scene.live().len(), frame.bounds());
    // Report cut triangles of complete trees only: a lazy tree has not split all of its nodes yet.
    let cuts = config.structure().id == SPEC.id && !lazy::is_lazy(config);
    Box::new(move |shape, _| {
        let flat = (shape.nodes_axis > 0)
            .then(|| left_out::flat(&bounds))
            .flatten();
        let uncut = cuts.then(|| left_out::uncut(shape, count)).flatten();
        flat.into_iter().chain(uncut).collect()
    })
}

/// Builds an axis-aligned tree and lays it out.
///
/// # Errors
/// Those of [`lazy::grow`] and [`lazy::Grown::lay_out`].
pub fn plane_tree<P: PlanePolicy + Send + 'static>(
    scene: &Triangles,
    config: &Config,
    policy: P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let grown = planes::during_planes(config, monitor, || {
        lazy::grow(scene, config, &frame, policy, params, monitor)
    })?;
    grown.lay_out(scene, config, frame, lines(scene, config, &frame), monitor)
}
