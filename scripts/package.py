# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension zip: `python scripts/package.py [--portable] [--for SYSTEM ...] [--wheel WHEEL ... [--unmodified]]
[--split] [--repository DIR] [--website URL]`.

Stages the add-on, the manifest with its wheels, the licence and the wheels in a temporary folder, builds the zip with
Blender's own tool, and validates it. Without --wheel the wheel for this machine is built, with --portable one for all
machines of its kind on which Blender runs, with --for one for another system. Wheels are named after their build
(`systems/bundled.py`), with --unmodified they go into the zip as they are. With --split, each system also gets a zip of
its own. With --repository, a folder becomes an extension repository that any web server can publish: the zips, the
list that Blender reads, and a page to drag the extension from. --website enters the page of the publisher. Warns if a
wheel needs a newer C library than Blender itself.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.core.base import command
from addon.lab.base.usage import Parser, output, website
from scripts.dev import environment
from scripts.systems import bundled, targets

ROOT = Path(__file__).resolve().parents[1]

IGNORED = ("lab", "__pycache__", "*.pyc", ".*")
"""Patterns of files and folders that are never part of the extension; the laboratory serves the command line."""

PLATFORMS = {
    r"(manylinux|linux).*_x86_64": "linux-x64",
    r"(manylinux|linux).*_aarch64": "linux-arm64",
    r"win_amd64": "windows-x64",
    r"win_arm64": "windows-arm64",
    r"macosx_.*_arm64": "macos-arm64",
    r"macosx_.*_x86_64": "macos-x64",
}
"""Blender's name of a platform by the pattern of a wheel's platform tag."""


REPOSITORY_PAGE = ROOT / "scripts" / "repository.html"
"""Template of the page of an extension repository; Blender's tool puts the table of extensions in."""


class PackageError(RuntimeError):
    """The extension cannot be packaged. The message gives the reason."""


REPORTED = (PackageError, targets.TargetError, environment.SetupError)
"""Errors that the command reports in one line."""


def platform_of(wheel_name: str) -> str:
    """Blender's name for the platform of a wheel. Raises PackageError."""
    tag = wheel_name.removesuffix(".whl").split("-")[-1]
    for pattern, name in PLATFORMS.items():
        if any(re.fullmatch(pattern, one) for one in tag.split(".")):
            return name
    raise PackageError(f"{wheel_name}: Blender knows no platform {tag!r}")


def too_new(wheel_name: str) -> str | None:
    """A warning if a wheel needs a newer glibc than Blender, by the name that maturin gave it, else None."""
    needed = [tuple(map(int, version)) for version in re.findall(r"manylinux_(\d+)_(\d+)", wheel_name)]
    if not needed or min(needed) <= targets.BLENDER_GLIBC:
        return None
    here, blender = (".".join(map(str, version)) for version in (min(needed), targets.BLENDER_GLIBC))
    return (
        f"WARNING: {wheel_name} needs glibc {here} or newer, Blender only {blender}: on older systems (RHEL 9 has "
        "2.34, Ubuntu 20.04 2.31) it can be installed but not loaded. For them package with --portable, or build the "
        "wheel there and give it with --wheel"
    )


def filled_manifest(text: str, wheels: Sequence[str], website: str | None = None) -> str:
    """The manifest with the platforms and the paths of these wheels inserted before its first table.

    website: the address of the publisher's page, entered if given. Raises PackageError if a wheel's version is not the
    manifest's: Blender would load a mismatched pair.
    """
    import tomllib

    manifest = tomllib.loads(text)
    for key in ("wheels", "platforms", "website"):
        if key in manifest:
            raise PackageError(f"blender_manifest.toml: {key} is filled in here and must not be in the file")
    for name in wheels:
        if name.split("-")[1] != manifest["version"]:
            raise PackageError(f"{name}: its version is not {manifest['version']}, the manifest's")
    platforms = sorted({platform_of(name) for name in wheels})
    lines = ["platforms = [" + ", ".join(f'"{name}"' for name in platforms) + "]", "wheels = ["]
    lines += [f'  "./wheels/{name}",' for name in sorted(wheels)] + ["]"]
    if website is not None:
        lines.append(f'website = "{website}"')
    lines += ["", ""]
    # Top-level keys after a table would belong to the table.
    table = re.search(r"^\[", text, re.MULTILINE)
    place = table.start() if table else len(text)
    return text[:place] + "\n".join(lines) + text[place:]


def stage(wheels: Sequence[Path], folder: Path, website: str | None = None, *, unmodified: bool = False) -> None:
    """Fill `folder` with everything that goes into the zip; its old content is removed.

    unmodified: copy the wheels, without naming them after their build. Raises PackageError.
    """
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "addon", folder, ignore=shutil.ignore_patterns(*IGNORED))
    shutil.copy2(ROOT / "LICENSE", folder)
    shutil.copy2(ROOT / "docs" / "manual.md", folder)  # panels open it
    (folder / "wheels").mkdir()
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    place = folder / "wheels"
    made = [Path(shutil.copy2(path, place)) for path in wheels] if unmodified else bundled.bundle(wheels, place)
    text = filled_manifest(manifest, [path.name for path in made], website)
    (folder / "blender_manifest.toml").write_text(text, encoding="utf-8")


def blender_tool() -> Path:
    """The path of Blender's own packaging program in the installed bpy. Raises PackageError."""
    found = importlib.util.find_spec("bpy")
    places = list(found.submodule_search_locations or []) if found else []
    programs = [p for place in places for p in Path(place).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")]
    if not programs:
        raise PackageError("Blender's packaging tool was not found: this Python has no bpy module")
    return programs[0]


def run_tool(*arguments: str) -> None:
    """Run Blender's packaging program. Raises PackageError with what it printed."""
    command = [sys.executable, str(blender_tool()), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # The tool reports some failures only in its output, with exit status 0.
    if done.returncode != 0 or "error:" in (done.stdout + done.stderr).lower():
        raise PackageError(f"blender_ext {arguments[0]}: {(done.stdout + done.stderr).strip()}")


def portable_wheel(name: str | None = None, interpreter: str | None = None) -> Path:
    """A wheel for all machines of one system on which Blender runs; None: of this machine's.

    On Linux the usual wheel needs the glibc of the machine that built it; elsewhere both are the same. interpreter: the
    name of a Python without a global lock, such as python3.14t, for which the stable interface does not exist; another
    system's need not be here. Raises PackageError, targets.TargetError or environment.SetupError.
    """
    if name is None and sys.platform != "linux":
        return environment.build_wheel(Path(sys.executable))[0]
    target = targets.TARGETS.get(name or targets.here())
    if target is None:
        raise PackageError(f"no portable wheel is made for {targets.here()}")
    with environment.alone():
        environment.prepare(environment.PORTABLE)
        environment.say(f"native module for {target.name}: looking for changes (a build takes minutes)")
        words, variables = targets.maturin(target, environment.PORTABLE.python)
        if interpreter:
            words = ["--interpreter", interpreter, *words]
        folder = "-".join(filter(None, ("wheel", target.name, interpreter)))
        return environment.build_wheel(environment.PORTABLE.python, folder, words, variables)[0]


def files(wheels: Sequence[Path]) -> list[Path]:
    """The wheels, with those of a folder in its place. Raises PackageError if there is no such file."""
    found = [file for path in wheels for file in (sorted(path.glob("*.whl")) if path.is_dir() else [path])]
    for path in found:
        if not path.is_file() or not zipfile.is_zipfile(path):
            raise PackageError(f"{path}: there is no such wheel")
    return found


def package(
    wheels: Sequence[Path],
    out: Path,
    *,
    portable: bool = False,
    systems: Sequence[str] = (),
    split: bool = False,
    website: str | None = None,
    unmodified: bool = False,
) -> list[Path]:
    """Build and validate the zip in the folder `out`, and with `split` one more per system. Returns the zips.

    portable: build the wheel for all machines of this kind and add it to `wheels`. systems: the same for each of these
    systems. website: the publisher's page. unmodified: see `stage`. Raises PackageError,
    targets.TargetError, environment.SetupError.
    """
    import tomllib

    built = [portable_wheel(name) for name in [None] * portable + list(systems)]
    chosen = list(dict.fromkeys([*wheels, *built]))
    if not chosen:
        chosen.append(environment.build_wheel(Path(sys.executable))[0])
    chosen = files(chosen)
    if not chosen:
        raise PackageError("the folders hold no wheels")
    for path in chosen:
        warning = too_new(path.name)
        if warning is not None:
            print(f"package: {warning}", file=sys.stderr)
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    out.mkdir(parents=True, exist_ok=True)
    name = f"{manifest['id']}-{manifest['version']}.zip"
    # Each call has a folder of its own: the tests of two Blenders package side by side.
    with tempfile.TemporaryDirectory(prefix="extension-", dir=out) as folder:
        staged, fresh = Path(folder) / "extension", Path(folder) / "zips"
        stage(chosen, staged, website, unmodified=unmodified)
        fresh.mkdir()
        run_tool("validate", str(staged))
        for options in [[], ["--split-platforms"]] if split else [[]]:
            run_tool("build", "--source-dir", str(staged), "--output-filepath", str(fresh / name), *options)
        zips = sorted(fresh.glob("*.zip"), key=lambda path: (path.name != name, path.name))
        for path in zips:
            run_tool("validate", str(path))
        return [path.replace(out / path.name) for path in zips]


def repository(zips: Sequence[Path], folder: Path) -> None:
    """Make the folder a static extension repository of these zips: `index.json`, `index.html`, and the zips.

    zips: as `package` returns them. Where there is one per system, Blender's users download that of their own. Older
    zips of the extension are removed from the folder, since Blender takes two versions of one id for a mistake. Raises
    PackageError and OSError.
    """
    whole, *single = zips
    chosen = single or [whole]
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(f"{whole.name.partition('-')[0]}-*.zip"):
        old.unlink()
    for path in chosen:
        shutil.copy2(path, folder)
    run_tool("server-generate", "--repo-dir", str(folder), "--html", "--html-template", str(REPOSITORY_PAGE))


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="package", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--wheel",
        type=Path,
        action="append",
        default=[],
        help="a wheel to bundle, or a folder of wheels; may be repeated",
    )
    parser.add_argument(
        "--portable",
        action="store_true",
        help="on Linux, build a wheel that runs wherever Blender does (minutes, and a download the first time)",
    )
    parser.add_argument(
        "--for",
        dest="systems",
        action="append",
        default=[],
        choices=[*targets.TARGETS, "all"],
        help="build a wheel for this system, or for all; may be repeated",
    )
    parser.add_argument(
        "--unmodified", action="store_true", help="bundle the wheels without naming them after their build"
    )
    parser.add_argument("--split", action="store_true", help="also make one zip per system")
    parser.add_argument(
        "--repository",
        type=output,
        metavar="DIR",
        help="also make this folder an extension repository, of the zips per system if there are",
    )
    parser.add_argument("--website", type=website, metavar="URL", help="the publisher's page, which Blender links to")
    parser.add_argument("--out", type=output, default=ROOT / "build", help="where the zip goes (default: build)")
    return command.run("package", arguments, parser.parse_args, run, told=REPORTED)


def run(asked: argparse.Namespace) -> int:
    """Package with these arguments. Returns the exit status."""
    systems = list(targets.TARGETS) if "all" in asked.systems else asked.systems
    zips = package(
        asked.wheel,
        asked.out,
        portable=asked.portable,
        systems=systems,
        split=asked.split,
        website=asked.website,
        unmodified=asked.unmodified,
    )
    for path in zips:
        print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
    if asked.repository is not None:
        repository(zips, asked.repository)
        print(f"{asked.repository / 'index.html'}: the page of the repository, next to index.json")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
