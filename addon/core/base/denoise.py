# SPDX-License-Identifier: GPL-3.0-or-later
"""Open Image Denoise, as a shared library with its C interface of version 2 (Áfra 2019-2025)."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import F32

NAMES = ("libOpenImageDenoise.so.2", "libOpenImageDenoise*.dylib", "OpenImageDenoise.dll", "libOpenImageDenoise.so*")
"""File names of the library on Linux, macOS and Windows; the first that exists is loaded."""

CPU, FLOAT3, BALANCED = 1, 3, 5
"""OIDN_DEVICE_TYPE_CPU, OIDN_FORMAT_FLOAT3 and OIDN_QUALITY_BALANCED of oidn.h."""

FEATURES = ("Denoising Albedo", "Normal")
"""Passes that guide the denoiser, by their native names."""

POLL_SECONDS = 0.05
"""Seconds between two calls of `keep_going`."""

_MONITOR = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)

_POINTER, _TEXT, _SIZE = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t

_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "oidnNewDevice": (_POINTER, [ctypes.c_int]),
    "oidnSetDeviceInt": (None, [_POINTER, _TEXT, ctypes.c_int]),
    "oidnCommitDevice": (None, [_POINTER]),
    "oidnReleaseDevice": (None, [_POINTER]),
    "oidnGetDeviceError": (ctypes.c_int, [_POINTER, ctypes.POINTER(_TEXT)]),
    "oidnNewFilter": (_POINTER, [_POINTER, _TEXT]),
    "oidnReleaseFilter": (None, [_POINTER]),
    "oidnSetSharedFilterImage": (None, [_POINTER, _TEXT, _POINTER, ctypes.c_int, *[_SIZE] * 5]),
    "oidnSetFilterInt": (None, [_POINTER, _TEXT, ctypes.c_int]),
    "oidnSetFilterBool": (None, [_POINTER, _TEXT, ctypes.c_bool]),
    "oidnSetFilterProgressMonitorFunction": (None, [_POINTER, _MONITOR, _POINTER]),
    "oidnCommitFilter": (None, [_POINTER]),
    "oidnExecuteFilter": (None, [_POINTER]),
}


class DenoiseError(RuntimeError):
    """The denoiser is missing or failed."""


def load(folders: Iterable[Path]) -> ctypes.CDLL:
    """The library, from the first of these folders that has it, else from the system. Raises DenoiseError."""
    # Try each file, then the names that the system's loader knows; the last error of a file is the reason of a failure.
    found = [str(path) for folder in folders for name in NAMES for path in sorted(folder.glob(name))]
    reason = "not found"
    for path in (*found, *(name for name in NAMES if "*" not in name)):
        try:
            library = ctypes.CDLL(path)
            for name, (result, arguments) in _SIGNATURES.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            reason = str(error) if path in found else reason
        else:
            return library
    raise DenoiseError(f"Open Image Denoise cannot be loaded: {reason}")


def with_features(passes: tuple[str, ...], integrator: str) -> tuple[str, ...]:
    """The passes of a picture that is to be denoised. Ambient occlusion has no albedo, and so no features."""
    return passes if integrator == "ao" else (*passes, *(name for name in FEATURES if name not in passes))


class Work(threading.Thread):
    """A task on a thread of its own. stopped: set to end it early; its result is then of no use."""

    def __init__(self, task: Callable[[Callable[[], bool]], F32]) -> None:
        """task: called with a function that returns whether to continue."""
        super().__init__(name="halfspace-denoise", daemon=True)
        self.stopped = False
        self.result: F32 | None = None
        self.error: BaseException | None = None
        self._task = task

    def run(self) -> None:
        """Keep the task's result, or its exception."""
        try:
            self.result = self._task(lambda: not self.stopped)
        except BaseException as error:
            self.error = error


def denoise(
    library: ctypes.CDLL,
    color: F32,
    *,
    albedo: F32 | None = None,
    normal: F32 | None = None,
    threads: int = 0,
    keep_going: Callable[[], bool] = lambda: True,
) -> F32:
    """A picture without its noise, in the best quality: (height, width, 3) float32, scene linear, as `color`.

    albedo, normal: those of the first surfaces, of the same shape; their own noise is removed first. threads: 0 means
    one per core. keep_going: called meanwhile by this thread; if it returns False, the result is `color` itself.
    Raises DenoiseError.
    """
    # Filter on another thread, and check meanwhile whether to stop.
    work = Work(lambda going: filtered(library, color, albedo=albedo, normal=normal, threads=threads, going=going))
    work.start()
    try:
        while work.is_alive():
            work.join(POLL_SECONDS)
            work.stopped = work.stopped or not keep_going()
    except BaseException:  # also KeyboardInterrupt: the arrays must outlive the filters
        work.stopped = True
        work.join()
        raise
    if work.error is not None:
        raise work.error
    return color if work.stopped or work.result is None else work.result


def filtered(
    library: ctypes.CDLL,
    color: F32,
    *,
    albedo: F32 | None = None,
    normal: F32 | None = None,
    quick: bool = False,
    threads: int = 0,
    going: Callable[[], bool] = lambda: True,
) -> F32:
    """As `denoise`, on the calling thread.

    quick: with the quality of Cycles' viewport, and features as noisy as they are: a third of the time or less. going:
    called by threads of the library; after it returned False, the result is of no use.
    """
    device = library.oidnNewDevice(CPU)
    if not device:
        raise DenoiseError("Open Image Denoise does not support this processor")
    try:
        if threads:
            library.oidnSetDeviceInt(device, b"numThreads", threads)
        library.oidnSetDeviceInt(device, b"setAffinity", 0)  # other threads of Blender share the cores
        library.oidnCommitDevice(device)
        _check(library, device)
        features: dict[bytes, F32] = {}
        # Only an albedo makes a normal usable.
        if albedo is not None:
            features = {b"albedo": albedo} if normal is None else {b"albedo": albedo, b"normal": normal}
        features = {name: _clean(image) for name, image in features.items()}
        filters = _Filters(library, device, going, quick)
        if not quick:
            # Remove the noise of the features first, so that the picture's filter can rely on them.
            features = {name: filters.run({name: image}) for name, image in features.items()}
        return filters.run({b"color": _clean(color), **features})
    finally:
        library.oidnReleaseDevice(device)


def remove(
    clean: Callable[[F32, F32 | None, F32 | None], F32], combined: F32, features: Mapping[str, F32], *, alpha: bool
) -> None:
    """Remove the noise of a (height, width, 4) picture in place.

    clean: returns colours without noise from colours, albedo and normal. features: flat passes by their names, or none.
    alpha: whether the alpha has noise too.
    """
    shape = (*combined.shape[:2], 3)
    albedo, normal = (features[name].reshape(shape) if name in features else None for name in FEATURES)
    combined[..., :3] = clean(combined[..., :3], albedo, normal)
    if alpha:
        combined[..., 3] = np.clip(clean(np.repeat(combined[..., 3:], 3, axis=2), None, None).mean(axis=2), 0, 1)


class _Filters:
    """Runs filters on a device, as long as `going` returns True."""

    def __init__(self, library: ctypes.CDLL, device: int, going: Callable[[], bool], quick: bool) -> None:
        self._library, self._device, self._going, self._quick = library, device, going, quick
        self._monitor = _MONITOR(lambda _user, _done: going())

    def run(self, inputs: dict[bytes, F32]) -> F32:
        """The output of one filter over these images, all of one shape."""
        output = np.empty_like(next(iter(inputs.values())))
        if not self._going():
            return output
        library = self._library
        handle = library.oidnNewFilter(self._device, b"RT")
        try:
            height, width, _ = output.shape
            for name, image in {**inputs, b"output": output}.items():
                library.oidnSetSharedFilterImage(handle, name, image.ctypes.data, FLOAT3, width, height, 0, 0, 0)
            if b"color" in inputs:
                library.oidnSetFilterBool(handle, b"hdr", True)
                library.oidnSetFilterBool(handle, b"cleanAux", len(inputs) > 1 and not self._quick)
            if self._quick:
                library.oidnSetFilterInt(handle, b"quality", BALANCED)
            library.oidnSetFilterProgressMonitorFunction(handle, self._monitor, None)
            library.oidnCommitFilter(handle)
            library.oidnExecuteFilter(handle)
            if self._going():
                _check(library, self._device)
        finally:
            library.oidnReleaseFilter(handle)
        return output


def _check(library: ctypes.CDLL, device: int) -> None:
    """Raise DenoiseError with the device's last error, if there is one."""
    message = ctypes.c_char_p()
    if library.oidnGetDeviceError(device, ctypes.byref(message)):
        raise DenoiseError(f"Open Image Denoise: {(message.value or b'unknown error').decode(errors='replace')}")


def _clean(image: F32) -> F32:
    """A contiguous copy with 0 for values that are not finite."""
    return np.ascontiguousarray(np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0), np.float32)
