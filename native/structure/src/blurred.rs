// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays from so far away that a tree does not separate the triangles for them.
//!
//! Error bounds of a traversal are proportional to the largest coordinate of a ray. From 10^6 sizes of the scene away they
//! are a large part of it: the ray meets most leaves, and tests a triangle once in each leaf that holds it. Where these
//! tests are more than there are triangles, the ray tests all triangles once instead.

use crate::division::{Joined, Part};
use crate::row::Built;
use crate::spec::Value;
use crate::structure::Structure;
use crate::tracer::trace;
use crate::work;
use halfspace_base::Monitor;
use halfspace_ray::{Ray, RayCounters};
use halfspace_trace::batch::Batch;

/// Distance from the origin of the frame, in extents of the scene, up to which rays are not blurred (chosen).
const NEAR: f64 = (1 << 15) as f64;

/// Width of what a ray meets, relative to its largest coordinate (chosen): by the counters of rays from 10^6 sizes away
/// through an octree and a kd-tree.
const BLUR: f64 = 1.0 / (1 << 20) as f64;

impl Structure {
    /// Answers the rays of a batch by one tree, through `ways`, or by all its triangles where the tree does not separate
    /// them. `counters`: one per ray, or none.
    pub(crate) fn each_near<Q: Joined>(
        &self,
        part: Part<'_>,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        mut counters: Option<&mut [RayCounters]>,
        ways: impl Fn(&[Ray], &mut [Q::Answer], Option<&mut [RayCounters]>),
    ) {
        let rays = batch.rays;
        let blurred = self.blurred(part, rays);
        let Some(all) = (!blurred.is_empty())
            .then(|| self.one_leaf(part.number))
            .flatten()
        else {
            return ways(rays, answers, counters);
        };
        // Keep the places of the other rays, since tiles are whole; a ray without a direction hits nothing.
        let mut others = rays.to_vec();
        for &i in &blurred {
            others[i].d = [0.0; 3];
        }
        ways(&others, answers, counters.as_deref_mut());
        // Test all triangles.
        let own: Vec<_> = blurred.iter().map(|&i| rays[i]).collect();
        let mut found = vec![Q::NOTHING; own.len()];
        let mut counts = vec![RayCounters::default(); own.len()];
        let batch = Batch {
            scene: &self.scene,
            frame: &all.frame,
            rays: &own,
            shadow_cache: false,
            ..*batch
        };
        let counted = counters.is_some().then_some(&mut *counts);
        trace::<Q>(None, Q::single(&all.plan), &batch, &mut found, counted);
        for ((i, answer), count) in blurred.into_iter().zip(found).zip(counts) {
            answers[i] = answer;
            if let Some(counters) = counters.as_deref_mut() {
                counters[i] = count;
            }
        }
    }

    /// Returns the rays that would test more triangles in the leaves of this tree than it holds, in their order.
    fn blurred(&self, part: Part<'_>, rays: &[Ray]) -> Vec<usize> {
        let built = part.built;
        let (frame, shape) = (&built.frame, &built.shape);
        let published = self.config().find("robust") == Some(&Value::Choice("none"));
        if published || built.tree.is_none() || built.growing.is_some() {
            return Vec::new();
        }
        // Return at once unless a ray begins far away, in coordinates of the scene.
        let extent = (0..3).fold(0.0_f64, |most, k| most.max(frame.bounds().extent(k)));
        let origin = frame.map().origin();
        #[expect(clippy::cast_possible_truncation, reason = "a limit that was chosen")]
        let limit = (NEAR * extent / f64::from(frame.scale())) as f32;
        let near = |ray: &Ray| (0..3).all(|k| (ray.o[k] - origin[k]).abs() <= limit);
        if rays.iter().all(near) {
            return Vec::new();
        }
        // Keep those that meet enough leaves: all within their blur, and at least those that a line meets.
        let count = self.ids_of(part.number).len();
        let line = (shape.leaves.max(1) as f64).sqrt().recip();
        let meets_all = |ray: &Ray| {
            let o = frame.point(ray.o);
            let most = f64::from(o[0].abs().max(o[1].abs()).max(o[2].abs()));
            let width = (most * BLUR / extent + line).min(1.0);
            most.is_finite() && width * width * shape.references as f64 >= count as f64
        };
        (rays.iter().enumerate())
            .filter(|(_, ray)| !near(ray) && meets_all(ray))
            .map(|(i, _)| i)
            .collect()
    }

    /// Returns all triangles of a part in one leaf; `None` where memory does not suffice. Made on demand.
    fn one_leaf(&self, number: usize) -> Option<&Built> {
        let make = || {
            let scene = self.scene_of(number).ok()?;
            work::whole(&scene, "none", &Monitor::new()).ok()
        };
        self.one_leaf[number].get_or_init(make).as_ref()
    }
}
