# SPDX-License-Identifier: GPL-3.0-or-later
"""The zips that the tests of this folder install."""

import builds
import pytest


@pytest.fixture(scope="session")
def zips(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The paths of the zips of `builds.zips`."""
    return builds.zips(tmp_path_factory.mktemp("zips"))
