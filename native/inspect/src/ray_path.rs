// SPDX-License-Identifier: GPL-3.0-or-later
//! The path of one ray through a structure: leaves visited in order, planes crossed, triangles tested.
//!
//! The traversal records the leaves whose triangles it tested, in its own order. The cells through which the ray
//! passes, empty ones included, and the planes it crosses are computed separately in f64 without error bounds, so that
//! tests can compare the two.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_geom::region::{Face, Line, Region, Span};
use halfspace_nodes::cells::{Cells, NodeId, try_each_leaf};
use halfspace_ray::path::Path;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_structure::Structure;
use std::collections::HashMap;

/// A leaf on the path of a ray.
#[derive(Debug, Clone)]
pub struct Visit {
    /// Region that the leaf covers, in the frame of the structure.
    pub region: Region,
    /// Depth of the leaf; the root has depth 0.
    pub depth: usize,
    /// Interval of `t` in which the ray lies in the region, in units of the ray's direction; it ends at the hit, unless
    /// the leaf was tested before the hit was known and lies beyond it. Both ends are NaN for a leaf that the ray misses
    /// but whose triangles the traversal tested because of its error bounds.
    pub span: Span,
    /// Word offset of the leaf's first block.
    pub first: u32,
    /// Number of triangles in the leaf.
    pub count: usize,
    /// Number of inner nodes that the traversal had visited when it tested the triangles; `None` if it tested none.
    pub tested: Option<u32>,
}

/// A plane that the ray crosses inside the node that the plane splits.
#[derive(Debug, Clone)]
pub struct Crossing {
    /// Ray parameter of the crossing, in units of the direction.
    pub t: f64,
    /// Kind of the plane, as in [`crate::polygons`].
    pub kind: u8,
    /// Depth of the node; the root has depth 0.
    pub depth: usize,
    /// The plane, clipped to the node's region.
    pub face: Face,
}

/// The path of one ray.
#[derive(Debug, Clone)]
pub struct RayPath {
    /// Nearest hit of the ray, or the one that ended its search for any.
    pub hit: Hit,
    /// Counters of the traversal.
    pub counters: RayCounters,
    /// Leaves on the path: tested ones in the order of the traversal, the others merged between them by entry
    /// distance.
    pub visits: Vec<Visit>,
    /// Planes on the path, nearest first.
    pub crossings: Vec<Crossing>,
}

/// Returns the path of a ray to its nearest hit, or to the one that ends an any-hit ray, or out of the scene.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn ray_path(structure: &Structure, ray: &Ray, any: bool, monitor: &Monitor) -> Result<RayPath> {
    let (hit, path) = structure.path(ray, any, Some(monitor));
    monitor.check()?;
    let built = structure.built();
    let scale = f64::from(built.frame.scale());
    let middle = built.frame.map().origin();
    // Convert the ray to the structure's frame, where the regions are.
    let line = Line {
        origin: std::array::from_fn(|k| (f64::from(ray.o[k]) - f64::from(middle[k])) * scale),
        direction: std::array::from_fn(|k| f64::from(ray.d[k]) * scale),
    };
    let follow = Follow {
        bounds: built.frame.bounds(),
        line,
        span: Span {
            enter: f64::from(ray.t_min),
            leave: f64::from(ray.t_max),
        },
        end: f64::from(ray.t_max.min(hit.t)),
        any,
        path: &path,
        monitor,
    };
    Ok(match built.tree.as_ref().and_then(|tree| tree.cells()) {
        Some(cells) => {
            let (visits, crossings) = follow.run(cells)?;
            RayPath {
                hit,
                counters: path.counters,
                visits,
                crossings,
            }
        }
        None => alone(structure, &line, follow.end, hit, &path),
    })
}

/// Returns an interval that ends where the ray ends, unless it begins beyond.
fn until(span: Span, end: f64) -> Span {
    let leave = if span.enter <= end {
        span.leave.min(end)
    } else {
        span.leave
    };
    Span { leave, ..span }
}

/// Returns the path through a structure without a tree, whose only cell is the scene's box. end: value of `t` at the
/// hit, or at the end of the ray.
fn alone(structure: &Structure, line: &Line, end: f64, hit: Hit, path: &Path) -> RayPath {
    let built = structure.built();
    let region = Region::of_scene(built.frame.bounds());
    let tested = (path.counters.tests > 0).then_some(0);
    let whole = Span {
        enter: f64::NEG_INFINITY,
        leave: f64::INFINITY,
    };
    // The only leaf is visited if the line meets the scene's box.
    let visits = region.span(line, whole).map(|span| Visit {
        region: region.clone(),
        depth: 0,
        span: until(span, end),
        first: 0,
        count: built.shape.references,
        tested,
    });
    RayPath {
        hit,
        counters: path.counters,
        visits: visits.into_iter().collect(),
        crossings: Vec::new(),
    }
}

/// A search for the nodes of a tree on a line.
struct Follow<'a> {
    /// Box of the scene, in the frame of the structure.
    bounds: Aabb,
    line: Line,
    /// Interval of `t` of the ray.
    span: Span,
    /// Value of `t` at the hit, or at the end of the ray.
    end: f64,
    /// Whether the ray ends at any hit: it need not visit all leaves before the hit.
    any: bool,
    /// The record of the traversal.
    path: &'a Path,
    /// Cancels the search.
    monitor: &'a Monitor,
}

/// A node still to visit.
struct Entry {
    id: NodeId,
    region: Region,
    /// Interval of `t` in which the line is inside the region.
    span: Span,
    depth: usize,
}

impl Follow<'_> {
    /// Returns the leaves and the planes on the path.
    fn run(&self, tree: &dyn Cells) -> Result<(Vec<Visit>, Vec<Crossing>)> {
        let (passed, mut crossings) = self.pass(tree)?;
        crossings.sort_by(|a, b| a.t.total_cmp(&b.t));
        Ok((self.merge(tree, passed)?, crossings))
    }

    /// Returns every leaf whose region the line passes within the span, and every plane that it crosses before the hit.
    fn pass(&self, tree: &dyn Cells) -> Result<(Vec<Visit>, Vec<Crossing>)> {
        let (mut passed, mut crossings) = (Vec::new(), Vec::new());
        if self.bounds.is_empty() {
            return Ok((passed, crossings));
        }
        let (id, region) = tree.root(self.bounds);
        let mut stack = Vec::new();
        if let Some(span) = region.span(&self.line, self.span) {
            stack.push(Entry {
                id,
                region,
                span,
                depth: 0,
            });
        }
        // Visit the nodes whose region the line passes.
        while let Some(entry) = stack.pop() {
            self.monitor.check()?;
            let found = tree.node(entry.id, &entry.region);
            let Entry {
                region,
                span,
                depth,
                ..
            } = entry;
            if let Some((first, count)) = found.leaf {
                let visit = Visit {
                    region,
                    depth,
                    span,
                    first,
                    count,
                    tested: None,
                };
                passed.push(visit);
                continue;
            }
            // Record the split planes that the ray crosses inside the node.
            for (plane, kind) in &found.planes {
                let t = self.line.crosses(plane);
                if span.enter < t && t < span.leave.min(self.end) {
                    crossings.push(Crossing {
                        t,
                        kind: *kind,
                        depth,
                        face: region.section(plane),
                    });
                }
            }
            for (id, region) in found.children {
                if let Some(span) = region.span(&self.line, span) {
                    stack.push(Entry {
                        id,
                        region,
                        span,
                        depth: depth + 1,
                    });
                }
            }
        }
        // Order the leaves along the ray.
        passed.sort_by(|a, b| a.span.enter.total_cmp(&b.span.enter));
        Ok((passed, crossings))
    }

    /// Returns the tested leaves in the order of the traversal, and between them the passed leaves that were not
    /// tested. Omits cells beyond the hit, those that the line only touches in a point, and of rays to any hit those
    /// with triangles, unless they were tested.
    fn merge(&self, tree: &dyn Cells, passed: Vec<Visit>) -> Result<Vec<Visit>> {
        let mut tested: HashMap<u32, Visit> = HashMap::new();
        let mut others = Vec::new();
        for mut visit in passed {
            visit.span = until(visit.span, self.end);
            let visited = self
                .path
                .leaves
                .iter()
                .any(|leaf| leaf.first == visit.first);
            if visit.count > 0 && visited {
                tested.insert(visit.first, visit);
            } else if visit.span.enter < visit.span.leave.min(self.end)
                && (visit.count == 0 || !self.any)
            {
                others.push(visit);
            }
        }
        // Error bounds may make the traversal test leaves that the line misses.
        let missing = self
            .path
            .leaves
            .iter()
            .any(|leaf| !tested.contains_key(&leaf.first));
        if missing {
            self.find_missing(tree, &mut tested)?;
        }
        // Merge the two lists: each untested leaf precedes the first tested leaf that the line enters later.
        let mut visits = Vec::new();
        let mut others = others.into_iter().peekable();
        for leaf in &self.path.leaves {
            let Some(mut visit) = tested.remove(&leaf.first) else {
                continue;
            };
            visit.tested = Some(leaf.steps);
            while let Some(other) = others.next_if(|other| other.span.enter < visit.span.enter) {
                visits.push(other);
            }
            visits.push(visit);
        }
        visits.extend(others);
        Ok(visits)
    }

    /// Searches the whole tree for the leaves that the traversal tested although the line misses them.
    fn find_missing(&self, tree: &dyn Cells, tested: &mut HashMap<u32, Visit>) -> Result<()> {
        try_each_leaf(tree, self.bounds, |leaf| {
            let wanted = self.path.leaves.iter().any(|l| l.first == leaf.first);
            if leaf.count > 0 && wanted && !tested.contains_key(&leaf.first) {
                // The line does not meet the leaf, so it has no interval there.
                let visit = Visit {
                    region: leaf.region.clone(),
                    depth: leaf.depth,
                    span: Span {
                        enter: f64::NAN,
                        leave: f64::NAN,
                    },
                    first: leaf.first,
                    count: leaf.count,
                    tested: None,
                };
                tested.insert(leaf.first, visit);
            }
            self.monitor.check()
        })
    }
}
