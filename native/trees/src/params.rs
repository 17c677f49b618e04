// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters that several structures share, and what their values in a configuration mean.

use halfspace_builders::binned::SurfaceArea;
use halfspace_builders::space::Stop;
use halfspace_leaf::keep::Keep;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::plane_tree;
use halfspace_structure::row::{Group, Kind, Need, OFF_ON, Only, ParamSpec, named};
use halfspace_structure::spec::{Config, Value};

/// Whether a traversal uses error bounds.
pub const ROBUST: ParamSpec = ParamSpec {
    name: "robust",
    label: "Robustness",
    doc: "widen: intervals grow by the rounding error, no hit is ever lost. none: as in textbooks, \
          for measuring how often that fails; never for pictures",
    unit: "",
    kind: Kind::Choice(&[
        named("widen", "Error Bounds"),
        named("none", "As Published"),
    ]),
    default: Value::Choice("widen"),
    group: Group::Numerics,
    needs: &[],
};

/// Depth limit.
pub const MAX_DEPTH: ParamSpec = ParamSpec {
    name: "max_depth",
    label: "Depth Limit",
    doc: "Leaves lie no deeper; 0 chooses by the number of triangles. More costs memory and \
          build time and rarely pays",
    unit: "levels",
    kind: Kind::Integer {
        min: 0,
        max: plane_tree::MAX_DEPTH as i64,
    },
    default: Value::Integer(0),
    group: Group::Builder,
    needs: &[],
};

/// Leaf size.
pub const LEAF_SIZE: ParamSpec = ParamSpec {
    name: "leaf_size",
    label: "Leaf Size",
    doc: "Nodes of at most this many triangles are not split. More builds faster and tests more",
    unit: "triangles",
    kind: Kind::Integer { min: 0, max: 64 },
    default: Value::Integer(1),
    group: Group::Builder,
    needs: &[],
};

/// Largest leaf of hierarchies split by the surface area heuristic, by default.
pub const LARGEST_LEAF: usize = 64;

/// Largest leaf of hierarchies split by the surface area heuristic.
pub const LEAF_MAX: ParamSpec = ParamSpec {
    name: "leaf_max",
    label: "Largest Leaf",
    doc: "Nodes of more triangles are always split. More saves memory where triangles crowd",
    unit: "triangles",
    kind: Kind::Integer { min: 1, max: 4096 },
    default: Value::Integer(LARGEST_LEAF as i64),
    group: Group::Builder,
    needs: &[],
};

/// Budget of spatial splits.
pub const SPLITS: ParamSpec = ParamSpec {
    name: "splits",
    label: "Spatial Splits",
    doc: "Planes may cut triangles where boxes would overlap, until there are this many further references per triangle; \
          0 is off. More gives closer boxes around long triangles, takes memory, and builds longer",
    unit: "references per triangle",
    kind: Kind::Float { min: 0.0, max: 4.0 },
    default: Value::Float(0.0),
    group: Group::Builder,
    needs: &[
        Need {
            key: "width",
            only: Only::Options(&["8"]),
        },
        Need {
            key: "quality",
            only: Only::Options(&["medium"]),
        },
    ],
};

const fn cost(name: &'static str, label: &'static str, doc: &'static str, value: f32) -> ParamSpec {
    ParamSpec {
        name,
        label,
        doc,
        unit: "",
        kind: Kind::Float { min: 0.0, max: 1e6 },
        default: Value::Float(value as f64),
        group: Group::Costs,
        needs: &[],
    }
}

/// Cost of a step.
pub const fn step_cost(costs: Costs) -> ParamSpec {
    cost(
        "step_cost",
        "Step Cost",
        "Cost of a step through a node. More gives fewer, larger leaves",
        costs.step,
    )
}

/// Cost of entering a leaf.
pub const fn leaf_cost(costs: Costs) -> ParamSpec {
    cost(
        "leaf_cost",
        "Leaf Cost",
        "Cost of entering a leaf with triangles. More gives fewer leaves",
        costs.leaf,
    )
}

/// Cost of a triangle.
pub const fn triangle_cost(costs: Costs) -> ParamSpec {
    cost(
        "triangle_cost",
        "Triangle Cost",
        "Cost of testing a triangle. More gives smaller leaves, a larger tree and a longer build",
        costs.triangle,
    )
}

/// Factor for splits that cut off empty space.
pub const fn empty_factor(costs: Costs) -> ParamSpec {
    ParamSpec {
        name: "empty_factor",
        label: "Empty Factor",
        doc: "Factor on the cost of a split that leaves one side empty. Less cuts off more empty \
              space, at the price of longer traversals",
        unit: "",
        kind: Kind::Float { min: 0.1, max: 1.0 },
        default: Value::Float(costs.empty as f64),
        group: Group::Costs,
        needs: &[],
    }
}

/// Whether rays build the lower parts of the tree.
pub const LAZY: ParamSpec = ParamSpec {
    name: "lazy",
    label: "Lazy Build",
    doc: "1: only the upper part is built at once, the rest where a ray comes for the first time. The first picture \
          is there sooner, the tree and the answer are the same; rays outside tiles are traced one by one. What rays \
          build later is not counted as build time. The memory limit covers what is built before the first ray; where the whole, \
          estimated from some subtrees built on trial, would not fit, nothing is built",
    unit: "",
    kind: OFF_ON,
    default: Value::Choice("0"),
    group: Group::Builder,
    needs: &[
        Need {
            key: "nodes",
            only: Only::Options(&["planes"]),
        },
        Need {
            key: "traversal",
            only: Only::Options(&["auto", "dir", "tile"]),
        },
        Need {
            key: "shadow",
            only: Only::Options(&["none", "cache"]),
        },
        Need {
            key: "leaves",
            only: Only::Options(&["blocks"]),
        },
    ],
};

/// Threshold below which the rays of a beam of up to 64 go on singly. González López and Gisbert Cantó have it, but give no
/// number.
pub const BEAM_LEAST: ParamSpec = ParamSpec {
    name: "beam_least",
    label: "Smallest Beam",
    doc: "Rays that have hit nothing go on singly when fewer than this are left together. More ends beams \
          earlier; 65 is never a beam, 1 always",
    unit: "rays",
    kind: Kind::Integer { min: 1, max: 65 },
    default: Value::Integer(4),
    group: Group::Numerics,
    needs: &[Need {
        key: "traversal",
        only: Only::Options(&["beam"]),
    }],
};

/// Threshold of surface and triangles below which a cell is not split.
pub const AREA_STOP: ParamSpec = ParamSpec {
    name: "area_stop",
    label: "Area Stop",
    doc: "A node of n of N triangles, 16 at most, becomes a leaf where n^2 N times its share of the scene's surface \
          is no more than this: few rays come by. More gives a smaller tree and a shorter build",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1e6 },
    default: Value::Float(16.0),
    group: Group::Costs,
    needs: &[],
};

/// Rule by which a node becomes a leaf.
pub const STOP: ParamSpec = ParamSpec {
    name: "stop",
    label: "Stopping Rule",
    doc: "When a node becomes a leaf; a plane is the cheapest in either case. cost: when no plane costs less than the \
          leaf, with the thesis's costs by pbrt's rule. beta: when a step costs more than beta n / 2 triangle tests at \
          n triangles, so that an even split would not pay (Hoobergs 2019, equations 3.2 to 3.6)",
    unit: "",
    kind: Kind::Choice(&[named("cost", "By Cost"), named("beta", "By Beta")]),
    default: Value::Choice("cost"),
    group: Group::Costs,
    needs: &[],
};

/// Share of visits that go on to one child only.
pub const BETA: ParamSpec = ParamSpec {
    name: "beta",
    label: "Beta",
    doc: "Share of the visits to a node that go on to one child only. 0 computes it at each plane, as 1 less twice its \
          section with the cell over the cell's surface: the share of uniform lines. More gives smaller leaves",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1.0 },
    default: Value::Float(0.0),
    group: Group::Costs,
    needs: &[Need {
        key: "stop",
        only: Only::Options(&["beta"]),
    }],
};

/// The stopping rule from `stop` and `beta`; `by_cost` is the one that compares costs.
///
/// # Panics
/// When the structure's row lacks these parameters.
pub fn stop(config: &Config, by_cost: Stop) -> Stop {
    if config.choice(STOP.name) == "cost" {
        return by_cost;
    }
    let beta = config.float(BETA.name);
    Stop::Even((beta > 0.0).then_some(beta))
}

/// Prices for leaves of blocks, from `step_cost`, `leaf_cost`, `triangle_cost` and `empty_factor`. A tree whose steps all
/// have another cost has no `step_cost`.
///
/// # Panics
/// When the structure's row lacks one of the other parameters.
pub fn costs(config: &Config) -> Costs {
    Costs {
        step: match config.find("step_cost") {
            Some(_) => config.float("step_cost"),
            None => Costs::PLANES.step,
        },
        leaf: config.float("leaf_cost"),
        triangle: config.float("triangle_cost"),
        empty: config.float("empty_factor"),
        ..Costs::BLOCKS
    }
}

/// The surface area heuristic for objects, from `step_cost`, `leaf_cost`, `triangle_cost` and `leaf_max`; what these do
/// not set is as in `costs`.
///
/// # Panics
/// When the structure's row lacks one of these parameters.
pub fn surface_area(config: &Config, costs: Costs) -> SurfaceArea {
    SurfaceArea {
        costs: Costs {
            step: config.float("step_cost"),
            leaf: config.float("leaf_cost"),
            triangle: config.float("triangle_cost"),
            ..costs
        },
        leaf_max: config.integer("leaf_max"),
    }
}

/// The number of rays of [`BEAM_LEAST`] or a parameter like it.
///
/// # Panics
/// When the structure's row lacks this parameter.
pub fn least(config: &Config, param: &ParamSpec) -> u32 {
    u32::try_from(config.integer(param.name)).expect("in range")
}

/// Triangle data in leaves, from `leaves`.
///
/// # Panics
/// When the structure's row lacks this parameter.
pub fn keep(config: &Config) -> Keep {
    config.pick(
        "leaves",
        [
            ("indices", Keep::Indices),
            ("corners", Keep::Corners),
            ("scalar", Keep::Indices),
        ],
    )
}
