// SPDX-License-Identifier: GPL-3.0-or-later
//! The uniform grid: equal cells, each with the triangles that reach into it, and no tree at all.

use crate::leaf_tests::{self, BLOCKS, SCALAR, singly};
use crate::list::List;
use crate::params;
use crate::ways::{distinct, every_way, together, traversal};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::grid;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::grid::Grid;
use halfspace_nodes::shape::{Measure, Shape};
use halfspace_papers::alone;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single as single;
use halfspace_structure::row::{
    Family, Group, Kind, Menu, Named, ParamSpec, SHADOW, StructureSpec,
};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::{Rays, Way};
use halfspace_structure::{Built, Plan};
use std::sync::Arc;

const WAYS: [Way; 5] = {
    let mut ways = every_way("cells", "steps");
    ways[0].doc = "the quickest for each batch: camera rays in tiles, shadow rays in streams, other rays one by one";
    ways
};

const OPTIONS: List<Named> = distinct(&WAYS);

const TRAVERSAL: ParamSpec = traversal(OPTIONS.slice());

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "grid",
    code: 70,
    label: "Uniform grid",
    family: Family::Space,
    summary: "Equal cells in rows and columns, traversed from wall to wall.",
    paper: "Amanatides and Woo 1987, A fast voxel traversal algorithm for ray tracing; Cleary and Wyvill 1988, \
            Analysis of an algorithm for fast ray tracing using uniform space subdivision",
    // A grid has no tree for beams of shadow rays to descend, so `beam` is not a choice.
    params: &[DENSITY, TRAVERSAL, params::ROBUST, LEAVES, SHADOW],
    ways: &WAYS,
    no_groups: "",
    menu: Menu::Others,
    literature: &[("Uniform grid (Amanatides and Woo)", "")],
    sweep: false,
    claims: &["voxel-step"],
    build,
};

const DENSITY: ParamSpec = ParamSpec {
    name: "density",
    label: "Density",
    doc: "Cells per triangle. More tests fewer triangles in more steps, and costs memory in proportion, for \
          empty cells too. There are fewer where \
          thousands of triangles as large as the scene would take memory out of all proportion, and rays test more there",
    unit: "cells per triangle",
    kind: Kind::Float {
        min: 0.001,
        max: 64.0,
    },
    default: Value::Float(4.0),
    group: Group::Main,
    needs: &[],
};

const LEAVES: ParamSpec = leaf_tests::leaves(&[
    BLOCKS,
    Named {
        needs: &[singly(&["auto", "steps"])],
        ..SCALAR
    },
]);

/// Depth of a cell in the overlay: below slices and rows.
const DEPTH: usize = 3;

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    monitor.check()?;
    let frame = Frame::new(scene.bounds());
    let mut blocks = Blocks::new();
    let cells = f64::from(config.float("density")) * scene.live().len() as f64;
    let framed = FramedScene {
        scene,
        frame: &frame,
    };
    let grid = grid::build(framed, cells, &mut blocks, monitor)?;
    let shape = shape(&grid, &frame);
    // Report fewer cells than the density implies, and axes along which there is only one.
    let mut left_out = Vec::new();
    let (made, wanted) = (grid.number(), grid::cell_count(&frame.bounds(), cells));
    if made < wanted {
        left_out.push(format!(
            "cells: {made} of {wanted}, large triangles would be in too many of them"
        ));
    }
    let one: Vec<_> = (0..3).filter(|&k| grid.count(k) == 1).collect();
    if !one.is_empty() && !scene.live().is_empty() {
        let names: Vec<_> = one.iter().map(|&k| ["x", "y", "z"][k]).collect();
        left_out.push(format!(
            "walls across {}: one cell is enough there",
            names.join(" and ")
        ));
    }
    let (tree, leaves) = (Arc::new(grid), Arc::new(blocks));
    let singly = |kernel| Plan::single("cells", "steps", kernel);
    let plan = singly(single::grid::grid(&tree, &leaves));
    let groups = together!(&tree, &leaves, cells, shadow_cells);
    let plan = match config.way().rays {
        _ if leaf_tests::alone(config) => singly(alone::grid(&tree, &leaves, config.robust())),
        // Streams of nearest hits are slower than single rays: cells are found by halving ranges.
        Rays::Auto => (plan.with_tiles(Rays::Tile, groups.tiles.closest))
            .with_any(Rays::Stream, groups.streams.any)
            .with_few_singly(),
        rays => groups.plan(plan, rays),
    };
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        tree: Some(tree),
        leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(config.choice("shadow"), None),
        shape,
        left_out,
        growing: None,
        refit: None,
    })
}

/// Measures a grid. Its cost is that of the cells that a random ray crosses, one step each.
fn shape(grid: &Grid, frame: &Frame) -> Shape {
    let mut measure = Measure::default();
    let whole = frame.bounds().area();
    grid.visit(|place, Leaf { count, .. }| {
        let share = if whole > 0.0 {
            grid.bounds(place).area() / whole
        } else {
            0.0
        };
        measure.steps(share);
        measure.leaf(count, DEPTH, share);
    });
    measure.finish()
}
