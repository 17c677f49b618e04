# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Blender with the installed zip, without a window: every command `blender ...` of the documents."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from scripts import package
from tests.blender.user_session import built_wheel, made_zip

COMMAND = "HALFSPACE_BLENDER"
"""Environment variable: the command that runs a real Blender, by default the program `blender` if there is one."""

OLDEST = (4, 5)

PAGES = ("README.md", "docs/*.md", "docs/*/*.md")

QUICK = ["--size", "64x64", "--seconds", "1", "--only-rays"]
"""Options that make a benchmark short."""

SCENE = """
import bpy
scene = bpy.context.scene
scene.render.engine, scene.halfspace.samples = "HALFSPACE", 1
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.render.filepath, scene.frame_end = "//default-", 3
bpy.ops.wm.save_as_mainfile(filepath="scene.blend")
"""

MODEL = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""

PANIC = """
import bpy, sys
class PanicException(BaseException): pass
def panic(*_, **__): raise PanicException("index out of bounds")
kind = next(one for one in bpy.types.RenderEngine.__subclasses__() if getattr(one, "bl_idname", "") == "HALFSPACE")
module = sys.modules[kind.__module__]
owner, name = {"read": (module.extract, "find"), "trace": (module, "watch"), "fill": (module.Result, "fill")}["STAGE"]
setattr(owner, name, panic)
"""


def pictures(name: str, numbers: Sequence[int]) -> set[str]:
    """The files of these frames."""
    return {f"{name}{number:04}.png" for number in numbers}


EXPECTED: dict[str, set[str]] = {
    "blender -b scene.blend -E HALFSPACE -f 1": pictures("default-", [1]),
    "blender -b scene.blend -E HALFSPACE -a": pictures("default-", range(1, 4)),
    "blender -b scene.blend -E HALFSPACE -s 101 -e 200 -a": pictures("default-", range(101, 201)),
    "blender -b scene.blend -E HALFSPACE -o //out/frame-#### -s 1 -e 200 -j 2 -a": pictures(
        "out/frame-", range(1, 200, 2)
    ),
    "blender -b scene.blend -E HALFSPACE -f 1,5,20..30": pictures("default-", [1, 5, *range(20, 31)]),
    "blender --background scene.blend --python scripts/bench.py -- --structures all --out report": {
        "report/bench.csv",
        "report/bench.json",
        "report/report.html",
        "report/rows.jsonl",
    },
    "blender --background --python scripts/halfspace.py -- export model.ply --out tree.npz": {"tree.npz"},
}
"""The files that each command of the documents writes."""


VERSION = r"Halfspace 0\.1\.0 \(bl_ext\.user_default\.halfspace, halfspace_native_\w+\)"
"""The line that scripts inside Blender print about the package that they use."""


class Blender:
    """A user's Blender, with folders of its own for settings and for work."""

    def __init__(self, program: list[str], folder: Path) -> None:
        self.program, self.user, self.work = program, folder / "user", folder / "work"
        self.user.mkdir()
        self.work.mkdir()
        (self.work / "model.ply").write_text(MODEL, encoding="utf-8")

    def run(self, *words: str, extensions: bool = True) -> tuple[int, str]:
        """Exit status and output of a command, in the folder for work. extensions: else none is enabled."""
        clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "BLENDER_"))}
        done = subprocess.run(
            [*self.program, *([] if extensions else ["--factory-startup"]), *words],
            env={**clean, "BLENDER_USER_RESOURCES": str(self.user), "HOME": str(self.user)},
            cwd=self.work,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=600,
            check=False,
        )
        return done.returncode, done.stdout

    def install(self, archive: Path) -> None:
        """Install and enable a zip."""
        words = ("--command", "extension", "install-file", "-r", "user_default", "-e", str(archive))
        _, said = self.run(*words)
        assert "STATUS Installed" in said, said  # the status is 0 in any case
        assert not re.search(r"^(Error|ERROR|FATAL|Traceback)", said, re.MULTILINE), said

    def files(self) -> set[str]:
        """The files in the folder for work that commands have written."""
        found = {path.relative_to(self.work).as_posix() for path in self.work.rglob("*") if path.is_file()}
        return found - {"scene.blend", "model.ply"}


@pytest.fixture(scope="module")
def program() -> list[str]:
    """The command that runs a real Blender; the test is skipped without one."""
    given = os.environ.get(COMMAND)
    words = shlex.split(given) if given else [found] if (found := shutil.which("blender")) else []
    if not words:
        pytest.skip(f"no Blender: neither a command in the variable {COMMAND} nor the program `blender`")
    done = subprocess.run([*words, "--version"], capture_output=True, text=True, check=False)
    version = re.search(r"Blender (\d+)\.(\d+)", done.stdout)
    assert version, done.stdout + done.stderr
    if (int(version[1]), int(version[2])) < OLDEST:
        pytest.skip(f"{version[0]} is older than the extension supports")
    return words


@pytest.fixture(scope="module")
def blender(program: list[str], tmp_path_factory: pytest.TempPathFactory) -> Blender:
    """A Blender with the zip of this repository, and a small scene."""
    folder = tmp_path_factory.mktemp("blender")
    (archive,) = package.package([built_wheel()], folder)
    made = Blender(program, folder)
    made.install(archive)
    status, said = made.run("--background", "--python-exit-code", "9", "--python-expr", SCENE)
    assert status == 0, said
    return made


@pytest.fixture(autouse=True)
def _cleared(request: pytest.FixtureRequest) -> None:
    """Remove what an earlier command has written."""
    if "blender" in request.fixturenames:
        made = request.getfixturevalue("blender")
        for name in made.files():
            (made.work / name).unlink()


def test_every_command_of_the_documents_is_run_here() -> None:
    lines = [
        line.partition(" #")[0].strip()
        for pattern in PAGES
        for page in package.ROOT.glob(pattern)
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("blender ")
    ]
    assert set(lines) == set(EXPECTED)


@pytest.mark.parametrize("line", EXPECTED, ids=[line.partition("scene.blend ")[2] for line in EXPECTED])
def test_a_command_of_the_documents_does_what_it_promises(blender: Blender, line: str) -> None:
    words = [str(package.ROOT / word) if word.startswith("scripts/") else word for word in shlex.split(line)[1:]]
    if "all" in words:
        words = ["kd,bvh-sah" if word == "all" else word for word in words] + QUICK
    status, said = blender.run(*words)
    assert status == 0, said
    assert "Traceback" not in said
    assert blender.files() == EXPECTED[line], said
    if "--python" in words:
        assert re.search(rf"^\[\w+\] {VERSION}, in Blender", said, re.MULTILINE), said
    for path in blender.work.rglob("*.npz"):
        with np.load(path) as tree:
            assert len(tree["triangles"]) == 1


@pytest.mark.parametrize("stage", ["read", "trace", "fill"])
@pytest.mark.parametrize("words", [["-f", "1"], ["-s", "1", "-e", "2", "-a"]], ids=["frame", "animation"])
def test_a_panic_keeps_the_last_picture_and_ends_as_an_error(blender: Blender, stage: str, words: list[str]) -> None:
    old = blender.work / "default-0001.png"
    old.write_bytes(b"old")
    panic = PANIC.replace("STAGE", stage)
    status, said = blender.run("-b", "scene.blend", "--python-expr", panic, "-E", "HALFSPACE", *words)
    assert status == 1, said
    assert "ERROR internal error: index out of bounds" in said or "Error: internal error" in said, said
    assert blender.files() == {old.name}
    assert old.read_bytes() == b"old"


@pytest.mark.parametrize(
    ("script", "words"), [("bench", ["bench.py", "--"]), ("export", ["halfspace.py", "--", "export"])]
)
def test_without_the_extension_a_script_says_so_in_one_line(blender: Blender, script: str, words: list[str]) -> None:
    path = str(package.ROOT / "scripts" / words[0])
    given = ("--python", path, *words[1:], "--out", "tree.npz")
    status, said = blender.run("-b", "scene.blend", *given, extensions=False)
    (line,) = [line for line in said.splitlines() if line.startswith(f"{script}: ")]
    assert status == 2
    assert "Halfspace is not enabled in this Blender" in line
    assert blender.files() == set()


def test_another_version_is_refused_in_one_line(program: list[str], tmp_path: Path) -> None:
    made = Blender(program, tmp_path)
    changes = {
        "blender_manifest.toml": lambda text: text.replace('version = "0.1.0"', 'version = "0.0.9"'),
        "core/base/native.py": lambda text: text.replace('VERSION = "0.1.0"', 'VERSION = "0.0.9"'),
    }
    made.install(made_zip(tmp_path, "old", built_wheel(), changes))
    path = str(package.ROOT / "scripts" / "halfspace.py")
    status, said = made.run("-b", "--python", path, "--", "export", "--out", "tree.npz")
    (line,) = [line for line in said.splitlines() if line.startswith("export: ")]
    assert status == 2
    assert line == (
        "export: the enabled extension (bl_ext.user_default.halfspace) is Halfspace 0.0.9, this repository is 0.1.0: "
        "use the same version"
    )
