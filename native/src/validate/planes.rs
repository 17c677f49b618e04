// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes: every cell is a closed convex body, every cut adds up, every triangle lies on
//! the sides of the planes that its leaf lies on.

use crate::build::cell::{Cell, ConvexCell, Direction, Plane};
use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::build::polytope::NEAR;
use crate::build::profile::Profile;
use crate::structure::Structure;
use crate::traverse::frame::U;
use std::collections::BTreeSet;

/// Heights that two ways of rounding may tell apart, as a share of the scene's size.
const HEIGHT: f32 = 8.0 * U;

/// Broken invariants of a tree of split planes.
pub fn planes(structure: &Structure, tree: &PlaneTree, broken: &mut Vec<String>) {
    let built = structure.built();
    let (frame, shape) = (&built.frame, &built.shape);
    let bounds = frame.bounds();
    let (mut inner, mut leaves, mut references) = (0, 0, 0);
    let mut cells = vec![(
        ConvexCell::from_box(bounds, bounds.magnitude()),
        None::<(Plane, bool)>,
    )];
    let mut path: Vec<(Plane, bool)> = Vec::new();
    tree.visit(|index, node, depth| {
        let (cell, side) = cells.pop().expect("one cell per node");
        path.truncate(depth.saturating_sub(1));
        path.extend(side);
        if depth > MAX_DEPTH {
            broken.push(format!(
                "node {index} lies at depth {depth}, beyond {MAX_DEPTH}"
            ));
        }
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
                let ids = built.blocks.ids(first, count);
                let unique: BTreeSet<_> = ids.iter().collect();
                if unique.len() != ids.len() {
                    broken.push(format!("leaf {index} holds a triangle twice"));
                }
                for id in ids {
                    let corners = structure.scene().corners(id).map(|p| frame.point(p));
                    if path
                        .iter()
                        .any(|&step| beyond(corners, step, bounds.magnitude()))
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
        let (below, above) = cell.split(plane);
        cells.extend([(above, Some((plane, true))), (below, Some((plane, false)))]);
    });
    let counted = (inner, leaves, references);
    let stated = (
        shape.nodes_axis + shape.nodes_oblique,
        shape.leaves,
        shape.references,
    );
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves and references are {counted:?}, the statistics say {stated:?}"
        ));
    }
}

/// Whether a triangle lies wholly on the wrong side of a plane.
fn beyond(corners: [[f32; 3]; 3], (plane, above): (Plane, bool), magnitude: f32) -> bool {
    let heights = corners.map(|p| plane.direction.height(p));
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

/// What is wrong with a cut through a cell.
fn fault(cell: &ConvexCell, plane: Plane) -> Option<String> {
    let offset = plane.offset;
    if let (ConvexCell::Box(flat), Direction::Axis(k)) = (cell, plane.direction) {
        let bounds = flat.bounds();
        let inside = bounds.min[k] <= offset && offset <= bounds.max[k];
        return (!inside).then(|| format!("the plane {offset} lies outside its cell"));
    }
    let mut profile = Profile::default();
    cell.extent(plane.direction, &mut profile);
    let magnitude = cell.magnitude();
    let cell = cell.polytope();
    let Some((below, above)) = cell.split(plane) else {
        // In cells as thin as this, which only nodes have that must be parted whatever it costs, rounding
        // may leave no two convex bodies. Both children then have the whole cell, which is no fault.
        let part = (offset - profile.low).min(profile.high - offset);
        let lost = part >= -HEIGHT * magnitude && part <= 8.0 * NEAR * magnitude;
        return (!lost).then(|| {
            format!(
                "the plane {plane:?} does not part its cell, from {} to {}, in a scene of size {magnitude}",
                profile.low, profile.high
            )
        });
    };
    // Published builders know no margin: of parts as thin as this rounding may move a whole facet, and such cells are
    // open however they are cut further.
    let closed = cell.gap() <= cell.area_noise();
    let thickness = [offset - profile.low, profile.high - offset];
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
