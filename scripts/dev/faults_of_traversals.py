# SPDX-License-Identifier: GPL-3.0-or-later
"""Deliberate faults of packets, single rays, leaves, streams and builds."""

from __future__ import annotations

from fault import ALL, BLOCK, ENDS, PACKETS, Fault

_FRAME_RAY = "native/ray/src/frame_ray.rs"
_QUERY = "native/ray/src/query.rs"
_STREAM = "native/trace/src/stream"
_LAST_BLOCKER = ("shadow_rays", "tiles_and_packets_try_the_last_blocker_first")
_BUNDLE = "native/trace/src/packet/bundle.rs"
_CANDIDATES = "native/leaf/src/candidates/mod.rs"
_SCALAR = "native/leaf/src/scalar/mod.rs"

ONE_BY_ONE = ("lib", "scalar::tests::no_hit_is_ever_rejected_and_proven_hits_are_hits")
"""Leaf tests of one triangle at a time."""
_POLYGONS = "native/polybeam/src"
_OWNED = ("lib", "tests::each_ray_is_in_one_beam_in_the_cells_on_its_way")
_PARALLEL = ("lib", "tests::each_parallel_ray_is_in_one_beam_in_the_cells_on_its_way")
_LIGHTS = ("lib", "shadow::tests::rays_to_lights_are_blocked_as_by_all_triangles")
_SUNS = ("lib", "shadow::tests::rays_of_a_sun_are_blocked_as_by_all_triangles")
_NO_LIGHT = ("lib", "shadow::tests::rays_without_a_light_go_singly")


_COHERENCE = "native/structure/src/coherence.rs"
_FOOTPRINT = "native/structure/src/footprint.rs"

TRAVERSALS = (
    Fault(
        "batches go to kernels for other coherences",
        _COHERENCE,
        "together >= self.limits.packets",
        "together < self.limits.packets",
        ("lib", "coherence::tests::batches_go_to_the_kernel_of_their_coherence"),
    ),
    Fault(
        "the visits that rays join left out of the sample",
        _COHERENCE,
        "counters.iter().map(RayCounters::visits).sum()",
        "counters.iter().map(own).sum()",
        ("lib", "coherence::tests::rays_that_visit_nodes_together_are_counted"),
    ),
    Fault(
        "the size of triangles compared the wrong way",
        _FOOTPRINT,
        "diagonal < self.limit.0 * pitch",
        "diagonal > self.limit.0 * pitch",
        ("lib", "footprint::tests::small_triangles_are_traced_in_packets_and_large_ones_in_tiles"),
    ),
    Fault(
        "pixels measured at the first ray instead of at the hits",
        _FOOTPRINT,
        "t * (b.d[k] - a.d[k])",
        "(b.d[k] - a.d[k])",
        ("lib", "footprint::tests::the_median_distance_and_the_mean_triangle_decide"),
    ),
    Fault(
        "bins without their largest centre",
        "native/builders/src/binned.rs",
        "reach.with(-centre[k])",
        "reach.with(-object.centre(0))",
        ("lib", "binned::tests::the_cost_is_that_of_the_partition"),
    ),
    Fault(
        "boxes united without their last side",
        "native/builders/src/reach.rs",
        "Self([a, b, c, f32::INFINITY, -d, -e, -f, f32::INFINITY])",
        "Self([a, b, c, f32::INFINITY, -d, -e, -e, f32::INFINITY])",
        ("lib", "reach::tests::unions_and_areas_are_those_of_boxes"),
    ),
    Fault(
        "rays of a packet not split by their signs",
        "native/trace/src/packet/rays.rs",
        "*own == signs",
        "true",
        ALL,
    ),
    Fault(
        "odd rays in packets with others",
        "native/trace/src/packet/fill.rs",
        "ordinary.to_bitmask() & filled",
        "filled",
        PACKETS,
    ),
    Fault(
        "triangles skipped that some rays of a packet see edge-on",
        "native/trace/src/packet/prepare.rs",
        "(one_sided & (outside | beyond))",
        "(outside | beyond)",
        PACKETS,
    ),
    Fault(
        "packets that look no farther than their middle",
        "native/trace/src/packet/prepare.rs",
        "(det + det_half).mul_add(far, doubt)",
        "(det - det_half).mul_add(far, doubt)",
        PACKETS,
    ),
    Fault(
        "uncertain steps along ropes",
        "native/trace/src/single/planes/rope.rs",
        "ahead[k].low > next.high",
        "true",
        ALL,
    ),
    Fault(
        "heights of points without their error bound",
        "native/trace/src/single/planes/ta_b_poly.rs",
        "frame.oblique_pad + wild",
        "0.0 * frame.oblique_pad",
        ALL,
    ),
    Fault(
        "planes along projected directions without their error bound",
        "native/trace/src/single/planes/projected.rs",
        "pad * inverse.abs()",
        "splat(0.0) * inverse.abs()",
        ALL,
    ),
    Fault(
        "rays projected onto the first eight directions only",
        "native/trace/src/single/planes/projected.rs",
        "(0..count)",
        "(0..count.min(LANES))",
        ALL,
    ),
    Fault(
        "packets that leave the boxes of intervals where they enter them",
        "native/trace/src/packet/slab_boxes.rs",
        "sides[back ^ 1]",
        "sides[back]",
        ("groups", "rays_that_go_together_answer_like_brute_force"),
    ),
    Fault(
        "tiles that pass by the far half of the boxes of intervals",
        "native/trace/src/tile/slab_boxes.rs",
        "inside.enter > inside.leave",
        "inside.enter > 0.5 * inside.leave",
        ("groups", "tiles_of_a_camera_and_of_a_light_answer_like_brute_force"),
    ),
    Fault(
        "streams that enter the boxes of intervals where they leave them",
        "native/trace/src/stream/slab_boxes.rs",
        "keep_max(near[k] * axis[INV] + axis[NEAR], enter)",
        "keep_max(far[k] * axis[INV] + axis[FAR], enter)",
        ("groups", "rays_that_go_together_answer_like_brute_force"),
    ),
    Fault(
        "cells left before it is certain",
        "native/trace/src/single/grid.rs",
        "axes[k].leaves(may[k][0]) < now",
        "true",
        ("grid", "triangles_that_reach_a_corner"),
    ),
    Fault("pending hits forgotten for one at the same distance", _QUERY, "far >= self.held.low", "false", ALL),
    Fault(
        "no allowance for the rounding of pending hits",
        _FRAME_RAY,
        "high * (PRUNE * PRUNE) + 2.0 * self.last_place",
        "high",
        BLOCK,
    ),
    Fault("sure distances without a far end", _CANDIDATES, "[low[lane], high[lane]]", "[low[lane], low[lane]]", BLOCK),
    Fault("sure hits outside the interval", _QUERY, "low > from && high < to", "low < high", ENDS),
    Fault(
        "triangles that planes cut end at the plane",
        "native/builders/src/sides.rs",
        "parts[1].min[axis] = at",
        "parts[1].min[axis] = parts[1].max[axis]",
        ("plane_boxes", "every_point_of_a_triangle_lies_in_the_box_of_a_leaf_that_holds_it"),
    ),
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
        "rays through boxes reported as rays through planes",
        "native/trees/src/boxes.rs",
        'Plan::single("boxes", "ordered", boxes8(&self.tree, &self.leaves))',
        'Plan::single("planes", "ordered", boxes8(&self.tree, &self.leaves))',
        ("plane_boxes", "all_rays_go_through_the_boxes_and_the_planes_are_freed"),
    ),
    Fault(
        "lists of children written over the list that is split",
        f"{_STREAM}/boxes.rs",
        "first + rays",
        "first",
        ("streams", "batches_of_any_size_answer_like_brute_force"),
    ),
    Fault(
        "groups of a list after the eighth forgotten",
        f"{_STREAM}/boxes.rs",
        "masks.iter().enumerate()",
        "masks[..masks.len().min(8)].iter().enumerate()",
        ("streams", "rays_that_meet_everything_answer_like_brute_force"),
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
        "any-hit packets that lose a ray of each box",
        "native/trace/src/packet/boxes.rs",
        "(entry.link, entry.count, entry.lanes) = (link, count, lanes)",
        "(entry.link, entry.count, entry.lanes) = (link, count, lanes & (lanes - 1))",
        PACKETS,
    ),
    Fault(
        "short lists that meet the boxes of their first ray only",
        f"{_STREAM}/boxes.rs",
        "union(word)",
        "word & 0xff",
        ("streams", "batches_of_any_size_answer_like_brute_force"),
    ),
    Fault(
        "any-hit rays dropped from lists before they end",
        f"{_STREAM}/lists.rs",
        "usize::from(!ended.contains(ray as usize))",
        "usize::from(ended.contains(ray as usize))",
        ("streams", "rays_that_meet_everything_answer_like_brute_force"),
    ),
    Fault(
        "a child left out of the order of likely blockers",
        f"{_STREAM}/order.rs",
        "children.into_iter().enumerate().map(bit).sum()",
        "children.into_iter().enumerate().skip(1).map(bit).sum()",
        ("streams", "batches_of_any_size_answer_like_brute_force"),
    ),
    Fault(
        "all rays of a tile taken as blocked by the last tile's blocker",
        "native/trace/src/tile/shadow/mod.rs",
        "tile.active == [0; R]",
        "true",
        _LAST_BLOCKER,
    ),
    Fault(
        "all rays of a packet taken as blocked by the last packet's blocker",
        "native/trace/src/packet/leaf.rs",
        "lanes & !u64::from(packet.blocked)",
        "lanes & !regular",
        _LAST_BLOCKER,
    ),
    Fault(
        "directions within a wall recognised by the frame's rounded direction",
        f"{_STREAM}/prepare.rs",
        "map(own.d, |d| f32::from(u8::from(d != 0.0)))",
        "map(own.d, |d| f32::from(u8::from(d.abs() > 1e-44)))",
        ("streams", "a_direction_that_rounds_to_zero_in_the_frame_is_not_in_the_wall"),
    ),
    Fault(
        "lists of the children of a plane written over one another",
        f"{_STREAM}/intervals.rs",
        "first + child * room + counts[child]",
        "first + counts[child]",
        ("streams", "batches_of_any_size_answer_like_brute_force"),
    ),
    Fault(
        "all rays of a list crossing an oblique plane upwards",
        "native/trace/src/visits/planes.rs",
        "inv.simd_lt(splat(0.0))",
        "inv.simd_lt(splat(f32::NEG_INFINITY))",
        ("groups", "rays_that_go_together_answer_like_brute_force"),
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
        "the published test hits beyond edges",
        _SCALAR,
        "e.iter().any(|x| *x > 0.0)",
        "e.iter().all(|x| *x > 0.0)",
        ("lib", "scalar::tests::the_published_test_agrees_away_from_edges"),
    ),
    Fault(
        "the second block of a leaf read from the first",
        "native/leaf/src/blocks.rs",
        "first + Self::offset(block) as usize + 1",
        "first + 1",
        ("lib", "scalar::tests::leaves_of_several_blocks_hold_their_triangles"),
    ),
    Fault(
        "planes stored whole all those of the first",
        "native/nodes/src/planes/projected_tree.rs",
        "self.whole[word as usize]",
        "self.whole[(word & 0) as usize]",
        ("oblique", "planes_along_more_directions_than_codes_are_stored_whole"),
    ),
    Fault(
        "clusters that go on after the end of their build",
        "native/trees/src/bsp/means.rs",
        "monitor.check().is_err()",
        "false",
        ("lib", "means::tests::a_cancelled_build_ends_the_rounds"),
    ),
    Fault(
        "edges of a polygon cut in their middle",
        f"{_POLYGONS}/polygon.rs",
        "last_height / (last_height - height)",
        "0.5 + 0.0 * last_height",
        ("lib", "polygon::tests::both_parts_of_a_clipped_polygon_have_its_area"),
    ),
    Fault(
        "a polygon smaller than its beam",
        f"{_POLYGONS}/beam.rs",
        "self.polygon.below(&heights, tolerance)",
        "self.polygon.below(&heights, -0.01)",
        _OWNED,
    ),
    Fault(
        "rays on a line in both parts of a beam",
        f"{_POLYGONS}/line.rs",
        "self.line.lower_is_first(form, way) == self.lower_first",
        "self.line.lower_is_first(form, way) || !self.lower_first",
        _OWNED,
    ),
    Fault(
        "a beam handed on to a larger cell as if it were a small one",
        f"{_POLYGONS}/traversal.rs",
        "beam.low.map(|x| x & !(edge - 1))",
        "beam.low.map(|x| x | (edge & 0))",
        _OWNED,
    ),
    Fault(
        "the last bin of each row of a polygon left out",
        f"{_POLYGONS}/raster.rs",
        "self.first[bin(left)]..self.first[bin(right) + 1]",
        "self.first[bin(left)]..self.first[bin(right)]",
        _OWNED,
    ),
    Fault(
        "rays that end in the first leaf with triangles",
        f"{_POLYGONS}/leaf.rs",
        "done & eight.open",
        "(done | 0xff) & eight.open",
        _OWNED,
    ),
    Fault(
        "shadow rays in the beam of a light that they pass",
        f"{_POLYGONS}/shadow.rs",
        "off <= self.off",
        "off <= 1e9 * self.off",
        _NO_LIGHT,
    ),
    Fault(
        "shadow rays in the beam of a light far behind which they end",
        f"{_POLYGONS}/shadow.rs",
        "(share - 1.0).max(0.0) * size",
        "0.0 * size",
        _NO_LIGHT,
    ),
    Fault(
        "reversed rays that go on from the light, not from their origin",
        f"{_POLYGONS}/leaf.rs",
        "Q::ANY || beam.unbounded || !(octant.form.origin().is_some() || begun)",
        "beam.unbounded || !(octant.form.origin().is_some() || begun)",
        _LIGHTS,
    ),
    Fault(
        "parallel rays compared as if all went through the middle",
        f"{_POLYGONS}/line.rs",
        "(a - r[x]) * m[y]",
        "a * m[y]",
        _PARALLEL,
    ),
    Fault(
        "parallel rays moved along an axis, not along themselves",
        f"{_POLYGONS}/form.rs",
        "from[k] - origin * speed(k)",
        "from[k] + 0.0 * origin * speed(k)",
        _SUNS,
    ),
    Fault(
        "rays of a sun that end before they begin",
        f"{_POLYGONS}/form.rs",
        "origin - low",
        "origin - high.min(1.0)",
        _SUNS,
    ),
    Fault(
        "parallel rays not tested before they leave a cell",
        f"{_POLYGONS}/form.rs",
        "start.mul_add(m[k], r[k]).simd_gt(offset)",
        "start.mul_add(m[k], r[k]).simd_lt(offset)",
        _PARALLEL,
    ),
    Fault(
        "parallel rays that end half way to a hit",
        f"{_POLYGONS}/form.rs",
        "self.interval(self.origin_of(rays, i), [far; 2])",
        "self.interval(self.origin_of(rays, i), [0.5 * far; 2])",
        ("beams", "parallel::rays_pass_all_cells_before_a_hit_far_behind_the_first"),
    ),
    Fault(
        "parallel rays that go on singly from another cell",
        f"{_POLYGONS}/form.rs",
        "(enter - self.origin_of(rays, i)) / self.scale",
        "(enter + 0.1 + self.origin_of(rays, i).abs()) / self.scale",
        _PARALLEL,
    ),
    Fault(
        "a cut of batches that depends on the number of threads",
        "native/trace/src/threads.rs",
        "rays.div_ceil(PARTS)",
        "rays.div_ceil(PARTS.min(wanted(threads)))",
        ("beams", "parallel::counters_do_not_depend_on_the_number_of_threads"),
    ),
)
