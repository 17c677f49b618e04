// SPDX-License-Identifier: GPL-3.0-or-later
//! From a configuration to a tree with oblique planes: costs and rules, the build loop, and the plan.

use super::normals::Normals;
use super::policy::Policy;
use super::settings::Settings;
use super::{Source, Variant, params};
use crate::kd::Axes;
use crate::lazy::{self, Grown};
use crate::left_out;
use crate::planes;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::piece::{Boxed, Clipped, ClippedBox, Piece, Whole};
use halfspace_builders::space::Params;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::spec::Config;
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
    source: impl FnOnce(&Settings, Arc<Normals>) -> S,
) -> Result<Built> {
    let settings = &Settings::of(config);
    let params = settings.params(scene.live().len(), variant);
    // Choose K, and build with whole or clipped triangles.
    build_with(
        scene,
        config,
        monitor,
        settings,
        &params,
        variant,
        |frame, normals, needed| {
            let k = if needed { settings.k } else { 3 };
            let small = if needed {
                settings.at_small_nodes(variant, k)
            } else {
                k
            };
            let task = Task {
                source: Arc::new(source(settings, normals)),
                variant,
                k: [k, small],
                axes_depth: settings.axes_depth,
            };
            let framed = FramedScene { scene, frame };
            let grown = if settings.clip {
                oblique::<Clipped>(framed, config, &params, task, monitor)?
            } else {
                oblique::<Whole>(framed, config, &params, task, monitor)?
            };
            Ok((grown, (small < k).then_some([k, small])))
        },
    )
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
    settings: &Settings,
    params: &Params,
    variant: Variant,
    grow: impl FnOnce(&Frame, Arc<Normals>, bool) -> Result<Tried>,
) -> Result<Built> {
    // Compute the normals of all triangles in the structure's frame.
    let frame = Frame::new(scene.bounds());
    let normals = Arc::new(Normals::new(scene, &frame));
    // Determine whether oblique planes are of any use.
    let needless = if !settings.has_axes(variant) {
        None
    } else if settings.k == 3 {
        Some("K = 3 leaves only the axes")
    } else if normals.all_parallel_to_axes() {
        Some(left_out::PARALLEL)
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
            axes_only(framed, config, settings, params, monitor).map(|grown| (grown, None))
        }
        Some(_) => grow(&frame, normals, false),
    })?;
    let lines = lines(needless, fewer, params.enough);
    grown.lay_out(scene, config, frame, lines, monitor)
}

/// Lists the features that a tree did not need. `needless`: why oblique planes are of no use; `fewer`: K at large and
/// at small nodes if these tried fewer directions; `enough`: as [`Params::enough`].
fn lines(needless: Option<&'static str>, fewer: Option<[usize; 2]>, enough: f32) -> lazy::LeftOut {
    Box::new(move |shape, first_only| {
        let mut lines = Vec::new();
        let nodes = shape.nodes_axis + shape.nodes_oblique;
        // Report how many nodes tried only the axes although others were to be tried.
        if first_only > 0 && needless.is_none() {
            lines.push(format!(
                "directions besides the axes: at {first_only} of {nodes} split planes, where one along an axis costs less \
                 than {enough} of a leaf"
            ));
        }
        // Report the reason why only the axes were tried. Where these have nodes of their own, a node that no axis splits
        // tries random directions, and then the reason did not hold.
        if let Some(reason) = needless
            && nodes > 0
        {
            if shape.nodes_axis == 0 {
                lines.push(format!("directions besides the axes: {reason}"));
            } else if shape.nodes_oblique == 0 {
                lines.push(format!("oblique planes: {reason}"));
            }
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
    settings: &Settings,
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
    if settings.clip {
        let axes = Axes::<ClippedBox>(PhantomData);
        lazy::grow(scene, config, frame, axes, params, monitor)
    } else {
        let axes = Axes::<Boxed>(PhantomData);
        lazy::grow(scene, config, frame, axes, params, monitor)
    }
}
