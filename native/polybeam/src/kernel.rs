// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernel of polygon beams: a batch is traced source by source, an origin or a direction that many of its rays have
//! in common, and the rays of no source one by one.

use crate::form::{Eye, Form, Parallel};
use crate::rays::{Given, Sorted};
use crate::recorder::Recorder;
use crate::shadow::Reversal;
use crate::source::{Source, common};
use crate::traversal::{SINGLE, Scratch, Traversal};
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::beam_path::BeamPath;
use halfspace_ray::query::{Any, Closest, Count, Counters, NoCount, Query};
use halfspace_ray::{Hit, Ray, RayCounters, RayRef, RaySlice};
use halfspace_single::octants::net::Links;
use halfspace_single::octants::step::NeighbourTraversal;
use halfspace_trace::batch::{Batch, SingleTraversal as _, baseline};
use halfspace_trace::kernel::Kernel;
use std::marker::PhantomData;
use std::sync::Arc;

/// Largest number of rays in a batch. Four times as many save a few steps, and take longer: allocators return so much
/// memory to the system, and half of the time is spent on getting it back.
const BATCH: usize = 1 << 19;

/// Largest number of origins and directions that are looked for in a batch.
const SOURCES: usize = 8;

/// Rays as polygons through octants with links.
#[derive(Debug)]
struct PolygonBeams<Q> {
    query: PhantomData<Q>,
    tree: Arc<Octree>,
    leaves: Arc<Blocks>,
    /// Rays go on singly where fewer than this are left together.
    least: u32,
}

/// Camera rays as polygons through octants with links, which begin with the whole image; where fewer than `least` rays
/// are left together they go on singly.
pub fn octants(tree: &Arc<Octree>, leaves: &Arc<Blocks>, least: u32) -> Arc<dyn Kernel<Closest>> {
    Arc::new(PolygonBeams::new(tree, leaves, least))
}

/// Shadow rays as polygons from their light through octants with links; where fewer than `least` rays are left together,
/// and where rays have no light in common, they go singly.
pub fn shadow_octants(
    tree: &Arc<Octree>,
    leaves: &Arc<Blocks>,
    least: u32,
) -> Arc<dyn Kernel<Any>> {
    Arc::new(PolygonBeams::new(tree, leaves, least))
}

/// A query that beams answer.
trait Beamed: Query {
    /// Passes `trace` room for the hits of a batch, and stores them as answers.
    fn answered(answers: &mut [Self::Answer], trace: impl FnOnce(&mut [Hit]));

    /// Finds a source of the rays with these indices, and sees them from there.
    fn source<'a>(beams: &PolygonBeams<Self>, batch: &Batch<'a>, rest: &[u32]) -> Option<Seen<'a>>
    where
        Self: Sized;
}

/// A source, and the rays of a batch as they are seen from there.
struct Seen<'a> {
    source: Source,
    /// The rays; those of a point light reversed.
    rays: Rays<'a>,
}

/// What the traversal of a batch writes, with one entry per ray, and the record of its beams.
struct Output<'a, C> {
    hits: &'a mut [Hit],
    counters: &'a mut [C],
    recorder: Option<&'a mut Recorder>,
}

/// Rays of a batch, or their copies.
enum Rays<'a> {
    Given(&'a [Ray]),
    Reversed(Vec<Ray>),
}

impl Beamed for Closest {
    #[inline(always)]
    fn answered(answers: &mut [Hit], trace: impl FnOnce(&mut [Hit])) {
        answers.fill(Hit::MISS);
        trace(answers);
    }

    fn source<'a>(beams: &PolygonBeams<Self>, batch: &Batch<'a>, rest: &[u32]) -> Option<Seen<'a>> {
        let source = common(batch.rays, rest)?.source;
        // The frame must keep an origin exactly, and steps from cell to cell reach only so far.
        if let Source::Origin(o) = source {
            let origin = batch.frame.point(o);
            let exact = batch.frame.is_unscaled() && batch.frame.map().is_exact(origin);
            if !(exact && o.iter().all(|x| x.is_finite()) && beams.tree.is_near(origin)) {
                return None;
            }
        }
        Some(Seen {
            source,
            rays: Rays::Given(batch.rays),
        })
    }
}

impl Beamed for Any {
    #[inline(always)]
    fn answered(answers: &mut [bool], trace: impl FnOnce(&mut [Hit])) {
        let mut hits = vec![Hit::MISS; answers.len()];
        trace(&mut hits);
        for (answer, hit) in answers.iter_mut().zip(hits) {
            *answer = hit.is_hit();
        }
    }

    fn source<'a>(beams: &PolygonBeams<Self>, batch: &Batch<'a>, rest: &[u32]) -> Option<Seen<'a>> {
        let common = common(batch.rays, rest);
        let light = Reversal::new(batch).and_then(|own| own.light(batch.rays, rest));
        // Take the sun or the point light that more of the sampled rays lead to.
        if let Some(common) = common
            && matches!(common.source, Source::Direction(_))
            && light.is_none_or(|light| light.samples < common.samples)
        {
            return Some(Seen {
                source: common.source,
                rays: Rays::Given(batch.rays),
            });
        }
        let light = light?;
        let seen = light.seen(batch.rays, rest);
        // Leave rays singly where beams would take few of them.
        if seen.count < beams.least as usize || !beams.tree.is_near(seen.light) {
            return None;
        }
        Some(Seen {
            source: Source::Origin(seen.light),
            rays: Rays::Reversed(seen.rays),
        })
    }
}

impl<Q: Beamed> PolygonBeams<Q> {
    fn new(tree: &Arc<Octree>, leaves: &Arc<Blocks>, least: u32) -> Self {
        Self {
            query: PhantomData,
            tree: tree.clone(),
            leaves: leaves.clone(),
            least,
        }
    }

    /// Traces the rays with one instruction set and the given counters.
    #[inline(always)]
    fn run<S: Simd, C: Counters>(&self, simd: S, batch: &Batch<'_>, mut output: Output<'_, C>) {
        let mut rest: Vec<u32> = (0..).take(batch.rays.len()).collect();
        for _ in 0..SOURCES {
            if rest.len() < self.least as usize || batch.is_cancelled() {
                break;
            }
            let Some(seen) = Q::source(self, batch, &rest) else {
                break;
            };
            let rays = match &seen.rays {
                Rays::Given(rays) => rays,
                Rays::Reversed(rays) => rays.as_slice(),
            };
            // Trace those that come from there; the others are left for the next source.
            let frame = batch.frame;
            let left = match seen.source {
                Source::Origin(o) => {
                    let given = Given::from_point(frame, rays, &rest, o);
                    // A light is given in the frame.
                    let eye = Eye(if Q::ANY { o } else { frame.point(o) });
                    self.traverse(simd, batch, &mut output, eye, given)
                }
                Source::Direction(d) => {
                    let Some(form) = Parallel::new(&self.tree, frame, d, Q::ANY) else {
                        break;
                    };
                    let given = Given::along(frame, rays, &rest, &form, d);
                    self.traverse(simd, batch, &mut output, form, given)
                }
            };
            if left.len() == rest.len() {
                break;
            }
            rest = left;
        }
        self.trace_singly(simd, batch, &mut output, &rest);
    }

    /// Traces rays with a form, and returns the others.
    #[inline(always)]
    fn traverse<S: Simd, F: Form, C: Counters>(
        &self,
        simd: S,
        batch: &Batch<'_>,
        output: &mut Output<'_, C>,
        form: F,
        given: Given,
    ) -> Vec<u32> {
        let sorted = Sorted::new(simd, &form, &given);
        let left = given.rest;
        let mut traversal = Traversal::<F, Q, C> {
            query: PhantomData,
            tree: &self.tree,
            least: self.least,
            job: self.job(batch),
            slice: RaySlice {
                frame: batch.frame,
                rays: batch.rays,
            },
            answers: output.hits,
            counters: output.counters,
            sorted,
            scratch: Scratch::default(),
            monitor: batch.monitor,
            recorder: output.recorder.as_deref_mut(),
        };
        traversal.run(simd, form);
        left
    }

    /// Traces rays one by one from the root.
    #[inline(always)]
    fn trace_singly<S: Simd, C: Counters>(
        &self,
        simd: S,
        batch: &Batch<'_>,
        output: &mut Output<'_, C>,
        rest: &[u32],
    ) {
        let single = NeighbourTraversal(&self.tree, Links);
        let mut entries = single.scratch();
        for &id in rest {
            if batch.is_cancelled() {
                return;
            }
            let (id, count) = (id as usize, &mut output.counters[id as usize]);
            let ray = &batch.rays[id];
            count.case(|| SINGLE);
            // Rays without a direction or with a number that is not finite hit nothing.
            let Some(frame) = &batch.frame.ray(ray) else {
                continue;
            };
            let ray = RayRef { ray, frame };
            let mut best = single.cast::<S, Q, C>(simd, self.job(batch), ray, &mut entries, count);
            output.hits[id] = best.answer(ray);
        }
    }

    /// Traces the rays and counts their work; out of line, so that one compiled traversal serves counting and recording.
    #[inline(never)]
    fn count_hits(
        &self,
        batch: &Batch<'_>,
        hits: &mut [Hit],
        counters: &mut [RayCounters],
        recorder: Option<&mut Recorder>,
    ) {
        let mut counters: Vec<_> = counters.iter_mut().map(Count::new).collect();
        let output = Output {
            hits,
            counters: &mut counters,
            recorder,
        };
        baseline!(simd => self.run(simd, batch, output));
    }

    /// The triangles that the rays are tested against.
    #[inline(always)]
    fn job<'a>(&'a self, batch: &Batch<'a>) -> Job<'a> {
        Job {
            scene: batch.scene,
            blocks: &self.leaves,
        }
    }
}

impl<Q: Beamed> Kernel<Q> for PolygonBeams<Q> {
    /// On x86-64 it is compiled for AVX2 alone, besides the counting version, which processors without it take: this crate
    /// is the slowest to compile.
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        #[cfg(target_arch = "x86_64")]
        if batch.level.as_avx2().is_none() {
            self.count(
                batch,
                answers,
                &mut vec![RayCounters::default(); batch.rays.len()],
            );
            return;
        }
        let mut none = vec![NoCount; batch.rays.len()];
        Q::answered(answers, |hits| {
            let output = Output {
                hits,
                counters: &mut none,
                recorder: None,
            };
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = batch.level.as_avx2() {
                simd.vectorize(
                    #[inline(always)]
                    || self.run(simd, batch, output),
                );
            }
            #[cfg(not(target_arch = "x86_64"))]
            fearless_simd::dispatch!(batch.level, simd => self.run(simd, batch, output));
        });
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        Q::answered(answers, |hits| self.count_hits(batch, hits, counters, None));
        true
    }

    fn record_beams(
        &self,
        batch: &Batch<'_>,
        hits: &mut [Hit],
        counters: &mut [RayCounters],
    ) -> Option<BeamPath> {
        let mut recorder = Recorder::default();
        self.count_hits(batch, hits, counters, Some(&mut recorder));
        Some(recorder.path)
    }

    fn counts(&self) -> bool {
        true
    }

    fn batch(&self) -> Option<usize> {
        Some(BATCH)
    }
}
