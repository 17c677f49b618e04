// SPDX-License-Identifier: GPL-3.0-or-later
//! Records the way of each beam, where rays are counted; other traversals contain no code of this.

use crate::beam::{Beam, Entry};
use crate::form::Form;
use crate::rays::Group;
use crate::traversal::{Octant, Traversal};
use halfspace_nodes::octree_nodes::Node;
use halfspace_ray::beam_path::{BeamAction, BeamPath, BeamStep};
use halfspace_ray::query::{Counters, Query};

/// A record, and the steps that the beams on the stack come from.
#[derive(Debug, Default)]
pub struct Recorder {
    /// The record.
    pub path: BeamPath,
    /// The step that the beam in work comes from, or that it is in.
    current: Option<u32>,
    /// The same of each beam on the stack.
    waiting: Vec<Option<u32>>,
}

impl<F: Form, Q: Query, C: Counters> Traversal<'_, F, Q, C> {
    /// Calls a function with the recorder, if there is one.
    #[inline(always)]
    fn record(&mut self, function: impl FnOnce(&mut Recorder)) {
        if C::COUNTS
            && let Some(recorder) = self.recorder.as_deref_mut()
        {
            function(recorder);
        }
    }

    /// Records that the beams of an octant begin.
    #[inline(always)]
    pub fn record_begin(&mut self) {
        self.record(|recorder| recorder.current = None);
    }

    /// Records that a beam is put on the stack.
    #[inline(always)]
    pub fn record_push(&mut self) {
        self.record(|recorder| recorder.waiting.push(recorder.current));
    }

    /// Records that a beam is taken from the stack.
    #[inline(always)]
    pub fn record_pop(&mut self) {
        self.record(|recorder| recorder.current = recorder.waiting.pop().flatten());
    }

    /// Records what becomes of the beam in work in its node.
    #[inline(always)]
    pub fn record_action(&mut self, action: BeamAction) {
        self.record_step(|step| step.action = action);
    }

    /// Records that rays of the beam in work are tested against the triangles of a leaf.
    #[inline(always)]
    pub fn record_test(&mut self) {
        self.record_step(|step| step.tested = true);
    }

    /// Changes the step that the beam in work is in.
    #[inline(always)]
    fn record_step(&mut self, change: impl FnOnce(&mut BeamStep)) {
        self.record(|recorder| {
            if let Some(current) = recorder.current {
                change(&mut recorder.path.steps[current as usize]);
            }
        });
    }

    /// Records that a beam enters its node.
    #[inline(always)]
    pub fn record_visit(&mut self, octant: &Octant<F>, group: &Group, node: Node, beam: &Beam) {
        if C::COUNTS && self.recorder.is_some() {
            let axis = match beam.entry {
                Entry::Inside => None,
                Entry::Face(face) => Some(face.axis),
            };
            let added = self.add_step(octant, group, node, beam, axis.map(|axis| (axis, false)));
            self.record(|recorder| recorder.current = Some(added));
        }
    }

    /// Records that a part of the beam in work leaves the root through the far face of its leaf across an axis.
    #[inline(always)]
    pub fn record_exit(
        &mut self,
        octant: &Octant<F>,
        group: &Group,
        node: Node,
        beam: &Beam,
        axis: usize,
    ) {
        if C::COUNTS && self.recorder.is_some() {
            self.add_step(octant, group, node, beam, Some((axis, true)));
        }
    }

    /// Adds a step with the open rays of a beam; returns its number. `face`: the axis of the face that the beam crosses,
    /// and whether that is the node's far one.
    #[inline(never)]
    fn add_step(
        &mut self,
        octant: &Octant<F>,
        group: &Group,
        node: Node,
        beam: &Beam,
        face: Option<(usize, bool)>,
    ) -> u32 {
        // Find the rays of the beam.
        self.scan(group, beam);
        let spans = self.scratch.spans.iter().flat_map(Clone::clone);
        let own: Vec<_> = spans
            .filter(|&i| self.is_open(octant, beam, i as usize))
            .map(|i| self.sorted.ids[i as usize])
            .collect();
        let Some(recorder) = self.recorder.as_deref_mut() else {
            return 0;
        };
        let path = &mut recorder.path;
        path.rays.extend(own);
        // Place its polygon in the face; rounding moves a corner beyond the edges of the face by little, which is cut.
        let edge = octant.grid.edge(node);
        let near: [f64; 3] = std::array::from_fn(|k| octant.place(k, beam.low[k]));
        let far: [f64; 3] = std::array::from_fn(|k| octant.place(k, beam.low[k] + edge));
        let low: [f64; 3] = std::array::from_fn(|k| near[k].min(far[k]));
        let high: [f64; 3] = std::array::from_fn(|k| near[k].max(far[k]));
        if let Some((axis, is_far)) = face {
            let plane = if is_far { far[axis] } else { near[axis] };
            for corner in beam.polygon.corners() {
                let point = octant.point(*corner, axis, plane);
                (path.vertices).push(std::array::from_fn(|k| point[k].max(low[k]).min(high[k])));
            }
        }
        let side = |axis: usize| (octant.grid.signs >> axis & 1) as usize;
        let number = path.steps.len();
        path.steps.push(BeamStep {
            parent: recorder.current,
            node: beam.node,
            level: node.level(),
            corners: [low, high],
            face: face.map(|(axis, is_far)| [axis, side(axis) ^ usize::from(is_far)]),
            vertices_end: path.vertices.len(),
            rays_end: path.rays.len(),
            tested: false,
            action: BeamAction::Left,
        });
        u32::try_from(number).expect("fewer steps than memory has room for")
    }
}
