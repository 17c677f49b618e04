# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a benchmark as tests of its report make them."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from addon.core.measure import costmap

RATE = {
    "n": 64,
    "mrays_s": {"min": 1.9, "med": 2.0, "max": 2.1},
    "times_embree": 0.5,
    "steps": 3.0,
    "tests": 4.0,
    "hits": 1.0,
    "rounds": [2.0] * 7,
    "anchor_rounds": [4.0] * 7,
    "noise": 0.01,
}
ROW: dict[str, Any] = {
    "scene": "room <1>",
    "triangles": 1234,
    "spec": "kd",
    "structure": "kd",
    "table": "chosen",
    "tables": ["chosen"],
    "tree": "kd",
    "label": "kd",
    "nodes": None,
    "ways": None,
    "k": None,
    "alpha": None,
    "seed": None,
    "threads": 1,
    "machine": "here",
    "round_id": "1",
    "anchor": "embree",
    "peak_bytes": 3_000_000,
    "scaling": None,
    "offsets": None,
    "build_s": {"min": 0.1, "med": 0.2, "max": 0.3},
    "bytes": 2_000_000,
    "statistics": {"leaves": 5},
    "rays": {"primary": RATE, "shadow": {**RATE, "mrays_s": None, "times_embree": None, "n": 0, "rounds": []}},
    "errors": {
        "reference": "brute",
        "rays": 100,
        "false_miss": 0,
        "false_hit": 0,
        "wrong_triangle": 0,
        "wrong_values": 0,
        "wrong_any_hit": 0,
        "t_ulp_max": 0,
        "t_ulp_p999": 0,
        "on_boundary": 3,
        "differing_pixels": 0,
    },
    "curve": None,
    "render_s": None,
    "left_out": ["oblique planes: <none>"],
    "too_slow": [],
    "error": None,
}


def row(spec: str, speed: float = 2.0, spread: float = 0.1, **errors: int) -> dict[str, Any]:
    made = copy.deepcopy(ROW)
    made["spec"] = made["tree"] = made["label"] = spec
    primary = made["rays"]["primary"]
    primary["mrays_s"] = {"min": speed - spread, "med": speed, "max": speed + spread}
    primary["rounds"] = [speed + spread * part for part in (-1, -0.6, -0.3, 0, 0.3, 0.6, 1)]
    made["errors"].update(errors)
    return made


def document(rows: list[dict[str, Any]]) -> dict[str, Any]:
    machine = {"processor": "P & Q", "cores": 2, "system": "S", "level": "avx2"}
    return {"schema": 1, "project_version": "0.1.0", "machine": machine, "rows": rows}


def pictured(one: dict[str, Any], seconds: float, spread: float = 0.01, drift: float = 0.0) -> None:
    """Give a row a picture that takes about so long, timed in seven rounds next to kd, which takes ten seconds."""
    pace = [1 + drift * step for step in range(7)]
    rounds = [seconds * (1 + spread * part) for part in (0.3, -1, 1, -0.6, 0, 0.6, -0.3)]
    rounds = [each * slower for each, slower in zip(rounds, pace, strict=True)]
    one["image_s"] = {"min": min(rounds), "med": sorted(rounds)[3], "max": max(rounds)}
    anchors = [10.0 * slower for slower in pace]
    one["image"] = {
        "samples": 16,
        "pixels": 1 << 14,
        "anchor": "kd",
        "rounds_s": rounds,
        "anchor_rounds_s": anchors,
        "noise": 0.01,
    }


def everything(spec: str, slowness: float, k: int | None = None) -> dict[str, Any]:
    """A row with all that can be drawn, of a configuration as fast as it goes."""
    made = row(spec, 2.0 / slowness) | {"table": "fastest", "tables": ["fastest"]}
    made["structure"], made["k"] = spec.partition(":")[0], k
    made["statistics"]["nodes_oblique"] = 7 if spec.startswith(("bsp-", "beam-hh")) else 0
    made["curve"] = [
        {"spp": n, "seconds": slowness * n / 10, "rmse": n**-0.5, "relmse": 1 / n, "flip": 0.1} for n in (1, 4, 16)
    ]
    made["scaling"] = [{"rays": n, "seconds": slowness * n / 1e6} for n in (64, 256, 1024)]
    made["offsets"] = [
        {"offset": offset, "rays": 100, "false_miss": 0, "wrong": 0, "false_miss_unguarded": 1, "wrong_unguarded": 2}
        for offset in (0.0, 10.0, 1e6)
    ]
    made["map"] = costmap.packed(np.full((16, 24), 10 * slowness, np.float32))
    rate = made["rays"]["primary"]
    made["rays"]["primary"] = {
        **rate,
        "steps_axis": 10 * slowness,
        "steps_oblique": 0.0,
        "steps_boxes": 0.0,
        "tests": 3.0,
    }
    return made
