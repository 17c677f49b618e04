// SPDX-License-Identifier: GPL-3.0-or-later
//! From a configuration to a tree with oblique planes: costs and rules, the build loop, and the plan.

use super::normals::Normals;
use super::policy::Policy;
use super::{Source, Variant, params};
use crate::kd::{Axes, default_depth};
use crate::kd_sah::thesis_depth;
use crate::lazy::{self, Grown};
use crate::planes;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::piece::{Boxed, Clipped, ClippedBox, Piece, Whole};
use halfspace_builders::space::{ObliqueStep, Params, Stop};
use halfspace_builders::sweep::Ties;
use halfspace_nodes::cost::Costs;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::{Frame, U};
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::spec::{Config, Value};
use std::marker::PhantomData;
use std::sync::Arc;

/// Builds a tree along a source's directions, and lays it out.
///
/// # Errors
/// Those of [`build_with`].
pub fn build<S: Source + 'static>(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    variant: Variant,
    source: impl FnOnce(Arc<Normals>) -> S,
) -> Result<Built> {
    let params = loop_params(scene, config, variant);
    // Choose K, and build with whole or clipped triangles.
    build_with(
        scene,
        config,
        monitor,
        variant,
        &params,
        |frame, normals, needed| {
            let k = if needed { config.integer("k") } else { 3 };
            let small = at_small_nodes(config, variant, k);
            let task = Task {
                source: Arc::new(source(normals)),
                variant,
                k: [k, small],
                axes_depth: config.integer("axes_depth"),
            };
            let framed = FramedScene { scene, frame };
            let grown = if config.choice("clip") == "1" {
                oblique::<Clipped>(framed, config, &params, task, monitor)?
            } else {
                oblique::<Whole>(framed, config, &params, task, monitor)?
            };
            Ok((grown, (small < k).then_some([k, small])))
        },
    )
}

/// Returns K at small nodes: a share of K, but at least one direction in addition to the axes. With the costs of the
/// thesis it is K.
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

/// A tree, and K at large and at small nodes if small nodes tried fewer directions.
pub type Tried = (Grown, Option<[usize; 2]>);

/// Builds a tree with `grow` and lays it out. `grow` receives the frame, the normals, and whether oblique planes are
/// useful. If they are not, the variant with cheap axis nodes becomes the kd-tree instead.
///
/// # Errors
/// Those of `grow` and [`Grown::lay_out`].
pub fn build_with(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    variant: Variant,
    params: &Params,
    grow: impl FnOnce(&Frame, Arc<Normals>, bool) -> Result<Tried>,
) -> Result<Built> {
    // Compute the normals of all triangles in the structure's frame.
    let frame = Frame::new(scene.bounds());
    let normals = Arc::new(Normals::new(scene, &frame));
    // Determine whether oblique planes are of any use.
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
    let (grown, fewer) = planes::during_planes(config, monitor, || match needless {
        None => grow(&frame, normals, true),
        Some(_) if variant == Variant::PlusKd => {
            let framed = FramedScene {
                scene,
                frame: &frame,
            };
            axes_only(framed, config, params, monitor).map(|grown| (grown, None))
        }
        Some(_) => grow(&frame, normals, false),
    })?;
    let left_out = left_out(needless, fewer, params.enough);
    grown.lay_out(scene, config, frame, left_out, monitor)
}

/// Lists the features that a tree did not need. `needless`: why oblique planes are of no use; `fewer`: K at large and
/// at small nodes if these tried fewer directions; `enough`: as [`Params::enough`].
fn left_out(
    needless: Option<&'static str>,
    fewer: Option<[usize; 2]>,
    enough: f32,
) -> lazy::LeftOut {
    Box::new(move |shape, first_only| {
        let mut lines = Vec::new();
        let nodes = shape.nodes_axis + shape.nodes_oblique;
        // Report how many nodes tried only the axes.
        if first_only > 0 {
            lines.push(format!(
                "directions besides the axes: at {first_only} of {nodes} nodes, where a plane along an axis costs less \
                 than {enough} of a leaf"
            ));
        }
        // Report the reason only if it held: a node that no axis splits tries random directions, and an empty scene has
        // no planes at all.
        if let Some(reason) = needless
            && shape.nodes_axis > 0
            && shape.nodes_oblique == 0
        {
            lines.push(format!("oblique planes: {reason}"));
        }
        // Report that small nodes tried fewer directions.
        if let Some([k, small]) = fewer
            && nodes > 0
        {
            lines.push(format!(
                "directions of small nodes: {small} instead of {k} are tried at those of up to {} triangles",
                params::SMALL,
            ));
        }
        lines
    })
}

/// Arguments of [`oblique`].
struct Task {
    source: Arc<dyn Source>,
    variant: Variant,
    /// K at large and at small nodes.
    k: [usize; 2],
    axes_depth: usize,
}

/// Builds a tree with oblique planes from pieces of type `P`.
fn oblique<P: Piece + 'static>(
    framed: FramedScene<'_>,
    config: &Config,
    params: &Params,
    task: Task,
    monitor: &Monitor,
) -> Result<Grown> {
    let policy = Policy::<P> {
        source: task.source,
        variant: task.variant,
        k: task.k[0],
        k_small: task.k[1],
        axes_depth: task.axes_depth,
        pieces: PhantomData,
    };
    lazy::grow(framed.scene, config, framed.frame, policy, params, monitor)
}

/// Builds the tree of the axes alone, which is the kd-tree.
fn axes_only(
    framed: FramedScene<'_>,
    config: &Config,
    params: &Params,
    monitor: &Monitor,
) -> Result<Grown> {
    // Planes in the walls of boxes replace slabs around flat triangles, and the costs alone limit the leaves of a
    // kd-tree.
    let params = &Params {
        slab: 0.0,
        sorted: false,
        leaf_most: usize::MAX,
        ..*params
    };
    let FramedScene { scene, frame } = framed;
    if config.choice("clip") == "1" {
        let axes = Axes::<ClippedBox>(PhantomData);
        lazy::grow(scene, config, frame, axes, params, monitor)
    } else {
        let axes = Axes::<Boxed>(PhantomData);
        lazy::grow(scene, config, frame, axes, params, monitor)
    }
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
