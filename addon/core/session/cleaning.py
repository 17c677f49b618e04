# SPDX-License-Identifier: GPL-3.0-or-later
"""Removal of the noise of one view's pictures, one at a time on another thread. No call waits for it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..base import denoise

if TYPE_CHECKING:
    from ..base.arrays import F32
    from .preview import Picture


class Denoiser(Protocol):
    """Returns (height, width, 3) colours without noise, guided by albedo and normal or by neither. Runs on any thread.

    threads: 0 means one per core. going: whether the result is still wanted. Raises denoise.DenoiseError.
    """

    def __call__(
        self, color: F32, albedo: F32 | None, normal: F32 | None, *, threads: int, going: Callable[[], bool]
    ) -> F32:
        """The colours without noise."""


@dataclass(frozen=True, eq=False)
class Noisy:
    """A picture with noise. features: flat passes that guide the denoiser, by name. alpha: whether it has noise too."""

    picture: Picture
    features: Mapping[str, F32]
    threads: int
    alpha: bool


class Cleaning:
    """Removes the noise of the pictures of one view. Call `advance` often while `busy`."""

    def __init__(self, denoiser: Denoiser) -> None:
        self.problem = ""
        """The reason why the last picture kept its noise, or ""."""
        self._denoiser = denoiser
        self._work: denoise.Work | None = None
        self._noisy: Noisy | None = None
        self._leaving: denoise.Work | None = None
        self._taken: tuple[tuple[int, int], int] | None = None
        """Edit, move and samples of the last picture that was taken."""
        self._failed: tuple[int, int] | None = None
        """Edit and move of the last picture that kept its noise."""
        self._begun = self._rested = 0.0

    @property
    def busy(self) -> bool:
        """Whether `advance` has work to do."""
        return self._noisy is not None or self._leaving is not None

    def wants(self, what: tuple[int, int], samples: int, *, last: bool) -> bool:
        """Whether to take a picture with these samples. The last of its edit and move is always wanted, others not
        while there is work, nor for as long after it as it took, so that the samples keep most of the processor.
        """
        if what == self._failed or (self._taken is not None and self._taken[0] == what and self._taken[1] >= samples):
            return False
        return last or (not self.busy and time.monotonic() >= self._rested)

    def take(self, noisy: Noisy) -> None:
        """Remove the noise of this picture next; what is in work is dropped."""
        self.drop()
        self._noisy, self._taken = noisy, (noisy.picture.what, noisy.picture.samples)
        self._begin()

    def drop(self, keep: tuple[int, int] | None = None) -> None:
        """Request the end of all work without waiting for it, unless it is about this edit and move."""
        if self._noisy is None or self._noisy.picture.what == keep:
            return
        if self._work is not None:
            self._work.stopped = True
            self._leaving, self._work = self._work, None
        self._noisy = self._taken = None

    def advance(self) -> Picture | None:
        """The picture that became clean since the last call, or None. If its noise could not be removed, it is the
        picture as it was, and `problem` has the reason.
        """
        if self._leaving is not None and not self._leaving.is_alive():
            self._leaving = None
        self._begin()
        work, noisy = self._work, self._noisy
        if work is None or noisy is None or work.is_alive():
            return None
        self._work = self._noisy = None
        now = time.monotonic()
        self._rested = now + (now - self._begun)
        if work.error is not None or work.result is None:
            self.problem = " ".join(str(work.error).split()) or type(work.error).__name__
            self._failed = noisy.picture.what
            return noisy.picture
        self.problem, self._failed = "", None
        return replace(noisy.picture, pixels=work.result, clean=True)

    def _begin(self) -> None:
        """Start the next picture once the one before, which is stopped, has ended."""
        if self._noisy is None or self._work is not None or self._leaving is not None:
            return
        noisy, denoiser = self._noisy, self._denoiser
        self._work = denoise.Work(lambda going: _clean(denoiser, noisy, going))
        self._begun = time.monotonic()
        self._work.start()


def _clean(denoiser: Denoiser, noisy: Noisy, going: Callable[[], bool]) -> F32:
    """The flat RGBA pixels of a picture without its noise. Raises denoise.DenoiseError."""
    x0, y0, x1, y1 = noisy.picture.part
    combined = noisy.picture.pixels.reshape(y1 - y0, x1 - x0, 4).copy()

    def clean(color: F32, albedo: F32 | None, normal: F32 | None) -> F32:
        return denoiser(color, albedo, normal, threads=noisy.threads, going=going)

    denoise.remove(clean, combined, noisy.features, alpha=noisy.alpha)
    return np.ravel(combined)
