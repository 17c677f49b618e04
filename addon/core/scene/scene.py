# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as validated, frozen arrays: the input of the native core, independent of the lifetime of Blender's data.

Everything is in the *scene frame*: Blender's world moved by `-Geometry.origin` (f64), so that scenes far from the
world's origin keep their precision when positions are rounded to f32.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F32, F64, I32, I64, U32
from .faulty import faulty
from .mattes import Mattes

if TYPE_CHECKING:
    from .instances import InstancedGeometry


RGB = tuple[float, float, float]


class SceneError(ValueError):
    """An array of the scene has the wrong shape, type or range. The message names it."""


def check(name: str, array: Any, dtype: Any, shape: tuple[int | None, ...]) -> None:
    """Raise SceneError unless `array` has this dtype and shape (None: any length) and is C-contiguous."""
    if not isinstance(array, np.ndarray) or array.dtype != dtype:
        found = getattr(array, "dtype", type(array).__name__)
        raise SceneError(f"{name}: expected {np.dtype(dtype)}, got {found}")
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("n" if size is None else str(size) for size in shape)
        raise SceneError(f"{name}: expected shape ({wanted}), got {array.shape}")
    if not array.flags.c_contiguous:
        raise SceneError(f"{name}: expected a C-contiguous array")


def check_range(name: str, indices: Any, count: int, what: str) -> None:
    """Raise SceneError unless all `indices` are those of `count` things."""
    if len(indices) and not 0 <= int(indices.min()) <= int(indices.max()) < count:
        raise SceneError(f"{name}: an index is out of range for {count} {what}")


def shallow(item: Any) -> dict[str, Any]:
    """The fields of a dataclass without slots and cached properties; unlike `asdict` it copies nothing in them, so a
    million lights take a second, not minutes.
    """
    return dict(vars(item))


@dataclass(frozen=True)
class Source:
    """The origin of a run of triangles: one mesh, placed once for each name.

    Triangles `start` to `start + count * len(names)`; the i-th `count` of them belong to the object `names[i]`.
    """

    start: int
    count: int
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Voxels:
    """A grid. values: (x, y, z, 1 or 3) float32. to_index: (3, 4), object space to whole indices of voxels."""

    values: F32
    to_index: list[list[float]]

    def __post_init__(self) -> None:
        check("voxels", self.values, np.float32, (None, None, None, None))
        self.values.flags.writeable = False


@dataclass(frozen=True)
class ObjectFrame:
    """An object's coordinate frames for textures.

    to_object: (3, 4), scene frame to object space. generated: (2, 3), offset added to a position in object space, then
    scale, which map its box to 0 to 1. values: others, by the numbers of "object_value" steps; missing ones are 0.
    """

    to_object: tuple[tuple[float, ...], ...]
    generated: tuple[tuple[float, ...], ...]
    values: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, eq=False)
class Geometry:
    """The triangles of a scene.

    vertices: (n, 3) float32, scene frame. triangles: (m, 3) int32. material_index: (m,) int32 into the scene's
    materials. corner_normals: (m, 3, 3) float32 unit vectors, or None if every triangle is flat. uvs: (m, 3, 2)
    float32, NaN where a mesh has none, or None if not requested. layers: corner attributes that materials read, each
    (m, 3, 2 to 4) float32, or None if no mesh has it. objects, and object_index, (m,) uint32 into them: the objects'
    frames for textures, or None if no material needs them. origin: (3,) float64, the world position of the scene
    frame's origin. sources: ascending, without gaps. Raises SceneError.
    """

    vertices: F32
    triangles: I32
    material_index: I32
    corner_normals: F32 | None = None
    uvs: F32 | None = None
    layers: tuple[F32 | None, ...] = ()
    objects: tuple[ObjectFrame, ...] = ()
    object_index: U32 | None = None
    origin: F64 = field(default_factory=lambda: np.zeros(3))
    sources: tuple[Source, ...] = ()

    def __post_init__(self) -> None:
        # Check shapes and types, then ranges.
        count = len(self.triangles)
        check("vertices", self.vertices, np.float32, (None, 3))
        check("triangles", self.triangles, np.int32, (None, 3))
        check("material_index", self.material_index, np.int32, (count,))
        check("origin", self.origin, np.float64, (3,))
        if self.corner_normals is not None:
            check("corner_normals", self.corner_normals, np.float32, (count, 3, 3))
        if self.uvs is not None:
            check("uvs", self.uvs, np.float32, (count, 3, 2))
        for number, layer in enumerate(self.layers):
            if layer is not None:
                check(f"layers[{number}]", layer, np.float32, (count, 3, None))
        if self.object_index is not None:
            check("object_index", self.object_index, np.uint32, (count,))
        check_range("triangles", self.triangles, len(self.vertices), "vertices")
        if not np.isfinite(self.origin).all():
            raise SceneError("origin: expected finite numbers")
        # Freeze the arrays, which sessions share.
        always = self.vertices, self.triangles, self.material_index, self.origin
        for array in (*always, self.corner_normals, self.uvs, *self.layers):
            if array is not None:
                array.flags.writeable = False

    def runs(self) -> list[tuple[int, str]]:
        """Number of triangles and object name of each run, in order."""
        return [(source.count, name) for source in self.sources for name in source.names]

    @property
    def count(self) -> int:
        """Number of triangles."""
        return len(self.triangles)

    @property
    def size(self) -> int:
        """Number of triangles that trees are built over."""
        return len(self.triangles)

    def faulty_triangles(self) -> dict[str, int]:
        """Number of degenerate triangles per object, which can never be hit: no area, or a non-finite vertex."""
        return self.count_by_object(faulty(self.vertices, self.triangles))

    def count_by_object(self, mask: NDArray[np.bool_]) -> dict[str, int]:
        """The number of marked triangles of each object that has any. mask: (m,) bool."""
        counts: dict[str, int] = {}
        for source in self.sources:
            marked = mask[source.start : source.start + source.count * len(source.names)]
            if marked.any():
                for name, number in zip(source.names, marked.reshape(-1, source.count).sum(axis=1), strict=True):
                    if number:
                        counts[name] = counts.get(name, 0) + int(number)
        return counts

    @staticmethod
    def empty() -> Geometry:
        """A scene without triangles, which shows only its background."""
        return Geometry(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))


PANORAMIC = (
    *("equirectangular", "equidistant", "equisolid", "polynomial", "mirror_ball", "central_cylindrical", "cube_face"),
)
"""Panoramic kinds of cameras."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A perspective, parallel or panoramic camera that looks along its -Z with +Y up.

    to_world: (4, 4) float64 without scale, camera to scene frame. window: left, right, bottom, top of the full frame,
    at distance 1 (perspective) or in scene units (orthographic); includes shift, sensor fit and pixel aspect.
    aperture_radius: 0 is a pinhole. aperture_blades: number of blades, fewer than 3 is round. aperture_rotation:
    radians. aperture_ratio: height by width. focus_distance: along -Z, or along the rays of a panorama. panorama: keys
    that a panoramic kind needs, as the native module takes them; its window is (0, 1, 0, 1). motion: the cameras of the
    frames before and after. poses: transforms like `to_world` at equal intervals of an open shutter, or fewer than two.
    rolling_shutter: share of the opening for which a row is exposed, from the top one to the bottom one; None: all rows
    together. shutter_curve: the times, 0 to 1, at which equal shares of its light have passed; none: they are even.
    """

    kind: str
    to_world: F64
    window: tuple[float, float, float, float]
    clip_start: float
    clip_end: float
    aperture_radius: float = 0.0
    aperture_blades: int = 0
    aperture_rotation: float = 0.0
    aperture_ratio: float = 1.0
    focus_distance: float = 1.0
    panorama: Mapping[str, Any] = field(default_factory=dict)
    motion: tuple[Camera, Camera] | None = None
    poses: tuple[tuple[tuple[float, ...], ...], ...] = ()
    rolling_shutter: float | None = None
    shutter_curve: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check("camera.to_world", self.to_world, np.float64, (4, 4))
        if self.kind not in ("perspective", "orthographic", *PANORAMIC):
            raise SceneError(f"camera.kind: expected perspective, orthographic or panoramic, got {self.kind!r}")
        if not np.isfinite(self.to_world).all() or not np.isfinite(self.window).all():
            raise SceneError("camera: its transform, lens or shift is not finite")

    def as_dict(self) -> dict[str, Any]:
        """The camera as the native module takes it."""
        own = shallow(self)
        panorama, motion = own.pop("panorama"), own.pop("motion")
        if self.rolling_shutter is None:  # the native module may be older than the settings
            del own["rolling_shutter"], own["shutter_curve"]
        moved = {} if motion is None else {"motion": tuple(side.as_dict() for side in motion)}
        return own | dict(panorama) | moved


@dataclass(frozen=True, eq=False)
class Image:
    """A texture. pixels: (h, w, 1 to 4) uint8, uint16 (both: the largest number is 1), float16 or float32, rows from
    the bottom; zero rows if the image is missing. Two channels are a grey and alpha, three an opaque colour. An array
    that views a `bytes` object is not copied.

    srgb: whether colours are sRGB-encoded and decoded after filtering, as in Cycles; otherwise they are linear. tiles:
    by UDIM number those of an image of tiles, which has no pixels itself.
    """

    name: str
    pixels: NDArray[Any]
    srgb: bool = False
    tiles: tuple[tuple[int, Image], ...] = ()

    def __post_init__(self) -> None:
        stored = getattr(self.pixels, "dtype", None) in (np.uint8, np.uint16, np.float16)
        channels = next(iter(np.shape(self.pixels)[-1:]), 4)
        dtype = self.pixels.dtype if stored else np.float32
        check(f"image {self.name}", self.pixels, dtype, (None, None, min(max(channels, 1), 4)))

    def as_dict(self) -> dict[str, Any]:
        """The image as the native module takes it."""
        if self.tiles:
            return {"name": self.name, "tiles": [{"number": n, **tile.as_dict()} for n, tile in self.tiles]}
        return {"name": self.name, "pixels": self.pixels, "srgb": self.srgb}


Operand = int | float | tuple[float, ...]
"""A value of a shader: the number of the step that computes it, or a constant float, colour or vector."""

Step = Mapping[str, Any]
"""One step of a program: "op", its "args", which are operands, and its settings, as the native module takes them."""

Hidden = tuple[str, ...]
"""Kinds of rays that ignore an object: camera, shadow, diffuse, glossy, transmission, volume."""

TERMINATOR = 0.1
"""Blender's default of an object's *Shadow Terminator*, *Geometry Offset*."""

Volume = Mapping[str, Any]
"""The inside of objects: "closures" and "program", as the native module takes them."""


@dataclass(frozen=True)
class Closure:
    """A shader node with its share of a material.

    kind: principled, diffuse, translucent, glossy, glass, refraction, conductor, sheen, velvet, toon_diffuse,
    toon_glossy, subsurface, hair, hair_reflection, hair_transmission, transparent, emission or holdout. inputs:
    operands by name, including "weight"; missing ones have Blender's defaults. normal: the shading normal, or None for
    the surface's own. multiscatter: whether rough reflections conserve energy. distribution: of the facets: ggx,
    beckmann or ashikhmin_shirley. method: of subsurface scattering: random_walk, random_walk_skin or
    random_walk_legacy.
    """

    kind: str
    inputs: Mapping[str, Operand]
    normal: Operand | None = None
    multiscatter: bool = True
    distribution: str = "ggx"
    method: str = "random_walk"

    @property
    def glows(self) -> bool:
        """Whether it may emit light."""
        emission = self.inputs.get("emission", 0.0)
        # An operand computed by a step may emit; a constant emits if it is not zero.
        return isinstance(emission, int) or bool(np.any(emission))

    def as_dict(self) -> dict[str, Any]:
        """The closure as the native module takes it."""
        own = shallow(self)
        return {"kind": own.pop("kind"), **own.pop("inputs"), **own}


@dataclass(frozen=True)
class Material:
    """A surface: closures whose inputs are computed per point by a program.

    Without closures, a Principled BSDF with the constant values here; `emission` includes its strength. receives,
    blocks: a bit for each set of linked lights that shine on its objects, and that these shade. receivers, blockers:
    the sets that its own emission belongs to, as those of a `Light`. hole: whether camera rays see a hole; catcher:
    whether they see only shadows of others. opaque_shadow: whether shadow rays do not pass. terminator: cosine towards
    the light below which shadow rays start on the curved surface of the corner normals.
    outputs: numbers of passes "Output" and values. portals: colour, position, direction. strands: the layer that is 1
    on tubes of hairs, whose inside rays do not see. tube: whether all its surfaces are such tubes, of any material:
    their few sides are shaded as round hairs.
    """

    name: str
    base_color: RGB = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 0.5
    ior: float = 1.5
    transmission: float = 0.0
    specular: float = 0.5
    emission: RGB = (0.0, 0.0, 0.0)
    alpha: float = 1.0
    closures: tuple[Closure, ...] = ()
    program: tuple[Step, ...] = ()
    volume: Volume | None = None
    hidden_from: Hidden = ()
    receives: int = 0xFFFFFFFF
    blocks: int = 0xFFFFFFFF
    receivers: int = 0
    blockers: int = 0
    hole: bool = False
    catcher: bool = False
    opaque_shadow: bool = False
    terminator: float = TERMINATOR
    outputs: tuple[tuple[int, Operand], ...] = ()
    portals: tuple[tuple[Operand, Operand, Operand], ...] = ()
    strands: int | None = None
    tube: bool = False

    @property
    def glows(self) -> bool:
        """Whether it may emit light."""
        return any(self.emission) or any(closure.glows for closure in self.closures)

    def as_dict(self) -> dict[str, Any]:
        """The material as the native module takes it."""
        own = shallow(self)
        if not (self.receivers or self.blockers):  # the native module may be older than the keys
            del own["receivers"], own["blockers"]
        return own | {"closures": [closure.as_dict() for closure in self.closures], "program": list(self.program)}


@dataclass(frozen=True, eq=False)
class Light:
    """A lamp that shines along its -Z. name: its object's, for messages. group: light group, from 1; 0 is none.
    max_bounces: largest number of times that a path has scattered before its light samples see the light; None is any.

    power: linear RGB in W (sun: W/m²), Blender's energy × colour. radius, size, size_y in scene units; angle, spot_size
    (full cone) and spread in radians; shape as in Blender: SQUARE, RECTANGLE, DISK, ELLIPSE. sphere: whether point and
    spot lights are spheres, otherwise discs that face the receiver. receivers, blockers: the sets of objects that the
    light shines on and that shade it, 1 to 31; 0 is all. If the light varies, `program` computes a factor on the power,
    `radiance` is the operand with the result, and `frame` holds the fields of one ObjectFrame, the light's own space.
    """

    kind: str
    to_world: F64
    power: RGB
    radius: float = 0.0
    angle: float = 0.0
    spot_size: float = 0.0
    spot_blend: float = 0.0
    shape: str = "SQUARE"
    size: float = 0.0
    size_y: float = 0.0
    spread: float = math.pi
    sphere: bool = False
    casts_shadow: bool = True
    hidden_from: Hidden = ("camera",)
    receivers: int = 0
    blockers: int = 0
    group: int = 0
    max_bounces: int | None = None
    program: tuple[Step, ...] = ()
    radiance: Operand | None = None
    frame: tuple[Mapping[str, Any], ...] = ()
    # Excluded from comparison: a renamed lamp emits the same light.
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        called = self.name or "light"
        check(f"{called}: to_world", self.to_world, np.float64, (4, 4))
        if not np.isfinite(self.to_world).all() or not np.isfinite(self.power).all():
            raise SceneError(f"{called}: its transform or power is not finite")


@dataclass(frozen=True)
class World:
    """The background; `color` is linear RGB and includes its strength.

    If it varies, `program` computes it from the direction, and `radiance` is the operand with the result. group,
    max_bounces, casts_shadow: as of a light, the latter for light samples of a world that varies. volume: the medium
    everywhere outside, which does not vary. outputs: as of a material.
    """

    color: RGB = (0.0, 0.0, 0.0)
    program: tuple[Step, ...] = ()
    radiance: Operand | None = None
    hidden_from: Hidden = ()
    group: int = 0
    volume: Volume | None = None
    outputs: tuple[tuple[int, Operand], ...] = ()
    max_bounces: int | None = None
    casts_shadow: bool = True


@dataclass(frozen=True)
class Numbers:
    """Pass indices of objects and materials, and light groups of objects; 0 where not set.

    objects, groups: by name. materials: one for each of the scene's materials.
    """

    objects: dict[str, float] = field(default_factory=dict)
    materials: tuple[float, ...] = ()
    groups: dict[str, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return any(self.objects.values()) or any(self.materials) or any(self.groups.values())

    def arrays(self, runs: list[tuple[int, str]]) -> dict[str, NDArray[Any]]:
        """The indices as the native module takes them. runs: number of triangles and object name of
        each run, in order.
        """
        first = np.concatenate([[0], np.cumsum([count for count, _ in runs], dtype=np.int64)])[: len(runs)]
        return {
            "first": first.astype(np.int32),
            "object": np.array([self.objects.get(name, 0.0) for _, name in runs], np.float32),
            "material": np.array(self.materials, np.float32),
            "groups": np.array([self.groups.get(name, 0) for _, name in runs], np.uint8),
        }


Moved = F32 | tuple[F32, I64, F64]
"""Corners of triangles in another frame, (m, 3, 3). For instances those of meshes, what is added to the index of a
triangle in a mesh to find it there, (k,), and the matrices of the instances, (k, 3, 4).
"""


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a picture needs except the structure and the settings.

    motion: where the triangles are a frame before and a frame after, for the vector pass.
    """

    geometry: Geometry | InstancedGeometry
    materials: tuple[Material, ...]
    lights: tuple[Light, ...]
    world: World
    numbers: Numbers = field(default_factory=Numbers)
    images: tuple[Image, ...] = ()
    grids: tuple[Voxels, ...] = ()
    mattes: Mattes | None = None
    motion: tuple[Moved, Moved] | None = None

    def __post_init__(self) -> None:
        flattened = isinstance(self.geometry, Geometry)
        indices = self.geometry.material_index if flattened else self.geometry.materials  # type: ignore[union-attr]
        check_range("material_index", indices, len(self.materials), "materials")

    def for_passes(self) -> dict[str, Any] | None:
        """The data that only passes need, as the native module takes it; None if there is none."""
        uvs = self.geometry.uvs
        if not self.numbers and uvs is None and self.mattes is None and self.motion is None:
            return None
        runs = self.geometry.runs()
        moved = {} if self.motion is None else {"motion": self.motion}
        identities = {} if self.mattes is None else self.mattes.arrays(runs)
        return {**self.numbers.arrays(runs), "uvs": uvs, **identities, **moved}
