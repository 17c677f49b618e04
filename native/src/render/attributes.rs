// SPDX-License-Identifier: GPL-3.0-or-later
//! What triangles carry beside their corners: material and shading normals. Per triangle of a flattened
//! scene, or per triangle of a mesh and per instance of it; the renderer sees no difference, bit for bit.

use std::sync::Arc;

use super::check::{Error, Result};
use crate::geom::vec3::{cross, sub, widen};
use crate::instances::Instances;

/// What the triangles of a mesh carry, in its own space; or those of a whole flattened scene.
#[derive(Debug, Clone, Default)]
pub struct MeshAttributes {
    /// Material of each triangle: a slot of the mesh, or for a flattened scene a material; `None` = all 0.
    pub material_index: Option<Vec<i32>>,
    /// Shading normals of each triangle's corners; `None` = flat.
    pub corner_normals: Option<Vec<[[f32; 3]; 3]>>,
}

/// What differs from instance to instance of a mesh.
#[derive(Debug, Clone, Default)]
pub struct InstanceAttributes {
    /// Materials of slots, instance after instance.
    pub materials: Vec<i32>,
    /// Where each instance's begin among them, and then their number. Slots beyond an instance's last use
    /// that.
    pub first_material: Vec<u32>,
    /// What turns each mesh's normals to the scene: the inverse transpose, row by row.
    pub normal_matrix: Vec<[[f32; 3]; 3]>,
    /// Whether that keeps unit length.
    pub keeps_length: Vec<bool>,
}

/// Of all triangles of a scene.
pub struct Attributes {
    meshes: Vec<MeshAttributes>,
    placed: Option<(Arc<Instances>, InstanceAttributes)>,
}

/// A triangle, found among those of its mesh.
#[derive(Clone, Copy)]
pub struct At<'a> {
    all: &'a Attributes,
    mesh: &'a MeshAttributes,
    triangle: usize,
    instance: usize,
    mirrored: bool,
}

impl Attributes {
    /// Of a flattened scene of `count` triangles.
    ///
    /// # Errors
    /// When an array does not fit.
    pub fn flattened(mesh: MeshAttributes, count: usize, materials: usize) -> Result<Self> {
        mesh.check(count, "")?;
        if let Some(index) = &mesh.material_index {
            check_materials("material_index", index, materials)?;
        }
        Ok(Self {
            meshes: vec![mesh],
            placed: None,
        })
    }

    /// Of instances.
    ///
    /// # Errors
    /// When an array does not fit.
    pub fn placed(
        instances: Arc<Instances>,
        meshes: Vec<MeshAttributes>,
        each: InstanceAttributes,
        materials: usize,
    ) -> Result<Self> {
        let wrong = |name: &str, expected: usize, got: usize| {
            Err(Error::Shape(format!(
                "surfaces['{name}']: expected {expected}, got {got}"
            )))
        };
        if meshes.len() != instances.meshes().len() {
            return wrong("meshes", instances.meshes().len(), meshes.len());
        }
        for (i, (mesh, structure)) in meshes.iter().zip(instances.meshes()).enumerate() {
            mesh.check(
                structure.scene().len(),
                &format!("surfaces['meshes'][{i}]: "),
            )?;
        }
        let count = instances.len();
        for (name, expected, got) in [
            ("first_material", count + 1, each.first_material.len()),
            ("normal_matrix", count, each.normal_matrix.len()),
            ("keeps_length", count, each.keeps_length.len()),
        ] {
            if expected != got {
                return wrong(name, expected, got);
            }
        }
        check_materials("surfaces['materials']", &each.materials, materials)?;
        let ends = each.first_material.windows(2);
        let last = each
            .first_material
            .last()
            .is_some_and(|&x| x as usize != each.materials.len());
        if let Some(i) = ends
            .clone()
            .position(|ends| ends[0] >= ends[1])
            .or(last.then_some(count))
        {
            return Err(Error::Shape(format!(
                "surfaces['first_material'][{i}]: every instance needs a material, up to the number of all"
            )));
        }
        Ok(Self {
            meshes,
            placed: Some((instances, each)),
        })
    }

    /// Whether some triangle has normals of its own.
    pub fn smooth(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.corner_normals.is_some())
    }

    /// Marks the materials that some triangle has; `live` tells those of a flattened scene that can be hit.
    pub fn mark_used(&self, live: impl Iterator<Item = u32>, used: &mut [bool]) {
        let Some((instances, each)) = &self.placed else {
            match &self.meshes[0].material_index {
                Some(index) => live.for_each(|id| used[index[id as usize] as usize] = true),
                None => live.take(1).for_each(|_| used[0] = true),
            }
            return;
        };
        let slots: Vec<Vec<i32>> = (self.meshes.iter().zip(instances.meshes()))
            .map(|(mesh, structure)| {
                let live = structure.scene().live();
                let mut slots: Vec<i32> = match &mesh.material_index {
                    Some(index) => live.iter().map(|&id| index[id as usize]).collect(),
                    None => live.iter().take(1).map(|_| 0).collect(),
                };
                slots.sort_unstable();
                slots.dedup();
                slots
            })
            .collect();
        for instance in 0..instances.len() {
            if let Some(place) = instances.place(instance) {
                for &slot in &slots[place.mesh as usize] {
                    used[each.material(instance, slot)] = true;
                }
            }
        }
    }

    /// A triangle by its number in the scene.
    #[inline(always)]
    pub fn at(&self, id: u32) -> At<'_> {
        let (mut mesh, mut triangle, mut instance, mut mirrored) = (0, id as usize, 0, false);
        if let Some((instances, _)) = &self.placed {
            let local;
            (instance, local) = instances.locate(id);
            triangle = local as usize;
            let place = instances.place(instance);
            (mesh, mirrored) = place.map_or((0, false), |p| (p.mesh as usize, p.mirrored));
        }
        At {
            all: self,
            mesh: &self.meshes[mesh],
            triangle,
            instance,
            mirrored,
        }
    }
}

impl At<'_> {
    /// The number of the triangle's material.
    #[inline(always)]
    pub fn material(&self) -> usize {
        let index = self.mesh.material_index.as_ref();
        let index = index.map_or(0, |index| index[self.triangle]);
        match &self.all.placed {
            None => index as usize,
            Some((_, each)) => each.material(self.instance, index),
        }
    }

    /// The shading normals of the corners, in the scene, for corners that stand there; `None` where all of the
    /// scene is flat.
    #[inline(always)]
    pub fn normals(&self, corners: [[f32; 3]; 3]) -> Option<[[f32; 3]; 3]> {
        let own = self.mesh.corner_normals.as_ref();
        let own = own.map(|normals| normals[self.triangle]);
        let Some((_, each)) = &self.all.placed else {
            return own;
        };
        let Some([a, b, c]) = own else {
            return Some([face_normal(corners); 3]);
        };
        let matrix = &each.normal_matrix[self.instance];
        let turned = [a, b, c].map(|n| {
            let n = matrix.map(|row| (n[0] * row[0] + n[1] * row[1]) + n[2] * row[2]);
            if each.keeps_length[self.instance] {
                n
            } else {
                unit(n)
            }
        });
        let [a, b, c] = turned;
        Some(if self.mirrored { [a, c, b] } else { [a, b, c] })
    }
}

impl InstanceAttributes {
    #[inline(always)]
    fn material(&self, instance: usize, slot: i32) -> usize {
        let (first, end) = (
            self.first_material[instance],
            self.first_material[instance + 1],
        );
        let slot = slot.max(0).cast_unsigned().min(end - first - 1);
        self.materials[(first + slot) as usize] as usize
    }
}

impl MeshAttributes {
    fn check(&self, count: usize, prefix: &str) -> Result<()> {
        if let Some(index) = &self.material_index {
            check_length(prefix, "material_index", index.len(), count)?;
        }
        if let Some(normals) = &self.corner_normals {
            check_length(prefix, "corner_normals", normals.len(), count)?;
            let bad = |n: &[[f32; 3]; 3]| n.as_flattened().iter().any(|c| !c.is_finite());
            if let Some(i) = normals.iter().position(bad) {
                return Err(Error::NonFinite(format!(
                    "{prefix}corner_normals[{i}] must be finite"
                )));
            }
        }
        Ok(())
    }
}

/// The unit normal of a triangle, in f64 until the end; as the flattened scene has it in arrays.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the normals of a scene are f32"
)]
fn face_normal(corners: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = corners.map(widen);
    let n = cross(sub(b, a), sub(c, a));
    let squares = (n[0] * n[0] + n[1] * n[1]) + n[2] * n[2];
    let length = if squares == 0.0 { 1.0 } else { squares.sqrt() };
    n.map(|x| (x / length) as f32)
}

fn unit(n: [f32; 3]) -> [f32; 3] {
    let squares = (n[0] * n[0] + n[1] * n[1]) + n[2] * n[2];
    let length = if squares == 0.0 { 1.0 } else { squares.sqrt() };
    n.map(|x| x / length)
}

fn check_materials(name: &str, index: &[i32], materials: usize) -> Result<()> {
    let wrong = |&index: &i32| usize::try_from(index).map_or(true, |index| index >= materials);
    match index.iter().position(wrong) {
        None => Ok(()),
        Some(i) => Err(Error::Shape(format!(
            "{name}[{i}]: {} is out of range for {materials} materials",
            index[i]
        ))),
    }
}

fn check_length(prefix: &str, name: &str, got: usize, triangles: usize) -> Result<()> {
    if got == triangles {
        return Ok(());
    }
    Err(Error::Shape(format!(
        "{prefix}{name} must have one entry per triangle: {triangles}, got {got}"
    )))
}
