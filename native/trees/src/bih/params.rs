// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of interval hierarchies.

use crate::leaf_tests::{SCALAR, singly};
use halfspace_structure::row::{Group, Kind, Named, Need, Only, ParamSpec, named};
use halfspace_structure::spec::Value;

/// Leaf size of hierarchies whose triangles a grid divides.
pub const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Nodes of at most this many triangles are not split. More builds faster and tests more",
    unit: "triangles",
    kind: Kind::Integer { min: 1, max: 64 },
    default: Value::Integer(6),
    group: Group::Builder,
    needs: &[Need {
        key: "split",
        only: Only::Options(&["grid", "middle", "median"]),
    }],
};

const INDICES: Named = named("indices", "Indices");

const CORNERS: Named = named("corners", "Corner Copies");

/// The parameter `leaves` with these options: whether leaves keep indices or copies of the corners, and how many triangles
/// are tested at once.
pub const fn leaves_of(options: &'static [Named]) -> ParamSpec {
    ParamSpec {
        name: "leaves",
        label: "Leaves",
        doc: "indices: leaves name triangles and corners, less than half the memory. corners: they hold \
              copies, which are tested sooner and take longer to build. scalar: indices, and triangles are tested one after \
              another, as the programs of the papers did, always by single rays; robust=none then decides hits in f32 by \
              pbrt's test",
        unit: "",
        kind: Kind::Choice(options),
        default: Value::Choice(options[0].name),
        group: Group::Numerics,
        needs: &[],
    }
}

/// The parameter `leaves` of hierarchies of intervals.
pub const LEAVES: ParamSpec = leaves_of(&[
    INDICES,
    CORNERS,
    Named {
        needs: &[singly(&["auto", "ordered"])],
        ..SCALAR
    },
]);

/// The same of nodes with an interval per child.
pub const WIDE_LEAVES: ParamSpec = leaves_of(&[
    INDICES,
    CORNERS,
    Named {
        needs: &[
            singly(&["auto", "ordered"]),
            Need {
                key: "n",
                only: Only::Options(&["2"]),
            },
        ],
        ..SCALAR
    },
]);

/// The same of nodes between slabs.
pub const SLAB_LEAVES: ParamSpec = leaves_of(&[
    INDICES,
    CORNERS,
    Named {
        needs: &[Need {
            key: "slabs",
            only: Only::Options(&["3", "7"]),
        }],
        ..SCALAR
    },
]);

/// Threshold below which empty space is cut off.
pub const EMPTY: ParamSpec = ParamSpec {
    name: "empty",
    label: "Empty Space",
    doc: "A node is put in to cut off empty space where less than this share of the surface is left. \
          0 for never; more costs memory and steps and saves visits of leaves",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1.0 },
    default: Value::Float(0.7),
    group: Group::Costs,
    needs: &[],
};

/// Where triangles are divided.
pub const SPLIT: ParamSpec = ParamSpec {
    name: "split",
    label: "Split",
    doc: "Where triangles are divided. grid: by the halves of a regular grid over the scene, without reading the node's \
          boxes (the global heuristic). middle: in the middle of the longest side of the node's box. median: half of them \
          on either side of it. sah: where the surface area heuristic is lowest, with the costs of bih-sah",
    unit: "",
    kind: Kind::Choice(&[
        named("grid", "Global Grid"),
        named("middle", "Middle of Box"),
        named("median", "Object Median"),
        named("sah", "Surface Area"),
    ]),
    default: Value::Choice("grid"),
    group: Group::Main,
    needs: &[],
};

/// Rule by which nodes of one child cut off empty space.
pub const CUT: ParamSpec = ParamSpec {
    name: "cut",
    label: "Cut Rule",
    doc: "Where a node of one child cuts off empty space. surface: along the axis where it saves most surface, on one side \
          or both. split: along the axis of the node's own split, where both ends are empty and 1.3 times the rest \
          is shorter than the side, as in the renderer Sunflow",
    unit: "",
    kind: Kind::Choice(&[
        named("surface", "By Surface"),
        named("split", "Along Split"),
    ]),
    default: Value::Choice("surface"),
    group: Group::Builder,
    needs: &[],
};

/// Where the share of the surface decides on cuts.
pub const BY_SURFACE: &[Need] = &[Need {
    key: "cut",
    only: Only::Options(&["surface"]),
}];

/// Number of children of a node.
pub const CHILDREN: ParamSpec = ParamSpec {
    name: "n",
    label: "Width",
    doc: "Intervals per node, all tested at once. More makes fewer, dearer steps; 2 is four planes a node",
    unit: "intervals",
    kind: Kind::Choice(&[named("4", "4"), named("2", "2"), named("8", "8")]),
    default: Value::Choice("4"),
    group: Group::Main,
    needs: &[],
};
