# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees as files: NumPy alone walks them, and finds what brute force finds."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.lab.commands import export
from addon.lab.export import trees
from tests.kinds import KINDS

PAGE = Path(__file__).resolve().parents[3] / "docs" / "trees.md"
RAYS = 40
FAR = np.array([300.0, -20.0, 7.0])
"""Position of the scene: a frame that is not led back to the scene's would show."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A soup of two hundred triangles, away from the origin."""
    rng = np.random.default_rng(3)
    corners = FAR + rng.normal(size=(200, 1, 3)) + 0.3 * rng.normal(size=(200, 3, 3))
    path = tmp_path_factory.mktemp("scene") / "soup.npz"
    np.savez(
        path,
        vertices=corners.reshape(-1, 3).astype(np.float32),
        triangles=np.arange(600, dtype=np.int32).reshape(-1, 3),
        camera_eye=FAR + np.array([0.0, -5.0, 1.0]),
        camera_target=FAR,
        camera_up=np.array([0.0, 0.0, 1.0]),
        camera_vfov_deg=np.float64(45.0),
    )
    return path


@pytest.fixture(scope="module")
def rays() -> tuple[Any, Any]:
    rng = np.random.default_rng(4)
    origins = (FAR + 4.0 * rng.normal(size=(RAYS, 3))).astype(np.float32)
    return origins, (FAR + rng.normal(size=(RAYS, 3)) - origins).astype(np.float32)


def interval(tree: Any, node: int, origin: Any, direction: Any) -> tuple[float, float]:
    """The distances between which a ray is inside a node's region, with some tolerance."""
    low, high = tree["node_bounds"][node].reshape(2, 3)
    walls = tree["walls"][tree["wall_offsets"][node] : tree["wall_offsets"][node + 1]]
    normals = np.vstack([np.eye(3), -np.eye(3), walls[:, :3]])
    heights = np.concatenate([high, -low, walls[:, 3]]) + 1e-4
    rates, gaps = normals @ direction, heights - normals @ origin
    with np.errstate(divide="ignore", invalid="ignore"):
        at = gaps / rates
    if (gaps[rates == 0] < 0).any():
        return np.inf, -np.inf
    return max(0.0, at[rates < 0].max(initial=0.0)), at[rates > 0].min(initial=np.inf)


def hits(tree: Any, chosen: Any, origin: Any, direction: Any) -> Any:
    """Distances of a ray to triangles, inf where it misses them (Möller and Trumbore 1997)."""
    corners = tree["scene_vertices"].astype(np.float64)[tree["scene_triangles"][chosen]]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (first * p).sum(axis=1)
        s = origin - corners[:, 0]
        q = np.cross(s, first)
        u, v, t = ((s * p).sum(axis=1) * inverse, (q @ direction) * inverse, (second * q).sum(axis=1) * inverse)
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0), t, np.inf)


def nearest(tree: Any, origin: Any, direction: Any) -> tuple[int, float, int]:
    """The nearest triangle, its distance, and the number of leaves visited."""
    stack, best, found, leaves = [0], np.inf, -1, 0
    while stack:
        node = stack.pop()
        enter, leave = interval(tree, node, origin, direction)
        if enter > min(leave, best):
            continue
        if tree["node_kind"][node] != trees.LEAF:
            stack += tree["children"][tree["child_offsets"][node] : tree["child_offsets"][node + 1]].tolist()
            continue
        leaves += 1
        chosen = tree["triangles"][tree["triangle_offsets"][node] : tree["triangle_offsets"][node + 1]]
        for triangle, t in zip(chosen, hits(tree, chosen, origin, direction), strict=True):
            if t < best or (t == best and triangle < found):
                best, found = float(t), int(triangle)
    return found, best, leaves


@pytest.mark.parametrize("spec", KINDS)
def test_numpy_walks_the_tree_and_finds_the_hits_of_brute_force(
    spec: str, scene: Path, rays: tuple[Any, Any], tmp_path: Path
) -> None:
    out = tmp_path / "tree.npz"
    assert export.main([str(scene), "--structure", spec, "--threads", "1", "--out", str(out)]) == 0
    with np.load(out, allow_pickle=False) as file:
        tree = dict(file)
    brute = native.build(tree["scene_vertices"], tree["scene_triangles"], "brute", threads=1)
    expected = brute.closest(*rays, threads=1)
    assert 0.2 < (expected.triangle >= 0).mean() < 1.0
    visited = []
    for number, (origin, direction) in enumerate(zip(*rays, strict=True)):
        found, t, leaves = nearest(tree, origin.astype(np.float64), direction.astype(np.float64))
        assert found == expected.triangle[number]
        assert t == pytest.approx(float(expected.t[number]), rel=1e-6)
        visited.append(leaves)
    leaves = int((tree["node_kind"] == trees.LEAF).sum())
    assert leaves < 20 or np.mean(visited) < leaves / 2, "regions bound their rays"


def test_the_page_describes_every_array(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "tree.npz"
    assert export.main([str(scene), "--structure", "bsp-wn", "--out", str(out)]) == 0
    with np.load(out, allow_pickle=False) as file:
        tree = dict(file)
    described = dict(re.findall(r"^\| `(\w+)` \| [^|]* \| (\w+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    types = {key: "text" if value.dtype.kind == "U" else str(value.dtype) for key, value in tree.items()}
    assert described == types
    # Counts agree with each other, and with the structure's own statistics.
    count = len(tree["node_kind"])
    for key in ("child", "plane", "wall", "triangle"):
        assert len(tree[f"{key}_offsets"]) == count + 1
        assert (np.diff(tree[f"{key}_offsets"].astype(np.int64)) >= 0).all()
    assert len(tree["children"]) == count - 1 == tree["child_offsets"][-1]
    assert tree["node_parent"][tree["children"]].min() >= 0
    structure = native.build(tree["scene_vertices"], tree["scene_triangles"], str(tree["spec"]), threads=1)
    assert (tree["node_kind"] == trees.LEAF).sum() == structure.statistics["leaves"]
    assert len(tree["triangles"]) == structure.statistics["references"]
    assert (tree["node_kind"] == 3).any(), "oblique planes"
    assert str(tree["scene"]) == "soup"


def test_the_same_tree_is_the_same_file(scene: Path, tmp_path: Path) -> None:
    one, other = tmp_path / "one.npz", tmp_path / "other.npz"
    for out, threads in ((one, "1"), (other, "2")):
        assert export.main([str(scene), "--threads", threads, "--out", str(out)]) == 0
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--structure", "octopus", "--out", "o.npz"], "octopus"),
        (["--out", "o.npy"], "expected a name that ends in .npz"),
        (["--threads", "-1", "--out", "o.npz"], "--threads: expected 0 to 1024"),
        ([], "--out"),
    ],
)
def test_bad_usage_is_one_line(
    scene: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str], monkeypatch: Any, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert export.main([str(scene), *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("export: ")
    assert words in line
    assert list(tmp_path.iterdir()) == []
