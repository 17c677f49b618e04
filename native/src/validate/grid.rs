// SPDX-License-Identifier: GPL-3.0-or-later
//! Uniform grids: walls in order, each triangle in every cell that one of its corners is in, and in none that
//! its box does not reach.

use crate::build::grid::Grid;
use crate::geom::Aabb;
use crate::structure::Structure;
use std::collections::BTreeSet;

/// All triangles that some cell holds.
pub fn cells(structure: &Structure, grid: &Grid) -> BTreeSet<u32> {
    let mut ids = BTreeSet::new();
    grid.visit(|_, (first, count)| ids.extend(structure.built().blocks.ids(first, count)));
    ids
}

/// Broken invariants, in words.
pub fn grid(structure: &Structure, grid: &Grid, broken: &mut Vec<String>) {
    let (built, scene) = (structure.built(), structure.scene());
    let bounds = built.frame.bounds();
    let corners = |id: u32| scene.corners(id).map(|p| built.frame.point(p));
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
    grid.visit(|place, (first, count)| {
        cells += 1;
        references += count;
        let ids = built.blocks.ids(first, count);
        let cell = grid.bounds(place);
        if !ids.is_sorted_by(|a, b| a < b) {
            broken.push(format!(
                "cell {place:?} holds a triangle twice, or out of order"
            ));
        }
        for id in ids {
            if !touch(&cell, &Aabb::of_triangle(corners(id))) {
                broken.push(format!("cell {place:?}: triangle {id} lies outside"));
            }
        }
    });
    for &id in scene.live() {
        for corner in corners(id) {
            let around = [0, 1, 2].map(|k| around(grid.walls(k), corner[k]));
            for z in around[2][0]..=around[2][1] {
                for y in around[1][0]..=around[1][1] {
                    for x in around[0][0]..=around[0][1] {
                        let (first, count) = grid.cell([x, y, z]);
                        if !built.blocks.ids(first, count).contains(&id) {
                            broken.push(format!("cell {:?} lacks triangle {id}", [x, y, z]));
                        }
                    }
                }
            }
        }
    }
    let shape = structure.shape();
    if (cells, references) != (shape.leaves, shape.references) {
        broken.push(format!(
            "{cells} cells hold {references} references, the statistics say {} and {}",
            shape.leaves, shape.references
        ));
    }
}

/// The first and the last cell that a coordinate is in, one by one.
fn around(walls: &[f32], x: f32) -> [usize; 2] {
    let holds = |cell: &usize| walls[*cell] <= x && x <= walls[*cell + 1];
    let cells = 0..walls.len() - 1;
    let first = cells.clone().find(holds).expect("walls around the scene");
    [
        first,
        cells.rev().find(holds).expect("the first, if no other"),
    ]
}

/// Whether two boxes have a point in common.
fn touch(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k])
}
