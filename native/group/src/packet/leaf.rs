// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of a leaf against a packet, in f32. Quantities of a triangle alone are computed for eight
//! triangles at once; then each triangle is tested against all rays, one per lane.
//!
//! The test is that of [`halfspace_leaf::candidates`] with its triple products permuted, so that the last factor depends
//! on the triangle only: `n = e2 x e1` gives determinant and distance, `q = s x d` the weights. With `|d| < 2`
//! per component, `|e| <= E`, `|s| <= S`: `n` is off by `8 u E^2` per component, the determinant by `84 u E^2`
//! and the distance by `48 u S E^2`, as in [`halfspace_leaf::lanes`]; `q` by `12 u S`, and the weights, like those from
//! `d x e2` there, by `84 u S E`. The part of a side that is lost below the normal numbers is multiplied by the
//! offset `s` in the distance only, and is less there than the part due to the determinant's error: no hit of a
//! packet lies behind its origin.

use crate::packet::prepare::{Prepared, prepare};
use crate::packet::{Group, MOST, Packet, Width, load, load3, store};
use crate::tile::{Candidate, Quotient, StoredTriangle};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::{Blocks, LANES as WIDE};
use halfspace_ray::query::{Counters, Query};
use halfspace_trace::input::Input;

/// The rays that are active in a leaf's cell.
#[derive(Clone, Copy)]
pub struct Active<'a, V> {
    /// Mask of the rays.
    pub lanes: u64,
    /// Distances where the rays leave the cell.
    pub leave: &'a V,
}

/// Tests the triangles of a leaf against the active rays and offers the candidates to the packet. Compiled once
/// for all trees.
#[inline(never)]
pub fn test<S: Simd, Q: Query, C: Counters, L: Width>(
    simd: S,
    input: Input<'_>,
    leaf: Leaf,
    packet: &mut Packet,
    active: Active<'_, L::Vector<S>>,
    counters: &mut [C],
) {
    let before = packet.blocked;
    simd.vectorize(
        #[inline(always)]
        || each::<S, Q, C, L>(simd, input, leaf, packet, active, counters),
    );
    if Q::ANY {
        packet
            .blocker
            .blocks((packet.blocked & !before).count_ones());
        packet.blocker.tested(leaf);
    }
}

/// Tests the leaf that blocked most rays of the last packet, if there is one, against the rays of `lanes` before they go
/// through the tree. Returns the mask of those that are still open.
#[inline(always)]
pub fn try_blocker<S: Simd, Q: Query, C: Counters, L: Width>(
    simd: S,
    input: Input<'_>,
    packet: &mut Packet,
    lanes: u64,
    counters: &mut [C],
) -> u64 {
    let last = std::mem::take(&mut packet.blocker).leaf();
    // Rays that have no packet test go singly.
    let regular = lanes & !packet.odd;
    let Some(leaf) = last.filter(|_| regular.count_ones() > 1) else {
        return lanes;
    };
    let group = Group {
        lanes: regular,
        lead: regular.trailing_zeros() as usize % MOST,
        signs: 0,
    };
    counters[packet.places[group.lead]].leaf(leaf.count);
    packet.join(regular, group, counters);
    let leave = &load::<S, L>(simd, &packet.reach);
    let active = Active {
        lanes: regular,
        leave,
    };
    test::<S, Q, C, L>(simd, input, leaf, packet, active, counters);
    if C::COUNTS {
        for lane in (0..MOST).filter(|lane| packet.blocked >> lane & 1 == 1) {
            counters[packet.places[lane]].spared();
        }
    }
    lanes & !u64::from(packet.blocked)
}

/// A start closer to the origin than this is moved to this distance before the origin. Most rays start at their origin
/// up to rounding; the product of such a start with a determinant would be subnormal, which costs some processors a
/// hundred cycles. Derived: the product with any determinant above 1.2e-20 is a normal number.
const BEFORE: f32 = 1e-18;

/// The rays of a packet in registers, for all triangles of a leaf.
struct Lanes<S: Simd, L: Width> {
    o: [L::Vector<S>; 3],
    d: [L::Vector<S>; 3],
    start: L::Vector<S>,
}

impl<S: Simd, L: Width> Lanes<S, L> {
    #[inline(always)]
    fn new(simd: S, packet: &Packet) -> Self {
        let start = load::<S, L>(simd, &packet.start);
        let splat = |x: f32| L::Vector::splat(simd, x);
        Self {
            o: load3::<S, L>(simd, &packet.o),
            d: load3::<S, L>(simd, &packet.d),
            // Move starts near the origin before it, see [`BEFORE`].
            start: (start.abs())
                .simd_lt(splat(BEFORE))
                .select(splat(-BEFORE), start),
        }
    }
}

/// The f32 test of one triangle against the rays of a packet.
struct Tested<S: Simd, L: Width> {
    /// Mask of the rays that the test could not reject.
    open: u64,
    /// Smallest weight, times the determinant.
    least: L::Vector<S>,
    /// Distances, times the determinant.
    t: L::Vector<S>,
    /// Determinants, positive.
    det: L::Vector<S>,
}

impl<S: Simd, L: Width> Tested<S, L> {
    /// Tests the triangle in `lane` of eight against rays that end at `reach`.
    #[inline(always)]
    fn new(
        simd: S,
        rays: &Lanes<S, L>,
        reach: L::Vector<S>,
        triangles: &Prepared,
        lane: usize,
    ) -> Self {
        let splat = |x: f32| L::Vector::splat(simd, x);
        let (o, d) = (&rays.o, &rays.d);
        // Compute the determinant, the distance's numerator and the two weights.
        let a = pick::<S, L>(simd, &triangles.corner, lane);
        let s = [o[0] - a[0], o[1] - a[1], o[2] - a[2]];
        let q = [
            s[1].mul_sub(d[2], s[2] * d[1]),
            s[2].mul_sub(d[0], s[0] * d[2]),
            s[0].mul_sub(d[1], s[1] * d[0]),
        ];
        let [nx, ny, nz] = pick::<S, L>(simd, &triangles.normal, lane);
        let det = d[0].mul_add(nx, d[1].mul_add(ny, d[2] * nz));
        let t = -s[0].mul_add(nx, s[1].mul_add(ny, s[2] * nz));
        let e2 = pick::<S, L>(simd, &triangles.e2, lane);
        let u = q[0].mul_add(e2[0], q[1].mul_add(e2[1], q[2] * e2[2]));
        let e1 = pick::<S, L>(simd, &triangles.e1, lane);
        let v = -q[0].mul_add(e1[0], q[1].mul_add(e1[1], q[2] * e1[2]));
        // Make the determinant positive, then compare without a division.
        let sign = splat(1.0).copysign(det);
        let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
        let least = u.min(v).min(det - u - v);
        let error = splat(triangles.uv_error[lane]);
        let t_error = splat(triangles.t_error[lane]);
        let doubt = reach.abs().mul_add(splat(triangles.doubt[lane]), t_error);
        // Reject hits before the start only if the sign of the determinant is certain.
        let det_error = splat(triangles.det_error[lane]);
        let soonest = det.mul_sub(rays.start, t_error + rays.start.abs() * det_error);
        let rejected = least.simd_lt(-error)
            | t.simd_gt(det.mul_add(reach, doubt))
            | (t.simd_lt(soonest) & det.simd_gt(det_error));
        Self {
            open: !rejected.to_bitmask(),
            least,
            t,
            det,
        }
    }

    /// The candidate of the rays of `open`.
    #[inline(always)]
    fn candidate<Q: Query, C: Counters>(
        &self,
        simd: S,
        open: u64,
        triangles: &Prepared,
        lane: usize,
        triangle: StoredTriangle,
    ) -> Candidate<S> {
        let sure = if Q::ANY && !C::QUICK {
            0
        } else {
            let error = L::Vector::splat(simd, triangles.uv_error[lane]);
            open & self.least.simd_gt(error).to_bitmask()
        };
        let mut rows = [[1.0; MOST]; 2];
        store::<S, L>(self.t, &mut rows[0]);
        store::<S, L>(self.det, &mut rows[1]);
        Candidate {
            row: 0,
            open: low(open),
            sure: low(sure),
            distance: Quotient {
                t: f32x16::from_slice(simd, &rows[0]),
                t_error: f32x16::splat(simd, triangles.t_error[lane]),
                det: f32x16::from_slice(simd, &rows[1]),
                det_error: f32x16::splat(simd, triangles.det_error[lane]),
            },
            triangle,
        }
    }
}

/// [`test()`] in the instruction set of the caller.
#[inline(always)]
fn each<S: Simd, Q: Query, C: Counters, L: Width>(
    simd: S,
    input: Input<'_>,
    leaf: Leaf,
    packet: &mut Packet,
    active: Active<'_, L::Vector<S>>,
    counters: &mut [C],
) {
    let (mut lanes, leave) = (active.lanes, *active.leave);
    count_tests(packet, lanes, leaf.count, counters);
    // Load the rays; they stay in registers for the whole leaf.
    let rays = Lanes::<S, L>::new(simd, packet);
    let mut reach = load::<S, L>(simd, &packet.reach).min(leave);
    let farthest = match packet.fan {
        Some(_) => farthest::<S, L>(simd, reach, lanes),
        None => f32::INFINITY,
    };
    let (mut at, mut left) = (leaf.first, leaf.count);
    while left > 0 {
        let n = left.min(WIDE);
        let gathered;
        let (block, next) = if input.blocks.has_indices() {
            gathered = input.blocks.gathered(input.scene, at, n);
            (&gathered, Blocks::after_indices(at, n))
        } else {
            input.blocks.block(at, n)
        };
        // Test eight triangles against the box of the fan, if there is one.
        let triangles = prepare(simd, packet, farthest, block, n);
        let mut kept = triangles.kept;
        // Test each remaining triangle against all rays.
        while kept != 0 {
            let lane = kept.trailing_zeros() as usize % WIDE;
            kept &= kept - 1;
            let tested = Tested::<S, L>::new(simd, &rays, reach, &triangles, lane);
            let open = tested.open & lanes;
            if open == 0 {
                continue;
            }
            // Hand the candidates over, and continue with the shorter reaches.
            let triangle = StoredTriangle::new(input.blocks, block, at, n, lane);
            let candidate = tested.candidate::<Q, C>(simd, open, &triangles, lane, triangle);
            packet.offer::<S, Q, C>(simd, input, &candidate, counters);
            if Q::ANY {
                lanes &= !u64::from(packet.blocked);
                if lanes == 0 {
                    return;
                }
            } else {
                reach = load::<S, L>(simd, &packet.reach).min(leave);
            }
        }
        at = next;
        left -= n;
    }
}

/// Loads a vector of one triangle into all lanes.
#[inline(always)]
fn pick<S: Simd, L: Width>(simd: S, rows: &[[f32; WIDE]; 3], lane: usize) -> [L::Vector<S>; 3] {
    [
        L::Vector::splat(simd, rows[0][lane]),
        L::Vector::splat(simd, rows[1][lane]),
        L::Vector::splat(simd, rows[2][lane]),
    ]
}

/// Counts one test per ray of `lanes` and triangle.
#[inline(always)]
fn count_tests<C: Counters>(packet: &Packet, mut lanes: u64, count: usize, counters: &mut [C]) {
    if C::QUICK {
        return;
    }
    while lanes != 0 {
        counters[packet.places[lanes.trailing_zeros() as usize % MOST]].tests(count);
        lanes &= lanes - 1;
    }
}

#[expect(clippy::cast_possible_truncation, reason = "at most 16 lanes")]
fn low(lanes: u64) -> u16 {
    lanes as u16
}

/// Largest `reach` of the rays of `lanes`.
#[inline(always)]
fn farthest<S: Simd, L: Width>(simd: S, reach: L::Vector<S>, lanes: u64) -> f32 {
    let mut rows = [f32::NEG_INFINITY; MOST];
    store::<S, L>(reach, &mut rows);
    let open = mask32x16::from_bitmask(simd, lanes);
    let none = f32x16::splat(simd, f32::NEG_INFINITY);
    let reach: f32x16<S> = open.select(f32x16::from_slice(simd, &rows), none);
    reach.reduce_max()
}
