# SPDX-License-Identifier: GPL-3.0-or-later
"""The ray sets: where they start, where they go, and that they depend on nothing but the seed."""

from __future__ import annotations

import halfspace_native
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.core.scene import grid, rays
from addon.core.scene.workload import View, Workload

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def room() -> Workload:
    """A floor and a wall, seen from above; the sky is free."""
    corners = [[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0], [-4, 4, 3], [4, 4, 3]]
    triangles = [[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]]
    view = View(np.array([0.5, -6.0, 3.0]), np.array([0.0, 0.0, 0.5]), UP, 50.0)
    return Workload("room", np.array(corners, np.float32), np.array(triangles, np.int32), view)


def make(workload: Workload, seed: int = 1, names: tuple[str, ...] = rays.NAMES) -> dict[str, rays.RaySet]:
    tracer = halfspace_native.build(workload.vertices, workload.triangles, "brute")
    return {r.name: r for r in rays.make(workload, tracer, size=(64, 32), seed=seed, names=names)}


def test_tiles_hold_eight_by_eight_neighbouring_pixels() -> None:
    order = rays.tile_order(24, 16)
    assert sorted(order) == list(range(24 * 16))
    for tile in order.reshape(-1, 64):
        y, x = np.divmod(tile, 24)
        assert (np.ptp(x), np.ptp(y)) == (7, 7)
        assert np.array_equal(tile, np.sort(tile)), "row by row inside a tile"
    assert order[64] == 8, "tiles go row by row from the top left"


def test_primary_rays_cover_the_view(room: Workload) -> None:
    primary = make(room)["primary"]
    assert primary.order == "tile8"
    np.testing.assert_allclose(np.linalg.norm(primary.directions, axis=1), 1.0, rtol=1e-6)
    right, up, forward = room.view.axes()
    depth = primary.directions @ forward
    tangent = np.tan(np.radians(25.0))
    y, x = (primary.directions @ up) / depth, (primary.directions @ right) / depth
    # Pixel centres lie half a pixel inside the frame, which is twice as wide as high.
    assert y.max() == pytest.approx(tangent * (1 - 1 / 32), rel=1e-5)
    assert x.max() == pytest.approx(2 * tangent * (1 - 1 / 64), rel=1e-5)
    # The first ray is that of the top left pixel.
    assert y[0] == pytest.approx(y.max())
    assert x[0] == pytest.approx(x.min())


def test_some_rows_of_tiles_have_the_rays_that_they_have_among_all(room: Workload) -> None:
    tracer = halfspace_native.build(room.vertices, room.triangles, "kd")
    size, rows = (64, 32), np.array([1, 3])
    whole, some = (
        rays.make(room, tracer, size=size, seed=1, names=("primary", "shadow", "diffuse"), rows=given)
        for given in (None, rows)
    )
    kept = np.concatenate([np.arange(8 * 64) + 8 * 64 * row for row in rows])
    np.testing.assert_array_equal(some[0].directions, whole[0].directions[kept])
    # Rays from the surface begin at hits of those pixels.
    assert {tuple(origin) for origin in some[1].origins} <= {tuple(origin) for origin in whole[1].origins}
    assert 0 < len(some[1]) == len(some[2]) <= len(kept)


def test_secondary_rays_leave_the_surface_on_the_side_of_the_viewer(room: Workload) -> None:
    sets = make(room)
    brute = halfspace_native.build(room.vertices, room.triangles, "brute")
    seen = int((brute.closest(sets["primary"].origins, sets["primary"].directions).triangle >= 0).sum())
    assert 0 < seen < len(sets["primary"])
    for name in ("shadow", "diffuse", "shuffled"):
        assert len(sets[name]) == seen
    offset = rays.OFFSET * room.diagonal()
    origins = sets["diffuse"].origins
    on_floor = origins[:, 2] < 2 * offset
    np.testing.assert_allclose(origins[on_floor, 2], offset, rtol=1e-3)
    np.testing.assert_allclose(origins[~on_floor, 1], 4 - offset, rtol=1e-6)
    assert (sets["diffuse"].directions[on_floor, 2] > 0).all()


def test_bounces_are_cosine_weighted() -> None:
    corners = np.array([[-99, -99, 0], [99, -99, 0], [0, 99, 0]], np.float32)
    view = View(np.array([0.0, 0.0, 5.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]), 60.0)
    floor = Workload("floor", corners, np.array([[0, 1, 2]], np.int32), view)
    tracer = halfspace_native.build(floor.vertices, floor.triangles, "brute")
    diffuse = rays.make(floor, tracer, size=(256, 256), seed=3, names=["diffuse"])[0]
    # Mean of cos is 2/3, of cos² 1/2; 65,536 samples give ± 0.001 and ± 0.0012.
    cosine = diffuse.directions[:, 2].astype(np.float64)
    assert cosine.mean() == pytest.approx(2 / 3, abs=0.004)
    assert (cosine**2).mean() == pytest.approx(1 / 2, abs=0.005)
    assert abs(diffuse.directions[:, :2].mean()) < 0.005


def test_shadow_rays_end_just_before_one_light(room: Workload) -> None:
    shadow = make(room)["shadow"]
    assert shadow.any_hit
    ends = shadow.origins + shadow.directions * (shadow.t_max / (1 - rays.SHORT_OF_LIGHT))[:, None]
    np.testing.assert_allclose(ends, np.broadcast_to(ends[0], ends.shape), atol=1e-4)
    tracer = halfspace_native.build(room.vertices, room.triangles, "brute")
    assert not tracer.occluded(shadow.origins, shadow.directions, t_max=shadow.t_max).all()


def test_shuffled_are_the_diffuse_rays_in_another_order(room: Workload) -> None:
    sets = make(room)
    rows = [np.concatenate([sets[n].origins, sets[n].directions], axis=1) for n in ("diffuse", "shuffled")]
    assert not np.array_equal(*rows)
    assert np.array_equal(*(np.unique(row, axis=0) for row in rows))


def test_the_seed_decides_and_nothing_else(room: Workload) -> None:
    first, second, other = make(room, 1), make(room, 1), make(room, 2)
    for name in rays.NAMES:
        assert np.array_equal(first[name].directions, second[name].directions)
    assert np.array_equal(first["shadow"].directions, other["shadow"].directions)
    assert not np.array_equal(first["diffuse"].directions, other["diffuse"].directions)


def test_further_sets_go_where_their_categories_say(room: Workload) -> None:
    sets = make(room, names=rays.ALL)
    assert list(sets) == list(rays.ALL)
    brute = halfspace_native.build(room.vertices, room.triangles, "brute")
    primary, lift = sets["primary"], rays.OFFSET * room.diagonal()
    seen = brute.closest(primary.origins, primary.directions).triangle >= 0
    # Ambient rays are short, and begin where diffuse rays do.
    ambient = sets["ambient"]
    assert ambient.any_hit
    assert np.array_equal(ambient.origins, sets["diffuse"].origins)
    assert np.allclose(ambient.t_max, rays.AMBIENT * room.diagonal())
    assert not np.array_equal(ambient.directions, sets["diffuse"].directions)
    # A later bounce begins at what the one before hits.
    found = brute.closest(sets["diffuse"].origins, sets["diffuse"].directions)
    hit = found.triangle >= 0
    assert 0 < len(sets["fourth"]) < len(sets["second"]) == hit.sum() < seen.sum()
    ends = sets["diffuse"].origins[hit] + found.t[hit, None] * sets["diffuse"].directions[hit]
    np.testing.assert_allclose(np.linalg.norm(sets["second"].origins - ends, axis=1), lift, atol=2e-6)
    # Rays behind a hit go on without meeting it again.
    behind = sets["behind"]
    assert len(behind) == seen.sum()
    assert set(map(tuple, behind.directions)) <= set(map(tuple, primary.directions))
    below = behind.origins[:, 2] < 0
    assert below.any()
    assert (brute.closest(behind.origins[below], behind.directions[below]).triangle < 0).all()
    # Long rays begin on the bounding box.
    low, high = room.bounds()
    onto = np.abs(np.stack([sets["long"].origins - low, sets["long"].origins - high]))
    np.testing.assert_allclose(onto.min(axis=(0, 2)), 0, atol=1e-6)
    assert len(sets["long"]) == len(primary)


def test_coplanar_rays_lie_in_the_plane_of_a_triangle(room: Workload) -> None:
    flat = make(room, names=("coplanar",))["coplanar"]
    floor, wall = np.abs(flat.directions[:, 2]) == 0, np.abs(flat.directions[:, 1]) == 0
    assert (floor | wall).all()
    # Triangles are chosen by area: the floor has 64 of 88 units.
    assert floor.mean() == pytest.approx(64 / 88, abs=0.04)
    assert (flat.origins[floor, 2] == 0).all()


def test_a_set_does_not_depend_on_the_others_that_are_made(room: Workload) -> None:
    whole = make(room, names=rays.ALL)
    for name in rays.ALL:
        (alone,) = make(room, names=(name,)).values()
        assert rays.fingerprint([alone]) == rays.fingerprint([whole[name]])


def test_only_the_named_sets_are_made_and_a_view_of_nothing_gives_empty_ones(room: Workload) -> None:
    assert list(make(room, names=("diffuse", "primary"))) == ["primary", "diffuse"]
    away = View(np.array([0.0, 0.0, 9.0]), np.array([0.0, 1.0, 20.0]), UP, 20.0)
    sets = make(Workload("away", room.vertices, room.triangles, away), names=rays.ALL)
    assert {name: len(one) for name, one in sets.items() if len(one)} == dict.fromkeys(
        ("primary", "long", "coplanar"), 64 * 32
    )


def test_rejects_sizes_that_are_no_tiles(room: Workload) -> None:
    with pytest.raises(ValueError, match="multiples of 8"):
        rays.make(room, None, size=(60, 64), seed=1, names=["primary"])


@given(count=st.integers(0, 5000), wanted=st.integers(1, 6000), seed=st.integers(0, 99))
def test_blocks_are_whole_and_ascending(count: int, wanted: int, seed: int) -> None:
    indices = rays.blocks(count, wanted, seed)
    assert (np.diff(indices) > 0).all()
    assert len(indices) >= min(wanted, count // 64 * 64 or count)
    if len(indices):
        assert indices[0] >= 0
        assert indices[-1] < count
    if wanted < count and count >= 64:
        assert (indices.reshape(-1, 64) % 64 == np.arange(64)).all()


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_frames_are_orthonormal(vector: tuple[float, float, float]) -> None:
    normal = np.array([vector]) / np.linalg.norm(vector)
    first, second = rays.frames(normal)
    basis = np.concatenate([first, second, normal])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-12)


def test_the_grid_has_every_inner_wall_twice_and_rays_inside_them() -> None:
    workload = grid.workload(boxes=3, rays=8000)
    assert len(workload.triangles) == 27 * 12
    walls = workload.extra[0]
    assert len(walls) == 8000
    assert np.isfinite(walls.origins).all()
    assert walls.directions.any(axis=1).all()
    along = (walls.directions == 0).sum(axis=1) == 2
    assert along.mean() > 0.3
    assert np.signbit(walls.directions[walls.directions == 0]).any(), "negative zeros too"
    lattice = walls.origins == np.round(walls.origins)
    assert (along & (lattice.sum(axis=1) >= 2)).mean() > 0.1
    brute = halfspace_native.build(workload.vertices, workload.triangles, "brute")
    answers = brute.closest(walls.origins, walls.directions)
    edge = (answers.triangle >= 0) & ((answers.u == 0) | (answers.v == 0) | (answers.u + answers.v == 1))
    assert edge.mean() > 0.2


def test_the_same_is_drawn_on_all_machines_without_a_deadline(pytestconfig: pytest.Config) -> None:
    assert settings().deadline is None
    assert settings().derandomize or pytestconfig.getoption("--hypothesis-profile") == "search"
