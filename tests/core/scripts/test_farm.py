# SPDX-License-Identifier: GPL-3.0-or-later
"""Recipes for farms: the job array of Slurm and the job type of Flamenco give the commands that they should."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import environment
import pytest
from sweep_runs import table

from addon.core.base import native
from addon.core.structures import specs
from addon.lab.commands import bench

FARM = environment.ROOT / "scripts" / "farm"

SMALLEST = ["grid", "--structures", "kd-median:leaf_size=1..5,traversal=dir", "--size", "8x8", "--repeats", "1"]
SMALLEST += ["--seconds", "0.1", "--check-rays", "64", "--curve", "none", "--only-rays"]
"""A sweep of five rows over a built-in scene."""


@pytest.mark.skipif(shutil.which("bash") is None or os.name == "nt", reason="Slurm's scripts need bash")
class TestSlurm:
    """scripts/farm/sweep.sbatch, with the variables that Slurm sets for a task."""

    def task(self, index: int, **more: str) -> subprocess.CompletedProcess[str]:
        variables = {**os.environ, "SLURM_ARRAY_TASK_ID": str(index), "BENCH": "echo bench", **more}
        words = ["bash", str(FARM / "sweep.sbatch"), "a b.ply", "--structures", "kd"]
        return subprocess.run(words, env=variables, capture_output=True, text=True, check=False)

    @pytest.mark.parametrize(
        ("first", "step", "indices"), [(1, 1, [1, 2, 3]), (0, 1, [0, 1, 2]), (5, 5, [5, 10, 15])], ids=str
    )
    def test_the_tasks_of_an_array_are_the_parts_of_a_sweep(self, first: int, step: int, indices: list[int]) -> None:
        array = {"SLURM_ARRAY_TASK_MIN": str(first), "SLURM_ARRAY_TASK_STEP": str(step), "SLURM_ARRAY_TASK_COUNT": "3"}
        for part, index in enumerate(indices, 1):
            done = self.task(index, **array, OUT="here")
            assert done.stdout == f"bench a b.ply --structures kd --shard {part}/3 --out here/part-{part}\n", (
                done.stderr
            )
            asked = bench.parser().parse_args(done.stdout.split()[1:])
            assert bench.read_shard(asked).name == f"{part}-of-3"

    def test_the_parts_of_an_array_merge_to_the_rows_of_a_single_run(self, tmp_path: Path) -> None:
        # The recipe takes words without spaces; the folder of the clone may contain one.
        command = f"{os.path.relpath(sys.executable, environment.ROOT)} scripts/bench.py"
        array = {"SLURM_ARRAY_TASK_MIN": "1", "SLURM_ARRAY_TASK_MAX": "3", "SLURM_ARRAY_TASK_COUNT": "3"}
        for index in ("1", "2", "3"):
            given = {**array, "SLURM_ARRAY_TASK_ID": index, "BENCH": command, "OUT": str(tmp_path / "sweep")}
            done = subprocess.run(
                ["bash", "scripts/farm/sweep.sbatch", *SMALLEST],
                cwd=environment.ROOT,
                env={**os.environ, **given},
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
        parts = sorted(map(str, (tmp_path / "sweep").iterdir()))
        assert [len(list(Path(part).glob("rows*.jsonl"))) for part in parts] == [1, 1, 1]
        assert bench.main([*parts, "--merge", "--out", str(tmp_path / "merged")]) == 0
        assert bench.main([*SMALLEST, "--out", str(tmp_path / "single")]) == 0
        single = table(tmp_path / "single")
        assert len(single) == 5
        assert table(tmp_path / "merged") == single
        # Without one part the rows are not whole.
        assert bench.main([*parts[:2], "--merge", "--out", str(tmp_path / "two")]) != 0

    def test_without_an_array_it_is_said(self) -> None:
        done = self.task(1)
        assert done.returncode != 0
        assert "submit with --array=1-N" in done.stderr

    def test_slurm_finds_its_options_before_the_first_command(self) -> None:
        lines = (FARM / "sweep.sbatch").read_text(encoding="utf-8").splitlines()
        commands = [number for number, line in enumerate(lines) if line and not line.startswith("#")]
        options = [number for number, line in enumerate(lines) if line.startswith("#SBATCH ")]
        assert lines[0] == "#!/bin/bash"
        assert len(options) >= 4
        assert max(options) < min(commands)


STUBS = """
const author = {
    Task: (name, type) => {
        if (!name.trim() || !type.trim()) throw "author.Task(name, type): name and type are required";
        return { name, type, commands: [], addCommand(command) { this.commands.push(command); } };
    },
    Command: (name, parameters) => ({ name, parameters }),
};
const frameChunker = (text, size) => {
    if (size < 1) throw `invalid chunk size, must be positive number: ${size}`;
    const frames = new Set();
    for (const part of text.replaceAll("..", "-").split(",")) {
        const [first, last = first] = part.split("-").map((word) => /^ *[0-9]+ *$/.test(word) ? Number(word) : NaN);
        if (isNaN(first) || isNaN(last)) throw `invalid range "${text}": ${part}`;
        for (let frame = first; frame <= last; frame++) frames.add(frame);
    }
    const sorted = [...frames].sort((a, b) => a - b), chunks = [];
    for (let i = 0; i < sorted.length; i += size) {
        const ranges = [];
        for (const frame of sorted.slice(i, i + size)) {
            const range = ranges.at(-1);
            if (range && range[1] === frame - 1) range[1] = frame; else ranges.push([frame, frame]);
        }
        chunks.push(ranges.map(([a, b]) => b > a + 1 ? `${a}-${b}` : b > a ? `${a},${b}` : `${a}`).join(","));
    }
    return chunks;
};
const tasks = [];
const settings = JSON.parse(process.argv[2]);
"""
"""What Flamenco's manager gives to a job type; its runs of two frames are "1,2", longer ones "1-3"."""

TASKS = [
    ({"frames": "1-4"}, [("render-1-3", "1..3"), ("render-4", "4")]),
    ({"frames": "3, 5-10, 47"}, [("render-3,5,6", "3,5,6"), ("render-7-9", "7..9"), ("render-10,47", "10,47")]),
    ({"frames": "1..4", "chunk_size": 2}, [("render-1,2", "1,2"), ("render-3,4", "3,4")]),
]
"""Settings, and the tasks and frames that the manager of Flamenco 3.9-beta1 made of them with the script."""


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
class TestFlamenco:
    """scripts/farm/halfspace_render.js, run by node."""

    def compiled(self, folder: Path, **settings: Any) -> subprocess.CompletedProcess[str]:
        script = (FARM / "halfspace_render.js").read_text(encoding="utf-8")
        end = "compileJob({ settings, addTask: (t) => tasks.push(t) }); console.log(JSON.stringify(tasks));"
        (folder / "job.js").write_text(STUBS + script + end, encoding="utf-8")
        usual = {"blendfile": "a.blend", "frames": "1-4", "chunk_size": 3, "format": "PNG", "scene": "Scene"}
        given = json.dumps({**usual, "render_output_path": "out/######", "structure": "", "samples": 0, **settings})
        return subprocess.run(["node", str(folder / "job.js"), given], capture_output=True, text=True, check=False)

    @pytest.mark.parametrize(("settings", "expected"), TASKS, ids=str)
    def test_each_chunk_of_frames_is_a_task_with_the_engine(
        self, tmp_path: Path, settings: dict[str, Any], expected: list[tuple[str, str]]
    ) -> None:
        tasks = json.loads(self.compiled(tmp_path, **settings).stdout)
        parameters = [task["commands"][0]["parameters"] for task in tasks]
        assert [(task["name"], task["type"]) for task in tasks] == [(name, "blender") for name, _ in expected]
        assert all([command["name"] for command in task["commands"]] == ["blender-render"] for task in tasks)
        assert parameters[0] == {
            "exe": "{blender}",
            "exeArgs": "{blenderArgs}",
            "argsBefore": [],
            "blendfile": "a.blend",
            "args": [
                *("--engine", "HALFSPACE", "--scene", "Scene", "--render-output", "out/######"),
                *("--render-format", "PNG", "--render-frame", expected[0][1]),
            ],
        }
        assert [each["args"][-1] for each in parameters] == [frames for _, frames in expected]

    def test_structure_and_samples_are_set_before_the_frames(self, tmp_path: Path) -> None:
        tasks = json.loads(self.compiled(tmp_path, structure="octree-net:leaf_size=4", samples=16).stdout)
        arguments = tasks[0]["commands"][0]["parameters"]["args"]
        expression = arguments[arguments.index("--python-expr") + 1]
        compile(expression, "expression", "exec")
        assert "use_spec(spec='octree-net:leaf_size=4')" in expression
        assert "group.samples = 16" in expression
        assert arguments.index("--python-expr") < arguments.index("--render-frame")

    def test_the_structures_of_the_description_exist(self) -> None:
        script = (FARM / "halfspace_render.js").read_text(encoding="utf-8")
        named = re.search(r"such as (\S+) or (\S+);", script)
        assert named is not None
        module = native.load()
        for spec in named.groups():
            assert specs.expand(spec, module.structures(), {}, []) == [spec]
            specs.prove(module, [spec])

    @pytest.mark.parametrize(
        ("settings", "line"),
        [
            ({"structure": "kd'); import os#"}, "structure: expected an id with key=value pairs"),
            ({"frames": "x"}, 'invalid range "x"'),
        ],
        ids=str,
    )
    def test_what_is_no_structure_and_what_are_no_frames_is_refused(
        self, tmp_path: Path, settings: dict[str, str], line: str
    ) -> None:
        done = self.compiled(tmp_path, **settings)
        assert done.returncode != 0
        assert line in done.stderr
