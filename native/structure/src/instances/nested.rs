// SPDX-License-Identifier: GPL-3.0-or-later
//! Instances of instances: one list of instances of meshes, whose transforms are composed.

use crate::instances::{IDENTITY, Instance, Instances, MOST};
use crate::structure::Structure;
use halfspace_base::error::{Error, Result};
use halfspace_geom::Transform;
use std::sync::Arc;

/// Content of an instance.
#[derive(Debug, Clone)]
pub enum Part {
    /// A mesh.
    Mesh(Arc<Structure>),
    /// Instances, which may place instances themselves.
    Group(Arc<Instances>),
}

/// Replaces each instance of a group by the group's own instances, in their order. Returns the meshes of all parts, one
/// part after another, and the instances of these. [`Instance::mesh`] of the arguments is an index of `parts`.
///
/// # Errors
/// [`Error::Shape`] when an index is out of range, or when there would be more than 2^31 - 2 instances.
pub fn expand(
    parts: &[Part],
    instances: &[Instance],
) -> Result<(Vec<Arc<Structure>>, Vec<Instance>)> {
    // List the meshes, and keep what each part places.
    let mut meshes = Vec::new();
    let mut placed: Vec<Vec<Instance>> = Vec::with_capacity(parts.len());
    for part in parts {
        let first = meshes.len() as u32;
        match part {
            Part::Mesh(mesh) => {
                meshes.push(Arc::clone(mesh));
                placed.push(vec![Instance {
                    mesh: first,
                    transform: IDENTITY,
                }]);
            }
            Part::Group(group) => {
                meshes.extend(group.meshes.iter().cloned());
                let own = group.instances();
                let renumbered = own.map(|one| Instance {
                    mesh: first + one.mesh,
                    ..one
                });
                placed.push(renumbered.collect());
            }
        }
    }
    // Count before anything is allocated.
    let mut count = 0;
    for (i, instance) in instances.iter().enumerate() {
        let Some(own) = placed.get(instance.mesh as usize) else {
            return Err(Error::Shape(format!(
                "mesh[{i}]: {} is out of range for {} meshes",
                instance.mesh.cast_signed(),
                parts.len()
            )));
        };
        count += own.len() as u64;
        if count > MOST {
            return Err(Error::Shape(format!(
                "instances: at most {MOST} are possible, instance {i} brings them to {count}"
            )));
        }
    }
    let mut out = Vec::with_capacity(count as usize);
    for instance in instances {
        let part = instance.mesh as usize;
        // A mesh keeps the bits of its transform.
        if matches!(parts[part], Part::Mesh(_)) {
            let mesh = placed[part][0].mesh;
            out.push(Instance { mesh, ..*instance });
            continue;
        }
        out.extend(placed[part].iter().map(|one| Instance {
            mesh: one.mesh,
            transform: compose(&instance.transform, &one.transform),
        }));
    }
    Ok((meshes, out))
}

/// The map that applies `inner` first and then `outer`, in f64.
fn compose(outer: &Transform, inner: &Transform) -> Transform {
    let sum = |row: &[f64; 3], column: [f64; 3]| {
        row[0] * column[0] + row[1] * column[1] + row[2] * column[2]
    };
    let column = |k: usize| [0, 1, 2].map(|j| inner.linear[j][k]);
    Transform {
        linear: outer
            .linear
            .map(|row| [0, 1, 2].map(|k| sum(&row, column(k)))),
        offset: [0, 1, 2].map(|k| sum(&outer.linear[k], inner.offset) + outer.offset[k]),
    }
}
