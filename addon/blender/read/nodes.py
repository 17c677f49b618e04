# SPDX-License-Identifier: GPL-3.0-or-later
"""Traversal of shader node trees towards constants, through reroutes, groups and muted nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

if TYPE_CHECKING:
    from ...core.scene.scene import RGB

MAX_STEPS = 256
"""Longest chain of links that is followed. Blender forbids cycles, but a file can be damaged."""

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of a colour's channels as a number: Rec. 709's in every working space."""

NUMBERS = ("VALUE", "INT", "BOOLEAN")
"""Types of sockets that hold one number."""

Remark = Callable[[str], None]
"""Called with the name of each unsupported node or setting."""


class Unsupported(Exception):
    """A node without an equivalent here. The message is its name for the user."""


class Links:
    """Cache of the links of node trees, because Blender searches all links of a tree for every socket.

    Valid for one reading, during which the trees must not change.
    """

    def __init__(self) -> None:
        self._feeding: dict[int, dict[int, Any]] = {}

    def feeding(self, socket: Any) -> Any:
        """The output at the other end of an input's link, or None."""
        tree = socket.id_data
        key = tree.as_pointer()
        if key not in self._feeding:
            found = self._feeding[key] = {}
            for link in tree.links:
                if link.is_valid and not link.is_muted:
                    found.setdefault(link.to_socket.as_pointer(), link.from_socket)
        return self._feeding[key].get(socket.as_pointer())


@dataclass(frozen=True)
class Place:
    """A socket, the group nodes that lead to its tree (outermost first), and the links of its trees.

    through: types of the group sockets that its value passes on the way to an input, see `source`.
    """

    socket: Any
    groups: tuple[Any, ...] = ()
    links: Links = field(default_factory=Links, repr=False, compare=False)
    through: tuple[str, ...] = ()

    @property
    def node(self) -> Any:
        """The node that has the socket."""
        return self.socket.node

    def input(self, name: str) -> Place | None:
        """An input of this node by name; None if this version of Blender has no such input."""
        socket = self.node.inputs.get(name)
        return None if socket is None else self.beside(socket)

    def beside(self, socket: Any) -> Place:
        """Another socket in the same tree."""
        return Place(socket, self.groups, self.links)

    def within(self, groups: tuple[Any, ...], socket: Any) -> Place:
        """A socket of the tree that these group nodes lead to."""
        return Place(socket, groups, self.links)

    def source(self) -> Place:
        """The source of this input's value: an output of a node that computes it, or an unlinked input.

        Raises Unsupported if the chain is too long.
        """
        # `last_input`: the last input on the way that has a value of its own.
        place = last_input = self
        through: tuple[str, ...] = ()
        for _ in range(MAX_STEPS):
            upstream = _upstream(place)
            if upstream is None:
                # A reroute or muted node without an input link counts as no link.
                return replace(last_input if _passes_on(place.node) else place, through=through)
            place = upstream
            if not (place.socket.is_output or _passes_on(place.node)):
                last_input = place
                through = (place.socket.type, *through)
        raise Unsupported(f"A chain of more than {MAX_STEPS} nodes")


def active_tree(block: Any) -> Any:
    """The node tree that a material, world or light renders with, or None.

    Since Blender 5.0 that is its tree; before, `use_nodes` decides.
    """
    if bpy.app.version < (5, 0) and not block.use_nodes:
        return None
    return block.node_tree


def output_node(tree: Any) -> Any:
    """A tree's active output, or None: the one for all engines, else the one for Cycles or for EEVEE."""
    return next(filter(None, map(tree.get_output_node, ("ALL", "CYCLES", "EEVEE"))), None)


def _passes_on(node: Any) -> bool:
    """Whether a node has no values of its own and only passes on its input's link."""
    return bool(node.mute or node.bl_idname == "NodeReroute")


def _upstream(place: Place) -> Place | None:
    """One step towards the source, or None if the value is computed here."""
    socket, groups, node = place.socket, place.groups, place.node
    # An input continues at the other end of its link.
    if not socket.is_output:
        feeding = place.links.feeding(socket)
        return None if feeding is None else place.beside(feeding)
    # A muted node passes on its internal link; groups are entered and left through equal identifiers.
    if node.mute:
        link = next((link for link in node.internal_links if link.to_socket == socket), None)
        return None if link is None else place.beside(link.from_socket)
    match node.bl_idname:
        case "NodeReroute":
            return place.beside(node.inputs[0])
        case "ShaderNodeGroup" if node.node_tree is not None:
            inside = next(
                (n for n in node.node_tree.nodes if n.bl_idname == "NodeGroupOutput" and n.is_active_output), None
            )
            twin = None if inside is None else _twin(inside.inputs, socket)
            return None if twin is None else place.within((*groups, node), twin)
        case "NodeGroupInput" if groups:
            twin = _twin(groups[-1].inputs, socket)
            return None if twin is None else place.within(groups[:-1], twin)
    return None


def _twin(sockets: Any, socket: Any) -> Any:
    """The socket on the other side of a group's boundary, or None: a group input's last, empty socket is only a
    placeholder.
    """
    return next((other for other in sockets if other.identifier == socket.identifier), None)


def converted(value: Any, have: str, want: str) -> Any:
    """Convert a constant from a socket of type `have` to one of type `want`.

    Vectors become the mean of their components, colours their luminance. Numbers of at most 0 are false, as in Cycles.
    """
    if want not in NUMBERS or have == want:
        return value
    if hasattr(value, "__len__"):
        if want == "BOOLEAN":
            return float(any(value[:3]))
        shares = LUMINANCE if have == "RGBA" else (1 / 3, 1 / 3, 1 / 3)
        value = sum(share * part for share, part in zip(shares, value, strict=False))
    match want:
        case "INT":
            return float(np.trunc(value))
        case "BOOLEAN":
            return float(value > 0)
    return float(value)


def constant(place: Place, remark: Remark, fallback: Any = None) -> Any:
    """The value of an input if it is constant; otherwise `fallback` (None: the input's own default), with a remark."""
    try:
        source = place.source()
    except Unsupported as unsupported:
        remark(str(unsupported))
    else:
        if not source.socket.is_output or source.node.bl_idname in ("ShaderNodeRGB", "ShaderNodeValue"):
            value, have = source.socket.default_value, source.socket.type
            for want in (*source.through, place.socket.type):
                value, have = converted(value, have, want), want
            return value
        remark(f"{source.node.bl_label} for {place.socket.name}")
    return place.socket.default_value if fallback is None else fallback


def number(place: Place | None, remark: Remark, absent: float = 0.0) -> float:
    """A constant number; `absent` if the input does not exist."""
    if place is None:
        return absent
    return float(converted(constant(place, remark), place.socket.type, "VALUE"))


def color(place: Place | None, remark: Remark, fallback: RGB | None = None) -> RGB:
    """A constant linear colour; black if the input does not exist."""
    if place is None:
        return (0.0, 0.0, 0.0)
    value = constant(place, remark, fallback)
    try:
        r, g, b = value[:3]
    except TypeError:
        r = g = b = value
    return (float(r), float(g), float(b))


def scaled(rgb: RGB, factor: float) -> RGB:
    """A colour multiplied by a number."""
    return (rgb[0] * factor, rgb[1] * factor, rgb[2] * factor)
