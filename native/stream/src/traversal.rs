// SPDX-License-Identifier: GPL-3.0-or-later
//! The traversal of streams: they take turns, one visit each, until all their stacks are empty.

use crate::lists::{Ended, Entry, Stream};
use crate::ray_state::{EdgedBlock, RayState};
use crate::{AHEAD, OCTANTS, Run, STREAM, Steps};
use fearless_simd::Simd;
use halfspace_geom::bound::keep_min;
use halfspace_leaf::blocks::{LANES, SPAN};
use halfspace_leaf::candidates::Edges;
use halfspace_leaf::{Block, Job, Leaf};
use halfspace_ray::query::{Count, Counters, NoCountLate, Query};
use halfspace_ray::{Hit, RayCounters, RayRef};
use halfspace_trace::batch::{Launch, baseline};
use halfspace_trace::late::Late;

/// The rays of a part of a batch, and the counters of each.
struct Riders<'a, C> {
    states: &'a mut [RayState],
    counters: &'a mut [C],
    ended: &'a mut Ended,
}

/// A list of rays, and the distances at which each enters and leaves the node.
struct Listed<'a> {
    list: &'a [u32],
    enter: &'a [f32],
    leave: &'a [f32],
}

impl Run<'_> {
    /// Finds the nearest hits, or any hits, of the rays, which must be those of the scene, in streams through a tree.
    /// Calls `write` with each ray's index and hit, in no particular order.
    pub fn streams<T: Steps, Q: Query>(&self, tree: &T, write: &mut dyn FnMut(usize, Hit)) {
        debug_assert!(self.placed.is_none(), "rays of instances go one by one");
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.level.as_avx512() {
            simd.vectorize(
                #[inline(always)]
                || self.streaming::<_, T, Q, _>(simd, tree, write, |_| NoCountLate),
            );
        } else if let Some(simd) = self.level.as_avx2() {
            simd.vectorize(
                #[inline(always)]
                || self.streaming::<_, T, Q, _>(simd, tree, write, |_| NoCountLate),
            );
        } else {
            // Processors with neither take the counting version, which is compiled for them anyway.
            let mut unused = vec![RayCounters::default(); self.rays.len()];
            self.count_streams::<T, Q>(tree, write, &mut unused);
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!(self.level, simd => {
            self.streaming::<_, T, Q, _>(simd, tree, write, |_| NoCountLate);
        });
    }

    /// Does the same and counts. A visit is a step or a leaf of the first ray of its list that still needs it.
    pub fn count_streams<T: Steps, Q: Query>(
        &self,
        tree: &T,
        write: &mut dyn FnMut(usize, Hit),
        counters: &mut [RayCounters],
    ) {
        let mut counters = counters.iter_mut();
        baseline!(simd => {
            self.streaming::<_, T, Q, _>(simd, tree, write, |_| {
                Count::new(counters.next().expect("one set of counters per ray"))
            });
        });
    }

    /// Traces part by part, each of at most [`STREAM`] rays.
    #[inline(always)]
    fn streaming<S: Simd, T: Steps, Q: Query, C: Counters>(
        &self,
        simd: S,
        tree: &T,
        write: &mut dyn FnMut(usize, Hit),
        mut counter: impl FnMut(usize) -> C,
    ) {
        let mut streams: [Stream<T::Node>; OCTANTS] = std::array::from_fn(Stream::new);
        let mut states = Vec::with_capacity(self.rays.len().min(STREAM));
        let mut scratch = T::Scratch::default();
        let mut late = Late::default();
        let mut ended = Ended::default();
        for (part, rays) in self.rays.chunks(STREAM).enumerate() {
            let own = Run(Launch { rays, ..self.0 });
            let mut write = |index: usize, hit: Hit| write(STREAM * part + index, hit);
            let mut counters: Vec<C> = (0..rays.len()).map(&mut counter).collect();
            own.set_out(simd, &mut streams, &mut states, T::INTERVALS);
            ended.clear(rays.len());
            let mut open = 0;
            for stream in &mut streams {
                open += usize::from(stream.begin(tree.root()));
            }
            // Let the streams take turns until all stacks are empty.
            while open > 0 {
                if C::COUNTS && self.is_cancelled() {
                    return;
                }
                for stream in &mut streams {
                    let Some(mut next) = stream.pop() else {
                        continue;
                    };
                    // Shorten the list once it pays.
                    if Q::ANY && ended.is_worth_dropping() {
                        stream.drop_ended(&mut next, &ended, T::INTERVALS);
                    }
                    if next.rays == 0 {
                        // All have ended.
                    } else if let Some(leaf) = tree.leaf(&next.node) {
                        let mut riders = Riders {
                            states: &mut states,
                            counters: &mut counters,
                            ended: &mut ended,
                        };
                        own.visit_leaf::<S, T, Q, C>(simd, stream, &next, leaf, &mut riders);
                    } else {
                        if C::COUNTS {
                            count_node(tree, stream, &next, &states, &mut counters);
                        }
                        tree.visit(simd, stream, next, &states, &mut scratch);
                    }
                    own.fetch_next(tree, stream, &states);
                    open -= usize::from(stream.stack().is_empty());
                }
            }
            own.answer(simd, &mut states, &mut late, &mut write);
        }
    }

    /// Decides the deferred hits, many at once in f64 where the frame allows it, and writes all answers. Compiled once
    /// for all trees.
    #[inline(never)]
    fn answer<S: Simd>(
        &self,
        simd: S,
        states: &mut [RayState],
        late: &mut Late,
        write: &mut dyn FnMut(usize, Hit),
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                for (index, state) in states.iter_mut().enumerate() {
                    let (ray, frame) = (&self.rays[index], state.ray());
                    match state.best.held() {
                        Some(held) if self.frame.is_unscaled() => {
                            late.push(simd, index, self.rays, &frame, held, write);
                        }
                        _ => write(index, state.best.answer(RayRef { ray, frame: &frame })),
                    }
                }
                late.settle(simd, self.rays, write);
            },
        );
    }

    /// Visits a leaf.
    #[inline(always)]
    fn visit_leaf<S: Simd, T: Steps, Q: Query, C: Counters>(
        &self,
        simd: S,
        stream: &Stream<T::Node>,
        own: &Entry<T::Node>,
        leaf: Leaf,
        riders: &mut Riders<'_, C>,
    ) {
        if C::COUNTS {
            count_leaf::<T, C>(stream, own, leaf, riders);
        }
        let list = stream.list(own);
        if T::INTERVALS {
            let (enter, leave) = stream.intervals(own);
            let listed = Listed { list, enter, leave };
            self.test_inside::<S, Q, C>(simd, leaf, listed, riders);
        } else {
            let part = |_: usize, state: &RayState| {
                T::enters(&own.node, &state.line).then(|| state.line.reach())
            };
            if T::INDICES {
                self.test_list::<S, Q, C, true>(simd, leaf, list, part, riders);
            } else {
                self.test_list::<S, Q, C, false>(simd, leaf, list, part, riders);
            }
        }
    }

    /// Tests the triangles of a leaf against rays with intervals. Compiled once for all trees of such lists.
    #[inline(never)]
    fn test_inside<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        leaf: Leaf,
        Listed { list, enter, leave }: Listed<'_>,
        riders: &mut Riders<'_, C>,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                let part = |i: usize, state: &RayState| {
                    let reach = state.line.reach();
                    (enter[i] <= reach).then(|| keep_min(leave[i], reach))
                };
                self.test_list::<S, Q, C, true>(simd, leaf, list, part, riders);
            },
        );
    }

    /// Tests each ray of a list against the triangles of a leaf, block by block. `part` is the reach of the ray at a
    /// position of the list in the leaf, `None` if it has a nearer hit by now. `ANY`: whether leaves may keep indices
    /// in place of corners.
    #[inline(always)]
    fn test_list<S: Simd, Q: Query, C: Counters, const ANY: bool>(
        &self,
        simd: S,
        leaf: Leaf,
        list: &[u32],
        part: impl Fn(usize, &RayState) -> Option<f32>,
        Riders {
            states,
            counters,
            ended,
        }: &mut Riders<'_, C>,
    ) {
        let mut room = [0.0; SPAN];
        let (mut at, mut left) = (leaf.first, leaf.count);
        while left > 0 {
            let n = left.min(LANES);
            let (words, next) = if ANY {
                self.blocks.load(self.scene, at, n, &mut room)
            } else {
                self.blocks.block(at, n)
            };
            let edges = Edges::new(simd, words, n);
            // Prefetch later rays in the first pass.
            for (i, &index) in list.iter().enumerate() {
                if let (true, Some(&later)) = (at == leaf.first, list.get(i + AHEAD)) {
                    states[later as usize].fetch_ahead();
                }
                let index = index as usize;
                let state = &mut states[index];
                if let Some(reach) = part(i, state) {
                    let block = EdgedBlock {
                        block: Block {
                            job: Job {
                                scene: self.scene,
                                blocks: self.blocks,
                            },
                            words,
                            count: n,
                        },
                        edges: &edges,
                    };
                    let (ray, counters) = (&self.rays[index], &mut counters[index]);
                    if state.test::<S, Q, C>(simd, block, ray, reach, counters) {
                        ended.add(index);
                    }
                }
            }
            (at, left) = (next, left - n);
        }
    }

    /// Prefetches the data of the next visit.
    #[inline(always)]
    fn fetch_next<T: Steps>(&self, tree: &T, stream: &Stream<T::Node>, states: &[RayState]) {
        let Some(next) = stream.stack().last() else {
            return;
        };
        let first = next.first as usize;
        let list = &stream.lists[first..first + AHEAD.min(next.rays as usize)];
        tree.fetch_ahead(&next.node, self.blocks);
        let inner = tree.leaf(&next.node).is_none();
        for &index in list {
            let state = &states[index as usize];
            if inner {
                state.fetch_line();
            } else {
                state.fetch_ahead();
            }
        }
    }
}

/// The rays of a list whose best hits do not lie before the node.
fn visitors<'a, T: Steps>(
    stream: &'a Stream<T::Node>,
    own: &'a Entry<T::Node>,
    states: &'a [RayState],
) -> impl Iterator<Item = usize> + 'a {
    let list = stream.list(own).iter().enumerate();
    list.filter_map(move |(i, &index)| {
        let line = &states[index as usize].line;
        let enters = if T::INTERVALS {
            stream.intervals(own).0[i] <= line.reach()
        } else {
            T::enters(&own.node, line)
        };
        enters.then_some(index as usize)
    })
}

/// Counts a visit to an inner node.
fn count_node<T: Steps, C: Counters>(
    tree: &T,
    stream: &Stream<T::Node>,
    own: &Entry<T::Node>,
    states: &[RayState],
    counters: &mut [C],
) {
    for (i, index) in visitors::<T>(stream, own, states).enumerate() {
        if i == 0 {
            tree.count(&own.node, &mut counters[index]);
        } else {
            counters[index].joined();
        }
    }
}

/// Counts a visit to a leaf, and announces it to all its rays.
fn count_leaf<T: Steps, C: Counters>(
    stream: &Stream<T::Node>,
    own: &Entry<T::Node>,
    leaf: Leaf,
    Riders {
        states, counters, ..
    }: &mut Riders<'_, C>,
) {
    for (i, index) in visitors::<T>(stream, own, states).enumerate() {
        if i == 0 {
            counters[index].leaf(leaf.count);
        } else {
            counters[index].joined();
        }
        counters[index].visit(leaf.first, leaf.count);
    }
}
