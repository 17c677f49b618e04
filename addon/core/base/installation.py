# SPDX-License-Identifier: GPL-3.0-or-later
"""Why the native module cannot be loaded on this machine, each reason in one sentence that names what helps."""

from __future__ import annotations

import contextlib
import platform
import re
import sys
import sysconfig
from pathlib import Path

MODULE = "halfspace_native"
"""The name of the module in a clone and in the Python package."""

WHEELS = Path(__file__).resolve().parents[2] / "wheels"
"""The wheels of an installed extension; a clone and the Python package have none there."""

SSE42_OF_WINDOWS = 38
"""PF_SSE4_2_INSTRUCTIONS_AVAILABLE of IsProcessorFeaturePresent."""

SYSTEMS = {"win": "Windows", "macosx": "macOS", "manylinux": "Linux", "musllinux": "Linux", "linux": "Linux"}
"""Name of the system by the beginning of a wheel's platform tag."""

PROCESSORS = {"x86_64": "x86-64", "amd64": "x86-64", "aarch64": "ARM", "arm64": "ARM"}
"""Name of the processor by the end of a wheel's platform tag or by the result of `platform.machine`, in lower case."""


def module_name() -> str:
    """The name of the module to import. In the extension it ends with the build: `scripts/systems/bundled.py`."""
    wheels = sorted(path.name for path in WHEELS.glob(f"{MODULE}*.whl"))
    return wheels[0].partition("-")[0] if wheels else MODULE


def processor_problem() -> str | None:
    """The reason why this processor cannot run the module, or None. Loading it there would end the program."""
    if PROCESSORS.get(platform.machine().lower()) != "x86-64" or has_sse42():
        return None
    return "Halfspace needs a processor with SSE4.2, as Blender does, and this one does not have it"


def has_sse42() -> bool:
    """Whether an x86-64 processor has SSE4.2; True where the system does not report it."""
    if sys.platform == "win32":
        import ctypes

        return bool(ctypes.windll.kernel32.IsProcessorFeaturePresent(SSE42_OF_WINDOWS))
    with contextlib.suppress(OSError):
        flags = re.search(r"^flags\s*:(.*)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
        return flags is None or "sse4_2" in flags[1].split()
    return True


def why_missing(error: ImportError) -> str:
    """The reason for a failed import of the module, in one sentence."""
    text = " ".join(str(error).split())
    symbol = re.search(r"GLIBC_([\d.]+)' not found", text)
    if symbol:
        return (
            f"The native module of Halfspace needs a Linux with glibc {symbol[1]} or newer: "
            "install a zip that was made with --portable"
        )
    here, module = _here(), module_name()
    missing = error.name if isinstance(error, ModuleNotFoundError) else None
    # In the extension, a package without its compiled part is what Blender has left of a removed one.
    if missing in (module, f"{module}.{MODULE}") and WHEELS.is_dir():
        targets = sorted(_targets())
        if here not in targets:
            return (
                f"This copy of Halfspace is for {' and '.join(targets) or 'no system'}, but this Blender runs {here}: "
                "install the zip for this system"
            )
        return "Blender did not unpack the native module of Halfspace: remove the extension and install it again"
    if missing == module:
        return (
            "The native module of Halfspace is not installed: "
            "install the Python package halfspace-rt again, or run scripts/demo.py in a clone"
        )
    if missing == f"{module}.{MODULE}":
        return (
            f"The native module of Halfspace that is installed is not for {here} with this {_python()}: "
            "install it again with the pip of this Python"
        )
    return f"The native module of Halfspace cannot be loaded on {here}: {text}"


def _python() -> str:
    """Name and version of this Python, such as "CPython 3.13", and whether it is the one without the global lock."""
    free = " (free-threaded)" if sysconfig.get_config_var("Py_GIL_DISABLED") else ""
    return f"{platform.python_implementation()} {sys.version_info[0]}.{sys.version_info[1]}{free}"


def has_wheel() -> bool:
    """Whether this is an installed extension with a wheel for this system."""
    return _here() in _targets()


def _here() -> str:
    """System and processor of this machine, such as "Linux on x86-64"."""
    return f"{SYSTEMS.get(_system(), sys.platform)} on {PROCESSORS.get(platform.machine().lower(), platform.machine())}"


def _targets() -> set[str]:
    """Systems and processors of the extension's wheels."""
    return {_target(path.name) for path in WHEELS.glob("*.whl")}


def _system() -> str:
    """The beginning of this system's platform tags."""
    return {"win32": "win", "darwin": "macosx"}.get(sys.platform, "linux")


def _target(wheel: str) -> str:
    """System and processor of a wheel from its file name, such as "Linux on x86-64"."""
    tag = wheel.removesuffix(".whl").rpartition("-")[2].partition(".")[0]
    system = next((name for beginning, name in SYSTEMS.items() if tag.startswith(beginning)), tag)
    processor = next((name for end, name in PROCESSORS.items() if tag.endswith(end)), tag)
    return f"{system} on {processor}"
