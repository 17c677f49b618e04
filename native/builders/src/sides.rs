// SPDX-License-Identifier: GPL-3.0-or-later
//! The two sides of a plane that cuts objects: each object goes to one side, or its parts to both, whichever costs least
//! by the surface area heuristic (Stich, Friedrich and Dietrich 2009, Spatial splits in bounding volume hierarchies,
//! section 4.3, reference unsplitting).

use crate::object::{Object, around};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;

/// Number of objects that one thread splits at a time in large nodes, and between two checks for cancellation (chosen).
pub const CHUNK: usize = 1 << 14;

/// The objects of a node, classified by the node's plane.
#[derive(Debug, Default, PartialEq)]
pub struct Sides {
    /// Objects on one side, below and above.
    pub apart: [Vec<Object>; 2],
    /// Objects that the plane cuts, with boxes that contain their parts below and above.
    pub cut: Vec<(Object, [Aabb; 2])>,
}

impl Sides {
    /// Classifies objects by a plane across an axis. Boxes that extend beyond it by more than `little` are cut; their
    /// triangles are clipped later, if they go to both sides. Objects above keep the memory of the list.
    pub fn along_axis(mut objects: Vec<Object>, axis: usize, at: f32, little: f32) -> Self {
        let mut sides = Self::default();
        objects.retain(|object| {
            // Distances by which the object extends below and above the plane.
            let below = at - object.bounds.min[axis];
            let above = object.bounds.max[axis] - at;
            if below.min(above) <= little {
                // An object in the plane belongs below, as in the tree of planes.
                if below < above {
                    return true;
                }
                sides.apart[0].push(*object);
            } else {
                let mut parts = [object.bounds; 2];
                parts[0].max[axis] = at;
                parts[1].min[axis] = at;
                sides.cut.push((*object, parts));
            }
            false
        });
        sides.apart[1] = objects;
        sides
    }

    /// Adds an object with the boxes around its parts. An object without a part below is not added but returned
    /// with its part above.
    pub fn take(&mut self, whole: Object, parts: [Aabb; 2]) -> Option<Object> {
        let [below, above] = parts;
        // Classify the object by which parts are not empty.
        match parts.map(|part| part.is_empty()) {
            [false, false] => self.cut.push((whole, parts)),
            [false, true] => self.apart[0].push(Object {
                bounds: below,
                ..whole
            }),
            [true, false] => {
                return Some(Object {
                    bounds: above,
                    ..whole
                });
            }
            // Rounding left no part on either side: keep the whole object.
            [true, true] => return Some(whole),
        }
        None
    }

    /// Concatenates the classified objects.
    pub fn joined(parts: Vec<Self>) -> Self {
        let all = |side: usize| parts.iter().map(|part| part.apart[side].len()).sum();
        let mut joined = Self {
            apart: [Vec::with_capacity(all(0)), Vec::with_capacity(all(1))],
            cut: Vec::new(),
        };
        for part in parts {
            for (all, own) in joined.apart.iter_mut().zip(part.apart) {
                all.extend(own);
            }
            joined.cut.extend(part.cut);
        }
        joined
    }

    /// Assigns each cut object to both sides, or whole to one of them, one after another, by the boxes so far.
    /// `cut` returns the tight boxes around the parts of an object that goes to both sides.
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Cancelled`].
    pub fn share_out(
        mut self,
        cut: impl Fn(&Object, [Aabb; 2]) -> [Aabb; 2],
        monitor: &Monitor,
    ) -> Result<[Vec<Object>; 2]> {
        // Start with the boxes of all parts, as if every object went to both sides.
        let mut bounds = [0, 1].map(|side| {
            let parts = self.cut.iter().map(|(_, parts)| parts[side]);
            parts.fold(around(&self.apart[side]), |all, part| all.union(&part))
        });
        // Number of objects on each side, if every cut object goes to both.
        let mut count = [0, 1].map(|side| (self.apart[side].len() + self.cut.len()) as f64);
        for (seen, (whole, parts)) in std::mem::take(&mut self.cut).into_iter().enumerate() {
            if seen % CHUNK == CHUNK - 1 {
                monitor.check()?;
            }
            // Compare the costs of both sides with those of one side.
            let grown = bounds.map(|own| own.union(&whole.bounds));
            let cost = |areas: [f64; 2], less: [f64; 2]| {
                areas[0] * (count[0] - less[0]) + areas[1] * (count[1] - less[1])
            };
            let [below, above] = bounds.map(|own| own.area());
            let both = cost([below, above], [0.0, 0.0]);
            let only_below = cost([grown[0].area(), above], [0.0, 1.0]);
            let only_above = cost([below, grown[1].area()], [1.0, 0.0]);
            // Clip the object only if it goes to both sides.
            if both <= only_below && both <= only_above {
                let parts = cut(&whole, parts);
                if parts.iter().any(Aabb::is_empty) {
                    count[usize::from(!parts[0].is_empty())] -= 1.0;
                    let above = self.take(whole, parts);
                    self.apart[1].extend(above);
                    continue;
                }
                // Put each part on its side.
                for (side, bounds) in parts.into_iter().enumerate() {
                    self.apart[side].push(Object { bounds, ..whole });
                }
            } else {
                // Put the whole object on the cheaper side.
                let side = usize::from(only_above < only_below);
                bounds[side] = grown[side];
                count[1 - side] -= 1.0;
                self.apart[side].push(whole);
            }
        }
        Ok(self.apart)
    }
}
