// SPDX-License-Identifier: GPL-3.0-or-later
//! The uniform grid: equal cells, each with the triangles that reach into it, and no tree at all.

use crate::build::Monitor;
use crate::build::grid::Grid;
use crate::build::plane_tree::Shape;
use crate::error::Result;
use crate::registry::{Built, Default, Kind, ParamSpec, StructureSpec, params};
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "grid",
    code: 70,
    label: "Uniform grid",
    family: "space",
    summary: "Equal cells in rows and columns, walked from wall to wall.",
    paper: "Amanatides and Woo 1987, A fast voxel traversal algorithm for ray tracing; Cleary and Wyvill 1988, \
            Analysis of an algorithm for fast ray tracing using uniform space subdivision",
    params: &[DENSITY, params::ROBUST],
    build,
};

const DENSITY: ParamSpec = ParamSpec {
    name: "density",
    label: "Density",
    doc: "Cells per triangle. More tests fewer triangles in more steps, and costs memory in proportion, for \
          empty cells too",
    unit: "cells per triangle",
    kind: Kind::Float {
        min: 0.001,
        max: 64.0,
    },
    default: Default::Float(4.0),
};

/// Levels above a cell as the overlay shows them: slices, rows, cells.
const DEPTH: usize = 3;

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    monitor.check()?;
    let frame = Frame::new(scene.bounds());
    let mut blocks = Blocks::new();
    let cells = f64::from(config.float("density")) * scene.live().len() as f64;
    let grid = Grid::new((scene, &frame), cells, &mut blocks, monitor)?;
    let shape = shape(&grid, &frame);
    let mut left_out = vec!["oblique planes: a grid divides along the axes".to_owned()];
    let one: Vec<_> = (0..3).filter(|&k| grid.count(k) == 1).collect();
    if !one.is_empty() {
        let names: Vec<_> = one.iter().map(|&k| ["x", "y", "z"][k]).collect();
        left_out.push(format!(
            "walls across {}: one cell is enough there",
            names.join(" and ")
        ));
    }
    Ok(Built {
        frame: frame.with_robust(config.choice("robust") != "none"),
        blocks,
        layout: Layout::Grid(grid),
        shape,
        left_out,
    })
}

/// Measures a grid. Its cost is that of the cells that a random ray meets, a step each.
fn shape(grid: &Grid, frame: &Frame) -> Shape {
    let mut shape = Shape {
        depth_max: DEPTH,
        depth_mean: DEPTH as f64,
        ..Shape::default()
    };
    let whole = frame.bounds().area();
    grid.visit(|place, (_, count)| {
        shape.leaves += 1;
        shape.leaves_empty += usize::from(count == 0);
        shape.references += count;
        shape.leaf_max = shape.leaf_max.max(count);
        shape.leaves_large += usize::from(count > 64);
        if whole > 0.0 {
            let share = grid.bounds(place).area() / whole;
            shape.sah_cost += share * (1.0 + 80.0 * count as f64);
        }
    });
    shape
}
