# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebooks of docs/lessons as pages of the site: run with nbclient, written as Markdown by nbconvert."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SECONDS = 300
"""Longest time of a cell."""


class NotebookError(RuntimeError):
    """A notebook cannot become a page. The message gives the reason in one line."""


def write(notebook: Path, page: Path, package: Path) -> None:
    """Run a notebook and write it with its results as a page, and its pictures beside it.

    notebook: an .ipynb. page: the .md; pictures are NAME_files/FILE in its folder. package: the folder from which cells
    import `halfspace`. Raises NotebookError.
    """
    try:
        import nbclient
        import nbformat
        from nbconvert import MarkdownExporter
    except ImportError as error:
        raise NotebookError(f"{error.name} is not installed: set up the environment with scripts/test.py") from error
    document = nbformat.read(notebook, as_version=4)
    with tempfile.TemporaryDirectory(prefix="notebook-") as folder, _variables(package, Path(folder)):
        client = nbclient.NotebookClient(document, timeout=SECONDS, resources={"metadata": {"path": folder}})
        try:
            client.execute()
        except nbclient.exceptions.CellExecutionError as error:
            raise NotebookError(f"{notebook.name}: {error.ename}: {error.evalue}") from error
    # Write the page, with a link to the file itself below its heading.
    names = {"unique_key": f"{page.stem}_files/{page.stem}", "output_files_dir": f"{page.stem}_files"}
    text, found = MarkdownExporter().from_notebook_node(document, resources=names)
    heading, _, rest = text.partition("\n")
    offer = f'[Download this notebook]({notebook.name}){{ download="{notebook.name}" }}'
    page.write_text(
        f"{heading}\n\n{offer}. The results below are of the machine that built this page.\n{rest}", encoding="utf-8"
    )
    for name, content in found["outputs"].items():
        (page.parent / name).parent.mkdir(parents=True, exist_ok=True)
        (page.parent / name).write_bytes(content)


@contextmanager
def _variables(package: Path, folder: Path) -> Iterator[None]:
    """The variables of the notebook's process: where `halfspace` is, and a folder for IPython's own files."""
    wanted = {
        "PYTHONPATH": os.pathsep.join(filter(None, (str(package), os.environ.get("PYTHONPATH", "")))),
        "IPYTHONDIR": str(folder / "ipython"),
    }
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
