// SPDX-License-Identifier: GPL-3.0-or-later
//! Structures of instances over their triangles in the scene.
//!
//! Far from the origin the vertices of an instance are rounded coarsely in the scene, compared with its triangles, and a
//! ray in the space of its mesh must look for triangles within that distance. Such an instance has a structure of its
//! own over the rounded triangles, in whose space rays have no such error.
//!
//! Instances that lie in one another cannot be separated by a tree over their boxes: each ray would enter nearly all of
//! them. They share one structure.

use crate::instances::{IDENTITY, Instances, NOWHERE};
use crate::structure::Structure;
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;
use halfspace_scene::{MeshInstance, Triangles};
use std::ops::Range;
use std::sync::Arc;

/// Distance between a vertex and its rounded one, relative to the mean size of the mesh's triangles, from which an
/// instance is copied (chosen): rays then cannot tell a quarter of the triangles that they pass from those they hit.
const COARSE: f64 = 1.0 / 128.0;

/// Least number of instances in one another that share a copy (chosen).
const CROWD: usize = 32;

/// Largest ratio of the area around a crowd to that of the box of each of its instances (chosen).
const WITHIN: f64 = 4.0;

/// Largest number of copies, and of their triangles together (chosen: about a gigabyte); further instances have none.
const MOST_COPIES: usize = 1 << 12;
const MOST_COPIED: usize = 1 << 22;

/// The structure of one instance, or of several.
#[derive(Debug)]
pub(super) struct Copy {
    pub(super) structure: Arc<Structure>,
    /// The identity, in place of the instances' transforms.
    pub(super) instance: MeshInstance,
    /// The first of the instances, which stands for all in the upper tree.
    place: u32,
}

/// The copies of a scene.
#[derive(Debug, Default)]
pub(super) struct Copies {
    /// Index into `all` of each place, or [`NOWHERE`]; empty without copies.
    of: Vec<u32>,
    all: Vec<Copy>,
}

impl Copies {
    /// Builds the copies, up to the limits and the free memory.
    pub(super) fn build(
        meshes: &[Arc<Structure>],
        places: &[MeshInstance],
        monitor: &Monitor,
    ) -> Result<Self> {
        let mut built = Self::default();
        let mut copied = 0;
        let size = |place: &MeshInstance| meshes[place.mesh as usize].scene().len();
        // Copy crowds first, then single instances.
        let crowds = crowds(places, size);
        let singles = (0..places.len()).map(|i| i..i + 1);
        for run in crowds.into_iter().chain(singles) {
            let alone = run.len() == 1;
            let place = &places[run.start];
            if alone && (built.has(run.start) || !is_coarse(place, &meshes[place.mesh as usize])) {
                continue;
            }
            let more: usize = places[run.clone()].iter().map(size).sum();
            if copied + more > MOST_COPIED {
                continue;
            }
            if built.all.len() == MOST_COPIES {
                break;
            }
            copied += more;
            match built.add(meshes, places, run, monitor) {
                Err(Error::Memory(_)) => break,
                added => added?,
            }
        }
        Ok(built)
    }

    /// Builds the copy of a run of instances.
    fn add(
        &mut self,
        meshes: &[Arc<Structure>],
        places: &[MeshInstance],
        run: Range<usize>,
        monitor: &Monitor,
    ) -> Result<()> {
        // Copy the triangles as they are in the scene.
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for place in &places[run.clone()] {
            let scene = meshes[place.mesh as usize].scene();
            let first = vertices.len() as u32;
            let point = |p: &[f32; 3]| place.to_scene.transform.point(*p);
            vertices.extend(scene.vertices().iter().map(point));
            indices.extend(scene.indices().iter().map(|&[a, b, c]| {
                let [b, c] = if place.to_scene.mirrored {
                    [c, b]
                } else {
                    [b, c]
                };
                [first + a, first + b, first + c]
            }));
        }
        let place = &places[run.start];
        let config = meshes[place.mesh as usize].config().clone();
        let scene = Arc::new(Triangles::new(vertices, indices)?);
        let structure = Arc::new(Structure::build_here(scene, config, monitor)?.unrounded());
        // Place it where it is, below the numbers of the meshes.
        let boxes = &structure.outline().boxes;
        let mesh = (meshes.len() + self.all.len()) as u32;
        let Some(instance) = MeshInstance::new(IDENTITY, boxes, mesh, place.first, false) else {
            return Ok(());
        };
        let mut bounds = Aabb::EMPTY;
        for place in &places[run.clone()] {
            bounds = bounds.union(&place.bounds);
        }
        if self.of.is_empty() {
            self.of = vec![NOWHERE; places.len()];
        }
        let first = run.start as u32;
        self.of[run].fill(self.all.len() as u32);
        self.all.push(Copy {
            structure,
            // The identity rounds no vertex.
            instance: MeshInstance {
                corner_error: [0.0; 3],
                bounds,
                ..instance
            },
            place: first,
        });
        Ok(())
    }

    /// Whether a place has a copy.
    fn has(&self, place: usize) -> bool {
        self.get(place).is_some()
    }

    /// The copy of a place.
    #[inline(always)]
    fn get(&self, place: usize) -> Option<&Copy> {
        // Nearly all scenes have no copies.
        let copy = *self.of.get(place)?;
        self.all.get(copy as usize)
    }

    /// Returns the box of a place in the upper tree: that of its crowd, or `None` if another place stands for it.
    pub(super) fn bounds(&self, place: usize, own: &MeshInstance) -> Option<Aabb> {
        match self.get(place) {
            None => Some(own.bounds),
            Some(copy) => (copy.place as usize == place).then_some(copy.instance.bounds),
        }
    }

    /// Returns the number of places that have a copy.
    pub(super) fn len(&self) -> usize {
        self.of.iter().filter(|copy| **copy != NOWHERE).count()
    }

    /// Returns their bytes.
    pub(super) fn bytes(&self) -> usize {
        let trees = self.all.iter().map(|copy| copy.structure.bytes());
        4 * self.of.len() + trees.sum::<usize>()
    }
}

impl Instances {
    /// The instance and the structure that rays traverse for a place.
    #[inline(always)]
    pub(super) fn traversed(&self, place: u32) -> (&MeshInstance, &Structure) {
        if let Some(copy) = self.copies.get(place as usize) {
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
            None => &self.copies.all[mesh - self.meshes.len()].structure,
        }
    }
}

/// Whether the vertices of an instance are rounded coarsely.
fn is_coarse(place: &MeshInstance, mesh: &Structure) -> bool {
    let [x, y, z] = place.corner_error;
    // A mesh without area has no tree.
    let detail = mesh.outline().detail;
    detail > 0.0 && x.max(y).max(z) > COARSE * detail
}

/// Returns the runs of instances that lie in one another, and whose triangles follow one another; `size` is the number
/// of triangles of an instance.
fn crowds(places: &[MeshInstance], size: impl Fn(&MeshInstance) -> usize) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut run = 0..0;
    let (mut around, mut least, mut count) = (Aabb::EMPTY, f64::INFINITY, 0);
    for (i, place) in places.iter().enumerate() {
        // A run ends where the boxes no longer fill the one around them, at a gap in the numbers, and at the limit.
        let (wider, smallest) = (around.union(&place.bounds), least.min(place.bounds.area()));
        let follows = run.is_empty() || {
            let first = places[run.start].first as usize;
            place.first as usize == first + count
        };
        let joins = follows
            && !place.bounds.is_empty()
            && wider.area() <= WITHIN * smallest
            && count + size(place) <= MOST_COPIED;
        if joins {
            (around, least) = (wider, smallest);
            count += size(place);
            run.end = i + 1;
            continue;
        }
        if run.len() >= CROWD {
            runs.push(run);
        }
        run = i..i + 1;
        (around, least, count) = (place.bounds, place.bounds.area(), size(place));
    }
    if run.len() >= CROWD {
        runs.push(run);
    }
    runs
}
