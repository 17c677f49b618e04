# SPDX-License-Identifier: GPL-3.0-or-later
"""One zip is installed over another while Blender runs."""

import contextlib
import gc
import sys
import threading
import types
import weakref
from pathlib import Path
from typing import Any

import bpy
import in_session
import locking
from in_session import NAME, addon_utils, install, native, open_scene, part, render, stale, traces, unpacked

SAMPLES = 3


def look() -> dict[str, Any]:
    """Texts of the enabled version that a user sees, and which build of the native module it uses."""
    kinds = [kind for kind in bpy.types.RenderEngine.__subclasses__() if kind.is_registered]
    return {
        "enabled": addon_utils.check(NAME),
        "engine": [kind.bl_label for kind in kinds if getattr(kind, "bl_idname", "") == "HALFSPACE"],
        "panel": bpy.types.HALFSPACE_PT_sampling.bl_label,
        "property": bpy.context.scene.halfspace.bl_rna.properties["samples"].description,
        "old_panel": hasattr(bpy.types, "HALFSPACE_PT_old"),
        "build": native().BUILD,
        "file": native().__file__,
    }


def functions() -> list[tuple[str, weakref.ref[Any]]]:
    """All functions and classes of the extension's modules, without keeping them alive."""
    return [
        (f"{name.removeprefix(NAME)}.{value.__name__}", weakref.ref(value))
        for name, module in list(sys.modules.items())
        if name.startswith(f"{NAME}.")
        for value in vars(module).values()
        if isinstance(value, types.FunctionType | type) and value.__module__ == name
    ]


def foreign() -> list[str]:
    """Registered classes and handlers of the extension that are not those of its loaded modules."""
    registered = [
        kind
        for base in (bpy.types.Panel, bpy.types.Operator, bpy.types.RenderEngine, bpy.types.PropertyGroup)
        for kind in base.__subclasses__()
        if kind.__module__.startswith(NAME) and kind.is_registered
    ]
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    handlers = [one for found in lists if isinstance(found, list) for one in found]
    found = [("handler", one) for one in handlers if getattr(one, "__module__", "").startswith(NAME)]
    # A function knows the module that it was made in, which is no longer among the loaded ones after an upgrade.
    for kind in registered:
        methods = [one for one in vars(kind).values() if isinstance(one, types.FunctionType)]
        found += [(kind.__qualname__, one) for one in methods if one.__module__.startswith(NAME)]
    return [
        f"{owner}: {one.__qualname__}"
        for owner, one in found
        if one.__module__ not in sys.modules or one.__globals__ is not vars(sys.modules[one.__module__])
    ]


def set_up() -> None:
    """The factory scene with settings of the user."""
    open_scene()
    group = bpy.context.scene.halfspace
    group.samples, group.overlay.show = SAMPLES, True


def settings() -> dict[str, Any]:
    """The user's settings of the open scene."""
    scene = bpy.context.scene
    return {"engine": scene.render.engine, "samples": scene.halfspace.samples, "overlay": scene.halfspace.overlay.show}


def over(first: str, second: str, busy: str = "") -> dict[str, Any]:
    """Install `first`, render, install `second` over it, render. busy: while a picture and a view are rendered."""
    found: dict[str, Any] = {"before": traces(), "installed": install(first)}
    set_up()
    found["first"] = {"look": look(), "picture": render(), "traces": traces()}
    found["set"] = settings()
    part("blender.read.sky")._end_at_exit()  # as the first Sky Texture does
    of_first = functions()
    with rendering(found) if busy else contextlib.nullcontext():
        found["installed"] += install(second)
    # Deferred deletion is what keeps what was unregistered.
    gc.collect()
    found["left"] = sorted(name for name, one in of_first if one() is not None)
    found["foreign"] = foreign()
    found["kept"] = settings()
    found["second"] = {"look": look(), "picture": render(), "traces": traces()}
    found["open"] = open_files()
    bpy.ops.wm.save_userpref()
    return found


def open_files() -> list[str]:
    """The files in the folder of the extension itself that this process has open or mapped; Linux lists them."""
    folder = str(Path(sys.modules[NAME].__file__ or "").resolve().parent)
    named = []
    for path in Path("/proc/self/fd").glob("*"):
        with contextlib.suppress(FileNotFoundError):  # the one that listed the folder
            named.append(str(path.readlink()))
    maps = Path("/proc/self/maps")
    mapped = [line.split(maxsplit=5)[-1] for line in maps.read_text().splitlines()] if maps.is_file() else []
    return sorted({name for name in (*named, *mapped) if name.startswith(folder)})


@contextlib.contextmanager
def rendering(found: dict[str, Any]) -> Any:
    """A picture on a thread of its own, as Blender renders it, and a view, both of which would take hours."""
    picture, view = begin_picture(), begin_view()
    yield
    picture.thread.join(60)
    found["picture ended"] = picture.cancelled and not picture.thread.is_alive()
    found["view ended"] = view.job.wait(60_000) and view.job.cancelled


def begin_picture() -> Any:
    """A picture as `engine.py` renders it; the result has its thread, and whether it was cancelled."""
    import numpy as np

    module, running = native(), part("blender.render.running")
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32)
    scene = module.RenderScene(module.build(corners, np.array([[0, 1, 2]], np.int32)))
    place = np.eye(4)
    place[2, 3] = 4.0
    camera = {"kind": "perspective", "to_world": place, "window": (-0.5, 0.5, -0.5, 0.5), "clip_start": 0.1}
    job = module.render(scene, camera | {"clip_end": 100.0}, HOURS, threads=1)
    picture = types.SimpleNamespace(cancelled=False)
    begun = threading.Event()

    class Engine:
        "Stands for the engine of the old version."

    def work() -> None:
        with running.picture(Engine()):
            begun.set()
            while not running.closing():
                assert not job.wait(10), "a million samples took no time"
            job.cancel()
            job.wait(60_000)
            picture.cancelled = job.cancelled

    picture.thread = threading.Thread(target=work)
    picture.thread.start()
    assert begun.wait(60)
    return picture


HOURS = {"width": 256, "height": 256, "samples": 1 << 20}


def begin_view() -> Any:
    """A 3D view in rendered mode, which Blender still keeps; the result has its native job."""
    import time

    viewport, views = part("blender.render.viewport"), part("blender.read.views")

    class Engine:
        "What the viewport needs of an engine, which cannot be made outside a window."

        def tag_redraw(self) -> None:
            "Nothing is drawn."

    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    scene.halfspace.preview_samples = 1 << 20
    window = scene.camera.calc_matrix_camera(depsgraph, x=256, y=256)
    inverse = scene.camera.matrix_world.inverted()
    context = types.SimpleNamespace(
        scene=scene,
        region=types.SimpleNamespace(width=256, height=256),
        region_data=types.SimpleNamespace(
            view_matrix=inverse, window_matrix=window, perspective_matrix=window @ inverse, view_perspective="PERSP"
        ),
        space_data=types.SimpleNamespace(
            clip_start=0.1, clip_end=100.0, use_local_camera=False, camera=None, use_render_border=False
        ),
    )
    view, engine = viewport.Viewport(), Engine()
    view.update(engine, context, depsgraph)
    while view._incoming:
        view._read()
        time.sleep(0.001)
    view._preview.look(views.seen(context))
    for _ in range(5000):
        view.tick()
        if view._preview._job is not None and view._preview._job.settings.samples > 1:
            # The view stays, as Blender keeps that of a window which it has not drawn since.
            return types.SimpleNamespace(view=view, engine=engine, job=view._preview._job.native)
        time.sleep(0.001)
    raise AssertionError("the view does not render")


def locked(folders: str, *zips: str) -> dict[str, Any]:
    """Install these zips one over the other; what each loads is locked. folders: "folders" if theirs cannot be renamed.

    A zip that is the one before is not installed again: the extension is disabled and enabled.
    """
    found: dict[str, Any] = {"looks": [], "pictures": [], "reported": []}
    for before, archive in zip((None, *zips), zips, strict=False):
        if archive == before:
            found["reported"].append(in_session.attempt(bpy.ops.preferences.addon_disable, module=NAME))
            found["reported"].append(in_session.attempt(bpy.ops.preferences.addon_enable, module=NAME))
        else:
            found["reported"].append(install(archive))
        if before is None:
            set_up()
        found["looks"].append(look())
        found["pictures"].append(render())
        # The compiled file lies next to the one that Python names.
        for file in Path(native().__file__).parent.glob("halfspace_native.*"):
            if file.suffix in {".so", ".pyd"}:
                locking.lock(str(file), folders == "folders")
    found |= {"kept": settings(), "foreign": foreign(), "there": locking.still_there(), "unpacked": unpacked()}
    bpy.ops.wm.save_userpref()
    return found


def later() -> dict[str, Any]:
    """A new session of the same user."""
    # Blender as a module starts without the user's preferences, which enable the extension.
    bpy.ops.wm.read_userpref()
    found: dict[str, Any] = {"at start": addon_utils.check(NAME)}
    open_scene()
    found |= {"look": look(), "picture": render(), "unpacked": unpacked(), "stale": stale(), "traces": traces()}
    return found
