// SPDX-License-Identifier: GPL-3.0-or-later
//! What all trees with oblique planes share: their parameters, their prices, and the loop's policy.
//!
//! A family is a [`Source`] of directions; a [`Variant`] says what is done with the axes.

pub mod clusters;
pub mod fixed;
pub mod hybrid;
pub mod normals;
pub mod params;
pub mod random;

use crate::build::Monitor;
use crate::build::cell::{ConvexCell, Direction};
use crate::build::cost::Costs;
use crate::build::piece::{Boxed, Clipped, ClippedBox, Piece, Whole};
use crate::build::plane_tree::PlaneTree;
use crate::build::preorder::Preorder;
use crate::build::shape::Shape;
use crate::build::space::{self, Node, ObliqueStep, Params, PlanePolicy, Stop};
use crate::build::sweep::Ties;
use crate::error::Result;
use crate::geom::Aabb;
use crate::registry::Built;
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::{Layout, PlaneWalk};
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::{Frame, U};
use crate::trees::kd::{Axes, default_depth};
use crate::trees::kd_sah::thesis_depth;
use normals::Normals;
use std::marker::PhantomData;
use std::sync::Arc;

/// What is done with the axes. K counts all directions of a node, the axes among them included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// No special axes.
    Plain,
    /// The first three directions are the axes.
    Plus,
    /// And their nodes are walked and priced as those of a kd-tree.
    PlusKd,
}

/// Directions for a node.
pub trait Source: Sync {
    /// Adds directions until `out` holds `k`, or until there are no more worth trying. What is in `out`
    /// already is not added again.
    fn directions<P: Piece>(&self, node: &Node<'_, P>, k: usize, out: &mut Vec<[f32; 3]>);

    /// Further directions for a node that would otherwise become a leaf.
    fn more<P: Piece>(&self, _: &Node<'_, P>, _: &mut Vec<[f32; 3]>) {}
}

/// Two directions with a larger cosine count as one.
const SAME: f32 = 0.999_99;

/// Adds a direction unless it, or its opposite, is among `out`. Says whether it was added.
pub fn add_distinct(out: &mut Vec<[f32; 3]>, n: [f32; 3]) -> bool {
    let known = out
        .iter()
        .any(|m| (m[0] * n[0] + m[1] * n[1] + m[2] * n[2]).abs() > SAME);
    if !known {
        out.push(n);
    }
    !known
}

/// The policy of the loop: axes as the variant wants them, then the source's directions.
struct Policy<'a, S, P> {
    source: &'a S,
    variant: Variant,
    k: usize,
    /// The same at small nodes.
    k_small: usize,
    /// Nodes above this depth try the axes only.
    axes_depth: usize,
    pieces: PhantomData<P>,
}

/// The axes as vectors.
pub const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl<S: Source, P: Piece> Policy<'_, S, P> {
    /// The source's directions beside the `known` ones.
    fn sources(&self, node: &Node<'_, P>, mut known: Vec<[f32; 3]>, out: &mut Vec<Direction>) {
        let first = known.len();
        let k = if node.pieces.len() <= params::SMALL {
            self.k_small
        } else {
            self.k
        };
        self.source.directions(node, k, &mut known);
        self.emit(&known[first..], out);
    }

    fn emit(&self, vectors: &[[f32; 3]], out: &mut Vec<Direction>) {
        out.extend(vectors.iter().map(|&n| {
            match self.variant {
                Variant::PlusKd => AXES
                    .iter()
                    .position(|axis| *axis == n)
                    .map_or(Direction::Oblique(n), Direction::Axis),
                _ => Direction::Oblique(n),
            }
        }));
    }
}

impl<S: Source, P: Piece> PlanePolicy for Policy<'_, S, P> {
    type Cell = ConvexCell;
    type Piece = P;

    fn root(&self, bounds: Aabb) -> ConvexCell {
        ConvexCell::from_box(bounds, bounds.magnitude())
    }

    fn directions(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        if self.variant != Variant::Plain || node.depth < self.axes_depth {
            self.emit(&AXES, out);
        } else {
            self.sources(node, Vec::with_capacity(self.k), out);
        }
    }

    fn further(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        if self.variant != Variant::Plain && node.depth >= self.axes_depth {
            self.sources(node, AXES.to_vec(), out);
        }
    }

    fn more(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        let mut vectors = Vec::new();
        self.source.more(node, &mut vectors);
        self.emit(&vectors, out);
    }

    fn last_resort(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        self.emit(&anything(node), out);
    }
}

/// Directions for a node that nothing else parts: the axes, and many at random.
pub fn anything<P>(node: &Node<'_, P>) -> Vec<[f32; 3]> {
    let mut random = random::generator(0, node.key);
    let mut vectors = AXES.to_vec();
    vectors.extend((0..16).map(|_| random::direction(&mut random)));
    vectors
}

/// Builds a tree along a source's directions and lays it out.
///
/// # Errors
/// As [`space::build`] and [`PlaneTree::new`].
pub fn build<S: Source>(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    variant: Variant,
    source: impl FnOnce(Arc<Normals>) -> S,
) -> Result<Built> {
    let params = loop_params(scene, config, variant);
    let mut tried = [0; 2];
    let mut built = build_with(
        scene,
        config,
        monitor,
        (variant, &params),
        |frame, normals, needed| {
            let k = if needed { config.integer("k") } else { 3 };
            tried = [k, at_small_nodes(config, variant, k)];
            let task = Task {
                source: &source(normals),
                variant,
                k: tried,
                axes_depth: config.integer("axes_depth"),
            };
            if config.choice("clip") == "1" {
                oblique::<S, Clipped>(scene, frame, &params, task, monitor)
            } else {
                oblique::<S, Whole>(scene, frame, &params, task, monitor)
            }
        },
    )?;
    let [k, small] = tried;
    if small < k {
        built.left_out.push(format!(
            "directions of small nodes: {small} instead of {k} are tried at those of up to {} triangles",
            params::SMALL,
        ));
    }
    Ok(built)
}

/// K at small nodes: a share of K, but never the axes alone.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most 32"
)]
fn at_small_nodes(config: &Config, variant: Variant, k: usize) -> usize {
    if config.choice("costs") != "fitted" {
        return k;
    }
    let axes = if variant == Variant::Plain { 0 } else { 3 };
    let share = (k as f32 * config.float("k_small")).ceil() as usize;
    share.max(axes + 1).min(k)
}

/// Builds a tree and lays it out: the kd-tree where oblique planes are of no use, otherwise what `grow`
/// makes of the frame, the normals, and whether oblique planes are of use.
///
/// # Errors
/// Those of `grow`, and as [`PlaneTree::new`].
pub fn build_with(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    (variant, params): (Variant, &Params),
    grow: impl FnOnce(&Frame, Arc<Normals>, bool) -> Result<Preorder>,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let normals = Arc::new(Normals::new(scene, &frame));
    let few = config
        .values()
        .any(|(name, k)| name == "k" && *k == Value::Integer(3));
    let needless = if variant == Variant::Plain {
        None
    } else if few {
        Some("K = 3 leaves only the axes")
    } else if normals.all_parallel_to_axes() {
        Some("every triangle is parallel to two axes")
    } else {
        None
    };
    let mut left_out = Vec::new();
    let preorder = match needless {
        None => grow(&frame, normals, true)?,
        Some(reason) if variant == Variant::PlusKd => {
            left_out.push(format!("oblique planes: {reason}"));
            axes_only(scene, &frame, params, config.choice("clip") == "1", monitor)?
        }
        Some(reason) => {
            left_out.push(format!("planes not parallel to two axes: {reason}"));
            grow(&frame, normals, false)?
        }
    };
    lay_out(scene, config, frame, &preorder, left_out)
}

/// What a tree is to be made of.
struct Task<'a, S> {
    source: &'a S,
    variant: Variant,
    /// At large nodes, and at small ones.
    k: [usize; 2],
    axes_depth: usize,
}

fn oblique<S: Source, P: Piece>(
    scene: &Triangles,
    frame: &Frame,
    params: &Params,
    task: Task<'_, S>,
    monitor: &Monitor,
) -> Result<Preorder> {
    let policy = Policy::<S, P> {
        source: task.source,
        variant: task.variant,
        k: task.k[0],
        k_small: task.k[1],
        axes_depth: task.axes_depth,
        pieces: PhantomData,
    };
    space::build(scene, frame, &policy, params, monitor)
}

/// The tree of the axes alone: that of the kd-tree.
fn axes_only(
    scene: &Triangles,
    frame: &Frame,
    params: &Params,
    clip: bool,
    monitor: &Monitor,
) -> Result<Preorder> {
    // Planes in the walls of boxes do for planar triangles what slabs do elsewhere; and the kd-tree's leaves are
    // as large as its prices want them.
    let params = &Params {
        slab: 0.0,
        sorted: false,
        leaf_most: usize::MAX,
        ..*params
    };
    if clip {
        space::build(
            scene,
            frame,
            &Axes::<ClippedBox>(PhantomData),
            params,
            monitor,
        )
    } else {
        space::build(scene, frame, &Axes::<Boxed>(PhantomData), params, monitor)
    }
}

/// Lays out a tree that may hold oblique planes.
///
/// # Errors
/// As [`PlaneTree::new`].
pub fn lay_out(
    scene: &Triangles,
    config: &Config,
    frame: Frame,
    preorder: &Preorder,
    mut left_out: Vec<String>,
) -> Result<Built> {
    let shape = Shape::new(preorder);
    if preorder.first_only > 0 {
        left_out.push(format!(
            "directions beside the axes: at {} of {} nodes, where a plane along an axis costs less than {} of a leaf",
            preorder.first_only,
            shape.nodes_axis + shape.nodes_oblique,
            config.float("enough"),
        ));
    }
    let mut blocks = Blocks::new();
    let tree = PlaneTree::new(preorder, scene, &frame, &mut blocks)?;
    let by_heights = config
        .values()
        .any(|(name, v)| name == "traversal" && *v == Value::Choice("ta-b-poly"));
    let walk = if by_heights {
        PlaneWalk::TaBPoly
    } else {
        PlaneWalk::Dir
    };
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        blocks,
        layout: Layout::Plane(tree, walk),
        shape,
        left_out,
    })
}

/// Prices and rules, as the configuration wants them.
pub fn loop_params(scene: &Triangles, config: &Config, variant: Variant) -> Params {
    let thesis = config.choice("costs") == "thesis";
    let costs = if thesis {
        Costs::THESIS
    } else {
        Costs::fitted(config)
    };
    let fixed = if thesis {
        Costs::THESIS_OBLIQUE
    } else {
        config.float("oblique_cost")
    };
    let oblique = match variant {
        Variant::PlusKd => ObliqueStep::Linear {
            alpha: config.float("alpha"),
            fixed,
            as_code: config.choice("rule") == "code",
        },
        _ => ObliqueStep::Fixed(fixed),
    };
    let triangles = scene.live().len();
    Params {
        costs,
        oblique,
        ties: match config.choice("ties") {
            "pbrt" => Ties::StartsFirst,
            _ => Ties::Clean,
        },
        slab: if config.choice("slab") == "1" {
            20.0 * U
        } else {
            0.0
        },
        leaf_size: usize::from(thesis),
        leaf_most: params::LEAF_MOST,
        area_stop: if thesis {
            0.0
        } else {
            config.float("area_stop")
        },
        max_depth: match config.integer("max_depth") {
            0 if thesis => thesis_depth(triangles),
            0 => default_depth(triangles),
            depth => depth,
        },
        stop: if thesis {
            Stop::Tolerant(3)
        } else {
            Stop::Cheapest
        },
        sorted: false,
        early: config
            .values()
            .any(|(name, v)| name == "early" && *v == Value::Choice("1")),
        enough: if !thesis && config.values().any(|(name, _)| name == "enough") {
            config.float("enough")
        } else {
            0.0
        },
    }
}
