// SPDX-License-Identifier: GPL-3.0-or-later
//! Structures of single instances, over their triangles in the scene.
//!
//! Far from the origin the vertices of an instance are rounded coarsely in the scene, compared with its size, and a ray
//! in the space of its mesh must look for triangles within that distance. Such an instance has a structure of its own
//! over the rounded triangles, in whose space rays have no such error.

use crate::instances::{IDENTITY, Instances, NOWHERE};
use crate::structure::Structure;
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_scene::{MeshInstance, Triangles};
use std::sync::Arc;

/// Distance between a vertex and its rounded one, relative to the size of the mesh, from which an instance is copied
/// (chosen).
const COARSE: f64 = 1.0 / 512.0;

/// Largest number of copies, and of their triangles together (chosen: about a gigabyte); further instances have none.
const MOST_COPIES: usize = 1 << 12;
const MOST_COPIED: usize = 1 << 22;

/// The structure of one instance.
#[derive(Debug)]
pub(super) struct Copy {
    pub(super) structure: Arc<Structure>,
    /// The identity, in place of the instance's transform.
    pub(super) instance: MeshInstance,
}

impl Instances {
    /// Builds the copies, up to the limits and the free memory, and sets the index of each place's copy.
    pub(super) fn copy_coarse(&mut self, monitor: &Monitor) -> Result<()> {
        let mut copied = 0;
        for number in 0..self.places.len() {
            let place = &self.places[number];
            let mesh = &self.meshes[place.mesh as usize];
            let size = mesh.scene().len();
            if !is_coarse(place, mesh) || copied + size > MOST_COPIED {
                continue;
            }
            if self.copies.len() == MOST_COPIES {
                break;
            }
            copied += size;
            // Copy the triangles as they are in the scene.
            let vertices = (mesh.scene().vertices().iter())
                .map(|p| place.to_scene.transform.point(*p))
                .collect();
            let indices = (mesh.scene().indices().iter())
                .map(|&[a, b, c]| {
                    if place.to_scene.mirrored {
                        [a, c, b]
                    } else {
                        [a, b, c]
                    }
                })
                .collect();
            let scene = Arc::new(Triangles::new(vertices, indices)?);
            let structure = match Structure::build_here(scene, mesh.config().clone(), monitor) {
                Err(Error::Memory(_)) => break,
                built => Arc::new(built?),
            };
            // Place it where it is, below the numbers of the meshes.
            let boxes = &structure.outline().boxes;
            let mesh = (self.meshes.len() + self.copies.len()) as u32;
            let Some(instance) = MeshInstance::new(IDENTITY, boxes, mesh, place.first, false)
            else {
                continue;
            };
            // The identity rounds no vertex.
            let instance = MeshInstance {
                corner_error: [0.0; 3],
                ..instance
            };
            if self.copy_of.is_empty() {
                self.copy_of = vec![NOWHERE; self.places.len()];
            }
            self.copy_of[number] = self.copies.len() as u32;
            self.copies.push(Copy {
                structure,
                instance,
            });
        }
        Ok(())
    }

    /// The instance and the structure that rays traverse for a place.
    #[inline(always)]
    pub(super) fn traversed(&self, place: u32) -> (&MeshInstance, &Structure) {
        // Nearly all scenes have no copies.
        if let Some(&copy) = self.copy_of.get(place as usize)
            && let Some(copy) = self.copies.get(copy as usize)
        {
            return (&copy.instance, &copy.structure);
        }
        let place = &self.places[place as usize];
        (place, &self.meshes[place.mesh as usize])
    }

    /// The structure of a mesh, or of a copy by the number of its instance's mesh.
    #[inline(always)]
    pub(super) fn structure(&self, mesh: u32) -> &Structure {
        let mesh = mesh as usize;
        match self.meshes.get(mesh) {
            Some(structure) => structure,
            None => &self.copies[mesh - self.meshes.len()].structure,
        }
    }
}

/// Whether the vertices of an instance are rounded coarsely.
fn is_coarse(place: &MeshInstance, mesh: &Structure) -> bool {
    let bounds = mesh.frame().bounds();
    let scale = f64::from(mesh.frame().scale());
    let half = |k: usize| 0.5 * (f64::from(bounds.max[k]) - f64::from(bounds.min[k])) / scale;
    let size = half(0).max(half(1)).max(half(2));
    let [x, y, z] = place.corner_error;
    // A mesh without area has no tree.
    size > 0.0 && x.max(y).max(z) > COARSE * size
}
