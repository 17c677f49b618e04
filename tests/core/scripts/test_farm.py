# SPDX-License-Identifier: GPL-3.0-or-later
"""Recipes for farms: the job array of Slurm and the job type of Flamenco give the commands that they should."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import bench
import environment
import pytest

from addon.core.base import native
from addon.core.structures import specs

FARM = environment.ROOT / "scripts" / "farm"


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
const author = { Task: (name, type) => ({ name, type, commands: [], addCommand(c) { this.commands.push(c); } }),
                 Command: (name, parameters) => ({ name, parameters }) };
const frameChunker = (frames, size) => ["1-3", "4"];
const tasks = [];
const settings = JSON.parse(process.argv[2]);
"""
"""What Flamenco's manager gives to a job type."""


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

    def test_each_chunk_of_frames_is_a_task_with_the_engine(self, tmp_path: Path) -> None:
        tasks = json.loads(self.compiled(tmp_path).stdout)
        assert [task["name"] for task in tasks] == ["render-1-3", "render-4"]
        command = tasks[0]["commands"][0]
        assert command["name"] == "blender-render"
        assert command["parameters"]["blendfile"] == "a.blend"
        arguments = command["parameters"]["args"]
        assert arguments[:4] == ["--engine", "HALFSPACE", "--scene", "Scene"]
        assert arguments[-2:] == ["--render-frame", "1..3"]
        assert "--python-expr" not in arguments

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

    def test_what_is_no_structure_is_refused(self, tmp_path: Path) -> None:
        done = self.compiled(tmp_path, structure="kd'); import os#")
        assert done.returncode != 0
        assert "structure: expected an id with key=value pairs" in done.stderr
