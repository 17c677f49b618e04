# SPDX-License-Identifier: GPL-3.0-or-later
"""The deliberate faults that `mutations.py` puts into the sources, each with the test that must notice it."""

from __future__ import annotations

from fault import AFAR, AFAR_BEAMS, ALL, BEAMS, BLOCK, ENDS, EXACT, INTEGERS, STABILITY, VERDICT, Fault
from faults_of_pictures import PICTURES, SURFACES
from faults_of_traversals import TRAVERSALS

_FRAME = "native/ray/src/frame.rs"
_RAY = "native/ray/src/ray.rs"
_CANDIDATES = "native/leaf/src/candidates/mod.rs"
_VERDICT = "native/geom/src/verdict.rs"
_MONITOR = "native/base/src/monitor.rs"

_REFIT = ("refit", "moved_triangles_are_hit_as_brute_force_hits_them")
"""Fits of every hierarchy to moved triangles."""

FAULTS = (
    Fault("plane distances without their error bound", _FRAME, "self.robust * slack", "0.0 * slack", ALL),
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
        ("contract", "distances_that_round_to_zero_are_hits_at_zero"),
    ),
    Fault(
        "the far child first",
        "native/nodes/src/planes/plane_tree.rs",
        "signs.wrapping_shr(link) & 1",
        "!signs.wrapping_shr(link) & 1",
        ALL,
    ),
    Fault("ties to the larger number", _RAY, "self.triangle < other.triangle", "self.triangle > other.triangle", EXACT),
    Fault("an infinite distance is a hit", _RAY, "t.abs() < f32::INFINITY", "!t.is_nan()", EXACT),
    Fault(
        "hits beyond the interval count",
        _RAY,
        "t <= self.t_max",
        "!t.is_nan()",
        ENDS,
    ),
    Fault(
        "one kind of octree link wrong",
        "native/nodes/src/octants/octree_nodes.rs",
        "self.node(node.parent()).children() + across",
        "self.node(node.parent()).children() + node.octant()",
        ALL,
    ),
    Fault(
        "octree traversals stop before the last cell",
        "native/trace/src/single/octants/step.rs",
        "next[axis] == grid.size",
        "next[axis] + 1 >= grid.size",
        ALL,
    ),
    Fault(
        "the empty child marked on the wrong side",
        "native/nodes/src/planes/plane_tree.rs",
        "EMPTY << (slot & 1)",
        "EMPTY << (1 - (slot & 1))",
        ALL,
    ),
    Fault(
        "triangles in the split plane lost",
        "native/builders/src/sweep/mod.rs",
        "min < at || max <= at",
        "min < at",
        ALL,
    ),
    Fault(
        "bins of a sweep skipped that hold the cheapest plane",
        "native/builders/src/sweep/bins.rs",
        "(starts[bin] + planar[bin]) as f32",
        "(starts[bin + 1] + planar[bin + 1]) as f32",
        ("lib", "sweep::tests"),
    ),
    Fault(
        "triangles cut to the wrong side of a cell",
        "native/geom/src/clip.rs",
        "bounds.max[k].min(round_up(high))",
        "bounds.max[k].min(round_up(0.5 * (low + high)))",
        ("lib", "clip::tests"),
    ),
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
        "native/leaf/src/lanes.rs",
        "2.0 * UV_ERROR * size + UNDERFLOW",
        "2.0 * UV_ERROR * size",
        AFAR_BEAMS,
    ),
    Fault(
        "wrong signs not counted, for rays in beams",
        "native/leaf/src/lanes.rs",
        "T_ERROR * size * size + det",
        "T_ERROR * size * size",
        AFAR_BEAMS,
    ),
    Fault("the f32 test blind behind the origin", _CANDIDATES, "keep_max(-ray.t_min, reach)", "reach", BLOCK),
    Fault(
        "signs that are uncertain in f64 used as they are",
        _VERDICT,
        "!settle_signs(o, d, v, &mut w, errors.weight)",
        "false",
        VERDICT,
    ),
    Fault(
        "128 bits trusted with more than they hold",
        "native/geom/src/exact/mod.rs",
        "2 * points + direction <= SIGN_PLACES",
        "2 * points <= SIGN_PLACES",
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
        "native/trace/src/tile/verdict.rs",
        "error * (four * ((first + size) * size))",
        "error * (0.0 * four * first)",
        ("lib", "late::tests"),
    ),
    Fault(
        "cut triangles lost where many are split at once",
        "native/builders/src/sides.rs",
        "joined.cut.extend(part.cut);",
        "joined.cut.truncate(part.cut.len());",
        ("lib", "plane_objects::tests::many_objects"),
    ),
    Fault("distances that are uncertain in f64 used as they are", _VERDICT, "low == high", "low <= high", VERDICT),
    Fault("the ends of the interval left out", _VERDICT, "high < span[0]", "high <= span[0]", ENDS),
    Fault(
        "boxes without their error bound",
        "native/trace/src/slabs.rs",
        "-shift + ray.slack[k]",
        "-shift",
        ALL,
    ),
    Fault(
        "cell boundaries of the sorted grid on the wrong side",
        "native/builders/src/grid_order.rs",
        "at.ceil() - 1.0",
        "at.floor()",
        ("lib", "grid_order::tests"),
    ),
    Fault(
        "turned boxes without their error bound",
        "native/trace/src/single/objects/obb.rs",
        "inv.abs() * splat(ray.oblique_pad)",
        "inv.abs() * splat(0.0)",
        ("lib", "single::objects::obb::tests"),
    ),
    Fault(
        "oblique planes crossed at the soonest where they are left",
        "native/trace/src/single/objects/slanted.rs",
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
        "pixels hidden before one plane given up",
        "native/trace/src/beam/planes/mod.rs",
        "open != piece.pixels",
        "false",
        BEAMS,
    ),
    Fault(
        "pixels of a cut beam lost",
        "native/trace/src/beam/planes/leaf.rs",
        "!outside",
        "outside",
        BEAMS,
    ),
    Fault(
        "shadow beams past the upper half of each cell",
        "native/trace/src/beam/shaft_tree.rs",
        "!u64::from(empty)",
        "1",
        ("beams", "shadow_beams_answer_like_single_rays_and_mostly_at_once"),
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
        ("lib", "scene::tests"),
    ),
    Fault(
        "the memory limit never met",
        _MONITOR,
        "used.saturating_add(bytes)",
        "0 * used",
        ("contract", "a_build_beyond_its_memory_is_refused"),
    ),
    Fault(
        "a cancelled build goes on",
        _MONITOR,
        "self.cancelled.load(Ordering::Relaxed)",
        "false",
        ("contract", "a_cancelled_build_ends_with_an_error"),
    ),
    Fault(
        "wrong triangles not counted",
        "addon/core/measure/accuracy.py",
        "wrong_triangle=int(other.sum())",
        "wrong_triangle=0",
        STABILITY,
    ),
    Fault(
        "other u and v taken for equal",
        "lab/stability/trials.py",
        "(a.u, b.u), (a.v, b.v)",
        "(a.u, a.u), (b.v, b.v)",
        STABILITY,
    ),
    Fault(
        "distances not compared",
        "lab/stability/stability.py",
        '(*COUNTS[1:], "t_ulp_max", "exact_wrong", "exact_t_ulp_max")',
        '(*COUNTS[1:], "exact_wrong")',
        STABILITY,
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
        "triangles that share a vertex overlap",
        "native/nearest/src/overlap.rs",
        "one.meets_beyond(i, other, j)",
        "one.meets(other) || i > j + 3",
        ("lib", "tests::neighbours_of_one_surface_overlap_only_in_further_points"),
    ),
    Fault(
        "a hit at the given distance left out",
        "distribution/halfspace/bvhtree.py",
        "distances <= limit",
        "distances < limit",
        ("tests/core/structures/test_bvhtree.py", "limits_are_closed"),
    ),
    Fault(
        "tests of the leaf of the hit taken for vain ones",
        "addon/core/inspector/reasons.py",
        "path.triangle not in table.triangles_of(step.node)",
        "len(table.triangles_of(step.node))",
        ("tests/core/inspector/test_replay.py", "work_in_vain"),
    ),
    Fault(
        "the time of the call left in that of the rays",
        "addon/core/inspector/ray_costs.py",
        "np.maximum(best - call, 0.0)",
        "np.maximum(best, 0.0)",
        ("tests/core/inspector/test_worst_rays.py", "less_that_of_the_call"),
    ),
    Fault(
        "reports written in place",
        "addon/core/report/results.py",
        'tempfile.mkstemp(dir=path.parent, prefix=path.name + ".")',
        "(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), str(path))",
        ("tests/core/scripts/test_faults.py", "full_disk"),
    ),
    Fault(
        "the image of a mirror's eye in the mirror",
        "native/render/src/path/beams/source.rs",
        "moved * height",
        "0.5 * moved * height",
        ("lib", "beams::source::tests::a_mirror_has_the_eye_behind_it"),
    ),
    Fault(
        "the ratio of the indices turned over",
        "native/render/src/path/beams/source.rs",
        "f64::from(eta) - 1.0",
        "1.0 / f64::from(eta) - 1.0",
        ("lib", "beams::source::tests::a_boundary_scales_the_height_of_the_eye"),
    ),
    Fault(
        "folded polygons count as flat",
        "native/render/src/path/beams/polygons.rs",
        "self.height(v).abs() <= FLAT * size",
        "self.height(v).abs() <= size",
        ("lib", "beams::polygons::tests::quads_are_one_polygon_and_cubes_are_six"),
    ),
    Fault(
        "normals in the cluster that is farthest",
        "native/trees/src/bsp/means.rs",
        "cosine > best.1",
        "cosine < best.1 || best.1 == f64::NEG_INFINITY",
        ("lib", "means::tests::centres_of_separate_clusters_are_their_means"),
    ),
    Fault(
        "a triangle more than the thesis draws",
        "native/trees/src/bsp/normals.rs",
        "wanted.min(n)",
        "(wanted + 1).min(n)",
        ("lib", "normals::tests::the_thesis_draws_triangles_and_not_normals"),
    ),
    Fault(
        "drift since the last fit instead of the build",
        "addon/core/session/refits.py",
        'DRIFT * statistics["sah_cost_built"]',
        'DRIFT * before.statistics["sah_cost"]',
        ("tests/core/session/test_refits.py", "cost_of_the_build"),
    ),
    Fault(
        "boxes that never grow at their lower ends",
        "native/nodes/src/boxes/box_tree.rs",
        "fitted.low(k)",
        "fitted.low(k).max(self.bounds[k][lane])",
        _REFIT,
    ),
    Fault(
        "the triangles of moved leaves not written",
        "native/leaf/src/members.rs",
        "self.keep.write(words, scene, frame, ids)",
        "()",
        _REFIT,
    ),
    Fault(
        "a fit that begins with the nodes of the last one",
        "native/trees/src/refit.rs",
        "self.template.clone()",
        "layers.tree.clone()",
        ("refit", "triangles_that_were_lost_for_a_while_are_found_again"),
    ),
    Fault(
        "a triangle that appears is in no leaf",
        "native/trees/src/refit.rs",
        "scene.live().iter().copied().find(|&id| !held[id as usize])",
        "None",
        ("refit", "what_cannot_be_fitted_is_refused_with_its_reason"),
    ),
    *TRAVERSALS,
    *SURFACES,
    *PICTURES,
)


def table() -> str:
    """The list, as Markdown."""
    lines = [
        "# Deliberate faults",
        "",
        "Made by `python scripts/dev/mutations.py --write`. Each of these faults is put into the sources by",
        "`python scripts/dev/mutations.py`, and the test beside it must fail.",
        "",
        "| # | fault | file | what is written | instead of | noticed by |",
        "| ---: | --- | --- | --- | --- | --- |",
    ]
    for number, fault in enumerate(FAULTS, 1):
        cells = (
            f"`{fault.file}`",
            *(f"`{text}`".replace("|", "\\|") for text in (fault.new, fault.old)),
            f"`{fault.test[0]}`, `{fault.test[1]}`",
        )
        lines.append(f"| {number} | {fault.what} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
