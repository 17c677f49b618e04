// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through oriented boxes, the nearest first: at a turned node the ray is rotated into the node's frame,
//! and all children are then tested as axis-aligned boxes are. If the tree has few rotations, the ray is turned into all
//! of them at the first turned node, eight rows at a time.
//!
//! # Error bound
//! Let `r` be a row of the rotation as stored, `|r| <= 1 + 2^-20`, so that the absolute values of its components sum to
//! at most 1.7321; `o`, `d` the ray in the scene's frame; `M` the scene's largest coordinate; `span >= |o| + M` in the
//! largest component; `u` the unit roundoff; and `p` the height of a wall, `|p| <= 1.7321 M`. The test computes
//! `O = r.o` and `D = r.d` in three roundings each (fewer with fused multiply-add), and then the distance
//! `p I - (O I ± slack)` with `I = 1 / D`. For a point `o + t d` of the scene `|t d| <= span` in each component, also
//! where `t` is negative. Hence
//!
//! ```text
//! |(O + t D) - r.(o + t d)|  <=  3 u 1.7321 (|o| + |t d|)      <=  10.4 u span      height of the point
//! |distance * D - (p - O)|   <=  u (3 |p| + 4 |O|)             <=   7.0 u span      reciprocal, products, sums
//! ```
//!
//! The sum, 17.4 u span, is below [`FrameRay::oblique_pad`], 28 u span, which leaves room for terms of second order. A
//! coordinate's error `b` in the space of an instance adds `1.7321 b`; the pad has `2 b`. So `slack = pad |I|`. The
//! argument compares heights, not distances: it needs neither the sign of the exact `r.d` nor that rows are at right
//! angles. `D` is moved off zero by the smallest normal float, which over `span` is far less than the rest. Where
//! `4 span I` overflows, the row bounds nothing. Packets and streams turn their rays with the same roundings.

use crate::single_rays;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::obb_tree::{Boxes, INNER, ObbTree, Rotation, WIDTH};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::frame::OBLIQUE_PAD;
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::slabs::Slabs;
use halfspace_trace::stack::{Entry, Stack};

/// A stack entry: a child still to visit and its entry distance.
#[derive(Debug, Clone, Copy, Default)]
pub struct BoxEntry {
    enter: f32,
    link: u32,
    count: u32,
}

impl Entry for BoxEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

/// Four spans of a ray per unit of its error bound of heights: no product with a reciprocal that four spans do not
/// overflow does.
const SPANS: f32 = 4.0 / OBLIQUE_PAD;

/// The slab test coefficients of a ray along the rows of a rotation, as [`Slabs`] has them along the axes: it crosses
/// the plane `row . x = p` no sooner than `p * inv + near` and no later than `p * inv + far`. Lane 3 is unused.
#[derive(Debug)]
pub struct Turned {
    inv: [f32; 4],
    near: [f32; 4],
    far: [f32; 4],
    /// Bit `k` is set if the ray enters through the upper walls of row `k`: no load waits for the stores above.
    down: usize,
}

impl Turned {
    /// Rotates a ray from `o` along `d`, a row per lane; `pad` is [`FrameRay::oblique_pad`].
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, rotation: &Rotation, [o, d]: [[f32; 3]; 2], pad: f32) -> Self {
        let splat = |x: f32| f32x4::splat(simd, x);
        let [x, y, z] = [0, 1, 2].map(|k: usize| f32x4::from_slice(simd, &rotation.columns[k]));
        let rotate = |v: [f32; 3]| z.mul_add(splat(v[2]), y.mul_add(splat(v[1]), x * splat(v[0])));
        let [inv, near, far] = coefficients(simd, rotate(d), rotate(o), splat(pad));
        let mut turned = Self {
            inv: [0.0; 4],
            near: [0.0; 4],
            far: [0.0; 4],
            down: inv.simd_lt(splat(0.0)).to_bitmask() as usize,
        };
        inv.store_slice(&mut turned.inv);
        near.store_slice(&mut turned.near);
        far.store_slice(&mut turned.far);
        turned
    }

    /// Stores the entry distances of all boxes of a node; returns the mask of those the ray may hit within the range.
    #[inline(always)]
    pub fn test<S: Simd>(
        &self,
        simd: S,
        bounds: &[[f32; WIDTH]; 6],
        within: Interval,
        enters: &mut [f32; WIDTH],
    ) -> u64 {
        let splat = |x: f32| f32x8::splat(simd, x);
        let (mut enter, mut leave) = (splat(within.enter), splat(within.leave));
        for k in 0..3 {
            let upper = 3 * (self.down >> k & 1);
            let near = f32x8::from_slice(simd, &bounds[k + upper]);
            let far = f32x8::from_slice(simd, &bounds[k + 3 - upper]);
            let inv = splat(self.inv[k]);
            enter = keep_max_each(near.mul_add(inv, splat(self.near[k])), enter);
            leave = keep_min_each(far.mul_add(inv, splat(self.far[k])), leave);
        }
        enter.store_slice(enters);
        enter.simd_le(leave).to_bitmask()
    }
}

/// The coefficients of slab tests along rows: the reciprocal of the speed along each, and the terms added for walls of
/// entry and of exit. `pad` is [`FrameRay::oblique_pad`].
#[inline(always)]
pub fn coefficients<S: Simd, V: SimdFloat<S, Element = f32>>(
    simd: S,
    speed: V,
    height: V,
    pad: V,
) -> [V; 3] {
    let splat = |x: f32| V::splat(simd, x);
    // Divide by the speed along each row, moved off zero.
    let inv = splat(1.0) / (speed + splat(f32::MIN_POSITIVE).copysign(speed));
    // Fold the origin and the error bound into the added terms.
    let shift = height * inv;
    let slack = inv.abs() * pad;
    // If a product with some height may overflow, the row bounds nothing.
    let largest = slack * splat(SPANS) + (slack + shift.abs());
    let bounds = largest.simd_le(splat(f32::MAX));
    [
        bounds.select(inv, splat(0.0)),
        bounds.select(-shift - slack, splat(f32::NEG_INFINITY)),
        bounds.select(slack - shift, splat(f32::INFINITY)),
    ]
}

/// Most rotations of a tree whose rays are turned into all of them at once.
const FEW: usize = 32;

/// The rows of all rotations of a tree that has few, and a ray's coefficients along them.
#[derive(Debug)]
pub struct Columns {
    /// Component `k` of the rows, three a rotation.
    rows: [Vec<f32>; 3],
    /// [`coefficients`] for each row.
    turned: [Vec<f32>; 3],
}

impl Columns {
    /// The rows of a tree; none if it has many rotations.
    fn new(tree: &ObbTree) -> Self {
        let few = if tree.rotations.len() <= FEW {
            &*tree.rotations
        } else {
            &[]
        };
        let size = (3 * few.len()).next_multiple_of(WIDTH);
        let rows = [0, 1, 2].map(|k: usize| {
            let mut column: Vec<_> = (few.iter())
                .flat_map(|rotation| [0, 1, 2].map(|row: usize| rotation.row(row)[k]))
                .collect();
            column.resize(size, 0.0);
            column
        });
        let nothing = || vec![0.0; size];
        Self {
            rows,
            turned: [nothing(), nothing(), nothing()],
        }
    }

    /// Turns a ray into all rotations.
    #[inline(always)]
    fn turn<S: Simd>(&mut self, simd: S, ray: &FrameRay) {
        let splat = |x: f32| f32x8::splat(simd, x);
        for i in (0..self.rows[0].len()).step_by(WIDTH) {
            let lanes = i..i + WIDTH;
            let row = |k: usize| f32x8::from_slice(simd, &self.rows[k][lanes.clone()]);
            let [x, y, z] = [row(0), row(1), row(2)];
            let along =
                |v: [f32; 3]| z.mul_add(splat(v[2]), y.mul_add(splat(v[1]), x * splat(v[0])));
            let found = coefficients(simd, along(ray.d), along(ray.o), splat(ray.oblique_pad));
            for (to, from) in self.turned.iter_mut().zip(found) {
                from.store_slice(&mut to[lanes.clone()]);
            }
        }
    }

    /// The turned ray for a rotation.
    #[inline(always)]
    fn ray(&self, number: usize) -> Turned {
        let of = |column: &[f32]| {
            let first = 3 * number;
            [column[first], column[first + 1], column[first + 2], 0.0]
        };
        let [inv, near, far] = &self.turned;
        let down = (0..3).fold(0, |down, k| {
            down | usize::from(inv[3 * number + k] < 0.0) << k
        });
        Turned {
            down,
            inv: of(inv),
            near: of(near),
            far: of(far),
        }
    }
}

/// The traversal of one tree by single rays.
pub struct ObbTraversal<'a>(pub &'a ObbTree);

impl SingleTraversal for ObbTraversal<'_> {
    type Scratch = (Vec<BoxEntry>, Columns);
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        // Each level leaves at most all children but one on the stack, and the lowest level all of them.
        let stack = vec![BoxEntry::default(); (MAX_DEPTH + 1) * (WIDTH - 1) + 2 * WIDTH];
        (stack, Columns::new(self.0))
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        (stack, columns): &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let frame = ray.frame;
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(stack);
        let few = !columns.rows[0].is_empty();
        let mut is_turned = false;
        let (mut link, mut count) = (0, self.0.root);
        loop {
            if count & INNER == 0 {
                // Test the triangles of a leaf.
                let leaf = Leaf {
                    first: link,
                    count: count as usize,
                };
                counters.leaf(leaf.count);
                if job.test_any::<S, Q, C>(simd, leaf, ray, frame.t_max, &mut best, counters) {
                    return best;
                }
            } else {
                // Test all children, and push those that may be hit, the nearest on top.
                let node = &self.0.nodes[link as usize];
                let mut enters = [0.0; WIDTH];
                let range = Interval::new(frame.t_min, best.reach);
                let mut hits = if count == INNER {
                    counters.step_boxes();
                    slabs.test::<S, f32x8<S>, WIDTH>(simd, &node.bounds, range, &mut enters)
                } else {
                    counters.step_oblique();
                    let turned = if few {
                        if !is_turned {
                            columns.turn(simd, frame);
                            is_turned = true;
                        }
                        columns.ray((count & !INNER) as usize)
                    } else {
                        let line = [frame.o, frame.d];
                        Turned::new(simd, self.0.rotation(count), line, frame.oblique_pad)
                    };
                    turned.test(simd, &node.bounds, range, &mut enters)
                };
                if hits.is_power_of_two() {
                    // Common case: one child is hit, nothing to sort. It is no empty slot: a ray that hits those hits
                    // all slots.
                    let lane = hits.trailing_zeros() as usize % WIDTH;
                    (link, count) = (node.link[lane], node.count[lane]);
                    continue;
                }
                let base = stack.size();
                while hits != 0 {
                    let lane = hits.trailing_zeros() as usize % WIDTH;
                    hits &= hits - 1;
                    // Skip empty slots, which a ray without any bounding row hits too.
                    if node.count[lane] == 0 {
                        continue;
                    }
                    let entry = BoxEntry {
                        enter: enters[lane],
                        link: node.link[lane],
                        count: node.count[lane],
                    };
                    (self.0).fetch_ahead(entry.link, entry.count, job.blocks);
                    stack.insert::<Q>(base, entry);
                }
            }
            // Pop the nearest child that starts within reach.
            let Some(child) = stack.pop_within(best.reach) else {
                return best;
            };
            (link, count) = (child.link, child.count);
        }
    }
}

single_rays! {
    /// Single rays through nodes of 8 oriented boxes, the nearest first.
    fn oriented_boxes(ObbTree) -> ObbTraversal<'a> {
        |kernel| ObbTraversal(&kernel.tree)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use halfspace_geom::Aabb;
    use halfspace_geom::vec3::{dot, widen};
    use halfspace_geom::verdict::verdict;
    use halfspace_nodes::obb_tree::outwards;
    use halfspace_ray::Ray;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;
    use halfspace_strategies::{near_triangle, point};
    use proptest::prelude::*;

    /// The rotation by the quaternion `(1, x, y, z)`, rounded.
    fn rotation([x, y, z]: [f64; 3]) -> Rotation {
        let s = 2.0 / (1.0 + x * x + y * y + z * z);
        let rows = [
            [1.0 - s * (y * y + z * z), s * (x * y - z), s * (x * z + y)],
            [s * (x * y + z), 1.0 - s * (x * x + z * z), s * (y * z - x)],
            [s * (x * z - y), s * (y * z + x), 1.0 - s * (x * x + y * y)],
        ];
        Rotation::new(rows.map(|row| row.map(|x| x as f32)))
    }

    /// The box of a triangle along the rows of a rotation.
    fn around(rotation: &Rotation, frame: &Frame, corners: [[f32; 3]; 3]) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for k in 0..3 {
            let heights = corners.map(|p| dot(widen(rotation.row(k)), widen(frame.point(p))));
            let low = heights.into_iter().fold(f64::INFINITY, f64::min);
            let high = heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
            [bounds.min[k], bounds.max[k]] = outwards(low, high, frame.bounds().magnitude());
        }
        bounds
    }

    /// The entry distance of a box along the rows of a rotation.
    fn meet(rotation: &Rotation, ray: &FrameRay, bounds: &Aabb) -> Option<f32> {
        let range = Interval::new(ray.t_min, ray.t_max);
        let [low, high] = [bounds.min, bounds.max].map(|p| p.map(|x| [x; WIDTH]));
        let walls = [low[0], low[1], low[2], high[0], high[1], high[2]];
        let mut enters = [0.0; WIDTH];
        let hits = dispatch!(Level::new(), simd => {
            let turned = Turned::new(simd, rotation, [ray.o, ray.d], ray.oblique_pad);
            turned.test(simd, &walls, range, &mut enters)
        });
        (hits != 0).then_some(enters[0])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn no_turned_box_rejects_a_hit(
            corners in [point(), point(), point()], o in point(), s in 0.0f32..1.0, t in 0.0f32..1.0,
            turn in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let scene = Triangles::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
            prop_assume!(!scene.live().is_empty());
            let frame = Frame::new(scene.bounds());
            let target = near_triangle(corners, [s, t]);
            let d: [f32; 3] = std::array::from_fn(|k| target[k] - o[k]);
            prop_assume!(d.iter().all(|x| x.is_finite()));
            let ray = Ray { o, d, t_min: 0.0, t_max: f32::INFINITY };
            let hit = verdict(o, d, corners).filter(|v| v.t >= 0.0 && v.t.is_finite());
            if let (Some(hit), Some(framed)) = (hit, frame.ray(&ray)) {
                let turn = rotation(turn);
                let enter = meet(&turn, &framed, &around(&turn, &frame, corners));
                prop_assert!(enter.is_some_and(|enter| enter <= framed.reach(hit.t)));
            }
        }
    }

    /// The number of rays, of those that hit, whose box along turned rows is rejected. Rays come from far away and are
    /// aimed exactly at vertices, where three walls meet.
    fn rejected(robust: bool) -> usize {
        let corners = [[1.0_f32, 2.0, 3.0], [7.0, 2.0, 5.0], [3.0, 6.0, 4.0]];
        let frame = Frame::new(Aabb::of_triangle(corners)).with_robust(robust);
        let turn = rotation([0.25, -0.125, 0.375]);
        let bounds = around(&turn, &frame, corners);
        let aimed = |i: u16| {
            let x = f32::from(i);
            let o = [
                -90_000.0 - 7.0 * x,
                30_001.0 + 13.0 * x,
                -70_003.0 - 5.0 * x,
            ];
            let target = corners[usize::from(i) % 3];
            let d = std::array::from_fn(|k| target[k] - o[k]);
            let (t_min, t_max) = (0.0, f32::INFINITY);
            Ray { o, d, t_min, t_max }
        };
        let lost = |ray: &Ray| {
            let met = frame
                .ray(ray)
                .is_some_and(|ray| meet(&turn, &ray, &bounds).is_some());
            verdict(ray.o, ray.d, corners).is_some() && !met
        };
        (0..2000).map(aimed).filter(lost).count()
    }

    /// Shows that the bound is needed, and so that the test above can fail.
    #[test]
    fn turned_boxes_without_error_bound_reject_hits() {
        assert_eq!(rejected(true), 0);
        assert!(rejected(false) > 0);
    }
}
