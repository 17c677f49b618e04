// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks trees of split planes: every cell is a closed convex polyhedron, the areas of the parts of each split
//! add up, and no triangle lies wholly outside the cell of its leaf.

use crate::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::tree::Body;
use halfspace_geom::cell::{Cell, ConvexCell, Direction, Plane, PlaneSide};
use halfspace_geom::polytope::NEAR;
use halfspace_geom::profile::Profile;
use halfspace_ray::frame::U;
use std::collections::BTreeSet;

/// Bound on the difference of two computations of a height, per unit of the scene's largest coordinate M. Derived:
/// an f32 dot product of three terms errs by at most 3 u sum |n_k p_k| <= 3 sqrt(3) u M, the rounding of an f64
/// height to f32 by sqrt(3) u M.
const HEIGHT: f32 = 8.0 * U;

/// Appends a description of each broken invariant.
pub fn planes(body: &Body<'_>, tree: &PlaneTree, broken: &mut Vec<String>) {
    let (frame, shape) = (body.frame, body.shape);
    let bounds = frame.bounds();
    let (mut inner, mut leaves, mut references) = (0, 0, 0);
    let mut cells = vec![(
        ConvexCell::from_box(bounds, bounds.magnitude()),
        None::<PlaneSide>,
    )];
    let mut path: Vec<PlaneSide> = Vec::new();
    tree.visit(|index, node, depth| {
        if body.monitor.is_cancelled() {
            return;
        }
        let (cell, side) = cells.pop().expect("one cell per node");
        path.truncate(depth.saturating_sub(1));
        path.extend(side);
        // Check the depth.
        if depth > MAX_DEPTH {
            broken.push(format!(
                "node {index} lies at depth {depth}, beyond {MAX_DEPTH}"
            ));
        }
        // Get the split plane of an inner node, or check a leaf and return.
        let plane = match node {
            Node::Axis { axis, split, .. } => Plane {
                direction: Direction::Axis(axis),
                offset: split,
            },
            Node::Oblique { normal, offset, .. } => Plane {
                direction: Direction::Oblique(normal),
                offset,
            },
            Node::Leaf { first, count } => {
                leaves += 1;
                references += count;
                let ids = body.blocks.ids(first, count);
                let unique: BTreeSet<_> = ids.iter().collect();
                if unique.len() != ids.len() {
                    broken.push(format!("leaf {index} holds a triangle twice"));
                }
                // No triangle may lie wholly beyond a plane on the path to its leaf.
                for id in ids {
                    let corners = body.scene.corners(id).map(|p| frame.point(p));
                    if path
                        .iter()
                        .any(|&side| beyond(corners, side, bounds.magnitude()))
                    {
                        broken.push(format!("leaf {index}: triangle {id} lies outside its cell"));
                    }
                }
                return;
            }
        };
        inner += 1;
        if let Some(fault) = fault(&cell, plane) {
            broken.push(format!("node {index}: {fault}"));
        }
        // Push the cells of the children, the one below last because it is visited first.
        let (below, above) = cell.split(plane);
        let side = |above| Some(PlaneSide { plane, above });
        cells.extend([(above, side(true)), (below, side(false))]);
    });
    // Compare the counts with the structure's statistics.
    let counted = (inner, leaves, references);
    let stated = (
        shape.nodes_axis + shape.nodes_oblique,
        shape.leaves,
        shape.references,
    );
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves and references are {counted:?}, the statistics are {stated:?}"
        ));
    }
}

/// Returns whether a triangle lies wholly on the other side of a plane.
fn beyond(corners: [[f32; 3]; 3], side: PlaneSide, magnitude: f32) -> bool {
    let PlaneSide { plane, above } = side;
    let heights = corners.map(|p| plane.direction.height(p));
    // Heights along an axis are exact, others are rounded.
    let slack = match plane.direction {
        Direction::Axis(_) => 0.0,
        Direction::Oblique(_) => HEIGHT * magnitude,
    };
    if above {
        heights.iter().all(|h| *h < plane.offset - slack)
    } else {
        heights.iter().all(|h| *h > plane.offset + slack)
    }
}

/// Returns a description of what is wrong with the split of `cell` by `plane`, or `None`.
fn fault(cell: &ConvexCell, plane: Plane) -> Option<String> {
    let offset = plane.offset;
    // In a box, an axis-aligned plane only has to lie inside.
    if let (ConvexCell::Box(flat), Direction::Axis(k)) = (cell, plane.direction) {
        let bounds = flat.bounds();
        let inside = bounds.min[k] <= offset && offset <= bounds.max[k];
        return (!inside).then(|| format!("the plane {offset} lies outside its cell"));
    }
    // Split the polytope.
    let mut profile = Profile::default();
    cell.extent(plane.direction, &mut profile);
    let magnitude = cell.magnitude();
    let cell = cell.polytope();
    let Some((below, above)) = cell.split(plane) else {
        // In cells this thin, which occur only in nodes that must be split at any cost, rounding may prevent two
        // convex parts. Both children then keep the whole cell, which is not a fault.
        let part = (offset - profile.low).min(profile.high - offset);
        let lost = part >= -HEIGHT * magnitude && part <= 8.0 * NEAR * magnitude;
        return (!lost).then(|| {
            format!(
                "the plane {plane:?} does not split its cell, from {} to {}, in a scene of size {magnitude}",
                profile.low, profile.high
            )
        });
    };
    // Published builders keep no margin from the cell's ends: in parts this thin, rounding may move a whole facet,
    // and all cells split from them are open too.
    let closed = cell.gap() <= cell.area_noise();
    let thickness = [offset - profile.low, profile.high - offset];
    // Each part must be a closed polytope.
    for (part, thickness) in [&below, &above].into_iter().zip(thickness) {
        let gap = part.gap();
        let open = gap > part.area_noise() && thickness > NEAR * magnitude && closed;
        if part.euler() != 2 || gap.is_nan() || open {
            return Some(format!(
                "the cut at {plane:?} leaves a cell open: Euler's number is {}, the vector areas of a \
                 surface of {} sum to {}",
                part.euler(),
                part.area(),
                gap
            ));
        }
    }
    // The areas of the parts, less the section they share, must sum to the area of the cell.
    let cap = below.facets().last().map_or(0.0, |f| f.area);
    let sum = below.area() + above.area() - 2.0 * cap;
    let error = (sum - cell.area()).abs();
    (error.is_nan() || error > cell.area_noise()).then(|| {
        format!(
            "the areas at {plane:?} add up to {sum}, not to {}",
            cell.area()
        )
    })
}
