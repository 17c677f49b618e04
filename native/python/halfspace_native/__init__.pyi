# SPDX-License-Identifier: GPL-3.0-or-later
"""Halfspace's native core: acceleration structures over triangles, rays through them, rendering.

Usable without Blender. Arrays are NumPy's; what is called F32 accepts float32 and float64, the
latter rounded once. Every error names the argument, the first bad index and what was expected.
Long calls release the GIL. Results do not depend on the caller's floating-point mode (flush-to-zero,
rounding), which is restored after each call; RuntimeError where it cannot be set.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypedDict, overload

import numpy as np
import numpy.typing as npt

__version__: str
"""The version of the module; the add-on refuses to work with another."""

F32 = npt.NDArray[np.float32] | npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32] | npt.NDArray[np.uint32] | npt.NDArray[np.int64]
I64 = npt.NDArray[np.int64]

class ShapeError(ValueError):
    """An array has the wrong shape or type, or an index is out of range."""

class NonFiniteError(ValueError):
    """A number is NaN, or infinite where a finite one is needed."""

class SpecError(ValueError):
    """A configuration string or a setting is not understood or out of range."""

class RefitError(ValueError):
    """A structure cannot be fitted to these moved vertices: it must be built again."""

class Cancelled(RuntimeError):
    """The work was cancelled through its monitor."""

class Parameter(TypedDict):
    """A parameter of a structure: key, label, what more of it costs, unit, type and range.

    kind: "integer" or "float" with min and max, or "choice" with options; the others are None.
    """

    name: str
    label: str
    doc: str
    unit: str
    kind: Literal["integer", "float", "choice"]
    default: int | float | str
    min: int | float | None
    max: int | float | None
    options: list[str] | None
    labels: list[str] | None
    """Names of the options for people."""
    group: Literal["main", "builder", "costs", "numerics"]
    """Part of a panel that shows it."""
    needs: list[Need]
    """Where it has an effect: where each of these holds."""
    option_needs: dict[str, list[Need]]
    """Where an option can be chosen, for those that cannot be chosen everywhere."""

class Need(TypedDict):
    """A condition on another parameter: its value is one of `options`, or a number above `above`; the other is None."""

    key: str
    options: list[str] | None
    above: float | None

class Way(TypedDict):
    """A valid pair of nodes and traversal.

    nodes: planes, wide, boxes, intervals, octants, cells or none. traversal: value of that parameter, "" for a
    structure without one. rays: how rays go together.
    """

    nodes: str
    traversal: str
    rays: Literal["single", "flight", "packet", "tile", "beam", "stream", "auto"]
    label: str
    doc: str

class Route(TypedDict):
    """Which kernel answers a kind of batch: its nodes, how rays go together, and whether counters are its own."""

    nodes: str
    rays: Literal["single", "flight", "packet", "tile", "beam", "stream"]
    counted: bool

class StructureRow(TypedDict):
    """A row of the registry. code is saved in .blend files and never reused. aliases: names and their parameters."""

    id: str
    aliases: dict[str, str]
    code: int
    label: str
    family: str
    summary: str
    paper: str
    parameters: list[Parameter]
    traversals: list[str]
    """Values of the parameter `traversal` through the structure's own nodes, the default first."""
    ways: list[Way]
    """All valid pairs of nodes and traversal, the default first."""
    no_groups: str
    """Why neither packets nor tiles nor streams go through its nodes; empty where all of them do."""
    heading: str
    """Heading of the family in lists."""
    menu: str
    """Title of the menu of `literature`."""
    literature: list[tuple[str, str]]
    """Names in the literature, each with its configuration."""
    sweep: bool
    """Whether split directions are selected anew at every node."""
    claims: list[str]
    """Ids of the published claims about it; a * at the end includes all ids that begin so."""

class Statistics(TypedDict):
    """Statistics of a build.

    build_seconds: wall-clock time. refits: number of times that the structure was fitted to moved vertices since it
    was built; refit_seconds: wall-clock time of the last of them, or 0. bytes: nodes and leaves, without the arrays
    of the scene. All numbers are those of the nodes that rays traverse. references: triangles in all leaves
    together. links: from leaves to their neighbours, where a structure stores them. depth_max, depth_mean: of the
    leaves, the root at 0. leaf_max: triangles in the largest leaf. leaves_large: leaves of more than 64. sah_cost:
    expected cost of a random ray in the thesis's units (80 a triangle, 1 an axis step, 5 an oblique step), the same
    for all structures. sah_cost_built: the same when the structure was built. parts_built, parts_waiting: with
    lazy=1 the subtrees that rays have caused to be built, and those not built yet; all other numbers then describe
    the part built so far. left_out: features that the scene did not need, each with its reason. dropped_triangles:
    those without area or with a vertex that is not finite.
    """

    build_seconds: float
    refits: int
    refit_seconds: float
    bytes: int
    nodes_axis: int
    nodes_oblique: int
    leaves: int
    leaves_empty: int
    leaf_max: int
    leaves_large: int
    references: int
    links: int
    depth_max: int
    depth_mean: float
    sah_cost: float
    sah_cost_built: float
    parts_built: int
    parts_waiting: int
    left_out: list[str]
    dropped_triangles: int

class SplitPolygons(TypedDict):
    """Split planes cut to their cells, breadth first.

    vertices: (v, 3) float32, scene frame. offsets: (p + 1,) uint32, where each polygon begins.
    depth: (p,) uint32. kind: (p,) uint8, 0 1 2 the plane of an axis, 3 oblique, 4 slab pair,
    5 octant, 6 the face of a box around the triangles of a node. hidden: how many more there are within max_depth.
    """

    vertices: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.uint32]
    depth: npt.NDArray[np.uint32]
    kind: npt.NDArray[np.uint8]
    hidden: int

def level() -> str:
    """The SIMD level in use: avx512, avx2, sse4.2, neon or fallback."""

def use_level(level: str) -> None:
    """Uses another SIMD level from now on in all threads of the process. Answers are the same at each level.

    level: "best", or a level of this machine as level() names it. ValueError if it has none of this name.
    """

def free_memory() -> int:
    """Memory limit of a build that is given none, in bytes: seven eighths of what machine and process have free."""

def structures() -> list[StructureRow]:
    """The registry: every structure and its parameters, in display order."""

def count_events(function: Callable[[], object], names: Sequence[str]) -> dict[str, float]:
    """Counts events while a function runs, on the calling thread and on those that it starts meanwhile.

    function: called without arguments; its result is dropped. names: of "cache_misses" and "cache_references" (of the
    last cache), "instructions", "page_faults", "task_clock" (nanoseconds). Returns the number of each, without the
    system's own work; where events share a counter of the processor, an estimate from its part of the time. Raises
    ValueError for other names; OSError, with one sentence, where the system does not count an event, as on all systems
    but Linux.
    """

def effective(spec: str) -> dict[str, int | float | str | None]:
    """Each parameter of a configuration's structure with its effective value, or None where it has no effect.

    The configuration may contradict itself: a value out of its range becomes the nearest, an option that the other
    values exclude becomes the default. SpecError for an unknown structure or parameter, or text that is no number.
    """

def options(spec: str) -> dict[str, list[str]]:
    """The options of each choice that are valid with the other values, which may contradict each other. SpecError."""

def idle(spec: str) -> list[tuple[str, str]]:
    """The given values that have no effect with the others: name, and name of the parameter that prevents it.

    SpecError as for effective().
    """

class Monitor:
    """Progress of a build, and cancellation of builds and of traced rays; usable from any thread."""

    progress: float
    """Fraction of the work that is done, 0..1."""
    cancelled: bool
    """Whether cancel() was called."""
    def __init__(self) -> None: ...
    def cancel(self) -> None:
        """Requests the work to stop; a build raises Cancelled within a tenth of a second."""

class Hits:
    """The results of closest(), one per ray.

    t: (n,) float32, distance in units of the direction, correctly rounded; inf = miss.
    triangle: (n,) int32, -1 = miss; among triangles at the same t the one with the smallest index.
    u, v: (n,) float32, weights of the second and third corner: the point is
    (1 - u - v) a + u b + v c. Each access makes a new array.
    counters: None, or per ray (n,) uint32 under "steps", "steps_axis", "steps_oblique", "steps_boxes", "leaves",
    "leaves_empty", "visits", "tests", "tests_wasted", "verdicts", "spared" (1: answered without a traversal of its
    own). "steps" are inner nodes: "steps_axis" of axis-aligned planes, "steps_oblique" of oblique planes or oriented
    boxes, "steps_boxes" of boxes, intervals, octants or grid cells. "leaves" are visits of leaves with triangles,
    "leaves_empty" of others. Rays that go together (packet, tile, beam, stream) visit a node once: the step or leaf is
    counted for one of them, and "visits" counts the nodes and leaves of every ray. "tests_wasted" are those "tests" on
    visits of leaves that did not improve the ray's answer; packets and tiles, which test for several rays at once,
    count all their tests there. From TA-B also the cases of ray and split plane, "case_n1" to "case_n5" (origin below
    the plane: 1 away from it, 2 along it, 3 towards it but the cell ends before, 4 through it inside the cell, 5
    through it before the cell), "case_p1" to "case_p5" (above), "case_z1" (in the plane: upwards), "case_z2"
    (downwards), "case_z3" (along); from beam-hh "beam_visits" (nodes visited by the beam whose first ray this is),
    "beam_cuts" (number of times a polygon split the beam) and "beam_singles" (1: the ray was traced on its own); from
    octree-beam with traversal=polygon "beams", "beam_clips" (of a polygon against a line), "beam_splits",
    "beam_pixels" (found by scan conversion), "beam_singles" and "beam_empty" (visits of nodes by beams without a ray).
    on_boundary: None, or from exact_closest (n,) bool: whether the ray passes exactly through an edge or a vertex
    of the triangle it hits.
    """

    t: npt.NDArray[np.float32]
    triangle: npt.NDArray[np.int32]
    u: npt.NDArray[np.float32]
    v: npt.NDArray[np.float32]
    counters: dict[str, npt.NDArray[np.uint32]] | None
    on_boundary: npt.NDArray[np.bool_] | None
    def __len__(self) -> int: ...

class NearestPoints:
    """The results of closest_points() and points_within().

    distance: (n,) float32, correctly rounded; inf = none found. triangle: (n,) int32, -1 = none; among triangles at the
    same exact distance the one with the smallest index. point: (n, 3) float32, the closest point of that triangle, each
    coordinate correctly rounded; NaN = none. Each access makes a new array.
    """

    distance: npt.NDArray[np.float32]
    triangle: npt.NDArray[np.int32]
    point: npt.NDArray[np.float32]
    def __len__(self) -> int: ...

class Faces(TypedDict):
    """Convex cells in the scene's frame."""

    vertices: F32
    """(v, 3), the corners of all faces."""
    offsets: npt.NDArray[np.uint32]
    """(f + 1,), where each face begins in `vertices`."""
    cells: npt.NDArray[np.uint32]
    """(c + 1,), where each cell begins among the faces."""

class LeafCells(Faces):
    """Leaves, the fullest first."""

    count: npt.NDArray[np.uint32]
    """(c,), triangles in each leaf."""
    depth: npt.NDArray[np.uint32]
    """(c,), 0 for the root."""
    hidden: int
    """Leaves left out because of max_count."""

class Visits(Faces):
    """Leaves along a ray: those tested in the order of the traversal, those passed untested between them.

    With traversal=boxes leaves are boxes, which may overlap.
    """

    enter: npt.NDArray[np.float64]
    leave: npt.NDArray[np.float64]
    """(c,), in units of the direction, up to the hit; beyond it for leaves that were tested before it was known. NaN
    where only the error bound led the traversal there."""
    depth: npt.NDArray[np.uint32]
    tested: npt.NDArray[np.bool_]
    steps: npt.NDArray[np.uint32]
    """Inner nodes that the traversal had visited when it tested the leaf; 0 for untested leaves."""
    triangles: npt.NDArray[np.uint32]
    """Those of all leaves, one after another."""
    triangle_offsets: npt.NDArray[np.uint32]
    """(c + 1,), where each leaf begins in `triangles`."""
    corners: F32
    """(3 t, 3), the three corners of each of `triangles`."""

class Crossings(TypedDict):
    """Planes along a ray, the nearest first, each cut to the node that it splits; none with traversal=boxes."""

    vertices: F32
    offsets: npt.NDArray[np.uint32]
    """(p + 1,), where each plane's polygon begins in `vertices`."""
    t: npt.NDArray[np.float64]
    kind: npt.NDArray[np.uint8]
    """(p,), as in SplitPolygons."""
    depth: npt.NDArray[np.uint32]

class RayPath(TypedDict):
    """The path of one ray."""

    t: float
    triangle: int
    """-1 = miss; t, u and v as in Hits."""
    u: float
    v: float
    counters: dict[str, int]
    """As in Hits, for this ray."""
    visits: Visits
    crossings: Crossings

class BeamPath(TypedDict):
    """The way of beams of polygons; one row per step, a beam in a node, in the order of the traversal. Scene frame."""

    hits: Hits
    """Those of the rays, with their counters."""
    parent: npt.NDArray[np.int32]
    """(s,), step that the beam comes from; -1 = it begins."""
    node: npt.NDArray[np.int32]
    """(s,), number of the node; of a beam that leaves the root the leaf that it comes from."""
    level: npt.NDArray[np.int32]
    """(s,), 0 for the root."""
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    """(s, 3), box of the node. Beams see the faces of the root one smallest cell farther out."""
    face: npt.NDArray[np.int32]
    """(s,), face of the node through which the beam enters it, or leaves the root: 2 axis + side, 0 lower or 1 upper;
    -1 = the beam begins inside."""
    action: npt.NDArray[np.int32]
    """(s,): 0 ended, no ray is left; 1 turned into single rays; 2 handed on whole to one child or one neighbour; 3
    clipped by the faces of a leaf, and handed on to the neighbours behind them; 4 split among the children of an inner
    node; 5 left the root."""
    tested: npt.NDArray[np.bool_]
    """(s,), whether the rays were tested against the triangles of a leaf."""
    vertices: npt.NDArray[np.float64]
    offsets: npt.NDArray[np.int64]
    """(s + 1,), where the polygon of each step, the beam's section in its face, begins in `vertices`. It contains the
    rays but for rounding; its corners lie in the face."""
    rays: npt.NDArray[np.int32]
    ray_offsets: npt.NDArray[np.int64]
    """(s + 1,), where the rays of each step that have not ended begin in `rays`."""

class Analysis(TypedDict):
    """Statistics of a tree, computed on demand; a function of the tree alone.

    Levels and depths count from the root, which has 0. Costs are in the units of `Statistics.sah_cost`: 1 per
    axis-aligned step, 5 per oblique step, 80 per triangle test.
    """

    nodes: int
    """Inner nodes. A grid has three levels of them: slices along x, rows along y, cells along z."""
    leaves: int
    leaf_depths: I64
    """Number of leaves at each depth."""
    leaf_sizes: I64
    """Numbers of triangles that leaves hold, ascending."""
    leaf_size_counts: I64
    """Number of leaves that hold as many triangles as the entry of `leaf_sizes` says."""
    children: I64
    """Number of inner nodes with 0, 1, 2, ... children."""
    level_nodes: I64
    """Inner nodes at each level."""
    level_planes_axis: I64
    level_planes_oblique: I64
    """Planes that the nodes of each level store; none for boxes, whose faces are not planes of the node."""
    level_directions_axis: I64
    level_directions_oblique: I64
    """Distinct directions of these planes; opposite normals count once."""
    sah_nodes: float
    sah_leaves: float
    """Expected cost of a random ray that meets the scene's box and is stopped by nothing: of steps and of tests.
    Regions are clipped to those of their parents, so turned boxes cost less than in `Statistics.sah_cost`; for all
    other structures the sum is that number."""
    sah_steps_axis: float
    sah_steps_oblique: float
    sah_tests: float
    """Expected numbers of the operations that these costs consist of."""
    epo: float
    """End-point overlap (Aila, Karras and Laine 2013): for each node the surface inside its region of triangles that
    no leaf below it holds, over the whole surface, multiplied by the cost of the node. 0 for trees that partition
    space. Regions of such trees are smaller by 2^-21, others larger by 2^-40 of the largest coordinate, which bounds
    the error of each clipped area by the triangle's perimeter times that distance."""
    epo_nodes: float
    epo_leaves: float
    """The parts of `epo` that are steps and tests."""
    epo_steps_axis: float
    epo_steps_oblique: float
    epo_tests: float
    """Expected numbers of the operations that these costs consist of."""
    epo_error: float
    """Standard error of `epo` if `epo_sample` < `epo_triangles`, else 0."""
    epo_sample: int
    """Number of triangles whose surface was used."""
    epo_triangles: int
    """Number of triangles that can be hit."""
    beta: float | None
    beta_axis: float | None
    beta_oblique: float | None
    """Share of the visits of nodes that one plane divides in which a random ray meets one child only: the mean of
    1 - 2 (area of the section) / (surface area of the node), weighted with that surface area; of all such nodes, of
    those with a plane of an axis, of those with an oblique plane. None without such nodes."""

class Export(TypedDict):
    """A whole tree as flat arrays: n nodes in preorder, scene frame. numpy.savez stores it.

    Lists of different length per node lie one after another; entries offsets[i] to offsets[i + 1] are those of node i.
    """

    node_kind: npt.NDArray[np.uint8]
    """(n,): 0, 1, 2 a plane of that axis; 3 oblique; 4 slabs; 5 octants; 6 boxes of the children; 7 a leaf."""
    node_parent: npt.NDArray[np.int32]
    """(n,); -1 for the root."""
    node_depth: npt.NDArray[np.uint32]
    """(n,)."""
    node_bounds: npt.NDArray[np.float64]
    """(n, 6): lower and upper corner of the box around the node's region."""
    child_offsets: npt.NDArray[np.uint32]
    children: npt.NDArray[np.uint32]
    """(n + 1,), (n - 1,): children of each node, the one below the first plane first."""
    plane_offsets: npt.NDArray[np.uint32]
    planes: npt.NDArray[np.float64]
    plane_kind: npt.NDArray[np.uint8]
    """(n + 1,), (p, 4), (p,): planes that the node stores, x, y and z of the normal and the height along it; kinds as
    of nodes."""
    wall_offsets: npt.NDArray[np.uint32]
    walls: npt.NDArray[np.float64]
    """(n + 1,), (w, 4): faces of each region that is no box, outward unit normal and height; none for boxes."""
    triangle_offsets: npt.NDArray[np.uint32]
    triangles: npt.NDArray[np.uint32]
    """(n + 1,), (r,): triangles of each leaf; none for inner nodes."""

class Structure:
    """A structure built over triangles. Immutable; any number of threads may trace rays through it."""

    spec: str
    """The configuration, with only what differs from the defaults."""
    statistics: Statistics
    """Statistics of the build."""
    counted_as: str
    """Name of the traversal of single rays, which counters count where rays are traced together but not counted
    together.
    """
    routes: dict[str, Route]
    """Which kernel answers each kind of batch: "single", "closest", "tiles" (rays with order="tile8"), "shadow".

    Each is a dictionary: "nodes", what rays are tested against; "rays", how they go together; "counted", whether
    counters are those of this kernel, and not of single rays.
    """

    def closest(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: bool = False,
        triangle_mask: npt.NDArray[np.uint32] | None = None,
        ray_mask: int | npt.NDArray[np.uint32] | None = None,
        monitor: Monitor | None = None,
    ) -> Hits:
        """The nearest triangle that each ray hits; the same bits for every structure.

        origins, directions: (n, 3), scene frame; directions of any length, a zero direction hits
        nothing. t_min, t_max: the closed interval that counts, in units of the direction, one
        number or (n,), negative behind the origin; 0 and inf when not given. A hit whose distance
        overflows float32 is a miss. order: "tile8" promises that every 64 consecutive
        rays are an 8x8-pixel tile. threads: 0 = one per core.
        triangle_mask: (m,) uint32, ray_mask: one number or (n,) uint32, all bits when not given: a ray meets only the
        triangles with which it shares a bit. Such rays are traced singly, and are not counted.
        monitor: to cancel the call, read between slices of at most 1024 rays; counted rays are traced in whole batches.
        It counts no progress.
        Raises ShapeError, NonFiniteError (NaN or infinite rays, found as they are traced; NaN distances), SpecError
        (order; counters with masks), Cancelled.
        """

    @overload
    def occluded(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: Literal[False] = False,
        triangle_mask: npt.NDArray[np.uint32] | None = None,
        ray_mask: int | npt.NDArray[np.uint32] | None = None,
        monitor: Monitor | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Whether each ray hits anything at all: (n,) bool; with counters=True a pair of that
        and the counters of Hits. Arguments and errors as for closest().
        """
    @overload
    def occluded(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: Literal[True],
        monitor: Monitor | None = None,
    ) -> tuple[npt.NDArray[np.bool_], dict[str, npt.NDArray[np.uint32]]]: ...
    def all_hits(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        max_hits: int | None = None,
        threads: int = 0,
        monitor: Monitor | None = None,
    ) -> tuple[npt.NDArray[np.int64], Hits]:
        """Every triangle that each ray hits, nearest first; of equal distances, the smallest index first. The same for
        every structure, to the bit.

        Returns (offsets, hits): offsets, (n + 1,) int64, where the hits of each ray begin, and the number of all hits;
        hits, those of one ray after another. max_hits: largest number of hits of a ray, the nearest; None = no limit.
        Rays are traced singly. Other arguments and errors as for closest(); MemoryError if the hits do not fit.
        """

    def count_hits(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        threads: int = 0,
        monitor: Monitor | None = None,
    ) -> npt.NDArray[np.int64]:
        """The number of triangles that each ray hits: (n,) int64. Arguments and errors as for closest()."""

    def closest_points(
        self,
        points: F32,
        max_distance: float | F32 | None = None,
        *,
        threads: int = 0,
        monitor: Monitor | None = None,
    ) -> NearestPoints:
        """The point of the triangles that is closest to each point, and its triangle. Exact: integers decide where f64
        cannot.

        points: (n, 3). max_distance: one number or (n,), only triangles at most that far away count; None = inf.
        Triangles without area count as segments or points, those that are not finite do not count. The first call
        copies the nodes. monitor: to cancel the queries. Raises ShapeError, NonFiniteError; SpecError unless the
        structure is a "bvh-sah"; Cancelled; MemoryError.
        """

    def points_within(
        self, points: F32, radius: float | F32, *, threads: int = 0, monitor: Monitor | None = None
    ) -> tuple[I64, NearestPoints]:
        """Every triangle at most `radius` away from each point, nearest first; of equal distances, the smallest index
        first.

        radius: one number or (n,). Returns (offsets, found): offsets, (n + 1,) int64, where the triangles of each point
        begin, and the number of all; found, those of one point after another. Other arguments and errors as for
        closest_points().
        """

    def overlaps(self, other: Structure, *, threads: int = 0, monitor: Monitor | None = None) -> npt.NDArray[np.int32]:
        """Every pair of a triangle of this structure and one of the other that have a point in common: (k, 2) int32,
        sorted. Exact: triangles that touch in a vertex are a pair.

        With the structure itself, pairs are of different triangles that share no edge; those that share a vertex have a
        further point in common. Each is found in both orders. Errors as for closest_points().
        """

    def refit(
        self,
        vertices: F32,
        triangles: Indices | None = None,
        *,
        threads: int = 0,
        monitor: Monitor | None = None,
    ) -> Structure:
        """Returns a new structure, fitted to moved vertices: the same nodes around the triangles where they are now.
        Its answers are those of a structure built anew, which takes longer.

        vertices: (n, 3), those of build() in their order; triangles that they leave without area or not finite are not
        hit until they can be again. triangles: those of build(), to have them compared; None = not compared.
        threads: 0 = one per core. monitor: to cancel the fit; it counts no progress. statistics has the cost now and at
        the build: rays take longer in the proportion.
        Raises RefitError unless the structure is one of boxes ("bvh-sah") or intervals ("bih" and those like it), and
        where a triangle can be hit that could not be when the structure was built; ShapeError for other numbers of
        vertices and for other triangles; Cancelled; MemoryError.
        """

    def record(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        any_hit: bool = False,
        monitor: Monitor | None = None,
    ) -> Recording:
        """Traces the rays one by one, on one thread, and records the answer of every leaf, so that the
        traversals can be repeated without triangle tests.

        any_hit: as occluded() does, else as closest(). Arguments and errors as for closest(); also
        SpecError for "brute", which has no traversal.
        """

    def validate(self, *, monitor: Monitor | None = None) -> list[str]:
        """Descriptions of broken invariants; empty for a valid structure. Slow, for tests.

        monitor: to cancel the check. Raises Cancelled.
        """

    def analysis(self, max_nodes: int = 200_000, *, monitor: Monitor | None = None) -> Analysis:
        """Statistics of the tree: leaves, levels, children, expected cost, end-point overlap, beta.

        max_nodes: end-point overlap of a tree of more nodes is estimated from a sample of the triangles,
        fewer by the same factor but at least 1024, with a fixed seed. Takes time in proportion to the nodes.
        monitor: to cancel it. Raises SpecError for numbers below 0, Cancelled.
        """

    def export(self, *, monitor: Monitor | None = None) -> Export:
        """The whole tree as flat arrays; numpy.savez(path, **structure.export()) stores it.

        monitor: to cancel it. Raises Cancelled.
        """

    def split_polygons(
        self, max_depth: int = 60, max_count: int = 20_000, *, monitor: Monitor | None = None
    ) -> SplitPolygons:
        """The split planes of nodes down to max_depth, at most max_count of them, breadth first.

        monitor: to cancel it. Raises SpecError for numbers below 0, Cancelled.
        """

    def leaf_cells(
        self, min_triangles: int = 1, max_count: int = 20_000, *, monitor: Monitor | None = None
    ) -> LeafCells:
        """The cells of leaves with at least min_triangles, the fullest first, at most max_count.

        monitor: to cancel it. Raises SpecError for numbers below 0, Cancelled.
        """

    def trace_path(
        self,
        origin: Sequence[float],
        direction: Sequence[float],
        t_min: float = 0.0,
        t_max: float = ...,
        *,
        any_hit: bool = False,
        monitor: Monitor | None = None,
    ) -> RayPath:
        """The path of one ray to its nearest hit: the nodes, leaves and triangles that its traversal tested.

        origin, direction: three numbers each, scene frame. t_min, t_max: as for closest(); inf when not given.
        any_hit: the path of a ray of occluded(), to the hit that ends it. monitor: to cancel it. Raises NonFiniteError,
        Cancelled.
        """

    def trace_beam(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        any_hit: bool = False,
        monitor: Monitor | None = None,
    ) -> BeamPath:
        """Traces rays that go together as beams of polygons, and records the way of the beams through the octree.

        origins, directions, t_min, t_max: as for closest(), at most 524,288 rays; those of a common origin, or of a
        common direction, go together. any_hit: rays of occluded(), whose beams begin at their light. monitor: to cancel
        it. A step is a beam in a node. The rays of a step that need another node are divided among the steps that come
        from it. Raises SpecError unless the structure is an "octree-beam" with traversal=polygon, for any_hit also
        shadow=beam; ShapeError, NonFiniteError, Cancelled.
        """

class Recording:
    """Rays and the answers of the leaves that they visited, from Structure.record()."""

    @property
    def counters(self) -> dict[str, npt.NDArray[np.uint32]]:
        """The counters of each ray when it was recorded, as Hits.counters."""

    def replay(self) -> npt.NDArray[np.float64]:
        """Traces the rays again on the calling thread, through the same nodes in the same order but with
        the recorded answers in place of triangle tests.

        Returns the seconds of each 1024 rays, the last for the rest: the time of traversal alone, from the ray
        in the structure's frame to the last leaf. To compare traversals on a busy machine, take the median of
        each chunk over several replays, interleaved, and add them up. RuntimeError if a ray visits
        other leaves than recorded, which is a bug.
        """

    def __len__(self) -> int: ...

def build(
    vertices: F32,
    triangles: Indices,
    spec: str = "kd",
    *,
    threads: int = 0,
    monitor: Monitor | None = None,
    memory_limit: int | None = None,
) -> Structure:
    """Builds a structure over triangles.

    vertices: (n, 3). triangles: (m, 3) indices; those without area or not finite are dropped and
    counted, and the others keep their indices. spec: "id" or "id:key=value,...", see structures(). The
    result is a function of these alone, on any number of threads; 0 = one per core.
    memory_limit: bytes that the build may use besides the scene, counted while it runs; None = seven
    eighths of the free memory of the machine when it begins. With lazy=1 the parts built later, by rays, are estimated.
    Raises SpecError, ShapeError, Cancelled, and MemoryError when the limit is exceeded or the tree cannot be
    addressed; RuntimeError for an internal error.
    """

class InstanceStatistics(TypedDict):
    """Statistics of instances.

    build_seconds: time to build the tree over the instances. bytes: memory, including the structures of the meshes;
    bytes_instances: the instances and the tree over them. nodes_axis: nodes of that tree. instances, meshes: their
    number. triangles: of all instances together. dropped_instances: those whose transform is singular, not finite or
    out of the range of float32. dropped_triangles: in the meshes of all others. left_out: as in Statistics.
    """

    build_seconds: float
    bytes: int
    bytes_instances: int
    nodes_axis: int
    instances: int
    meshes: int
    triangles: int
    dropped_instances: list[int]
    dropped_triangles: int
    left_out: list[str]

class Instances:
    """Instances of meshes in two levels: a tree over the instances above the structures of the meshes. Immutable; any
    number of threads may trace it at once.

    Results equal bit for bit those of a structure over flattened(), and triangles have the same indices: first
    those of instance 0, then those of instance 1 and so on.
    """

    statistics: InstanceStatistics
    """Statistics of the build and of the meshes."""

    def __len__(self) -> int:
        """Number of instances, including dropped ones."""

    def closest(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: bool = False,
        triangle_mask: npt.NDArray[np.uint32] | None = None,
        ray_mask: int | npt.NDArray[np.uint32] | None = None,
        monitor: Monitor | None = None,
    ) -> Hits:
        """Like Structure.closest(). Steps include those of the tree over the instances."""

    @overload
    def occluded(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: Literal[False] = False,
        triangle_mask: npt.NDArray[np.uint32] | None = None,
        ray_mask: int | npt.NDArray[np.uint32] | None = None,
        monitor: Monitor | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Like Structure.occluded()."""
    @overload
    def occluded(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: Literal[True],
        monitor: Monitor | None = None,
    ) -> tuple[npt.NDArray[np.bool_], dict[str, npt.NDArray[np.uint32]]]: ...
    def all_hits(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        max_hits: int | None = None,
        threads: int = 0,
        monitor: Monitor | None = None,
    ) -> tuple[npt.NDArray[np.int64], Hits]:
        """Like Structure.all_hits()."""

    def count_hits(
        self,
        origins: F32,
        directions: F32,
        t_min: float | F32 | None = None,
        t_max: float | F32 | None = None,
        *,
        threads: int = 0,
        monitor: Monitor | None = None,
    ) -> npt.NDArray[np.int64]:
        """Like Structure.count_hits()."""

    def flattened(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Vertices (n, 3) and triangles (m, 3) of the scene with all instances copied: a vertex becomes x * m[0] + y *
        m[1] + z * m[2] + m[3] for each row m of the matrix, in float64 and in this order, then rounded to float32.
        Mirrored instances swap the second and third corner of each triangle. Dropped instances have NaN vertices.
        Raises MemoryError.
        """

def build_instances(
    structures: Sequence[Structure | Instances],
    mesh: npt.NDArray[np.int32],
    matrices: npt.NDArray[np.float64],
    *,
    top: str = "sah",
    threads: int = 0,
    monitor: Monitor | None = None,
    memory_limit: int | None = None,
) -> Instances:
    """Builds a tree over instances; the structures of the meshes are shared, not copied.

    structures: of the meshes, in mesh space, whose configurations may differ; in place of one, Instances are placed as
    a whole, each as an instance of its mesh with the product of the matrices. mesh: (k,) int32, the index of what each
    instance places. An instance so far from the origin that its vertices are rounded coarsely in the scene has a
    structure of its own. Meshes are numbered part after part, for RenderScene too. matrices: (k, 4, 4) or (k, 3, 4)
    float64, mesh to scene. top: how the tree over the instances is partitioned: "sah" by the surface area heuristic,
    "grid" by a regular grid as in bih, "middle" or "median" along the longest side. threads, monitor, memory_limit: as
    for build(). Instances whose matrix is singular, not finite or out of the range of float32 are dropped and listed in
    the statistics. Raises ShapeError (also for more than 2**31 - 2 triangles), SpecError, Cancelled, MemoryError.
    """

def exact_closest(
    vertices: F32,
    triangles: Indices,
    origins: F32,
    directions: F32,
    t_min: float | F32 | None = None,
    t_max: float | F32 | None = None,
    *,
    threads: int = 0,
) -> Hits:
    """The nearest hit by exact integer arithmetic, O(n) per ray: for small inputs.

    Arguments and errors as for build() and Structure.closest().
    """

def exact_closest_points(
    vertices: F32, triangles: Indices, points: F32, max_distance: float | F32 | None = None
) -> NearestPoints:
    """The closest points by integer arithmetic alone, O(n) per point: for small inputs.

    Arguments and errors as for build() and Structure.closest_points().
    """

def exact_overlaps(
    vertices: F32, triangles: Indices, other_vertices: F32, other_triangles: Indices
) -> npt.NDArray[np.int32]:
    """Every pair of triangles of two scenes that have a point in common, by integer arithmetic alone: (k, 2) int32,
    sorted. Compares all pairs: for small inputs.

    Arguments and errors as for build(); triangles that are not finite have no pairs.
    """

class Case(TypedDict):
    """A generated scene and rays that test numerical extremes.

    extremes: the extreme cases that it covers, e.g. "X16". vertices: (n, 3) float32; cases about
    invalid input have some that are not finite. triangles: (m, 3) uint32. origins, directions: (r, 3) float32,
    finite. t_min, t_max: (r,) float32.
    """

    name: str
    summary: str
    extremes: list[str]
    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.uint32]
    origins: npt.NDArray[np.float32]
    directions: npt.NDArray[np.float32]
    t_min: npt.NDArray[np.float32]
    t_max: npt.NDArray[np.float32]

def cases(size: Literal["small", "large"] = "small", *, seed: int = 7) -> list[Case]:
    """The generated scenes and rays for which every structure must return the hits of brute force.

    size: "small": hundreds of triangles and rays per case; "large": tens of thousands. seed: 0 to 2**64 - 1, seeds
    the random parts. Raises SpecError if either is out of range.
    """

def ulp_distance(a: npt.NDArray[np.float32], b: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
    """Number of float32 steps between a and b, (n,) each, counted through zero.

    Two NaN are 0 apart, NaN and a number 2**63 - 1. Raises ShapeError if the lengths differ.
    """

class RecordedRays(TypedDict):
    """Rays of one kind, as `RenderJob.recorded` returns them."""

    origins: npt.NDArray[np.float32]
    directions: npt.NDArray[np.float32]
    t_min: npt.NDArray[np.float32]
    t_max: npt.NDArray[np.float32]
    any: bool
    traced: int

class RenderStatistics(TypedDict):
    """Statistics of a render so far; final once it has ended.

    seconds: wall-clock time. rays_primary: camera rays; rays_shadow: rays to lights; those continued behind a
    transparent surface count again; rays_secondary: rays after a bounce or through a transparent surface;
    rays_programs: rays of nodes such as Ambient Occlusion. beams:
    groups of secondary rays that came from one virtual eye and were traced in tiles, rays_beams: rays in them,
    beam_deviation: largest angle between a ray from a virtual eye and the direction of the single ray, radians; all
    0 without "secondary_beams". mrays_s: all rays per second, in millions. steps, tests: inner nodes visited and
    triangles tested by camera rays; None unless "Traversal Steps" or "Triangle Tests" is among the passes, because
    an uncounted traversal is faster.
    """

    seconds: float
    rays_primary: int
    rays_shadow: int
    rays_secondary: int
    rays_programs: int
    beams: int
    rays_beams: int
    beam_deviation: float
    mrays_s: float
    steps: int | None
    tests: int | None

def evaluate_program(request: Mapping[str, Any]) -> npt.NDArray[np.float32]:
    """The result of a shading program at points that no ray meets, (n, 4) float32: a colour and its alpha, a vector,
    or a number three times.

    request: a dictionary of "positions" and "normals" (unit vectors), (n, 3) float32; "program" and "result", as the
    program and an argument of a material of RenderScene; and, as for RenderScene, "images", "layers", (n, 3, 2 to
    4), of which the first corner of entry i belongs to point i, "objects", "object_index", (n,), and "origin". There
    is no camera, and heights next to a point are those of the point.

    Raises ShapeError, NonFiniteError and SpecError as RenderScene does. Releases the GIL while it computes.
    """

class RenderScene:
    """A scene to render: a structure with materials, lights and background, without the camera.

    Lengths and positions are in the structure's space, colours are linear RGB. Unknown keys raise an error, so that
    misspelt ones are not ignored.

    structure: a Structure or Instances; shared, not copied. material_index: (m,) int32, the material of each of the
    structure's m triangles, including dropped ones;     None = the first for all. materials: dictionaries, all keys
    optional, the defaults being Blender's Principled BSDF:     "name" (for messages), "base_color" (3,), "metallic"
    0..1, "roughness" 0..1, "ior" > 0,     "transmission" 0..1, "specular" (0.5: the layer that "ior" gives, 0: no
    layer), "emission" (3,)     radiance on both sides, "alpha" (0 = invisible). An empty list is one default material.
    What varies over a surface is given by "program" and "closures" instead. A program is a list     of steps,
    dictionaries with "op", "args" and the settings of the operation; an argument is     the index of an earlier step
    (an int) or a constant (a float, or three or four floats). A     closure has a "kind" (principled, diffuse,
    translucent, glossy, glass, refraction, transparent,     emission, conductor, sheen, velvet, toon_diffuse,
    toon_glossy, subsurface, hair, hair_reflection,     hair_transmission, holdout), inputs of the names above and
    "weight", "color", "specular_tint", "coat_weight",     "coat_roughness", "coat_ior", "coat_tint",
    "diffuse_roughness",     "anisotropy", "rotation" (turns), "tangent", "coat_normal" (scene space, 0 = the
    surface's), "sheen_weight",     "sheen_roughness", "sheen_tint", "smooth" (a toon lobe's edge), "extinction" (a
    conductor's, whose "color" is     the index), "film_thickness" (nm), "film_ior", "subsurface_weight",
    "subsurface_radius" (a colour),     "subsurface_scale", "subsurface_ior", "subsurface_anisotropy",
    "radial_roughness", "offset", "melanin",     "redness", "absorption" (those of hair), "translucency" (the share of
    principled's diffuse base that sends     light to the other side), each an argument as in a program, and "normal",
    "multiscatter" (True), "distribution" (ggx, beckmann, ashikhmin_shirley), "method" (of subsurface scattering:
    random_walk, random_walk_skin, random_walk_legacy). At most 8 closures, 4 of them principled.     "hidden_from"
    names the kinds of rays     that pass through its surfaces: camera, shadow, diffuse, glossy, transmission, volume
    (scattered in one).     "receives" and "blocks" have a bit for each set of linked lights that shine on it and that
    it shades (all);     "receivers" and "blockers", 0 to 31, are the sets that its own emission belongs to, as a light
    (0).     "hole" (False): camera rays see a hole in the picture, except where it is transparent. "catcher" (False):
    camera     rays see only what the other objects take from the light of its surfaces, as alpha or in a pass.
    "opaque_shadow" (False): shadow rays do not pass it. "terminator" (0.1): cosine towards the light below which
    shadow rays start on the curved surface that corner normals describe, 0 = never.     "strands": the number of a
    layer that is 1 on tubes around hairs, whose inside rays do not see if the material     has a closure of hair.
    "tube" (False): all its surfaces are such tubes, with the normals of their corners at right     angles to the hair;
    their sides are shaded as round hair.     "outputs" pairs of a number below 64 and an argument, the values of the
    passes "Output" and that number.     "volume" fills the objects whose surfaces have the material: {"closures",
    "program"}, closures     with "scattering", "absorption" and "emission", coefficients per scene unit, and
    "anisotropy"     (-1 to 1; Henyey and Greenstein's phase function), each an argument as in a program, 0 by
    default; they add up, and what is constant is traversed in closed form. Path tracing only. corner_normals: (m, 3, 3)
    float32, shading normals of each triangle's corners, any length;     None = flat. surfaces: for Instances, in place
    of these two; None = the first material and flat: "meshes", a list of     {"material_index": (m,) int32 slots or
    None, "corner_normals": (m, 3, 3) float32 in the mesh's space or None};     "materials" (s,) int32, the materials of
    the slots, instance after instance; "first_material" (k + 1,) int32,     where each instance's slots begin; slots
    beyond its last use the last one; "normal_matrix" (k, 3, 3) float32,     the inverse transpose that transforms
    normals to the scene, row by row; "keeps_length" (k,) bool, whether it     preserves unit length. lights:
    dictionaries with "kind" ("point", "sun", "spot", "area"), "to_world" (4, 4), "power"     (3,), and, as the kind
    needs, "radius", "angle", "spot_size", "spot_blend", "shape"     ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"), "size",
    "size_y", "spread" (π), "sphere" (False: points and     spots are discs that face the receiver); "casts_shadow"
    (True). "receivers" and "blockers", 0 to 31, are the     sets of objects that the light shines on and that shade it
    (0: all).     A light shines along its -Z. Angles are full angles in radians. Brightness is that of     Cycles:
    power P gives a point or spot light the radiant intensity P / 4π W/sr, an area     light the radiance P / (π area)
    on one side, a sun the irradiance P in W/m². Rays of all kinds except those     in "hidden_from" (default
    ("camera",)) see a light with a size, and it lights the lobes that scatter     such rays. Negative power darkens.
    Lights without power are left out.     "group" (0): the light group, from 1 to 64, 0 = none. "max_bounces" (no
    limit): largest number of times that a     path has scattered before its light samples see the light. With "program"
    and "radiance", an argument as in a     material, the power is multiplied by the result; "frame" is a list of one
    object, the light's own space. world: {"color": (3,)}, radiance of the background; None = black. With "program" and
    "radiance",     an argument as in a material, the radiance of each direction. "hidden_from" and "volume", which must
    not     vary, as for materials. "group", "max_bounces" and "casts_shadow" as for lights. images: dictionaries of
    "name", "pixels", (h, w, 1 to 4) uint8, uint16, float16 or float32, rows from the bottom,     and "srgb", whether
    colours are decoded after interpolation. An image without pixels is missing: pink. Arrays     that view a `bytes`
    object are not copied. With "tiles", such dictionaries with a "number" each (UDIM), the     image consists of these.
    layers: (m, 3, 2 to 4) float32 arrays, attributes of the corners for programs, or None for a missing one. For
    Instances, m counts the triangles of all meshes, mesh after mesh; the same holds for "uvs" of indices. objects:
    dictionaries of "to_object", (3, 4), scene to object space, and "generated",     (2, 3), offset and then factor that
    map object space to 0..1 in the object's box, and "values",     rows of four floats that the steps "object_value"
    read by "column" (none). For Instances, one of each. object_index: (m,) uint32, the object of each triangle; None =
    the first for all. Not for Instances. origin: (3,), the world position of the scene's origin. grids: dictionaries of
    "values", (x, y, z, 1 or 3) float32, voxels that the step "voxels" reads by their number     in this list, counted
    from 1, at a position in object space, and "to_index", (3, 4), object space to the     array's indices, where the
    voxels lie at whole numbers. indices: object and material indices for the passes of that name; None = all 0. "first"
    (n,) int32,     the first triangle of each run of triangles of one object, ascending from 0; "object" (n,) float32,
    the     index of each run's object; "material" float32, the index of each material; "uvs" (m, 3, 2) float32, NaN
    for triangles without, or None, for the UV pass.     For mattes "identities" (n, 2) uint32, of each run's object and
    of that with its children, and     "material_identities" (s,) uint32, not 0 (None: no surfaces in the mattes).
    "groups" (n,) uint8, the light group of each run's object, counted from 1 (None: none).     "motion", two (m, 3, 3)
    float32, the corners of all triangles in the picture before this one and in the one     after, for the pass "Vector"
    (None: they stay). For Instances, two tuples: the corners of the meshes' triangles     there, each in its mesh's
    space; (k,) int64, for each instance the difference from the index of its triangle here     to that there; (k, 3, 4)
    float64, the transforms to the scene there. like: the same scene at another time (None: there is none). Materials,
    images, layers, the "meshes" of surfaces, world     and indices that are not given are those of it, without a copy.

    Raises ShapeError (array of the wrong shape or type, index out of range), NonFiniteError,
    SpecError (a number out of range, a missing or unknown key); each names the key and its index.
    Releases the GIL while it compiles the scene.
    """

    def __init__(
        self,
        structure: Structure | Instances,
        *,
        material_index: npt.NDArray[np.int32] | None = None,
        materials: Sequence[Mapping[str, Any]] | None = None,
        corner_normals: npt.NDArray[np.float32] | None = None,
        surfaces: Mapping[str, Any] | None = None,
        lights: Sequence[Mapping[str, Any]] | None = None,
        world: Mapping[str, Any] | None = None,
        images: Sequence[Mapping[str, Any]] | None = None,
        layers: Sequence[npt.NDArray[np.float32] | None] | None = None,
        objects: Sequence[Mapping[str, Any]] | None = None,
        object_index: npt.NDArray[np.uint32] | None = None,
        origin: tuple[float, float, float] | None = None,
        grids: Sequence[Mapping[str, Any]] | None = None,
        indices: Mapping[str, Any] | None = None,
        like: RenderScene | None = None,
    ) -> None: ...
    @property
    def left_out(self) -> list[str]:
        """Features that this scene does not need and its paths do not compute, each with its reason, such as "shadow
        rays: no lights".
        """

class RenderJob:
    """A render on its own threads, or its result.

    Deleting it cancels the render and waits for its threads. All methods may be called from any
    Python thread.
    """

    def wait(self, milliseconds: int) -> bool:
        """Waits until the render has ended, at most the given time; True if it has ended: done, failed or cancelled.
        Releases the GIL. SpecError for a negative time.
        """

    def cancel(self) -> None:
        """Requests the render to stop, which takes at most 0.1 s, and returns at once. The samples so far stay
        readable.
        """

    @property
    def progress(self) -> float:
        """Fraction of all pixel samples that are done, 0..1."""

    @property
    def finished(self) -> bool:
        """Whether the render has ended: done, failed or cancelled."""

    @property
    def cancelled(self) -> bool:
        """Whether the render was cancelled before it was done. False until it has stopped."""

    @property
    def samples_done(self) -> int:
        """Number of samples that every pixel has, or no longer needs."""

    @property
    def error(self) -> str | None:
        """The error that ended the render, or None."""

    @property
    def passes(self) -> dict[str, int]:
        """The passes that are filled, with their number of channels."""

    @property
    def statistics(self) -> RenderStatistics:
        """Statistics of the render so far."""

    def recorded(self) -> dict[str, RecordedRays]:
        """The rays recorded so far, by kind: "camera", "shadow 0", "diffuse 1", ..., with the number of times that
        their path has scattered (8: at least 8 times), "nearest" for shadow rays that may pass surfaces, and
        "continued" behind such a surface. Empty without the setting "record_rays".

        Each kind is a dictionary of "origins" and "directions", (n, 3) float32 in the structure's space, "t_min" and
        "t_max", (n,) float32, "any", whether any hit answers the rays, and "traced", the number of rays of the kind,
        of which these n are a uniform choice in random order. Once the render has ended, it is the same for all
        structures and numbers of threads. Rays of the node programs and of media around the camera are not recorded.
        """

    def copy_into(self, name: str, out: npt.NDArray[np.float32], *, keep: bool = False) -> None:
        """Writes the current state of a pass: rows from the bottom up, channels innermost.

        out: float32, one-dimensional, C-contiguous, width * height * channels elements, where
            width and height are those of the border.
        keep: whether pixels without a sample yet keep their values in `out`; otherwise they become zero.
        "Combined" is the mean so far, premultiplied RGBA, scene linear. "Depth" (along the view axis, 1e10 =
        nothing hit), "Position", "Object Index" and "Material Index" are those of the first sample, because a mean
        across an edge belongs to no surface; "Normal" and "UV" (with 1 as third channel) are means, not
        renormalised. "Mist" is a mean, 1 where nothing is hit, "Denoising Albedo" the mean albedo of the first
        surface. "Traversal Steps", "Triangle Tests" and "Leaf Depth" (of the last leaf tested) are means per camera
        ray. "Sample Count" is the number of samples of each pixel. Light passes are those of Cycles: the direct
        and indirect light of diffuse, glossy and transmitting lobes divided by their colours, which multiplied by them
        add up to Combined with the direct and indirect light of volumes, emission and environment; light of shadow
        catchers is in none of them. "CryptoObject00" to "CryptoAsset07" are two identities with their shares each,
        "Output 0" to "Output 63" means of what the materials of the first surfaces output, with 1 as fourth channel.
        "Vector" is the motion of the first surface in pixels, to the picture before and from the one after.
        "Shadow Catcher" is the light of shadow catchers among all objects divided by that among catchers alone; without
        it, Combined holds the shadow. "Roughness" is a mean, as the nodes of the first surfaces give it.
        "Light Group 0" to "Light Group 63" are the parts of Combined that come from the emitters of each group.

        Raises SpecError (a pass that is unknown or not filled), ShapeError (type, size, contiguity or a read-only
        array). Releases the GIL.
        """

def render(
    scene: RenderScene | Sequence[RenderScene],
    camera: Mapping[str, Any],
    settings: Mapping[str, Any],
    *,
    threads: int = 0,
    points: Mapping[str, Any] | None = None,
) -> RenderJob:
    """Starts a render and returns at once.

    scene: a RenderScene, or a sequence of the same scene in the middles of equal parts of the time in which the shutter
    is open; the samples take them in turn. camera: "kind" ("perspective", "orthographic"), "to_world" (4, 4) (the
    camera looks along its     -Z, +Y is up; scale is ignored), "window" (left, right, bottom, top) of the full frame at
    distance 1 (perspective) or in scene units (orthographic), "clip_start" and "clip_end" as     depths along -Z. Depth
    of field: "aperture_radius" (0: none) in scene units, "aperture_blades" (0: round),     "aperture_rotation" in
    radians, "aperture_ratio" (1: as high as wide), "focus_distance" along -Z.     Panoramic kinds have the window (0,
    1, 0, 1), focus and clip by distance, and need more keys, angles in     radians: "equirectangular" (2,) "longitude"
    and "latitude"; "equidistant" "fov"; "equisolid" "fov", "focal"     length and (2,) "sensor" in its unit;
    "polynomial" "fov", "sensor" and (5,) "polynomial";     "central_cylindrical" (2,) "longitude" and (2,) "height" on
    a cylinder of radius 1; "mirror_ball" and     "cube_face" none. "motion": a pair of cameras, of the picture before
    this one and of the one after, for the     pass "Vector" (None: the camera stays). "poses": transforms (4, 4) at
    equal intervals from the opening of the     shutter to its end, between which rays are interpolated; fewer than two:
    none.     "rolling_shutter": share of the opening, 0 to 1, for which a row is exposed, from the top row to the
    bottom one     (None: all rows together); "shutter_curve": the times, 0 to 1, at which equal shares of a row's light
    have passed     (none: they are even). With it "poses" and the scenes of several times are at equal intervals of
    time. settings: "width" and "height" of the full frame in pixels; "border" (x0, y0, x1, y1) in pixels     from the
    lower left, half open, or None; "samples" per pixel: cost in proportion;     "integrator" ("path", "whitted": direct
    light, mirrors and clear glass, or "ao": openness within     "ambient_distance" (inf));     "max_bounces" (4): 0 =
    direct light only, as in Cycles;     "diffuse_bounces", "glossy_bounces", "transmission_bounces" (1024): the same by
    kind;     "volume_bounces" (0): the same for scattering in     volumes; "transparent_bounces" (8): transparent
    surfaces that a path passes before one is black, as in Cycles;     "clamp_indirect" (0): upper limit of what a
    sample     adds after its first bounce, as the mean of its channels, 0 = no limit; "clamp_direct" (0): the same
    limit     for what it adds up to and with its first bounce; "filter_glossy" (0: off): blurs lobes met after an
    improbable bounce; "caustics_reflective" and "caustics_refractive" (True): whether reflecting and refracting
    lobes are kept after a diffuse bounce; all three as in Cycles, and biased; "secondary_beams" (False), for
    whitted: rays that flat polygons mirror or refract go as beams from the polygon's virtual eye, with     refraction
    approximate (Heckbert and Hanrahan 1984); "seed" (0);     "film_transparent" (False), also behind glass of a
    roughness up to "transparent_glass" (-1: none);     "passes" (["Combined"]), names as in RenderJob.passes;
    "step_samples" (None):     samples (at most 64) between two updates of a tile, None = 1, 3, 4, then 8; "filter"
    ("blackman_harris", or "box") and "filter_width" (1.5), as in Cycles. "exposure" (1): factor on the colours     of
    Combined. "noise_threshold" (0: off): blocks of     8 x 8 pixels with less noise get no more samples, after
    "min_samples" (0: derived from the threshold), which is     biased. "time_limit" (0: none): seconds after which no
    samples begin, once each pixel has one. "mist":     {"start" (5), "depth" (25), "falloff" ("QUADRATIC", "LINEAR",
    "INVERSE_QUADRATIC")} of the pass. "record_rays"     (0): largest number of rays of each kind for
    RenderJob.recorded(), at most 65536; costs time. threads: 0 = one per core. points: the points of surfaces that the
    pixels show in place of what the camera sees, to bake pictures, row by row     from the bottom; for scenes without
    instances: "triangle" (n,) uint32, 2^32 - 1 = none, "place" (n, 6) float32,     the barycentric weights of the
    second and third corner at the pixel's centre, then their changes from pixel to     pixel to the right, and upwards.
    "seen" from "above" (default: along the shading normal), or from the "camera";     with "background", the background
    in the direction of the points from the world's origin at "origin" (3,).

    The image depends only on scene, camera and settings, bit for bit: not on the structure, the number of threads
    or step_samples; and a border shows the same pixels as the full frame. With a noise threshold a border may stop
    other blocks; with a time limit the image depends on the machine.

    Raises SpecError, ShapeError or NonFiniteError naming the key. An error during the render does not raise: see
    RenderJob.error.
    """
