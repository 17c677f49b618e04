// SPDX-License-Identifier: GPL-3.0-or-later
//! The kd-tree: axis-aligned planes where the surface area heuristic wants them, triangles cut to
//! their cells (Wald and Havran 2006).

use crate::build::Monitor;
use crate::build::cell::{BoxCell, Direction};
use crate::build::cost::Costs;
use crate::build::piece::{ClippedBox, Piece};
use crate::build::plane_tree::{MAX_DEPTH, PlaneTree};
use crate::build::preorder::Preorder;
use crate::build::shape::Shape;
use crate::build::space::{self, Node, ObliqueStep, Params, PlanePolicy, Stop};
use crate::build::sweep::Ties;
use crate::error::Result;
use crate::geom::Aabb;
use crate::registry::{Built, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::{Layout, PlaneWalk};
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;
use crate::trees::lazy;
use std::marker::PhantomData;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "kd",
    code: 1,
    label: "kd-tree",
    family: "space",
    summary: "Axis-aligned split planes by the surface area heuristic, triangles cut to their cells.",
    paper: "Wald and Havran 2006, On building fast kd-trees for ray tracing, and on doing that in O(N log N)",
    params: &[
        params::TRAVERSAL_AXIS,
        params::ROBUST,
        params::step_cost(Costs::PLANES),
        params::leaf_cost(Costs::PLANES),
        params::triangle_cost(Costs::PLANES),
        params::empty_factor(Costs::PLANES),
        params::AREA_STOP,
        params::MAX_DEPTH,
        params::LAZY,
    ],
    build,
};

/// The three axes, everywhere, for pieces of this kind.
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
        costs: Costs::fitted(config),
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
        stop: Stop::Cheapest,
        sorted: false,
        early: false,
        enough: 0.0,
    };
    let policy = Axes::<ClippedBox>(PhantomData);
    if config.choice("lazy") == "1" {
        return lazy::build(scene, config, policy, &params, monitor);
    }
    plane_tree(scene, config, &policy, &params, monitor)
}

/// Builds an axis-aligned tree and lays it out.
pub fn plane_tree<P: PlanePolicy>(
    scene: &Triangles,
    config: &Config,
    policy: &P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let preorder = space::build(scene, &frame, policy, params, monitor)?;
    lay_out(scene, config, frame, &preorder)
}

/// Lays an axis-aligned tree out for the walk that the configuration names.
pub fn lay_out(
    scene: &Triangles,
    config: &Config,
    frame: Frame,
    preorder: &Preorder,
) -> Result<Built> {
    let shape = Shape::new(preorder);
    let mut blocks = Blocks::new();
    let tree = PlaneTree::new(preorder, scene, &frame, &mut blocks)?;
    let robust = config.robust();
    let walk = match (config.choice("traversal"), robust) {
        ("auto" | "dir" | "wide" | "boxes" | "tile8" | "tile16" | "p4" | "p8" | "p16", _) => {
            PlaneWalk::Dir
        }
        ("seq", true) => PlaneWalk::Seq,
        ("seq", false) => PlaneWalk::Seq1985,
        ("rope" | "ropetree", true) => PlaneWalk::Rope,
        ("rope" | "ropetree", false) => PlaneWalk::Rope1990,
        ("ta-a", true) => PlaneWalk::TaA,
        ("ta-a", false) => PlaneWalk::TaA1997,
        ("sung", true) => PlaneWalk::Sung,
        ("sung", false) => PlaneWalk::Sung1992,
        ("arvo", true) => PlaneWalk::Arvo,
        ("arvo", false) => PlaneWalk::Arvo1988,
        (_, true) => PlaneWalk::TaB,
        (_, false) => PlaneWalk::TaB1997,
    };
    let layout = Layout::Plane(tree, walk);
    let frame = frame.with_robust(robust);
    Ok(Built {
        frame,
        blocks,
        layout,
        shape,
        left_out: Vec::new(),
    })
}
