# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer through its Python face: images against closed forms, and jobs."""

import gc
import math
import threading
import time
from pathlib import Path

import halfspace_native as native
import numpy as np
import pytest

from tests.kinds import KINDS
from tests.render_scenes import FLOOR, MATTE, POINT, camera, finish, image, placed, scene, settings

TASKS = Path("/proc/self/task")
"""The threads of this process, where the system lists them."""


def test_point_light_has_cycles_brightness():
    job = finish(native.render(scene(), camera(), settings()))
    expected = 0.8 / math.pi * np.array([100.0, 50.0, 0.0]) / (4 * math.pi) / 4
    rgba = image(job).mean(axis=0)
    np.testing.assert_allclose(rgba[:3], expected, rtol=1e-4, atol=1e-7)
    assert rgba[3] == 1.0


def test_structures_and_threads_agree_bit_for_bit():
    def render(spec, threads):
        passes = ["Combined", "Depth", "Normal", "Position"]
        how = settings(width=80, height=40, passes=passes, max_bounces=3)
        lit = scene(spec, world={"color": (0.1, 0.2, 0.3)})
        job = finish(native.render(lit, camera(window=(-10, 10, -5, 5)), how, threads=threads))
        return b"".join(image(job, name, 3200).tobytes() for name in passes)

    reference = render("brute", 1)
    for spec in KINDS:
        assert render(spec, 3) == reference, spec


def test_beams_of_mirrors_are_the_same_in_all_structures():
    # A mirror as floor below a matte square, which the picture shows twice.
    square = FLOOR[0] * np.float32(0.1) + np.float32([0, 0, 2])
    vertices = np.concatenate([FLOOR[0], square])
    triangles = np.concatenate([FLOOR[1], FLOOR[1] + 4])
    mirror = {"metallic": 1.0, "roughness": 0.0, "base_color": (1, 1, 1)}
    tilted = np.float64([[1, 0, 0, 0], [0, 0.8, -0.6, -6], [0, 0.6, 0.8, 8], [0, 0, 0, 1]])
    view = camera(kind="perspective", to_world=tilted, window=(-0.5, 0.5, -0.5, 0.5))

    def render(spec, beams):
        made = native.RenderScene(
            native.build(vertices, triangles, spec),
            materials=[mirror, MATTE],
            material_index=np.int32([0, 0, 1, 1]),
            lights=[POINT | {"to_world": placed(z=5)}],
            world={"color": (0.5, 0.6, 0.7)},
        )
        how = settings(width=64, height=64, integrator="whitted", max_bounces=3, secondary_beams=beams)
        job = finish(native.render(made, view, how))
        return image(job, pixels=64 * 64), job.statistics

    single, none = render("brute", beams=False)
    assert (none["beams"], none["rays_beams"], none["beam_deviation"]) == (0, 0, 0.0)
    reference, statistics = render("brute", beams=True)
    assert statistics["beams"] == 0, "brute force traces no tiles"
    assert np.abs(reference - single).mean() < 1e-3 * single.mean()
    for spec in KINDS:
        picture, statistics = render(spec, beams=True)
        assert picture.tobytes() == reference.tobytes(), spec
        assert 0 < statistics["beam_deviation"] < 1e-5
        assert statistics["rays_beams"] <= statistics["rays_secondary"]
    picture, statistics = render("kd", beams=True)
    assert statistics["beams"] > 0
    assert statistics["rays_beams"] > 0.9 * statistics["rays_secondary"]


def test_passes_and_statistics():
    names = ["Combined", "Depth", "Normal", "Position", "Traversal Steps", "Triangle Tests", "Sample Count"]
    job = finish(native.render(scene(), camera(), settings(passes=names)))
    assert job.passes == dict(zip(names, (4, 1, 3, 3, 1, 1, 1), strict=True))
    assert np.all(np.abs(image(job, "Depth") - 8) < 1e-5)
    assert np.all(image(job, "Normal") == [0, 0, 1])
    assert np.all(image(job, "Sample Count") == 4)
    assert image(job, "Triangle Tests").mean() >= 1
    statistics = job.statistics
    assert statistics["rays_primary"] == 8 * 4 * 4 == statistics["rays_shadow"]
    assert statistics["rays_secondary"] == 0, "no ray after the last bounce could find light"
    assert statistics["tests"] == image(job, "Triangle Tests").sum() * 4
    uncounted = finish(native.render(scene(), camera(), settings()))
    assert uncounted.statistics["steps"] is None
    assert job.finished
    assert not job.cancelled
    assert job.progress == 1.0
    assert job.samples_done == 4


def test_rays_are_recorded_by_kind():
    def render(limit, threads=1):
        how = settings(width=80, height=40, max_bounces=2, record_rays=limit)
        job = finish(native.render(scene(world={"color": (0.1, 0.2, 0.3)}), camera(), how, threads=threads))
        return job.recorded(), job.statistics

    kinds, statistics = render(1 << 16, threads=2)
    assert list(kinds)[:3] == ["camera", "shadow 0", "diffuse 1"]
    assert kinds["camera"]["traced"] == statistics["rays_primary"] == len(kinds["camera"]["origins"])
    assert sum(kind["traced"] for name, kind in kinds.items() if "shadow" in name) == statistics["rays_shadow"]
    assert [kind["any"] for kind in kinds.values()] == ["shadow" in name for name in kinds]
    for name, few in render(30)[0].items():
        every = kinds[name]
        assert few["traced"] == every["traced"]
        for key in ("origins", "directions", "t_min", "t_max"):
            assert few[key].dtype == np.float32
            np.testing.assert_array_equal(few[key], every[key][:30])
    assert not render(0)[0]
    with pytest.raises(native.SpecError, match="record_rays"):
        render((1 << 16) + 1)


@pytest.mark.parametrize(
    ("hidden", "bounces", "depth", "light", "sky"),
    [
        ((), 1, 4, 0, 0),
        (("camera",), 1, 8, 0, 0),
        (("camera", "shadow"), 1, 8, 1, 0),
        (("camera", "diffuse"), 1, 8, 0, 1),
        (("camera", "glossy", "transmission"), 1, 8, 0, 0),
        (("camera", "shadow", "diffuse"), 1, 8, 1, 1),
    ],
)
def test_rays_pass_what_is_hidden_from_them(hidden, bounces, depth, light, sky):
    vertices = np.concatenate([FLOOR[0] * 999, FLOOR[0] * 999 + np.float32([0, 0, 4])])
    triangles = np.concatenate([FLOOR[1], FLOOR[1] + 4])
    black = {"base_color": (0, 0, 0), "specular": 0.0, "hidden_from": hidden}
    made = native.RenderScene(
        native.build(vertices, triangles, "kd"),
        materials=[MATTE, black],
        material_index=np.int32([0, 0, 1, 1]),
        lights=[POINT | {"to_world": placed(z=6), "power": (1, 1, 1)}],
        world={"color": (1, 1, 1)},
    )
    passes = ["Combined", "Depth"]
    job = finish(native.render(made, camera(), settings(max_bounces=bounces, samples=64, passes=passes)))
    assert np.allclose(image(job, "Depth"), depth, atol=1e-4)
    lit = 0.8 / math.pi / (4 * math.pi) / 36
    np.testing.assert_allclose(image(job)[:, :3].mean(), light * lit + sky * 0.8, rtol=1e-3, atol=1e-6)


def test_lights_and_the_world_reach_what_they_are_visible_to():
    round_light = POINT | {"radius": 0.3}
    shiny = {"base_color": (0, 0, 0), "specular": 0.5, "roughness": 0.5}

    def brightness(material, hidden):
        made = scene(materials=[material], lights=[round_light | {"hidden_from": hidden}])
        return image(finish(native.render(made, camera(), settings(samples=256)))).mean()

    for material, kind, other in ((MATTE, "diffuse", "glossy"), (shiny, "glossy", "diffuse")):
        seen = brightness(material, ("camera",))
        assert brightness(material, ("camera", other)) == pytest.approx(seen, rel=0.02)
        assert brightness(material, ("camera", kind)) == pytest.approx(0.25, abs=1e-6), "alpha alone"
    downwards = camera(kind="perspective", to_world=placed(z=5), window=(-0.01, 0.01, -0.01, 0.01))
    for hidden, seen in (((), True), (("camera",), False)):
        made = scene(lights=[round_light | {"hidden_from": hidden}])
        floor = finish(native.render(made, downwards, settings()))
        without = 0.8 / math.pi * 100 / (4 * math.pi) / 4
        assert (image(floor)[:, 0].min() > 2 * without) == seen
    for hidden, value in (((), 1.0), (("camera",), 0.0)):
        sky = {"color": (1, 1, 1), "hidden_from": hidden}
        away = camera(to_world=placed(z=-8))
        job = finish(native.render(scene(world=sky), away, settings()))
        assert np.all(image(job)[:, :3] == value)
    with pytest.raises(native.SpecError, match="hidden_from"):
        scene(materials=[{"hidden_from": ("everyone",)}])


def test_border_and_rows_from_the_bottom():
    wide = camera(window=(-4, 4, -2, 2))
    full = image(finish(native.render(scene(), wide, settings(passes=["Position"]))), "Position")
    assert full[0, 1] < full[-1, 1], "the first row is the bottom one"
    part = finish(native.render(scene(), wide, settings(passes=["Position"], border=(2, 1, 7, 3))))
    np.testing.assert_array_equal(image(part, "Position", 10).reshape(2, 5, 3), full.reshape(4, 8, 3)[1:3, 2:7])


def test_left_out_says_why():
    lines = scene(lights=[]).left_out
    assert "shadow rays: no lights" in lines
    assert "refraction: no material transmits" in lines
    glass = scene(materials=[MATTE | {"transmission": 1.0}]).left_out
    assert not any("refraction" in line or "shadow rays" in line for line in glass)


def test_cancel_stops_a_render_that_would_take_hours():
    job = native.render(scene(), camera(), settings(width=2000, height=2000, samples=100_000))
    until = time.monotonic() + 300
    while job.progress == 0 and time.monotonic() < until:
        assert not job.wait(100)
    job.cancel()
    assert job.wait(300_000)
    assert job.cancelled
    assert job.finished
    assert job.error is None
    assert 0 < job.progress < 1
    assert np.isfinite(image(job, pixels=4_000_000)).all()


def test_waiting_lets_other_python_threads_run():
    job = native.render(scene(), camera(), settings(width=2000, height=2000, samples=100_000))
    ticks, enough = [], threading.Event()

    def tick():
        while not enough.is_set():
            ticks.append(time.sleep(0.01))

    ticker = threading.Thread(target=tick)
    ticker.start()
    grown = []
    for _ in range(10):
        before = len(ticks)
        job.wait(100)
        grown.append(len(ticks) - before)
    enough.set()
    ticker.join()
    # With the lock held throughout a wait, at most one tick can fall between two looks.
    assert max(grown) >= 2


@pytest.mark.skipif(not TASKS.is_dir(), reason="this system does not list a process's threads")
def test_a_deleted_job_stops_and_takes_its_threads_along():
    before = len(list(TASKS.iterdir()))
    job = native.render(scene(), camera(), settings(width=2000, height=2000, samples=100_000), threads=2)
    assert len(list(TASKS.iterdir())) > before
    del job
    gc.collect()
    assert len(list(TASKS.iterdir())) == before


def test_copying_while_rendering_gives_means_at_any_time():
    job = native.render(scene(), camera(), settings(width=400, height=400, samples=60))
    expected = 0.8 / math.pi * 100 / (4 * math.pi) / 4
    while not job.wait(5):
        red = image(job, pixels=160_000)[:, 0]
        done = red[red != 0]
        np.testing.assert_allclose(done, expected, rtol=1e-4)
    assert job.samples_done == 60


def test_a_glowing_surface_and_a_background_map_are_sampled_and_exact():
    # A closed form for each: the irradiance below a wide glowing ceiling, and below half a white sky.
    ceiling = FLOOR[0] + np.array([0, 0, 1e-2], np.float32)
    vertices = np.concatenate([FLOOR[0], ceiling])
    triangles = np.concatenate([FLOOR[1], FLOOR[1] + 4])
    structure = native.build(vertices, triangles)
    glow = {"closures": [{"kind": "emission", "emission": (2.0, 1.0, 0.5)}]}
    numbers = np.array([0, 0, 1, 1], np.int32)
    made = native.RenderScene(structure, materials=[MATTE, glow], material_index=numbers, lights=[])
    below = camera(to_world=placed(z=5e-3), clip_start=1e-4)
    job = finish(native.render(made, below, settings(samples=256)))
    np.testing.assert_allclose(image(job).mean(axis=0)[:3], 0.8 * np.array([2.0, 1.0, 0.5]), rtol=0.02)
    assert job.statistics["rays_shadow"] > 0

    half = [
        {"op": "coordinate", "kind": "generated"},
        {"op": "channel", "args": [0], "channel": 0},
        {"op": "math", "kind": "GREATER_THAN", "args": [1, 0.0, 0.0]},
    ]
    world = {"color": (0, 0, 0), "program": half, "radiance": 2}
    job = finish(native.render(scene(lights=[], world=world), camera(), settings(samples=256)))
    np.testing.assert_allclose(image(job).mean(axis=0)[:3], 0.4, rtol=0.02)
    assert job.statistics["rays_shadow"] > 0


def test_many_lights_shine_as_much_as_one():
    # The power of one light in a thousand, all at its position or around it.
    def brightness(count, spread):
        places = np.random.default_rng(3).uniform(-spread, spread, (count, 2))
        lights = [POINT | {"to_world": placed(x, y, 2), "power": np.full(3, 100.0 / count)} for x, y in places]
        job = finish(native.render(scene(lights=lights), camera(), settings(samples=1024)))
        return image(job).mean()

    one = brightness(1, 0)
    assert brightness(1000, 1e-3) == pytest.approx(one, rel=2e-3)
    assert brightness(33, 1e-3) == pytest.approx(one, rel=2e-3)


def test_integrators_do_what_they_say():
    path = image(finish(native.render(scene(), camera(), settings()))).mean(axis=0)
    whitted = image(finish(native.render(scene(), camera(), settings(integrator="whitted")))).mean(axis=0)
    np.testing.assert_allclose(whitted, path, rtol=1e-6)
    open_sky = image(finish(native.render(scene(), camera(), settings(integrator="ao")))).mean(axis=0)
    np.testing.assert_array_equal(open_sky, 1)
    roof = np.concatenate([FLOOR[0], FLOOR[0] + np.array([0, 0, 1], np.float32)])
    structure = native.build(roof, np.concatenate([FLOOR[1], FLOOR[1] + 4]))
    made = native.RenderScene(structure, materials=[MATTE], lights=[POINT])
    below = camera(to_world=placed(z=0.5), clip_start=1e-3)
    for distance, expected in ((0.5, 1.0), (2.0, 0.25), (math.inf, 0.0)):
        asked = settings(integrator="ao", ambient_distance=distance, samples=1024)
        seen = image(finish(native.render(made, below, asked)))[:, :3].mean()
        assert seen == pytest.approx(expected, abs=0.02), distance
    with pytest.raises(ValueError, match="ambient_distance"):
        native.render(scene(), camera(), settings(integrator="ao", ambient_distance=0.0))
