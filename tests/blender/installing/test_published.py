# SPDX-License-Identifier: GPL-3.0-or-later
"""An extension repository of `scripts/package.py` on a web server: Blender installs, updates and removes from it."""

import functools
import http.server
import json
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from scripts import package
from tests.blender.installing.builds import check_picture
from tests.blender.user_session import session

STEPS = "published"


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves files without a log."""

    def log_message(self, *_: object) -> None:
        """Log nothing."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A folder, and the address under which a web server of this machine publishes it."""
    folder = tmp_path / "published"
    folder.mkdir()
    handler = functools.partial(Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as made:
        threading.Thread(target=made.serve_forever, daemon=True).start()
        yield folder, f"http://127.0.0.1:{made.server_port}"
        made.shutdown()


def publish(archive: str, version: str, folder: Path) -> None:
    """Make the folder the repository of this zip, under the name that `package` gives it."""
    path = folder.parent / f"halfspace-{version}.zip"
    shutil.copy2(archive, path)
    package.repository([path], folder)


def test_blender_installs_updates_and_removes_what_is_published(
    zips: dict[str, str], server: tuple[Path, str], tmp_path: Path
) -> None:
    folder, address = server
    user = tmp_path / "user"
    user.mkdir()
    publish(zips["old"], "0.0.9", folder)
    first = session(user, STEPS, "install", f"{address}/index.json")
    assert first["reported"] == [], first["log"]
    assert (first["enabled"], first["engine"]) == ([True, True], ["Halfspace 0.0.9"])
    check_picture(first["picture"])
    # Nothing is newer; then the next version is published.
    assert session(user, STEPS, "update")["engine"] == ["Halfspace 0.0.9"]
    publish(zips["new"], "0.1.0", folder)
    assert sorted(path.name for path in folder.iterdir()) == ["halfspace-0.1.0.zip", "index.html", "index.json"]
    second = session(user, STEPS, "update")
    assert second["reported"] == [], second["log"]
    assert (second["enabled"], second["engine"]) == ([True, True], ["Halfspace"])
    check_picture(second["picture"])
    assert len(second["unpacked"]) == 1
    last = session(user, STEPS, "remove")
    assert last["reported"] == [], last["log"]
    assert (last["enabled"], last["engine"], last["unpacked"]) == ([False, False], [], [])


def test_blender_says_in_one_sentence_that_a_repository_cannot_be_read(
    server: tuple[Path, str], tmp_path: Path
) -> None:
    _, address = server
    found = session(tmp_path, STEPS, "install", f"{address}/nothing/index.json")
    lines = [line for line in found["log"].splitlines() if " sync: " in line]
    assert len(lines) == 1, found["log"]
    assert "404" in lines[0]
    assert lines[0].endswith(f"reading '{address}/nothing/index.json'!")
    assert "Traceback" not in found["log"]
    assert found["enabled"] == [False, False]


def test_the_list_names_each_system_and_the_page_has_links_to_drag(zips: dict[str, str], tmp_path: Path) -> None:
    folder = tmp_path / "site"
    paths = [tmp_path / name for name in ("halfspace-0.1.0.zip", "halfspace-0.1.0-linux_x64.zip")]
    for path in paths:
        shutil.copy2(zips["new"], path)
    package.repository(paths, folder)
    (entry,) = json.loads((folder / "index.json").read_text(encoding="utf-8"))["data"]
    assert (entry["id"], entry["version"]) == ("halfspace", "0.1.0")
    assert entry["archive_url"] == "./halfspace-0.1.0-linux_x64.zip", "Blender downloads the zip of its own system"
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert 'href="./halfspace-0.1.0-linux_x64.zip?repository=.%2Findex.json&' in page
    assert "${" not in page
