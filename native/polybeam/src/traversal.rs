// SPDX-License-Identifier: GPL-3.0-or-later
//! The traversal: beams go from leaf to leaf, through links, until all rays have ended.
//!
//! It ends: each beam goes through leaves in their order along the octant, and comes by at most [`SPLITS`] splits from one
//! whose rays were counted and not zero. Each ray is in one of the parts of a beam, or goes on singly.

use crate::beam::{Beam, Entry, Position, Sides};
use crate::form::Form;
use crate::line::{Ahead, Line};
use crate::rays::{Group, Sorted};
use crate::recorder::Recorder;
use fearless_simd::Simd;
use halfspace_base::Monitor;
use halfspace_leaf::Job;
use halfspace_nodes::octree_nodes::{Node, OUTSIDE, Octree};
use halfspace_ray::beam_path::BeamAction;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{Hit, RaySlice};
use halfspace_single::octants::step::Grid;
use std::marker::PhantomData;
use std::ops::Range;

/// Names of this traversal's entries in [`halfspace_ray::ray::RayCounters::cases`], in order: beams, counting each part
/// of a beam that is split; clips of a polygon against a line; splits of a beam; pixels found by scan conversion; rays
/// that go on singly; visits of nodes by beams that no ray is left in, counted for another ray.
pub const NAMES: [&str; 6] = [
    "beams",
    "beam_clips",
    "beam_splits",
    "beam_pixels",
    "beam_singles",
    "beam_empty",
];

pub const BEAM: usize = 0;
pub const CLIP: usize = 1;
pub const SPLIT: usize = 2;
pub const PIXEL: usize = 3;
pub const SINGLE: usize = 4;
const EMPTY: usize = 5;

/// Largest estimate of the number of rays per area, relative to that of the whole image (chosen).
const DENSEST: f64 = 4.0;

/// Number of splits after which the rays of a beam are counted, although its polygon is large enough for some (chosen).
const SPLITS: u8 = 8;

/// A batch of rays through one tree.
pub struct Traversal<'a, F: Form, Q, C> {
    /// Kind of query: nearest hits, or any hits of reversed rays.
    pub query: PhantomData<Q>,
    pub tree: &'a Octree,
    /// Rays go on singly where fewer than this are left together.
    pub least: u32,
    pub job: Job<'a>,
    pub slice: RaySlice<'a>,
    pub answers: &'a mut [Hit],
    pub counters: &'a mut [C],
    pub sorted: Sorted,
    /// Memory that beams use one after another.
    pub scratch: Scratch<F::Triangle>,
    /// Cancels the traversal.
    pub monitor: Option<&'a Monitor>,
    /// Records the beams, where rays are counted.
    pub recorder: Option<&'a mut Recorder>,
}

/// Memory that beams use one after another.
pub struct Scratch<T> {
    stack: Vec<Beam>,
    edges: Vec<[f64; 2]>,
    pub spans: Vec<Range<u32>>,
    pub triangles: Vec<crate::leaf::Facing<T>>,
}

impl<T> Default for Scratch<T> {
    fn default() -> Self {
        Self {
            stack: Vec::new(),
            edges: Vec::new(),
            spans: Vec::new(),
            triangles: Vec::new(),
        }
    }
}

/// Constants that the rays of an octant share.
pub struct Octant<F> {
    pub grid: Grid,
    /// Their origin or direction.
    pub form: F,
    /// Side of the smallest cells.
    unit: f32,
    /// Largest estimate of the number of rays per area: where many rays lie in line, a polygon around them has almost no
    /// area, and so have its parts without rays.
    pub densest: f64,
}

impl<F: Form> Octant<F> {
    /// The rays of a form with these signs.
    pub fn new(tree: &Octree, signs: u32, form: F) -> Self {
        Self {
            grid: Grid::new(tree, signs),
            form,
            unit: tree.cube().unit(),
            densest: f64::INFINITY,
        }
    }

    /// Factor from a coordinate to that in the direction of the rays.
    #[inline(always)]
    pub fn sign(&self, axis: usize) -> f32 {
        if self.grid.signs >> axis & 1 == 1 {
            -1.0
        } else {
            1.0
        }
    }

    /// The plane with this number. The outer faces of the root are moved outwards by a smallest cell, so that no ray
    /// along one of them is lost to rounding.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounds to f32")]
    pub fn ahead(&self, axis: usize, number: u32) -> Ahead {
        let plane = f64::from(self.grid.plane(axis, number));
        let mut offset = (plane - self.form.middle()[axis]) * f64::from(self.sign(axis));
        if number == 0 {
            offset -= f64::from(self.unit);
        }
        if number == self.grid.size {
            offset += f64::from(self.unit);
        }
        let offset = offset * self.form.scale();
        Ahead {
            axis,
            offset: offset as f32,
        }
    }

    /// The coordinate of the plane with this number, moved as [`Self::ahead`] moves it.
    pub fn place(&self, axis: usize, number: u32) -> f64 {
        let outwards = f64::from(number == self.grid.size) - f64::from(number == 0);
        let outwards = outwards * f64::from(self.unit * self.sign(axis));
        f64::from(self.grid.plane(axis, number)) + outwards
    }

    /// The point, in the frame, where a ray at a point of the plane of polygons crosses the plane across an axis at this
    /// coordinate; for drawing.
    pub fn point(&self, place: [f64; 2], axis: usize, plane: f64) -> [f64; 3] {
        let (middle, scale) = (self.form.middle(), self.form.scale());
        let sign = |k: usize| f64::from(self.sign(k));
        let offset = (plane - middle[axis]) * sign(axis) * scale;
        let crossing = self.form.crossing(place, axis, offset);
        std::array::from_fn(|k| {
            if k == axis {
                plane
            } else {
                middle[k] + sign(k) * crossing[k] / scale
            }
        })
    }

    /// The planes of the corner `number`.
    #[inline(always)]
    pub fn planes(&self, number: [u32; 3]) -> [Ahead; 3] {
        [
            self.ahead(0, number[0]),
            self.ahead(1, number[1]),
            self.ahead(2, number[2]),
        ]
    }
}

impl<F: Form, Q: Query, C: Counters> Traversal<'_, F, Q, C> {
    /// Traces all sorted rays.
    #[inline(always)]
    pub fn run<S: Simd>(&mut self, simd: S, form: F) {
        let groups = std::mem::take(&mut self.sorted.groups);
        for group in &groups {
            let mut octant = Octant::new(self.tree, group.signs, form);
            self.record_begin();
            self.begin(&mut octant, group);
            while let Some(beam) = self.scratch.stack.pop() {
                self.record_pop();
                if self.monitor.is_some_and(Monitor::is_cancelled) {
                    return;
                }
                self.visit(simd, &octant, group, beam);
            }
        }
    }

    /// Begins with one beam, the octant's part of the image, or with one for each face of the root that it enters
    /// through.
    #[inline(always)]
    fn begin(&mut self, octant: &mut Octant<F>, group: &Group) {
        let polygon = group.extent.polygon();
        let density = group.extent.count as f64 / polygon.area().max(f64::MIN_POSITIVE);
        octant.densest = DENSEST * density;
        let first = group.raster.first[0] as usize;
        let whole = Beam {
            density,
            polygon,
            sides: Sides::none(),
            node: 0,
            low: [0; 3],
            entry: Entry::Inside,
            payer: self.sorted.ids[first],
            splits: 0,
            unbounded: false,
        };
        let near = octant.planes([0; 3]);
        let far = octant.planes([octant.grid.size; 3]);
        // Of an origin, some planes lie behind it; parallel beams begin before all.
        let has_origin = octant.form.origin().is_some();
        let ahead = |plane: &Ahead| !has_origin || plane.offset > 0.0;
        if !far.iter().all(ahead) {
            return;
        }
        if !near.iter().any(ahead) {
            self.push(whole);
            return;
        }
        // Rays enter through the last of the near planes ahead, before they reach a far plane of another axis.
        for face in near.into_iter().filter(ahead) {
            let others = || (0..3).filter(|k| *k != face.axis);
            let after = others().filter(|k| ahead(&near[*k]));
            let after = after.map(|k| Line::first(near[k], face));
            let before = others().map(|k| Line::first(face, far[k]));
            let mut beam = Some(whole);
            for side in after.chain(before) {
                self.counters[whole.payer as usize].case(|| CLIP);
                beam = beam.and_then(|beam| beam.part(&octant.form, side));
            }
            if let Some(beam) = beam {
                self.push(Beam {
                    entry: Entry::Face(face),
                    ..beam
                });
            }
        }
    }

    #[inline(always)]
    fn push(&mut self, beam: Beam) {
        self.counters[beam.payer as usize].case(|| BEAM);
        self.record_push();
        self.scratch.stack.push(beam);
    }

    /// Takes a beam through its node: to children, to neighbours, or to its end.
    #[inline(always)]
    fn visit<S: Simd>(&mut self, simd: S, octant: &Octant<F>, group: &Group, mut beam: Beam) {
        loop {
            let node = self.tree.node(beam.node);
            self.record_visit(octant, group, node, &beam);
            if beam.unbounded {
                self.record_action(BeamAction::Singles);
                self.scan(group, &beam);
                self.go_on_singly(simd, octant, node, &beam);
                return;
            }
            if node.is_inner() {
                self.count_visit(octant, group, &mut beam, |counters| counters.step_boxes());
                if !self.descend(octant, node, &mut beam) {
                    self.record_action(BeamAction::Ended);
                    return;
                }
                continue;
            }
            let leaf = node.blocks();
            self.count_visit(octant, group, &mut beam, |counters| {
                counters.leaf(leaf.count)
            });
            // Find the rays where triangles may hit them, or where few are left.
            let likely = beam.density * beam.polygon.area();
            let few = likely < f64::from(self.least);
            let doubtful = few || beam.splits >= SPLITS;
            if doubtful || leaf.count != 0 {
                beam.sides.drop_far(&octant.form, &beam.polygon);
                let mut found = self.scan(group, &beam);
                // The rows of a narrow polygon contain more rays than it does, and its parts would have no end.
                if doubtful && found >= self.least as usize {
                    found = self.count_own(simd, octant, &mut beam);
                }
                if found == 0 {
                    self.record_action(BeamAction::Ended);
                    return;
                }
                if found < self.least as usize {
                    self.record_action(BeamAction::Singles);
                    self.go_on_singly(simd, octant, node, &beam);
                    return;
                }
                if leaf.count != 0 {
                    self.record_test();
                    let open = self.test(simd, octant, node, &mut beam);
                    if open == 0 {
                        self.record_action(BeamAction::Ended);
                        return;
                    }
                    if open < self.least {
                        self.record_action(BeamAction::Singles);
                        self.go_on_singly(simd, octant, node, &beam);
                        return;
                    }
                }
            }
            if !self.leave(octant, group, node, &mut beam) {
                return;
            }
        }
    }

    /// Finds the ranges of rays that contain those of a beam; returns their number.
    #[inline(always)]
    pub fn scan(&mut self, group: &Group, beam: &Beam) -> usize {
        let Scratch { edges, spans, .. } = &mut self.scratch;
        group.raster.scan(&beam.polygon, edges, spans)
    }

    /// Whether the sorted ray `i`, found by a scan, belongs to a beam and is open.
    #[inline(always)]
    pub fn is_open(&self, octant: &Octant<F>, beam: &Beam, i: usize) -> bool {
        let way = self.sorted.way(i);
        let mut sides = beam.sides.all().iter();
        sides.all(|side| side.holds(&octant.form, way)) && self.sorted.reach[i] != f32::NEG_INFINITY
    }

    /// Counts a visit: for the first open ray of the beam, and as joined for the others.
    #[inline(always)]
    fn count_visit(
        &mut self,
        octant: &Octant<F>,
        group: &Group,
        beam: &mut Beam,
        count: impl FnOnce(&mut C),
    ) {
        if !C::COUNTS {
            return;
        }
        let mut paid = false;
        let mut count = Some(count);
        self.scan(group, beam);
        let spans = std::mem::take(&mut self.scratch.spans);
        for at in spans.iter().flat_map(Clone::clone).map(|i| i as usize) {
            if !self.is_open(octant, beam, at) {
                continue;
            }
            let id = self.sorted.ids[at];
            if paid {
                self.counters[id as usize].joined();
                continue;
            }
            paid = true;
            beam.payer = id;
            if let Some(count) = count.take() {
                count(&mut self.counters[id as usize]);
            }
        }
        self.scratch.spans = spans;
        // A beam without rays is paid for by its last one.
        if let Some(count) = count.take() {
            let payer = &mut self.counters[beam.payer as usize];
            payer.case(|| EMPTY);
            count(payer);
        }
    }

    /// Splits a beam among the children of an inner node behind the face that it enters through; keeps one part in
    /// `beam`. Returns `false` if no part is left.
    #[inline(always)]
    fn descend(&mut self, octant: &Octant<F>, node: Node, beam: &mut Beam) -> bool {
        let grid = &octant.grid;
        let half = grid.edge(node) / 2;
        let Entry::Face(face) = beam.entry else {
            // The origin is inside: take its child.
            let Some(origin) = octant.form.origin() else {
                return false;
            };
            let mut child = 0;
            for (k, x) in origin.into_iter().enumerate() {
                let cell = grid.cell(k, x, 0, grid.size - 1);
                if cell >= beam.low[k] + half {
                    child |= 1 << k;
                    beam.low[k] += half;
                }
            }
            beam.node = node.children() + (child ^ grid.signs);
            self.record_action(BeamAction::HandedOn);
            return true;
        };
        // Compare with both mid planes across the face, and push all parts but the last.
        let mut parts = [(Some(*beam), 0_u32), (None, 0), (None, 0), (None, 0)];
        let mut count = 1;
        for axis in (0..3).filter(|k| *k != face.axis) {
            let mid = octant.ahead(axis, beam.low[axis] + half);
            let before = count;
            for i in 0..before {
                let (Some(part), child) = parts[i] else {
                    continue;
                };
                match part.compare(&octant.form, face, mid) {
                    Position::Whole(true) => {}
                    Position::Whole(false) => parts[i].1 |= 1 << axis,
                    Position::Across => {
                        let counters = &mut self.counters[beam.payer as usize];
                        counters.case(|| CLIP);
                        counters.case(|| SPLIT);
                        let near = Line::first(face, mid);
                        let part = part.split();
                        parts[i].0 = part.part(&octant.form, near);
                        parts[count] =
                            (part.part(&octant.form, near.opposite()), child | 1 << axis);
                        count += 1;
                    }
                }
            }
        }
        self.record_action(if count > 1 {
            BeamAction::Split
        } else {
            BeamAction::HandedOn
        });
        let mut kept = false;
        for (part, child) in parts.into_iter().take(count) {
            let Some(mut part) = part else {
                continue;
            };
            for (k, low) in part.low.iter_mut().enumerate() {
                *low += half * (child >> k & 1);
            }
            part.node = node.children() + (child ^ grid.signs);
            if kept {
                self.push(part);
            } else {
                (*beam, kept) = (part, true);
            }
        }
        kept
    }

    /// Takes a beam through the far faces of its leaf to the neighbours behind them; keeps one part in `beam`. Returns
    /// `false` if no part is left.
    #[inline(always)]
    fn leave(&mut self, octant: &Octant<F>, group: &Group, node: Node, beam: &mut Beam) -> bool {
        let grid = &octant.grid;
        let edge = grid.edge(node);
        let next = beam.low.map(|x| x + edge);
        let planes = octant.planes(next);
        // Compare the three pairs of faces: which one comes first.
        let pairs = [(0, 1), (0, 2), (1, 2)];
        let order = pairs.map(|(x, y)| beam.compare(&octant.form, planes[x], planes[y]));
        let across = order.contains(&Position::Across);
        self.record_action(if across {
            BeamAction::Clipped
        } else {
            BeamAction::HandedOn
        });
        let whole = *beam;
        let mut kept = false;
        for axis in 0..3 {
            let mut part = Some(if across { whole.split() } else { whole });
            for ((x, y), order) in pairs.into_iter().zip(order) {
                if x != axis && y != axis {
                    continue;
                }
                match order {
                    // Another face certainly comes first, or this one does.
                    Position::Whole(lower) if lower != (x == axis) => part = None,
                    Position::Whole(_) => {}
                    Position::Across => {
                        self.counters[whole.payer as usize].case(|| CLIP);
                        let side = Line::first(planes[axis], planes[x + y - axis]);
                        part = part.and_then(|part| part.part(&octant.form, side));
                    }
                }
            }
            let Some(mut part) = part else {
                continue;
            };
            if !self.cross(octant, node, axis, &mut part) {
                self.record_exit(octant, group, node, &part, axis);
                continue;
            }
            if kept {
                self.counters[whole.payer as usize].case(|| SPLIT);
                self.push(part);
            } else {
                (*beam, kept) = (part, true);
            }
        }
        kept
    }

    /// Moves a beam to the node behind the face of its leaf across `axis`; returns `false` at the root's boundary.
    #[inline(always)]
    fn cross(&self, octant: &Octant<F>, node: Node, axis: usize, beam: &mut Beam) -> bool {
        let grid = &octant.grid;
        let plane = beam.low[axis] + grid.edge(node);
        if plane == grid.size {
            return false;
        }
        let side = usize::from(grid.signs >> axis & 1 == 0);
        let neighbour = self.tree.links(node.leaf_index())[2 * axis + side];
        if neighbour == OUTSIDE {
            return false;
        }
        // A larger neighbour begins lower along the other axes.
        let edge = grid.edge(self.tree.node(neighbour));
        beam.low[axis] = plane;
        beam.low = beam.low.map(|x| x & !(edge - 1));
        beam.node = neighbour;
        beam.entry = Entry::Face(octant.ahead(axis, plane));
        true
    }
}
