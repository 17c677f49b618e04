# SPDX-License-Identifier: GPL-3.0-or-later
"""Open Image Denoise, as a shared library with its C interface of version 2 (Áfra 2019-2025)."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import F32

NAMES = ("libOpenImageDenoise.so.2", "libOpenImageDenoise*.dylib", "OpenImageDenoise.dll", "libOpenImageDenoise.so*")
"""File names of the library on Linux, macOS and Windows; the first that exists is loaded."""

CPU, FLOAT3 = 1, 3
"""OIDN_DEVICE_TYPE_CPU and OIDN_FORMAT_FLOAT3 of oidn.h."""

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
    "oidnSetFilterBool": (None, [_POINTER, _TEXT, ctypes.c_bool]),
    "oidnSetFilterProgressMonitorFunction": (None, [_POINTER, _MONITOR, _POINTER]),
    "oidnCommitFilter": (None, [_POINTER]),
    "oidnExecuteFilter": (None, [_POINTER]),
}


class DenoiseError(RuntimeError):
    """The denoiser is missing or failed."""


def load(folders: Iterable[Path]) -> ctypes.CDLL:
    """The library, from the first of these folders that has it, else from the system. Raises DenoiseError."""
    # Try each file, then the names that the system's loader knows; the last error is the reason of a failure.
    found = (str(path) for folder in folders for name in NAMES for path in sorted(folder.glob(name)))
    reason = "not found"
    for path in (*found, *(name for name in NAMES if "*" not in name)):
        try:
            library = ctypes.CDLL(path)
            for name, (result, arguments) in _SIGNATURES.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            reason = str(error)
        else:
            return library
    raise DenoiseError(f"Open Image Denoise cannot be loaded: {reason}")


def denoise(
    library: ctypes.CDLL,
    color: F32,
    *,
    albedo: F32 | None = None,
    normal: F32 | None = None,
    threads: int = 0,
    keep_going: Callable[[], bool] = lambda: True,
) -> F32:
    """A picture without its noise: (height, width, 3) float32, scene linear, as `color`.

    albedo, normal: those of the first surfaces, of the same shape; their own noise is removed first. threads: 0 means
    one per core. keep_going: called meanwhile by this thread; if it returns False, the result is `color` itself.
    Raises DenoiseError.
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
        images = {b"color": color}
        # Only an albedo makes a normal usable.
        if albedo is not None:
            images |= {b"albedo": albedo} if normal is None else {b"albedo": albedo, b"normal": normal}
        # Filter on another thread, and check meanwhile whether to stop.
        work = _Work(library, device, {name: _clean(image) for name, image in images.items()})
        work.start()
        try:
            while work.is_alive():
                work.join(POLL_SECONDS)
                work.stopped = work.stopped or not keep_going()
        except BaseException:  # also KeyboardInterrupt: the device must outlive the filters
            work.stopped = True
            work.join()
            raise
        if work.error is not None:
            raise work.error
        return color if work.stopped else work.result
    finally:
        library.oidnReleaseDevice(device)


class _Work(threading.Thread):
    """The filters of one picture, on a thread of their own. stopped: set to end them early."""

    def __init__(self, library: ctypes.CDLL, device: int, images: dict[bytes, F32]) -> None:
        super().__init__(name="halfspace-denoise", daemon=True)
        self.stopped = False
        self.error: BaseException | None = None
        self.result = np.empty_like(images[b"color"])
        self._library, self._device, self._images = library, device, images
        self._monitor = _MONITOR(lambda _user, _done: not self.stopped)

    def run(self) -> None:
        try:
            # Remove the noise of the features first, so that the picture's filter can rely on them.
            color = self._images.pop(b"color")
            clean = {}
            for name, image in self._images.items():
                clean[name] = np.empty_like(image)
                self._filter({name: image}, clean[name])
            self._filter({b"color": color, **clean}, self.result)
        except BaseException as error:
            self.error = error

    def _filter(self, inputs: dict[bytes, F32], output: F32) -> None:
        """Run one filter over these images."""
        if self.stopped:
            return
        library = self._library
        handle = library.oidnNewFilter(self._device, b"RT")
        try:
            height, width, _ = output.shape
            for name, image in {**inputs, b"output": output}.items():
                library.oidnSetSharedFilterImage(handle, name, image.ctypes.data, FLOAT3, width, height, 0, 0, 0)
            if b"color" in inputs:
                library.oidnSetFilterBool(handle, b"hdr", True)
                library.oidnSetFilterBool(handle, b"cleanAux", len(inputs) > 1)
            library.oidnSetFilterProgressMonitorFunction(handle, self._monitor, None)
            library.oidnCommitFilter(handle)
            library.oidnExecuteFilter(handle)
            if not self.stopped:
                _check(library, self._device)
        finally:
            library.oidnReleaseFilter(handle)


def _check(library: ctypes.CDLL, device: int) -> None:
    """Raise DenoiseError with the device's last error, if there is one."""
    message = ctypes.c_char_p()
    if library.oidnGetDeviceError(device, ctypes.byref(message)):
        raise DenoiseError(f"Open Image Denoise: {(message.value or b'unknown error').decode(errors='replace')}")


def _clean(image: F32) -> F32:
    """A contiguous copy with 0 for values that are not finite."""
    return np.ascontiguousarray(np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0), np.float32)
