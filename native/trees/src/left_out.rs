// SPDX-License-Identifier: GPL-3.0-or-later
//! What a scene does not need of a structure: read from its triangles before a build, or from the shape of a tree.

use halfspace_geom::Aabb;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

/// The reason why a scene of walls parallel to the axes needs no oblique planes.
pub const PARALLEL: &str = "every triangle is parallel to two axes";

/// Returns whether every triangle is parallel to two axes. The first oblique triangle ends the search.
pub fn is_parallel(scene: &Triangles) -> bool {
    scene.live().iter().all(|&id| {
        let [a, b, c] = scene.corners(id);
        (0..3).any(|k| a[k] == b[k] && b[k] == c[k])
    })
}

/// Mean number of triangles whose boxes a ray meets, up to which walls parallel to the axes need no spatial splits. Measured
/// on generated boxes and sheets: splits add references and save no step at 1.8 and 2.0, they save half of the steps at 5.4.
const FEW: f64 = 3.0;

/// Returns a line about spatial splits, if walls parallel to the axes leave hardly any boxes that overlap. A ray that meets
/// the box of the scene meets that of a triangle with the probability of the ratio of their surfaces.
pub fn needless_splits(scene: &Triangles, frame: &Frame) -> Option<String> {
    if scene.live().is_empty() || !is_parallel(scene) {
        return None;
    }
    let areas = scene.live().iter().map(|&id| {
        let corners = scene.corners(id).map(|p| frame.point(p));
        Aabb::of_triangle(corners).area()
    });
    let met = areas.sum::<f64>() / frame.bounds().area();
    (met <= FEW).then(|| {
        format!("spatial splits: {PARALLEL}, and a ray meets the boxes of {met:.1} of them")
    })
}

/// Returns a line about the axes along which a scene with these bounds has no extent, across which there are no planes.
pub fn flat(bounds: &Aabb) -> Option<String> {
    let flat = (0..3).filter(|&k| bounds.extent(k) == 0.0);
    let names: Vec<_> = flat.map(|k| ["x", "y", "z"][k]).collect();
    (!names.is_empty()).then(|| {
        let names = names.join(" and ");
        format!("planes across {names}: the scene has no extent there")
    })
}

/// Returns a line about cutting triangles, if no plane of a tree over `count` triangles cuts one.
pub fn uncut(shape: &Shape, count: usize) -> Option<String> {
    let needless = shape.nodes_axis > 0 && shape.references == count;
    needless.then(|| "cut triangles: no plane goes through one".to_owned())
}

/// Returns a line about the nodes of one child of a binary hierarchy, if it has none.
pub fn no_empty_space(shape: &Shape) -> Option<String> {
    let inner = shape.nodes_axis + shape.nodes_oblique;
    (inner > 0 && inner + 1 == shape.leaves)
        .then(|| "nodes of one child: nowhere is enough space empty".to_owned())
}

/// Returns a line about the levels of an octree above its depth limit that it does not reach, and the reason.
pub fn levels(shape: &Shape, limit: usize, leaf_size: usize, budget: usize) -> Option<String> {
    if shape.nodes_axis == 0 || shape.depth_max >= limit {
        return None;
    }
    let reason = if shape.leaf_max <= leaf_size {
        format!("no cell holds more than {leaf_size} triangles any more")
    } else {
        format!("cells would need more than {budget} references per triangle")
    };
    Some(format!(
        "levels below {} of {limit}: {reason}",
        shape.depth_max
    ))
}
