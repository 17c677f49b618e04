// SPDX-License-Identifier: GPL-3.0-or-later
//! The way of one ray through a structure: cells visited in order, planes crossed, triangles tested.
//!
//! The walk itself says which leaves it tested, in its own order. Where the ray is in which cell, and
//! which empty cells and planes it passes, is worked out beside it, in plain f64: so the two can be
//! held against each other.

use crate::geom::Aabb;
use crate::regions::{self, Cells, Face, Line, Region, Task, each_leaf};
use crate::structure::Structure;
use crate::traverse::path::Path;
use crate::traverse::{Hit, Ray, RayCounters};
use std::collections::HashMap;

/// A leaf on the way.
#[derive(Debug, Clone)]
pub struct Visit {
    /// What it covers, in the structure's frame.
    pub region: Region,
    /// Of the leaf.
    pub depth: usize,
    /// Where the ray is inside, in units of its direction. Both NaN for a leaf that the walk tested
    /// although the ray passes it by, which the allowance for rounding makes possible.
    pub span: (f64, f64),
    /// Where the blocks of the leaf begin.
    pub first: u32,
    /// How many triangles they hold.
    pub count: usize,
    /// Whether the walk tested them.
    pub tested: bool,
}

/// A plane that the ray crosses inside the node that it splits.
#[derive(Debug, Clone)]
pub struct Crossing {
    /// Where, in units of the direction.
    pub t: f64,
    /// As in [`crate::polygons`].
    pub kind: u8,
    /// Of the node.
    pub depth: usize,
    /// The plane, cut to the node.
    pub face: Face,
}

/// The way of one ray.
#[derive(Debug, Clone)]
pub struct RayPath {
    /// The answer.
    pub hit: Hit,
    /// What the walk counted.
    pub counters: RayCounters,
    /// The leaves on the way: the tested ones in the order of the walk, the others between them.
    pub visits: Vec<Visit>,
    /// The planes on the way, the nearest first.
    pub crossings: Vec<Crossing>,
}

/// Follows a ray to its nearest hit, or out of the scene.
pub fn ray_path(structure: &Structure, ray: &Ray) -> RayPath {
    let (hit, path) = structure.path(ray);
    let built = structure.built();
    let scale = built.frame.point([1.0; 3]).map(f64::from);
    let line = Line {
        origin: std::array::from_fn(|k| f64::from(ray.o[k]) * scale[k]),
        direction: std::array::from_fn(|k| f64::from(ray.d[k]) * scale[k]),
    };
    let task = Follow {
        bounds: built.frame.bounds(),
        line,
        span: (f64::from(ray.t_min), f64::from(ray.t_max.min(hit.t))),
        path: &path,
    };
    match regions::with_walked_cells(structure, task) {
        Some((visits, crossings)) => RayPath {
            hit,
            counters: path.counters,
            visits,
            crossings,
        },
        None => alone(structure, &line, (hit, &path)),
    }
}

/// Without a tree the scene's box is the only cell.
fn alone(structure: &Structure, line: &Line, (hit, path): (Hit, &Path)) -> RayPath {
    let built = structure.built();
    let region = Region::of_scene(built.frame.bounds());
    let whole = (f64::NEG_INFINITY, f64::INFINITY);
    let tested = path.counters.tests > 0;
    let visits = region.interval(line, whole).map(|span| Visit {
        region: region.clone(),
        depth: 0,
        span,
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

struct Follow<'a> {
    bounds: Aabb,
    line: Line,
    span: (f64, f64),
    path: &'a Path,
}

impl Task for Follow<'_> {
    type Result = (Vec<Visit>, Vec<Crossing>);

    fn run<T: Cells>(self, tree: &T) -> Self::Result {
        let (passed, mut crossings) = self.pass(tree);
        crossings.sort_by(|a, b| a.t.total_cmp(&b.t));
        (self.merge(tree, passed), crossings)
    }
}

impl Follow<'_> {
    /// Every leaf and every plane that the line passes within the span.
    fn pass<T: Cells>(&self, tree: &T) -> (Vec<Visit>, Vec<Crossing>) {
        let (mut passed, mut crossings) = (Vec::new(), Vec::new());
        if self.bounds.is_empty() {
            return (passed, crossings);
        }
        let (top, whole) = tree.top(self.bounds);
        let mut waiting = Vec::new();
        if let Some(span) = whole.interval(&self.line, self.span) {
            waiting.push((top, whole, span, 0));
        }
        while let Some((place, region, span, depth)) = waiting.pop() {
            let found = tree.look(place, &region);
            if let Some((first, count)) = found.leaf {
                let visit = Visit {
                    region,
                    depth,
                    span,
                    first,
                    count,
                    tested: false,
                };
                passed.push(visit);
                continue;
            }
            for (plane, kind) in &found.planes {
                let t = self.line.crosses(plane);
                if span.0 < t && t < span.1 {
                    crossings.push(Crossing {
                        t,
                        kind: *kind,
                        depth,
                        face: region.section(plane),
                    });
                }
            }
            for (child, part) in found.children {
                if let Some(within) = part.interval(&self.line, span) {
                    waiting.push((child, part, within, depth + 1));
                }
            }
        }
        passed.sort_by(|a, b| a.span.0.total_cmp(&b.span.0));
        (passed, crossings)
    }

    /// The tested leaves in the order of the walk, those passed untested between them. A cell that is
    /// only touched in a point counts when it was tested.
    fn merge<T: Cells>(&self, tree: &T, passed: Vec<Visit>) -> Vec<Visit> {
        let mut tested: HashMap<u32, Visit> = HashMap::new();
        let mut others = Vec::new();
        for visit in passed {
            let walked = self.path.leaves.iter().any(|leaf| leaf.0 == visit.first);
            if visit.count > 0 && walked {
                tested.insert(visit.first, visit);
            } else if visit.span.0 < visit.span.1 {
                others.push(visit);
            }
        }
        let missing = self.path.leaves.iter().any(|l| !tested.contains_key(&l.0));
        if missing {
            self.find_missing(tree, &mut tested);
        }
        let mut visits = Vec::new();
        let mut others = others.into_iter().peekable();
        for (first, _) in &self.path.leaves {
            let Some(mut visit) = tested.remove(first) else {
                continue;
            };
            visit.tested = true;
            while let Some(other) = others.next_if(|other| other.span.0 < visit.span.0) {
                visits.push(other);
            }
            visits.push(visit);
        }
        visits.extend(others);
        visits
    }

    /// Looks through the whole tree for the leaves that the walk tested and the line passes by.
    fn find_missing<T: Cells>(&self, tree: &T, tested: &mut HashMap<u32, Visit>) {
        each_leaf(tree, self.bounds, |leaf| {
            let wanted = self.path.leaves.iter().any(|l| l.0 == leaf.first);
            if leaf.count > 0 && wanted && !tested.contains_key(&leaf.first) {
                let visit = Visit {
                    region: leaf.region.clone(),
                    depth: leaf.depth,
                    span: (f64::NAN, f64::NAN),
                    first: leaf.first,
                    count: leaf.count,
                    tested: true,
                };
                tested.insert(leaf.first, visit);
            }
        });
    }
}
