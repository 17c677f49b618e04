# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python package for users of NumPy: lists, tensors, single rays, pickles, files, monitors."""

from __future__ import annotations

import copy
import pickle
import sys
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import halfspace_native
import numpy as np
import pytest

from addon.lab.commands import export
from scripts import package_python

RNG = np.random.default_rng(5)
VERTICES = RNG.random((300, 3), np.float32)
TRIANGLES = np.arange(300, dtype=np.int32).reshape(-1, 3)
ORIGIN, DIRECTION = (0.5, 0.5, -1.0), (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def halfspace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The package as it is staged for the wheel, imported under its own name."""
    folder = tmp_path_factory.mktemp("staged")
    package_python.stage(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        other = {name: sys.modules.pop(name) for name in list(sys.modules) if name.split(".")[0] == "halfspace"}
        import halfspace  # type: ignore[import-not-found]

        yield halfspace
        for name in [name for name in sys.modules if name.split(".")[0] == "halfspace"]:
            del sys.modules[name]
        sys.modules.update(other)


class Tensor:
    """An array of another library, of which NumPy knows the protocol DLPack alone."""

    def __init__(self, values: Any) -> None:
        self._values = np.array(values)

    def __dlpack__(self, **options: Any) -> Any:
        """The array itself."""
        return self._values.__dlpack__(**options)

    def __dlpack_device__(self) -> Any:
        """The CPU."""
        return self._values.__dlpack_device__()


@pytest.mark.parametrize(
    ("vertices", "triangles"),
    [
        (VERTICES, TRIANGLES),
        (VERTICES.tolist(), TRIANGLES.tolist()),
        (VERTICES.astype(np.float64), TRIANGLES.astype(np.uint16)),
        (VERTICES.astype(">f8"), TRIANGLES.astype(">i8")),
        (np.asfortranarray(VERTICES), TRIANGLES[::-1][::-1]),
        (Tensor(VERTICES), Tensor(TRIANGLES)),
    ],
    ids=["arrays", "lists", "kinds", "bytes swapped", "strides", "tensors"],
)
def test_triangles_of_any_kind_make_the_same_tree(halfspace: Any, vertices: Any, triangles: Any) -> None:
    made = halfspace.build(vertices, triangles, "kd")
    whole = halfspace_native.build(VERTICES, TRIANGLES, "kd")
    assert isinstance(made, halfspace.Structure)
    assert repr(made) == repr(whole) == f"<Structure kd: 100 triangles, {whole.statistics['bytes']} bytes>"
    assert all(np.array_equal(made.export()[name], values) for name, values in whole.export().items())


@pytest.mark.parametrize("kind", [list, np.float16, np.float64, np.int64, Tensor])
def test_one_origin_serves_all_rays_and_one_ray_is_one(halfspace: Any, kind: Any) -> None:
    made, whole = halfspace.build(VERTICES, TRIANGLES), halfspace_native.build(VERTICES, TRIANGLES)
    directions = RNG.integers(-3, 4, (20, 3))
    given = kind(directions.tolist()) if kind in (list, Tensor) else directions.astype(kind)
    origin = kind([0, 0, 0]) if kind in (list, Tensor) else np.zeros(3, kind)
    many = whole.closest(np.zeros((20, 3)), directions.astype(np.float64), 0.5, 3.0)
    hits = made.closest(origin, given, t_min=0.5, t_max=[3] * 20, counters=True)
    assert (hits.t.tobytes(), hits.triangle.tolist()) == (many.t.tobytes(), many.triangle.tolist())
    assert set(hits.counters) == set(whole.closest(np.zeros((1, 3)), np.ones((1, 3)), counters=True).counters or ())
    # One direction serves all origins, in every call.
    starts = RNG.random((7, 3)) - [0, 0, 1]
    flat = np.broadcast_to(np.array(DIRECTION), (7, 3)).copy()
    assert made.occluded(starts, DIRECTION).tolist() == whole.occluded(starts, flat).tolist()
    assert made.count_hits(starts, DIRECTION).tolist() == whole.count_hits(starts, flat).tolist()
    assert made.all_hits(starts, DIRECTION)[1].t.tobytes() == whole.all_hits(starts, flat)[1].t.tobytes()
    assert made.closest(ORIGIN, DIRECTION).t.shape == (1,)
    masked = made.occluded(ORIGIN, DIRECTION, triangle_mask=[0] * 100, ray_mask=1)
    assert masked.tolist() == [False]
    assert len(made.closest([], []).t) == 0


def test_what_is_no_array_is_refused_in_one_sentence(halfspace: Any) -> None:
    made = halfspace.build(VERTICES, TRIANGLES)
    for call, said in (
        (lambda: halfspace.build([[0, 0, "a"]], [[0, 1, 2]]), "vertices: expected numbers, got <U"),
        (lambda: halfspace.build([[0, 0, 1], [1]], [[0, 1, 2]]), "vertices: cannot be read as an array: "),
        (lambda: halfspace.build(VERTICES, [[0.0, 1, 2]]), "triangles: expected whole numbers, got float64"),
        (lambda: made.closest([1, 2], [3, 4]), "origins: expected an"),
        (lambda: made.closest([ORIGIN] * 2, [DIRECTION] * 3), "directions: expected one per origin, 2, got 3"),
        (lambda: made.closest(ORIGIN, DIRECTION, triangle_mask=[-1] * 100), "triangle_mask: expected whole numbers of"),
        (lambda: made.closest(ORIGIN, DIRECTION, triangle_mask=[0.5] * 100), "triangle_mask: expected whole numbers"),
    ):
        with pytest.raises(halfspace.ShapeError, match=said):
            call()


def test_points_overlaps_refits_and_instances_take_what_the_package_made(halfspace: Any) -> None:
    made = halfspace.build(VERTICES.tolist(), TRIANGLES.tolist(), "bvh-sah")
    whole = halfspace_native.build(VERTICES, TRIANGLES, "bvh-sah")
    at = np.array([[0.1, 0.2, 0.3]])
    assert made.closest_points([0.1, 0.2, 0.3]).distance == whole.closest_points(at).distance
    assert made.points_within([0.1, 0.2, 0.3], 0.3)[0].tolist() == whole.points_within(at, 0.3)[0].tolist()
    assert made.overlaps(made).tolist() == whole.overlaps(whole).tolist()
    moved = made.refit((VERTICES + 1).tolist())
    assert moved.statistics["refits"] == 1
    assert pickle.loads(pickle.dumps(moved)).statistics["refits"] == 0
    both = halfspace.build_instances([made], [0, 0], [np.eye(4)[:3].tolist()] * 2)
    assert len(both) == both.statistics["instances"] == 2
    assert both.closest(ORIGIN, DIRECTION).t == whole.closest(np.array([ORIGIN]), np.array([DIRECTION])).t


@pytest.mark.parametrize("spec", ["kd", "bvh-sah:width=4", "octree-net", "kd:lazy=1"])
def test_a_tree_is_the_same_after_a_pickle_and_a_file(halfspace: Any, tmp_path: Path, spec: str) -> None:
    made = halfspace.build(VERTICES, TRIANGLES, spec)
    made.save(tmp_path / "tree.npz")
    assert copy.deepcopy(made) is copy.copy(made) is made, "it cannot change"
    for again in (pickle.loads(pickle.dumps(made)), halfspace.load_structure(tmp_path / "tree.npz")):
        assert again.spec == made.spec
        assert "lazy=1" in spec or all(
            np.array_equal(again.export()[name], values) for name, values in made.export().items()
        )


def test_an_archive_of_the_command_is_a_tree(halfspace: Any, tmp_path: Path) -> None:
    assert export.main(["grid", "--structure", "bsp-wn-plus-kd:k=3", "--out", str(tmp_path / "a.npz")]) == 0
    assert halfspace.load_structure(tmp_path / "a.npz").spec == "bsp-wn-plus-kd:k=3"


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"format": np.array(9)}, "its format is 9, and this version reads 1"),
        ({"planes": np.zeros((1, 4))}, "planes is not that of kd over its triangles: it was changed"),
        ({"spec": np.array("oak")}, "unknown structure 'oak'"),
        ({"scene_triangles": np.array([[0, 1, 900]], np.int32)}, "triangles"),
        ({"children": None}, "the key 'children' is missing: it is no archive of a tree"),
        (None, "cannot be read as .npz: it is no NumPy archive"),
    ],
)
def test_a_file_that_was_changed_is_refused_with_a_reason(
    halfspace: Any, tmp_path: Path, changed: dict[str, Any] | None, said: str
) -> None:
    path = tmp_path / "tree.npz"
    halfspace.build(VERTICES, TRIANGLES).save(path)
    with np.load(path) as file:
        found = {**file, **(changed or {})}
    if changed is None:
        path.write_bytes(b"nothing")
    else:
        np.savez(path, **{name: values for name, values in found.items() if values is not None})
    with pytest.raises(halfspace.WorkloadError) as caught:
        halfspace.load_structure(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


def test_progress_is_reported_and_its_errors_end_the_build(halfspace: Any) -> None:
    count = 100_000
    vertices, triangles = RNG.random((3 * count, 3), np.float32), np.arange(3 * count).reshape(-1, 3)
    seen: list[float] = []
    halfspace.build(vertices, triangles, threads=1, progress=seen.append)
    assert seen[-1] == 1.0
    assert seen == sorted(seen)

    def stop(_: float) -> None:
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        halfspace.build(vertices, triangles, threads=1, progress=stop)
    with pytest.raises(ValueError, match="expected no monitor"):
        halfspace.build(vertices, triangles, monitor=halfspace.Monitor(), progress=stop)
    assert not [one for one in threading.enumerate() if one.name == "halfspace-progress"]


def test_a_monitor_ends_the_work_of_its_block(halfspace: Any) -> None:
    with halfspace.Monitor() as monitor:
        made = halfspace.build(VERTICES, TRIANGLES, monitor=monitor)
        assert (monitor.progress, monitor.cancelled) == (1.0, False)
        made.closest(ORIGIN, DIRECTION, monitor=monitor)
    assert monitor.cancelled
    for work in (lambda: halfspace.build(VERTICES, TRIANGLES, monitor=monitor), lambda: _long(made, monitor)):
        with pytest.raises(halfspace.Cancelled):
            work()


def _long(made: Any, monitor: Any) -> None:
    made.closest(ORIGIN, RNG.random((5000, 3)), monitor=monitor)


def test_the_wheel_of_the_native_module_carries_its_types() -> None:
    folder = Path(halfspace_native.__file__ or "").parent
    assert {"py.typed", "__init__.pyi"} <= {path.name for path in folder.iterdir()}
    for wheel in (package_python.ROOT / "build" / "wheel").glob("*.whl"):
        with zipfile.ZipFile(wheel) as archive:
            assert {"halfspace_native/py.typed", "halfspace_native/__init__.pyi"} <= set(archive.namelist())
