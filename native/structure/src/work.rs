// SPDX-License-Identifier: GPL-3.0-or-later
//! The work of rays through a tree, compared with that of brute force.
//!
//! No tree separates triangles that coincide, or that overlap wherever a ray goes. Its rays then test nearly all of
//! them, and visit its nodes in addition: that takes longer than brute force, which visits none. A sample of rays counts
//! this work when a tree is built, and a tree that does more than brute force is replaced by it.

use crate::plan::Plan;
use crate::row::{Built, Refit};
use crate::spec::{Config, Value};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, simd};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::shape::Measure;
use halfspace_ray::frame::Frame;
use halfspace_ray::query::Closest;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_scene::Triangles;
use halfspace_trace::batch::Batch;
use halfspace_trace::brute::brute;
use halfspace_trace::kernel::Kernel;
use std::sync::Arc;

/// Trees of fewer triangles are kept (chosen): a ray tests them all in a fraction of a microsecond.
const FEW: usize = 256;

/// Ratio of the work to that of brute force up to which a tree is kept (chosen): one leaf of all triangles is as good.
const MORE: f64 = 1.1;

/// A tree that spares its rays all but this part of the triangles is kept (chosen), whatever its nodes cost: a small scene
/// has few triangles for the nodes to spare.
const SEPARATED: f64 = 1.0 / 16.0;

/// Number of rays of the sample (chosen).
const RAYS: usize = 64;

/// Time of a visit of an inner node, of a leaf, and of a triangle tested alone, in tests of brute force, which tests eight
/// triangles at once. Chosen near the times of fans and of coincident triangles on processors with AVX-512.
const STEP: f64 = 4.0;
const LEAF: f64 = 6.0;
const ALONE: f64 = 8.0;
/// As [`STEP`], for nodes in a heap.
const HEAP_STEP: f64 = 40.0;

/// Which trees are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trees {
    /// All of them.
    All,
    /// Those whose rays do no more work than those of brute force.
    Worth,
}

/// Builds the tree of a configuration, or brute force if its rays do less work.
///
/// # Errors
/// Those of [`crate::row::StructureSpec::build`].
pub fn build(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    trees: Trees,
    remarks: &mut Vec<String>,
) -> Result<Built> {
    let built = (config.structure().build)(scene, config, monitor)?;
    // Keep trees as published, and those that rays build.
    let published = config.find("robust") == Some(&Value::Choice("none"));
    let all = scene.live().len();
    if trees == Trees::All || built.tree.is_none() || published || all < FEW {
        return Ok(built);
    }
    let scalar = config.find("leaves") == Some(&Value::Choice("scalar"));
    let (expected, tests) = work(scene, &built, scalar);
    if expected <= MORE * all as f64 || tests <= SEPARATED * all as f64 {
        return Ok(built);
    }
    remarks.push(format!(
        "the tree: its rays would do {:.1} times the work of testing all {all} triangles, as they now do",
        expected / all as f64
    ));
    let replaced = Replaced.refit(scene, config, monitor)?;
    Ok(Built {
        refit: built.refit.and(replaced.refit.clone()),
        ..replaced
    })
}

/// Brute force in place of a tree, which can be fitted to moved triangles if the tree could.
#[derive(Debug)]
struct Replaced;

impl Refit for Replaced {
    fn refit(&self, scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
        let shadow = match config.choice("shadow") {
            "cache" => "cache",
            _ => "none",
        };
        Ok(Built {
            refit: Some(Arc::new(Self)),
            ..whole(scene, shadow, monitor)?
        })
    }

    fn bytes(&self) -> usize {
        0
    }
}

/// Returns the mean work of rays of a sample, in tests of brute force, and the mean number of their tests.
fn work(scene: &Triangles, built: &Built, scalar: bool) -> (f64, f64) {
    let rays = sample(scene);
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    let batch = Batch {
        scene,
        frame: &built.frame,
        rays: &rays,
        level: simd::level(),
        shadow_cache: false,
        placed: None,
        monitor: None,
    };
    let single: &dyn Kernel<Closest> = &*built.plan.single;
    let counted = single.count(&batch, &mut hits, &mut counters);
    assert!(counted, "single rays can be counted");
    let step = if built.plan.counted_as == "heap" {
        HEAP_STEP
    } else {
        STEP
    };
    let test = if scalar { ALONE } else { 1.0 };
    let of = |c: &RayCounters| {
        step * f64::from(c.steps())
            + LEAF * f64::from(c.leaves + c.leaves_empty)
            + test * f64::from(c.tests)
    };
    let tests: f64 = counters.iter().map(|c| f64::from(c.tests)).sum();
    let count = rays.len().max(1) as f64;
    (counters.iter().map(of).sum::<f64>() / count, tests / count)
}

/// Returns rays from around the scene to its triangles: half of them to a vertex, half to a centre.
#[expect(clippy::cast_possible_truncation, reason = "rays are rounded")]
fn sample(scene: &Triangles) -> Vec<Ray> {
    let (bounds, live) = (scene.bounds(), scene.live());
    let middle = [0, 1, 2].map(|k| 0.5 * f64::from(bounds.min[k]) + 0.5 * f64::from(bounds.max[k]));
    let radius = (0..3).fold(0.0_f64, |most, k| most.max(bounds.extent(k)));
    let step = live.len().div_ceil(RAYS);
    let rays = live.iter().step_by(step).enumerate().map(|(i, &id)| {
        // Go around a sphere by the golden angle.
        let height = (2.0 * i as f64 + 1.0) / RAYS as f64 - 1.0;
        let (sin, cos) = (2.399_963 * i as f64).sin_cos();
        let across = (1.0 - height * height).max(0.0).sqrt();
        let from = [across * cos, across * sin, height];
        let o = [0, 1, 2].map(|k| (middle[k] + radius * from[k]) as f32);
        let [a, b, c] = scene.corners(id);
        let target = if i % 2 == 0 {
            a
        } else {
            [0, 1, 2].map(|k| (a[k] / 3.0 + b[k] / 3.0) + c[k] / 3.0)
        };
        Ray {
            o,
            d: [0, 1, 2].map(|k| target[k] - o[k]),
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    });
    rays.filter(|ray| ray.o.iter().chain(&ray.d).all(|x| x.is_finite()))
        .collect()
}

/// Puts all triangles into one leaf, which every ray tests.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns them.
pub fn whole(scene: &Triangles, shadow: &str, monitor: &Monitor) -> Result<Built> {
    monitor.check()?;
    let frame = Frame::new(scene.bounds());
    let mut blocks = Blocks::new();
    blocks.push_leaf(scene, &frame, scene.live());
    blocks.seal();
    let mut measure = Measure::default();
    measure.leaf(scene.live().len(), 0, 1.0);
    let leaves = Arc::new(blocks);
    let plan = Plan::single("none", "all", brute(&leaves, scene.live().len()));
    Ok(Built {
        frame,
        tree: None,
        leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(shadow, None),
        shape: measure.finish(),
        left_out: Vec::new(),
        growing: None,
        refit: None,
    })
}
