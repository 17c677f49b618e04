// SPDX-License-Identifier: GPL-3.0-or-later
//! Common parts of all trees with oblique planes: parameters, costs, and the policy of the build loop.
//!
//! A family is a [`Source`] of directions; a [`Variant`] selects the treatment of the axes.

pub mod beam_hh;
pub mod clusters;
pub mod fixed;
pub mod hybrid;
pub mod ize;
pub mod normals;
pub mod params;
pub mod random;

use crate::kd::{Axes, default_depth};
use crate::kd_sah::thesis_depth;
use crate::planes;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::piece::{Boxed, Clipped, ClippedBox, Piece, Whole};
use halfspace_builders::space::{self, Node, ObliqueStep, Params, PlanePolicy, Stop};
use halfspace_builders::sweep::Ties;
use halfspace_geom::Aabb;
use halfspace_geom::cell::{ConvexCell, Direction};
use halfspace_nodes::cost::Costs;
use halfspace_nodes::preorder::Preorder;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::{Frame, U};
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::spec::{Config, Value};
use normals::Normals;
use std::marker::PhantomData;
use std::sync::Arc;

/// Source of the sweeps.
pub const HOOBERGS: &str =
    "Hoobergs 2019, Bomen voor binaire ruimtepartitie (master thesis, KU Leuven)";

/// Defines the three rows of a family of sweeps: plain, with the axes, and with the axes as cheap nodes. `grow` builds a
/// variant.
macro_rules! sweep_rows {
    ($id:literal, $codes:expr, $label:literal, along $along:literal, k $k:literal, $grow:path) => {
        /// The registry's row: plain.
        pub const PLAIN: StructureSpec = StructureSpec {
            id: $id,
            code: $codes[0],
            label: concat!("BSP, ", $label),
            family: "space",
            summary: concat!("Planes along ", $along, "."),
            paper: $crate::bsp::HOOBERGS,
            params: &const { params::usual(params::k(1, $k)) },
            ways: $crate::planes::rows::ANY_WAYS,
            build: |scene, config, monitor| $grow(scene, config, monitor, Variant::Plain),
        };

        /// The registry's row: with the axes.
        pub const PLUS: StructureSpec = StructureSpec {
            id: concat!($id, "-plus"),
            code: $codes[1],
            label: concat!("BSP, ", $label, " +"),
            summary: concat!("Planes along the axes and ", $along, "."),
            params: &const { params::plus(params::k(3, $k)) },
            build: |scene, config, monitor| $grow(scene, config, monitor, Variant::Plus),
            ..PLAIN
        };

        /// The registry's row: with the axes as cheap nodes.
        pub const PLUS_KD: StructureSpec = StructureSpec {
            id: concat!($id, "-plus-kd"),
            code: $codes[2],
            label: concat!("BSP, ", $label, " + Kd"),
            summary: concat!("Planes along the axes, at cheap nodes, and ", $along, "."),
            params: &const { params::kd(params::k(3, $k)) },
            build: |scene, config, monitor| $grow(scene, config, monitor, Variant::PlusKd),
            ..PLAIN
        };
    };
}
pub(crate) use sweep_rows;

/// What is done with the axes. K counts all directions of a node, the axes among them included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// The axes are not treated specially.
    Plain,
    /// The first three directions are the axes.
    Plus,
    /// Like `Plus`, and nodes split along an axis are traversed and priced like those of a kd-tree.
    PlusKd,
}

/// The triangles of a node, one per piece.
pub trait Ids {
    /// Number of pieces.
    fn count(&self) -> usize;

    /// The triangle of a piece.
    fn get(&self, piece: usize) -> u32;
}

impl<P: Piece> Ids for &[P] {
    fn count(&self) -> usize {
        self.len()
    }

    fn get(&self, piece: usize) -> u32 {
        self[piece].id()
    }
}

/// A node as sources of directions see it, whatever its pieces: so that the loop is compiled once for all sources.
pub struct Triangulated<'a> {
    /// Key of the random choices at this node.
    pub key: u64,
    /// Its triangles.
    pub ids: &'a dyn Ids,
}

/// A source of directions for nodes.
pub trait Source: Sync {
    /// Adds directions until `out` holds `k`, or until there are no more worth trying. Directions in `out` are not added
    /// again.
    fn directions(&self, node: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>);

    /// Adds further directions for a node that would otherwise become a leaf.
    fn more(&self, _: &Triangulated<'_>, _: &mut Vec<[f32; 3]>) {}
}

/// Largest absolute cosine of two directions that count as distinct.
const SAME: f32 = 0.999_99;

/// Appends a direction unless it or its opposite is in `out`. Returns whether it was appended.
pub fn add_distinct(out: &mut Vec<[f32; 3]>, n: [f32; 3]) -> bool {
    let known = out
        .iter()
        .any(|m| (m[0] * n[0] + m[1] * n[1] + m[2] * n[2]).abs() > SAME);
    if !known {
        out.push(n);
    }
    !known
}

/// The policy of the build loop: the axes as the variant requires, then the source's directions.
struct Policy<'a, P> {
    source: &'a dyn Source,
    variant: Variant,
    k: usize,
    /// K at small nodes.
    k_small: usize,
    /// Nodes above this depth try only the axes.
    axes_depth: usize,
    pieces: PhantomData<P>,
}

/// The node without the type of its pieces.
fn triangulated<'a, P: Piece>(node: &'a Node<'_, P>) -> Triangulated<'a> {
    Triangulated {
        key: node.key,
        ids: &node.pieces,
    }
}

/// Unit vectors of the axes.
pub const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl<P: Piece> Policy<'_, P> {
    /// Appends the source's directions that are not in `known`.
    fn sources(&self, node: &Node<'_, P>, mut known: Vec<[f32; 3]>, out: &mut Vec<Direction>) {
        let first = known.len();
        // Small nodes try fewer directions.
        let k = if node.pieces.len() <= params::SMALL {
            self.k_small
        } else {
            self.k
        };
        self.source.directions(&triangulated(node), k, &mut known);
        self.emit(&known[first..], out);
    }

    /// Appends vectors as directions; the variant with cheap axis nodes marks the axes as such.
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

impl<P: Piece> PlanePolicy for Policy<'_, P> {
    type Cell = ConvexCell;
    type Piece = P;

    fn root(&self, bounds: Aabb) -> ConvexCell {
        ConvexCell::from_box(bounds, bounds.magnitude())
    }

    fn directions(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        // Try the axes first; `further` adds the others if these are not enough.
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
        self.source.more(&triangulated(node), &mut vectors);
        self.emit(&vectors, out);
    }

    fn last_resort(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        self.emit(&anything(node), out);
    }
}

/// Returns directions for a node that nothing else splits: the axes and 16 random ones.
pub fn anything<P>(node: &Node<'_, P>) -> Vec<[f32; 3]> {
    let mut random = random::generator(0, node.key);
    let mut vectors = AXES.to_vec();
    vectors.extend((0..16).map(|_| random::direction(&mut random)));
    vectors
}

/// Builds a tree along a source's directions, and lays it out.
///
/// # Errors
/// Those of [`space::build`] and [`PlaneTree::new`].
pub fn build<S: Source>(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    variant: Variant,
    source: impl FnOnce(Arc<Normals>) -> S,
) -> Result<Built> {
    let params = loop_params(scene, config, variant);
    // Choose K, and build with whole or clipped triangles.
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
                oblique::<Clipped>(scene, frame, &params, task, monitor)
            } else {
                oblique::<Whole>(scene, frame, &params, task, monitor)
            }
        },
    )?;
    // Report that small nodes tried fewer directions.
    let [k, small] = tried;
    if small < k && built.shape.nodes_axis + built.shape.nodes_oblique > 0 {
        built.left_out.push(format!(
            "directions of small nodes: {small} instead of {k} are tried at those of up to {} triangles",
            params::SMALL,
        ));
    }
    Ok(built)
}

/// Returns K at small nodes: a share of K, but at least one direction in addition to the axes.
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

/// Builds a tree and lays it out. If oblique planes are useless, this is the kd-tree or a tree grown without them;
/// otherwise the result of `grow`, which receives the frame, the normals, and whether oblique planes are useful.
///
/// # Errors
/// Those of `grow` and [`PlaneTree::new`].
pub fn build_with(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    (variant, params): (Variant, &Params),
    grow: impl FnOnce(&Frame, Arc<Normals>, bool) -> Result<Preorder>,
) -> Result<Built> {
    // Compute the normals of all triangles in the structure's frame.
    let frame = Frame::new(scene.bounds());
    let normals = Arc::new(Normals::new(scene, &frame));
    // Determine whether oblique planes can be of any use.
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
    let preorder = planes::during_planes(config, monitor, || match needless {
        None => grow(&frame, normals, true),
        Some(_) if variant == Variant::PlusKd => {
            axes_only(scene, &frame, params, config.choice("clip") == "1", monitor)
        }
        Some(_) => grow(&frame, normals, false),
    })?;
    let mut built = lay_out(scene, config, frame, &preorder, monitor)?;
    // Report the reason only if it held: a node that no axis splits tries random directions, and an empty scene has no
    // planes at all.
    let axes_alone = || {
        let shape = Shape::new(&preorder);
        shape.nodes_axis > 0 && shape.nodes_oblique == 0
    };
    if let Some(reason) = needless.filter(|_| axes_alone()) {
        built.left_out.push(format!("oblique planes: {reason}"));
    }
    Ok(built)
}

/// Arguments of [`oblique`].
struct Task<'a> {
    source: &'a dyn Source,
    variant: Variant,
    /// K at large and at small nodes.
    k: [usize; 2],
    axes_depth: usize,
}

/// Builds a tree with oblique planes from pieces of type `P`.
fn oblique<P: Piece>(
    scene: &Triangles,
    frame: &Frame,
    params: &Params,
    task: Task<'_>,
    monitor: &Monitor,
) -> Result<Preorder> {
    let policy = Policy::<P> {
        source: task.source,
        variant: task.variant,
        k: task.k[0],
        k_small: task.k[1],
        axes_depth: task.axes_depth,
        pieces: PhantomData,
    };
    space::build(scene, frame, &policy, params, monitor)
}

/// Builds the tree of the axes alone, which is the kd-tree.
fn axes_only(
    scene: &Triangles,
    frame: &Frame,
    params: &Params,
    clip: bool,
    monitor: &Monitor,
) -> Result<Preorder> {
    // For planar triangles, planes in the walls of boxes replace slabs; and the costs alone limit the leaves of a
    // kd-tree.
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
/// Those of [`PlaneTree::new`].
pub fn lay_out(
    scene: &Triangles,
    config: &Config,
    frame: Frame,
    preorder: &Preorder,
    monitor: &Monitor,
) -> Result<Built> {
    let mut built = planes::lay_out(scene, config, frame, preorder, monitor)?;
    // Report how many nodes tried only the axes.
    if preorder.first_only > 0 {
        let shape = Shape::new(preorder);
        built.left_out.push(format!(
            "directions besides the axes: at {} of {} nodes, where a plane along an axis costs less than {} of a leaf",
            preorder.first_only,
            shape.nodes_axis + shape.nodes_oblique,
            config.float("enough"),
        ));
    }
    Ok(built)
}

/// Returns the costs and rules that the configuration selects.
pub fn loop_params(scene: &Triangles, config: &Config, variant: Variant) -> Params {
    let thesis = config.choice("costs") == "thesis";
    // Costs of the thesis, or those of the configuration.
    let costs = if thesis {
        Costs::THESIS
    } else {
        crate::params::costs(config)
    };
    let fixed = if thesis {
        Costs::THESIS_OBLIQUE
    } else {
        config.float("oblique_cost")
    };
    // Only the variant with cheap axis nodes has the linear cost.
    let oblique = match variant {
        Variant::PlusKd => ObliqueStep::Linear {
            alpha: config.float("alpha"),
            fixed,
            as_code: config.choice("rule") == "code",
        },
        _ => ObliqueStep::Fixed(fixed),
    };
    // Set the stopping rules and the treatment of triangles at planes.
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
