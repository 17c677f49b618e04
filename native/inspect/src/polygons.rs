// SPDX-License-Identifier: GPL-3.0-or-later
//! The split planes of a tree as polygons, each clipped to its node's region, for the overlay.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::region::rectangle;
use halfspace_geom::vec3::Vec3;
use halfspace_nodes::cells::BOX;
use halfspace_structure::Structure;

/// Convex polygons in the scene's space.
#[derive(Debug, Clone, Default)]
pub struct Polygons {
    /// Vertices of all polygons, one polygon after another.
    pub vertices: Vec<[f32; 3]>,
    /// Index into `vertices` of each polygon's first vertex, then the length of `vertices`.
    pub offsets: Vec<u32>,
    /// Depth of each polygon's node; the root has depth 0.
    pub depths: Vec<u32>,
    /// Kind of each polygon: 0, 1, 2 a plane perpendicular to that axis; 3 oblique; 4 one of the planes that bound
    /// a child; 5 a plane through an octree node's centre; 6 a face of a box.
    pub kinds: Vec<u8>,
    /// Number of polygons within `max_depth` that exceed `max_count` and are left out.
    pub hidden: usize,
}

/// Returns the split planes of all nodes down to `max_depth`, breadth first, at most `max_count` of them.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn split_polygons(
    structure: &Structure,
    max_depth: usize,
    max_count: usize,
    monitor: &Monitor,
) -> Result<Polygons> {
    let mut polygons = Polygons {
        offsets: vec![0],
        ..Polygons::default()
    };
    let built = structure.built();
    let Some(cells) = built.tree.as_ref().and_then(|tree| tree.cells()) else {
        return Ok(polygons);
    };
    let frame = &built.frame;
    let mut level = vec![cells.root(frame.bounds())];
    for depth in 0..=max_depth {
        let mut next = Vec::new();
        for (id, region) in level {
            monitor.check()?;
            let mut node = cells.node(id, &region);
            // Append the planes that the node stores, each clipped to its region.
            for (plane, kind) in &node.planes {
                let corners = region.section(plane);
                if !corners.is_empty() {
                    let corners = corners.into_iter().map(|p| frame.to_scene(narrow(p)));
                    polygons.push(corners, depth, *kind, max_count);
                }
            }
            // Append the boxes of its children, with the depth of the children.
            if node.boxes && depth < max_depth {
                let boxes = node.children.iter().filter_map(|(_, child)| child.bounds());
                for bounds in boxes.filter(|bounds| !bounds.is_empty()) {
                    for axis in 0..3 {
                        for at in [bounds.min[axis], bounds.max[axis]] {
                            let corners = rectangle(&bounds, axis, at);
                            let corners = corners.map(|p| frame.to_scene(narrow(p)));
                            polygons.push(corners, depth + 1, BOX, max_count);
                        }
                    }
                }
            }
            next.append(&mut node.children);
        }
        level = next;
    }
    Ok(polygons)
}

/// Rounds a point to f32.
#[expect(clippy::cast_possible_truncation, reason = "for drawing")]
fn narrow(p: Vec3) -> [f32; 3] {
    p.map(|x| x as f32)
}

impl Polygons {
    /// Appends a polygon, or counts it as hidden once `max_count` polygons exist.
    fn push(
        &mut self,
        corners: impl IntoIterator<Item = [f32; 3]>,
        depth: usize,
        kind: u8,
        max_count: usize,
    ) {
        if self.kinds.len() >= max_count {
            self.hidden += 1;
            return;
        }
        self.vertices.extend(corners);
        #[expect(clippy::cast_possible_truncation, reason = "bounded by max_count")]
        self.offsets.push(self.vertices.len() as u32);
        #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
        self.depths.push(depth as u32);
        self.kinds.push(kind);
    }
}
