// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays of a beam in one leaf: tests against its triangles, and rays that go on singly.

use crate::beam::Beam;
use crate::form::Form;
use crate::rays::{LANES, eight};
use crate::traversal::{Octant, PIXEL, SINGLE, Traversal};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_beam::bundle::lanes;
use halfspace_geom::bound::keep_min;
use halfspace_leaf::Leaf;
use halfspace_nodes::octree_nodes::Node;
use halfspace_ray::query::{Any, Best, Closest, Counters, Query};
use halfspace_ray::{Hit, RayRef};
use halfspace_single::octants::net::Links;
use halfspace_single::octants::step::{NeighbourTraversal, NumberedLeaf, Position, Steps};
use halfspace_trace::batch::SingleTraversal;

/// A triangle as the rays of an octant see it.
pub struct Facing<T> {
    seen: T,
    id: u32,
    /// Vertices in the frame.
    corners: [[f32; 3]; 3],
}

/// Eight rays of a span.
struct Eight {
    /// Index of the first one.
    at: usize,
    /// Mask of those that belong to the beam and are open.
    open: u64,
}

impl<F: Form, Q: Query, C: Counters> Traversal<'_, F, Q, C> {
    /// Those of the rays from index `at` up to `end` that belong to a beam and are open.
    #[inline(always)]
    fn own<S: Simd>(&self, simd: S, form: &F, beam: &Beam, [at, end]: [usize; 2]) -> Eight {
        let reach = eight(simd, &self.sorted.reach, at);
        let mut open = reach
            .simd_gt(f32x8::splat(simd, f32::NEG_INFINITY))
            .to_bitmask()
            & 0xff;
        if end - at < LANES {
            open &= (1 << (end - at)) - 1;
        }
        // Compare with the lines of the beam, exactly where f32 cannot decide.
        let ways = self.sorted.load(simd, at);
        for side in beam.sides.all() {
            if open == 0 {
                break;
            }
            let [inside, unsure] = side.sort(simd, form, &ways);
            let mut own = inside;
            for lane in lanes(unsure & open) {
                own |= u64::from(side.holds(form, self.sorted.way(at + lane))) << lane;
            }
            open &= own;
        }
        Eight { at, open }
    }

    /// The number of open rays of a beam among those found by the last scan.
    #[inline(always)]
    pub fn count_own<S: Simd>(&self, simd: S, octant: &Octant<F>, beam: &mut Beam) -> usize {
        let mut count = 0;
        for span in &self.scratch.spans {
            let (start, end) = (span.start as usize, span.end as usize);
            for at in (start..end).step_by(LANES) {
                count += self
                    .own(simd, &octant.form, beam, [at, end])
                    .open
                    .count_ones();
            }
        }
        beam.estimate(count, octant.densest);
        count as usize
    }

    /// Tests the rays of a beam, found by the last scan, against the triangles of its leaf. Ends those that need no other
    /// leaf, and returns the number of the others.
    #[inline(always)]
    pub fn test<S: Simd>(
        &mut self,
        simd: S,
        octant: &Octant<F>,
        node: Node,
        beam: &mut Beam,
    ) -> u32 {
        let leaf = node.blocks();
        if !Q::ANY {
            self.face(octant, node);
        }
        let edge = octant.grid.edge(node);
        let planes = octant.planes(beam.low.map(|x| x + edge));
        let triangles = std::mem::take(&mut self.scratch.triangles);
        let spans = std::mem::take(&mut self.scratch.spans);
        let mut left = 0;
        for span in &spans {
            let (start, end) = (span.start as usize, span.end as usize);
            for at in (start..end).step_by(LANES) {
                let mut eight = self.own(simd, &octant.form, beam, [at, end]);
                let late = if Q::ANY {
                    0
                } else {
                    octant.form.late(simd, &self.sorted, at, planes)
                };
                if C::COUNTS {
                    self.count_tests(&eight, late, leaf);
                }
                if eight.open == 0 {
                    continue;
                }
                if Q::ANY {
                    self.block(simd, node, &mut eight);
                } else {
                    let open = eight.open & !late;
                    self.find(simd, octant, &triangles, Eight { at, open });
                }
                // A ray ends if its best hit, or its end, lies before all planes that it may leave through.
                let splat = |x: f32| f32x8::splat(simd, x);
                let [r, m] = (octant.form).parts(self.sorted.load(simd, at), splat);
                let reach = crate::rays::eight(simd, &self.sorted.reach, at);
                let mut done = 0xff;
                for (k, plane) in planes.into_iter().enumerate() {
                    let place = reach.mul_add(m[k], r[k]);
                    done &= place.simd_lt(splat(plane.offset)).to_bitmask();
                }
                let done = done & eight.open;
                for lane in lanes(done) {
                    self.sorted.reach[at + lane] = f32::NEG_INFINITY;
                }
                left += (eight.open & !done).count_ones();
            }
        }
        self.scratch.triangles = triangles;
        self.scratch.spans = spans;
        beam.estimate(left, octant.densest);
        left
    }

    /// Offers those of eight rays that are in `open` the triangles that they may hit before their best hits.
    #[inline(always)]
    fn find<S: Simd>(
        &mut self,
        simd: S,
        octant: &Octant<F>,
        triangles: &[Facing<F::Triangle>],
        eight: Eight,
    ) {
        for triangle in triangles {
            let found = F::candidates(simd, &triangle.seen, &self.sorted, eight.at) & eight.open;
            for lane in lanes(found) {
                self.offer(octant, eight.at + lane, triangle);
            }
        }
    }

    /// Tests reversed rays as they are given, one by one, against a leaf; ends those that are blocked.
    #[inline(always)]
    fn block<S: Simd>(&mut self, simd: S, node: Node, eight: &mut Eight) {
        let (job, leaf) = (self.job, node.blocks());
        for lane in lanes(eight.open) {
            let i = eight.at + lane;
            let id = self.sorted.ids[i] as usize;
            let (ray, count) = (&self.slice.rays[id], &mut self.counters[id]);
            // A ray next to the scene hits nothing, and ends too.
            if let Some(frame) = &self.slice.frame.ray(ray) {
                let ray = RayRef { ray, frame };
                let mut best = Best::new(frame);
                if !job.test::<S, Any, C>(simd, leaf, ray, f32::INFINITY, &mut best, count) {
                    continue;
                }
                self.answers[id] = best.hit();
            }
            self.sorted.reach[i] = f32::NEG_INFINITY;
            eight.open &= !(1 << lane);
        }
    }

    /// Prepares the triangles of a leaf for the rays of an octant.
    #[inline(always)]
    fn face(&mut self, octant: &Octant<F>, node: Node) {
        let sign = [octant.sign(0), octant.sign(1), octant.sign(2)];
        let triangles = &mut self.scratch.triangles;
        triangles.clear();
        self.job.blocks.each(node.blocks(), |id, corners| {
            triangles.push(Facing {
                seen: octant.form.face(sign, corners),
                id,
                corners,
            });
        });
    }

    /// Counts the pixels of a scan, and the tests of those that belong to the beam and have begun.
    #[inline(always)]
    fn count_tests(&mut self, eight: &Eight, late: u64, leaf: Leaf) {
        for lane in lanes(eight.open) {
            let id = self.sorted.ids[eight.at + lane] as usize;
            self.counters[id].case(|| PIXEL);
            if !Q::ANY && late >> lane & 1 == 0 {
                self.counters[id].visit(leaf.first, leaf.count);
                self.counters[id].tests(leaf.count);
            }
        }
    }

    /// Decides by the exact verdict whether a ray hits a triangle, and cuts its reach at its best hit.
    #[inline(always)]
    fn offer(&mut self, octant: &Octant<F>, i: usize, triangle: &Facing<F::Triangle>) {
        let id = self.sorted.ids[i] as usize;
        let ray = &self.slice.rays[id];
        let frame = &self.slice.frame.limits_of(ray);
        let mut best = Best::known(self.answers[id]);
        best.offer::<Closest, C>(
            RayRef { ray, frame },
            triangle.id,
            #[inline(always)]
            || (self.job.blocks).scene_corners(self.job.scene, triangle.id, triangle.corners),
            &mut self.counters[id],
        );
        let hit = best.hit();
        if hit.triangle != Hit::NONE {
            self.answers[id] = hit;
            let far = frame.reach(hit.t);
            octant.form.cut(&mut self.sorted, i, far);
        }
    }

    /// Takes the open rays of a beam, found by the last scan, from its leaf to their best hits one by one.
    #[inline(always)]
    pub fn go_on_singly<S: Simd>(&mut self, simd: S, octant: &Octant<F>, node: Node, beam: &Beam) {
        let grid = &octant.grid;
        let steps = Steps {
            tree: self.tree,
            grid,
        };
        let edge = grid.edge(node);
        let near = octant.planes(beam.low);
        let single = NeighbourTraversal(self.tree, Links);
        let mut entries = single.scratch();
        let spans = std::mem::take(&mut self.scratch.spans);
        for span in &spans {
            let (start, end) = (span.start as usize, span.end as usize);
            for at in (start..end).step_by(LANES) {
                let eight = self.own(simd, &octant.form, beam, [at, end]);
                for i in lanes(eight.open).map(|lane| at + lane) {
                    let reach = if Q::ANY {
                        0.0
                    } else {
                        F::reach(&self.sorted, i)
                    };
                    self.sorted.reach[i] = f32::NEG_INFINITY;
                    let id = self.sorted.ids[i] as usize;
                    let (ray, count) = (&self.slice.rays[id], &mut self.counters[id]);
                    let Some(frame) = &self.slice.frame.ray(ray) else {
                        continue;
                    };
                    count.case(|| SINGLE);
                    // Find where the ray enters the leaf. A reversed ray begins anew at its own origin, and so does one
                    // that has not begun, is too far for steps, or may be in another part of the beam.
                    let enter = if Q::ANY {
                        0.0
                    } else {
                        octant.form.enter(&self.sorted, i, near)
                    };
                    let begun = enter >= frame.t_min && self.tree.is_near(frame.o);
                    if Q::ANY || beam.unbounded || !(octant.form.origin().is_some() || begun) {
                        let ray = RayRef { ray, frame };
                        let mut best =
                            single.cast::<S, Q, C>(simd, self.job, ray, &mut entries, count);
                        self.answers[id] = best.answer(ray);
                        continue;
                    }
                    // Find its smallest cell there.
                    let cell = |k: usize| {
                        let x = frame.o[k] + enter * frame.d[k];
                        grid.cell(k, x, beam.low[k], beam.low[k] + edge - 1)
                    };
                    let from = Position {
                        leaf: NumberedLeaf {
                            index: beam.node,
                            node,
                        },
                        at: [cell(0), cell(1), cell(2)],
                        enter,
                    };
                    let mut best = Best::known(self.answers[id]);
                    best.reach = keep_min(frame.t_max, reach);
                    let ray = RayRef { ray, frame };
                    steps.follow::<S, Closest, C, Links>(
                        simd, self.job, ray, from, &mut best, count,
                    );
                    self.answers[id] = best.hit();
                }
            }
        }
        self.scratch.spans = spans;
    }
}
