# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad installations of the native module: the reason is one sentence that names what helps."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from addon.core.base import installation, native

ABSENT = ModuleNotFoundError("No module named 'halfspace_native'", name="halfspace_native")


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    native.load.cache_clear()
    yield
    native.load.cache_clear()


@pytest.fixture
def wheels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of an extension's wheels, still empty."""
    monkeypatch.setattr(installation, "WHEELS", tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("tags", "words"),
    [
        (["win_amd64"], "is for Windows on x86-64, but this Blender runs Linux on x86-64: install the zip"),
        (["manylinux_2_28_aarch64"], "is for Linux on ARM, but this Blender runs Linux on x86-64"),
        (["macosx_11_0_arm64", "win_amd64"], "is for Windows on x86-64 and macOS on ARM, but"),
        ([], "is for no system, but this Blender runs Linux on x86-64"),
        (["manylinux_2_28_x86_64"], "Blender did not unpack the native module"),
        (["linux_x86_64", "win_amd64"], "Blender did not unpack the native module"),
    ],
)
def test_an_extension_for_another_system_names_both(wheels: Path, tags: list[str], words: str) -> None:
    for tag in tags:
        (wheels / f"halfspace_native-0.1.0-cp311-abi3-{tag}.whl").touch()
    said = installation.why_missing(ABSENT)
    expected = words if words.startswith("Blender") else f"This copy of Halfspace {words}"
    assert said.startswith(expected)
    assert "\n" not in said


def test_the_module_of_the_extension_has_its_build_in_its_name(wheels: Path) -> None:
    assert (installation.module_name(), installation.has_wheel()) == ("halfspace_native", False)
    (wheels / "halfspace_native_0a1b-0.1.0-cp311-abi3-win_amd64.whl").touch()
    assert (installation.module_name(), installation.has_wheel()) == ("halfspace_native_0a1b", False)
    (wheels / "halfspace_native_0a1b-0.1.0-cp311-abi3-manylinux_2_28_x86_64.whl").touch()
    assert (installation.module_name(), installation.has_wheel()) == ("halfspace_native_0a1b", True)


@pytest.mark.parametrize("missing", ["halfspace_native_0a1b", "halfspace_native_0a1b.halfspace_native"])
def test_a_build_that_was_not_unpacked_or_lost_a_part_is_said_to_be_absent(wheels: Path, missing: str) -> None:
    (wheels / "halfspace_native_0a1b-0.1.0-cp311-abi3-linux_x86_64.whl").touch()
    said = installation.why_missing(ModuleNotFoundError(f"No module named {missing!r}", name=missing))
    assert said.startswith("Blender did not unpack the native module")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "/lib/x86_64-linux-gnu/libc.so.6: version `GLIBC_2.35' not found (required by /tmp/a.so)",
            "needs a Linux with glibc 2.35 or newer: install a zip that was made with --portable",
        ),
        ("a.so: invalid ELF header", "cannot be loaded on Linux on x86-64: a.so: invalid ELF header"),
        ("dlopen(a.so):\n  tried: 'a.so'", "cannot be loaded on Linux on x86-64: dlopen(a.so): tried: 'a.so'"),
    ],
)
def test_an_error_of_the_loader_becomes_one_sentence(wheels: Path, text: str, words: str) -> None:
    assert installation.why_missing(ImportError(text, name="halfspace_native")).endswith(words)


@pytest.mark.skipif(not Path("/proc/cpuinfo").is_file(), reason="this system does not list the processor's features")
def test_this_processor_has_what_it_reports() -> None:
    assert installation.has_sse42() == ("sse4_2" in Path("/proc/cpuinfo").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("machine", "text", "refused"),
    [
        ("x86_64", "flags\t\t: fpu sse4_1 ssse3 popcnt\n", True),
        ("x86_64", "flags\t\t: fpu sse4_1 sse4_2 popcnt\n", False),
        ("AMD64", "flags\t\t: fpu\n", True),
        ("aarch64", "flags\t\t: fpu\n", False),
        ("x86_64", "nothing known\n", False),
    ],
)
def test_a_processor_without_sse42_is_refused_before_the_module_is_loaded(
    machine: str, text: str, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: text)
    loaded: list[str] = []

    def load(name: str) -> object:
        loaded.append(name)
        raise ImportError("not tried")

    monkeypatch.setattr(native.importlib, "import_module", load)
    problem = native.problem()
    assert problem is not None
    assert ("needs a processor with SSE4.2" in problem) == refused
    assert loaded == ([] if refused else ["halfspace_native"])
