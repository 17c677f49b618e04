// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks uniform grids: walls ascend, each triangle is in every cell that contains one of its vertices, and in no
//! cell that its box does not touch.

use crate::grid::Grid;
use crate::tree::Body;
use halfspace_geom::Aabb;
use halfspace_leaf::Leaf;

/// Appends a description of each broken invariant.
pub fn grid(body: &Body<'_>, grid: &Grid, broken: &mut Vec<String>) {
    let scene = body.scene;
    let bounds = body.frame.bounds();
    let corners = |id: u32| scene.corners(id).map(|p| body.frame.point(p));
    for axis in 0..3 {
        let walls = grid.walls(axis);
        let ends = [walls[0], walls[walls.len() - 1]];
        let whole = [bounds.min[axis], bounds.max[axis]];
        if !bounds.is_empty() && (!walls.is_sorted() || ends != whole) {
            broken.push(format!(
                "the walls across axis {axis} do not divide the box"
            ));
        }
    }
    let (mut cells, mut references) = (0, 0);
    // Each cell must hold each triangle once, in ascending order, and only triangles whose box touches it.
    grid.visit(|cell, Leaf { first, count }| {
        if body.monitor.is_cancelled() {
            return;
        }
        cells += 1;
        references += count;
        let ids = body.blocks.ids(first, count);
        let bounds = grid.bounds(cell);
        if !ids.is_sorted_by(|a, b| a < b) {
            broken.push(format!(
                "cell {cell:?} holds a triangle twice, or out of order"
            ));
        }
        for id in ids {
            if !touch(&bounds, &Aabb::of_triangle(corners(id))) {
                broken.push(format!("cell {cell:?}: triangle {id} lies outside"));
            }
        }
    });
    // Each triangle must be in every cell that contains one of its vertices.
    for &id in scene.live() {
        if body.monitor.is_cancelled() {
            return;
        }
        for corner in corners(id) {
            // A vertex on a wall is in the cells on both sides.
            let around = [0, 1, 2].map(|k| around(grid.walls(k), corner[k]));
            for z in around[2][0]..=around[2][1] {
                for y in around[1][0]..=around[1][1] {
                    for x in around[0][0]..=around[0][1] {
                        let Leaf { first, count } = grid.cell([x, y, z]);
                        if !body.blocks.ids(first, count).contains(&id) {
                            broken.push(format!("cell {:?} lacks triangle {id}", [x, y, z]));
                        }
                    }
                }
            }
        }
    }
    // Compare the counts with the structure's statistics.
    let shape = body.shape;
    if (cells, references) != (shape.leaves, shape.references) {
        broken.push(format!(
            "{cells} cells hold {references} references, the statistics are {} and {}",
            shape.leaves, shape.references
        ));
    }
}

/// Returns the first and the last cell that contain a coordinate, by linear search.
fn around(walls: &[f32], x: f32) -> [usize; 2] {
    let holds = |cell: &usize| walls[*cell] <= x && x <= walls[*cell + 1];
    let cells = 0..walls.len() - 1;
    let first = cells.clone().find(holds).expect("walls around the scene");
    [
        first,
        cells.rev().find(holds).expect("the first, if no other"),
    ]
}

/// Returns whether two boxes have a point in common.
fn touch(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k])
}
