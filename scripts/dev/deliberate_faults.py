# SPDX-License-Identifier: GPL-3.0-or-later
"""The deliberate faults that `mutations.py` puts into the sources, each with the test that must notice it.

Faults of error bounds and of the exact verdict, which no tool invents; cargo-mutants finds others.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A fault of the native module: in `file`, the expression `old` is replaced by `new`, and `test` (program and name)
    must fail.
    """

    what: str
    file: str
    old: str
    new: str
    test: tuple[str, str]


ALL = ("contract", "every_structure_answers_like_brute_force")
"""Every structure on every extreme case."""

EXACT = ("contract", "brute_force_answers_like_exact_arithmetic")
"""Brute force against exact arithmetic: faults that all structures share."""

ENDS = ("contract", "the_ray_interval_is_closed")
PACKETS = ("packets", "packets_lose_nothing_on_hard_scenes")
AFAR = ("lib", "candidates::tests::no_tiny_triangle_is_rejected_from_afar")
AFAR_BEAMS = ("lib", "lanes::tests::no_tiny_triangle_is_rejected_from_afar")
BLOCK = ("lib", "candidates::tests::no_hit_is_ever_rejected")
COLUMNS = ("lib", "columns::tests::regular_rays_have_the_bits_of_single_ones")
UNUSUAL = ("lib", "columns::tests::unusual_rays_are_not_regular")
VERDICT = ("lib", "verdict::tests")
INTEGERS = ("lib", "exact")
ONE_BY_ONE = ("lib", "scalar::tests::no_hit_is_ever_rejected_and_proven_hits_are_hits")

_COLUMNS = "native/ray/src/columns.rs"
_FRAME = "native/ray/src/frame.rs"
_RAY = "native/ray/src/ray.rs"
_CANDIDATES = "native/leaf/src/candidates/mod.rs"
_LANES = "native/leaf/src/lanes.rs"
_VERDICT = "native/geom/src/verdict.rs"
_PREPARE = "native/group/src/packet/prepare.rs"
_QUERY = "native/ray/src/query.rs"
_BUNDLE = "native/group/src/packet/bundle.rs"
_SCALAR = "native/leaf/src/scalar/mod.rs"
_FORM = "native/polybeam/src/form.rs"

FAULTS = (
    Fault("plane distances without their error bound", _COLUMNS, "(robust * slack)", "(splat(0.0) * slack)", ALL),
    Fault(
        "plane distances of unusual rays without their error bound",
        _FRAME,
        "self.robust * slack",
        "0.0 * slack",
        COLUMNS,
    ),
    Fault("unusual rays converted with others", _COLUMNS, "regular.to_bitmask()", "!0", UNUSUAL),
    Fault(
        "the check for NaN directions dropped",
        _FRAME,
        "longest == 0.0 || !finite",
        "longest == 0.0",
        ("contract", "zero_and_nan_directions_hit_nothing"),
    ),
    Fault(
        "no allowance for distances that round to zero",
        _FRAME,
        "(f64::from(f32::from_bits(1)) * to_frame + f64::from(TINY)) as f32",
        "(0.0 * (to_frame + f64::from(TINY))) as f32",
        COLUMNS,
    ),
    Fault("ties to the larger number", _RAY, "self.triangle < other.triangle", "self.triangle > other.triangle", EXACT),
    Fault("an infinite distance is a hit", _RAY, "t.abs() < f32::INFINITY", "!t.is_nan()", EXACT),
    Fault("hits beyond the interval count", _RAY, "t <= self.t_max", "!t.is_nan()", ENDS),
    Fault(
        "the f32 test without bounds on its weights",
        _CANDIDATES,
        "self.least.simd_lt(-uv_error)",
        "self.least.simd_lt(splat(0.0))",
        BLOCK,
    ),
    Fault(
        "the f32 test without a bound on its distance",
        _CANDIDATES,
        "[2.0 * UV_ERROR * size, T_ERROR * (size * size)]",
        "[2.0 * UV_ERROR * size, 0.0]",
        BLOCK,
    ),
    Fault(
        "the f32 test trusted where a product overflowed",
        _CANDIDATES,
        "keep_min(2.0 * farthest, ray.span) + zero_or_nan",
        "keep_min(2.0 * farthest, ray.span)",
        BLOCK,
    ),
    Fault(
        "the rounding of short edges not multiplied by the offset",
        _CANDIDATES,
        "[uv + UNDERFLOW, uv * size + (3.0 * det + UNDERFLOW)]",
        "[uv, uv * size + (3.0 * det + UNDERFLOW)]",
        AFAR,
    ),
    Fault(
        "wrong signs counted up to the reach only", _CANDIDATES, "3.0 * det * farthest", "3.0 * det * reach.abs()", AFAR
    ),
    Fault(
        "the rounding of short edges not multiplied by the offset, for rays in beams",
        _LANES,
        "2.0 * UV_ERROR * size + UNDERFLOW",
        "2.0 * UV_ERROR * size",
        AFAR_BEAMS,
    ),
    Fault(
        "wrong signs not counted, for rays in beams",
        _LANES,
        "T_ERROR * size * size + det",
        "T_ERROR * size * size",
        AFAR_BEAMS,
    ),
    Fault("the f32 test blind behind the origin", _CANDIDATES, "keep_max(-ray.t_min, reach)", "reach", BLOCK),
    Fault(
        "signs that are uncertain in f64 used as they are",
        _VERDICT,
        "f64::from(sign) * error",
        "*w + 0.0 * f64::from(sign)",
        VERDICT,
    ),
    Fault(
        "64 bits trusted with more than they hold",
        "native/geom/src/exact/mod.rs",
        "self.points.count().max(self.direction.count()) <= WORD",
        "self.points.count() <= WORD",
        INTEGERS,
    ),
    Fault("carries lost in fixed point", "native/geom/src/exact/wide.rs", "all >> LIMB", "0", INTEGERS),
    Fault(
        "weights as certain as if the origin were near",
        _VERDICT,
        "(first + size) * size",
        "0.0 * first * (size * size)",
        VERDICT,
    ),
    Fault("distances as certain as if f64 were exact", _VERDICT, "(first * (size * size))", "(0.0 * first)", VERDICT),
    Fault(
        "weights of sixteen rays as certain as if f64 were exact",
        "native/trace/src/verdicts.rs",
        "error * (four * ((first + size) * size))",
        "error * (0.0 * four * first)",
        ("lib", "late::tests"),
    ),
    Fault("distances that are uncertain in f64 used as they are", _VERDICT, "low == high", "low <= high", VERDICT),
    Fault(
        "u and v as certain as if f64 were exact",
        _VERDICT,
        "errors_of_both * inverse.abs() * WEIGHT_SLACK",
        "0.0 * errors_of_both * inverse",
        VERDICT,
    ),
    Fault(
        "products of long differences taken as exact",
        "native/geom/src/exact/short.rs",
        "is_difference(value, p, o) && is_short(value)",
        "is_difference(value, p, o)",
        INTEGERS,
    ),
    Fault("the ends of the interval left out", _VERDICT, "high < span[0]", "high <= span[0]", ENDS),
    Fault("boxes without their error bound", "native/trace/src/slabs.rs", "-shift + ray.slack[k]", "-shift", ALL),
    Fault(
        "cell boundaries of the sorted grid on the wrong side",
        "native/builders/src/grid_order.rs",
        "at.ceil() - 1.0",
        "at.floor()",
        ("lib", "grid_order::tests"),
    ),
    Fault(
        "turned boxes without their error bound",
        "native/single/src/objects/obb.rs",
        "inv.abs() * pad",
        "inv.abs() * splat(0.0)",
        ("lib", "objects::obb::tests"),
    ),
    Fault(
        "oblique planes crossed at the soonest where they are left",
        "native/single/src/objects/slanted.rs",
        "slabs.latest(direction, near)",
        "slabs.soonest(direction, near)",
        ALL,
    ),
    Fault(
        "triangles beyond the oblique plane of their node",
        "native/builders/src/slanted.rs",
        "around(below, k).1",
        "around(below, k).1.next_down().next_down()",
        ALL,
    ),
    Fault(
        "cubes that a triangle touches rejected",
        "native/geom/src/overlap.rs",
        "low > limit",
        "low > 0.99 * limit",
        ("lib", "overlap::tests"),
    ),
    Fault(
        "triangles that are not finite kept",
        "native/scene/src/triangles.rs",
        "v.as_flattened().iter().map(|x| x * 0.0).sum::<f32>() == 0.0",
        "true",
        ("lib", "triangles::tests"),
    ),
    Fault(
        "of equally near triangles the larger number",
        "native/nearest/src/verdict.rs",
        "self.id.cmp(&other.id)",
        "other.id.cmp(&self.id)",
        ("lib", "tests::the_nearer_triangle_is_that_of_integers"),
    ),
    Fault(
        "boxes at the distance of the nearest triangle skipped",
        "native/nearest/src/closest.rs",
        "entry.least > reach",
        "entry.least >= 0.999 * reach",
        ("lib", "tests::the_tree_finds_what_a_comparison_of_all_triangles_finds"),
    ),
    Fault(
        "a squared distance certain where it is not",
        "native/nearest/src/span.rs",
        "DOT_ERROR * size * largest(direction)",
        "-0.001 * least",
        ("lib", "tests::the_nearer_triangle_is_that_of_integers"),
    ),
    Fault(
        "triangles in one plane never meet",
        "native/nearest/src/meeting.rs",
        "inside || (0..3).any(|k| shadows_meet([p, q], self.edge(k), plane))",
        "inside && plane[0] > 2",
        ("lib", "tests::triangles_meet_as_integers_decide"),
    ),
    Fault(
        "boxes that touch are apart",
        "native/nearest/src/overlap.rs",
        "a.min[k] <= b.max[k] && b.min[k] <= a.max[k]",
        "a.min[k] < b.max[k] && b.min[k] < a.max[k]",
        ("lib", "tests::all_overlaps_are_found"),
    ),
    Fault(
        "odd rays in packets with others",
        "native/group/src/packet/fill.rs",
        "ordinary.to_bitmask() & filled",
        "filled",
        PACKETS,
    ),
    Fault(
        "triangles skipped that some rays of a packet see edge-on",
        _PREPARE,
        "(one_sided & (outside | beyond))",
        "(outside | beyond)",
        PACKETS,
    ),
    Fault(
        "packets that look no farther than their middle",
        _PREPARE,
        "(det + det_half).mul_add(far, doubt)",
        "(det - det_half).mul_add(far, doubt)",
        PACKETS,
    ),
    Fault("uncertain steps along ropes", "native/papers/src/rope.rs", "ahead[k].low > next.high", "true", ALL),
    Fault(
        "heights of points without their error bound",
        "native/papers/src/ta_b_poly.rs",
        "frame.oblique_pad + wild",
        "0.0 * frame.oblique_pad",
        ALL,
    ),
    Fault(
        "planes along projected directions without their error bound",
        "native/papers/src/projected.rs",
        "pad * inverse.abs()",
        "splat(0.0) * inverse.abs()",
        ALL,
    ),
    Fault(
        "cells left before it is certain",
        "native/single/src/grid.rs",
        "axes[k].leaves(may[k][0]) < now",
        "true",
        ("grid", "triangles_that_reach_a_corner"),
    ),
    Fault("pending hits forgotten for one at the same distance", _QUERY, "far >= self.held.low", "false", ALL),
    Fault(
        "no allowance for the rounding of pending hits",
        "native/ray/src/frame_ray.rs",
        "high * (PRUNE * PRUNE) + 2.0 * self.last_place",
        "high",
        BLOCK,
    ),
    Fault("sure distances without a far end", _CANDIDATES, "[low[lane], high[lane]]", "[low[lane], low[lane]]", BLOCK),
    Fault("sure hits outside the interval", _QUERY, "low > from && high < to", "low < high", ENDS),
    Fault(
        "boxes of parts rounded inwards",
        "native/builders/src/spatial/parts.rs",
        "self.outwards(part.min[k], -1.0)",
        "part.min[k].next_up()",
        ("lib", "spatial::tests::the_box_of_a_part_is_rounded_outwards"),
    ),
    Fault(
        "triangles cut by oblique planes count for one side only",
        "native/geom/src/oblique_part.rs",
        "high.min(-low) <= self.little",
        "high.max(-low) >= self.little",
        ("lib", "every_point_of_the_triangle_is_in_the_part_on_its_side"),
    ),
    Fault(
        "bounds of a group of rays taken from the nearer origins",
        _BUNDLE,
        "if back { [low, high] } else { [high, low] }",
        "if back { [high, low] } else { [low, high] }",
        PACKETS,
    ),
    Fault(
        "bounds of a group of rays without errors of distances",
        _BUNDLE,
        "axis.slack = slack",
        "axis.slack = 0.0",
        PACKETS,
    ),
    Fault(
        "directions within a wall recognised by the frame's rounded direction",
        "native/stream/src/prepare.rs",
        "map(own.d, |d| f32::from(u8::from(d != 0.0)))",
        "map(own.d, |d| f32::from(u8::from(d.abs() > 1e-44)))",
        ("streams", "a_direction_that_rounds_to_zero_in_the_frame_is_not_in_the_wall"),
    ),
    Fault(
        "the scalar test without bounds on its first weight",
        _SCALAR,
        "u < -errors.uv || rest < -errors.uv",
        "u < 0.0 || rest < 0.0",
        ONE_BY_ONE,
    ),
    Fault(
        "the scalar test without a bound on its distance",
        _SCALAR,
        "t > det * reach + errors.t",
        "t > det * reach",
        ONE_BY_ONE,
    ),
    Fault(
        "the scalar test proves hits by the sign of their weights",
        _SCALAR,
        "u > errors.uv",
        "u > -errors.uv",
        ONE_BY_ONE,
    ),
    Fault(
        "a polygon smaller than its beam",
        "native/polybeam/src/beam.rs",
        "self.polygon.below(&heights, tolerance)",
        "self.polygon.below(&heights, -0.01)",
        ("lib", "tests::each_ray_is_in_one_beam_in_the_cells_on_its_way"),
    ),
    Fault(
        "rays on a line in both parts of a beam",
        "native/polybeam/src/line.rs",
        "self.line.lower_is_first(form, way) == self.lower_first",
        "self.line.lower_is_first(form, way) || !self.lower_first",
        ("lib", "tests::each_ray_is_in_one_beam_in_the_cells_on_its_way"),
    ),
    Fault(
        "shadow rays in the beam of a light that they pass",
        "native/polybeam/src/shadow.rs",
        "off <= self.off",
        "off <= 1e9 * self.off",
        ("lib", "shadow::tests::rays_without_a_light_go_singly"),
    ),
    Fault(
        "rays of a sun that end before they begin",
        _FORM,
        "origin - low",
        "origin - high.min(1.0)",
        ("lib", "shadow::tests::rays_of_a_sun_are_blocked_as_by_all_triangles"),
    ),
    Fault(
        "parallel rays not tested before they leave a cell",
        _FORM,
        "start.mul_add(m[k], r[k]).simd_gt(offset)",
        "start.mul_add(m[k], r[k]).simd_lt(offset)",
        ("lib", "tests::each_parallel_ray_is_in_one_beam_in_the_cells_on_its_way"),
    ),
)
