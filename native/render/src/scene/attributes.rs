// SPDX-License-Identifier: GPL-3.0-or-later
//! Per-triangle attributes: material and shading normals. They are stored per triangle of a flattened scene, or per
//! triangle of a mesh and per instance; both return the same values bit for bit.

use std::sync::Arc;

use crate::check::{Error, Result};
use crate::values::varying::Row;
use halfspace_geom::vec3::{cross, sub, widen};
use halfspace_ray::Tracer;
use halfspace_structure::instances::Instances;
use prefetch_index::prefetch_index;

/// Attributes of the triangles of a mesh, in mesh space, or of a whole flattened scene, in scene space.
#[derive(Debug, Clone, Default)]
pub struct MeshAttributes {
    /// Material of each triangle: for a mesh its slot, for a flattened scene its material; `None` = all 0.
    pub material_index: Option<Vec<i32>>,
    /// Shading normals at each triangle's three corners; `None` = flat.
    pub corner_normals: Option<Vec<[[f32; 3]; 3]>>,
}

/// Attributes that differ from instance to instance of a mesh.
#[derive(Debug, Clone, Default)]
pub struct InstanceAttributes {
    /// Materials of the slots, instance after instance.
    pub materials: Vec<i32>,
    /// Index in `materials` where those of each instance begin, and at the end their total number. Slots beyond an
    /// instance's last one use the last one's material.
    pub first_material: Vec<u32>,
    /// Matrix that transforms each instance's normals to scene space: the inverse transpose, row by row.
    pub normal_matrix: Vec<[[f32; 3]; 3]>,
    /// Whether that matrix preserves unit length.
    pub keeps_length: Vec<bool>,
}

/// The attributes of instanced meshes.
#[derive(Debug, Clone)]
pub struct InstancedAttributes {
    /// The instances.
    pub instances: Arc<Instances>,
    /// Attributes of each mesh.
    pub meshes: Vec<MeshAttributes>,
    /// Attributes of each instance.
    pub each: InstanceAttributes,
}

/// The attributes of all triangles of a scene.
pub struct Attributes {
    /// Attributes of each mesh; of the flattened scene alone if nothing is instanced.
    meshes: Arc<Vec<MeshAttributes>>,
    /// Row of each mesh's first triangle, and at the end the number of all rows.
    first_row: Vec<usize>,
    instanced: Option<(Arc<Instances>, InstanceAttributes)>,
    /// Object of each triangle of a flattened scene; empty = one object.
    objects: Vec<u32>,
}

/// The attributes of one triangle.
#[derive(Clone, Copy)]
pub struct At<'a> {
    all: &'a Attributes,
    mesh: &'a MeshAttributes,
    first_row: usize,
    triangle: usize,
    instance: usize,
    mirrored: bool,
}

impl Attributes {
    /// The attributes of a flattened scene of `count` triangles and `materials` materials.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] with the array whose length, index or value is wrong.
    pub fn flattened(mesh: MeshAttributes, count: usize, materials: usize) -> Result<Self> {
        // Check the arrays before any triangle is looked up.
        mesh.check(count, "")?;
        if let Some(index) = &mesh.material_index {
            check_materials("material_index", index, materials)?;
        }
        Ok(Self {
            meshes: Arc::new(vec![mesh]),
            first_row: vec![0, count],
            instanced: None,
            objects: Vec::new(),
        })
    }

    /// The attributes of instanced meshes. `known`: of other instances of the same meshes, whose attributes they share.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] with the array whose length, index or value is wrong.
    pub fn instanced(
        attributes: InstancedAttributes,
        materials: usize,
        known: Option<&Self>,
    ) -> Result<Self> {
        let InstancedAttributes {
            instances,
            meshes,
            each,
        } = attributes;
        let meshes = known.map_or_else(|| Arc::new(meshes), |known| Arc::clone(&known.meshes));
        check_meshes(&meshes, &instances)?;
        each.check(instances.len(), materials)?;
        // Number the rows of the meshes, one after another.
        let mut first_row = vec![0];
        for (mesh, structure) in instances.meshes().iter().enumerate() {
            first_row.push(first_row[mesh] + structure.scene().len());
        }
        Ok(Self {
            meshes,
            first_row,
            instanced: Some((instances, each)),
            objects: Vec::new(),
        })
    }

    /// Sets the object of each triangle, which media, walks and programs that trace rays need; ignored for instances.
    pub fn set_objects(&mut self, objects: &[u32]) {
        if self.instanced.is_none() {
            self.objects = objects.to_vec();
        }
    }

    /// The number of rows of data that vary, see [`Row`].
    pub fn rows(&self) -> usize {
        self.first_row[self.meshes.len()]
    }

    /// The number of instances; `None` for a flattened scene.
    pub fn instances(&self) -> Option<usize> {
        self.instanced
            .as_ref()
            .map(|(_, each)| each.keeps_length.len())
    }

    /// Whether some mesh has shading normals.
    pub fn smooth(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.corner_normals.is_some())
    }

    /// Sets `used` for each material that some triangle has. `live`: triangles of a flattened scene that rays can
    /// hit.
    pub fn mark_used(&self, live: impl Iterator<Item = u32>, used: &mut [bool]) {
        // A flattened scene: mark the materials of its live triangles.
        let Some((instances, each)) = &self.instanced else {
            match &self.meshes[0].material_index {
                Some(index) => live.for_each(|id| used[index[id as usize] as usize] = true),
                None => live.take(1).for_each(|_| used[0] = true),
            }
            return;
        };
        // Collect the slots that the live triangles of each mesh use.
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
        // Look the slots up in the materials of every instance.
        for instance in 0..instances.len() {
            if let Some(place) = instances.place(instance) {
                for &slot in &slots[place.mesh as usize] {
                    used[each.material(instance, slot)] = true;
                }
            }
        }
    }

    /// Returns the triangles whose material is among `wanted`, ascending. `live`: triangles of a flattened scene that
    /// rays can hit. `None`: there are more than `most` in instances.
    pub fn wearing(&self, live: &[u32], wanted: &[bool], most: usize) -> Option<Vec<u32>> {
        let Some((instances, each)) = &self.instanced else {
            let wears = |&&id: &&u32| wanted[self.at(id).material()];
            return Some(live.iter().filter(wears).copied().collect());
        };
        let mut found = Vec::new();
        for instance in 0..instances.len() {
            // Skip instances without such a material before looking at their triangles.
            let slots = each.first_material[instance]..each.first_material[instance + 1];
            let slots = &each.materials[slots.start as usize..slots.end as usize];
            let Some(place) = instances.place(instance) else {
                continue;
            };
            if !slots.iter().any(|&material| wanted[material as usize]) {
                continue;
            }
            let mesh = place.mesh as usize;
            let live = instances.meshes()[mesh].scene().live();
            let index = self.meshes[mesh].material_index.as_ref();
            let slot = |id: u32| index.map_or(0, |index| index[id as usize]);
            let first = first_triangle(instances, instance);
            let wears = |&&id: &&u32| wanted[each.material(instance, slot(id))];
            found.extend(live.iter().filter(wears).map(|id| first + id));
            if found.len() > most {
                return None;
            }
        }
        Some(found)
    }

    /// Prefetches the attributes of a triangle of a flattened scene.
    #[inline(always)]
    pub fn prefetch(&self, triangle: u32) {
        let MeshAttributes {
            material_index,
            corner_normals,
        } = &self.meshes[0];
        if let Some(index) = material_index {
            prefetch_index(index, triangle as usize);
        }
        if let Some(normals) = corner_normals {
            prefetch_index(normals, triangle as usize);
        }
    }

    /// Returns the attributes of a triangle by its index in the scene.
    #[inline(always)]
    pub fn at(&self, id: u32) -> At<'_> {
        let (mut mesh, mut triangle, mut instance, mut mirrored) = (0, id as usize, 0, false);
        // Find the instance, and the triangle's index within the mesh.
        if let Some((instances, _)) = &self.instanced {
            let local;
            (instance, local) = instances.locate(id);
            triangle = local as usize;
            let place = instances.place(instance);
            (mesh, mirrored) = place.map_or((0, false), |p| (p.mesh as usize, p.to_scene.mirrored));
        }
        At {
            all: self,
            mesh: &self.meshes[mesh],
            first_row: self.first_row[mesh],
            triangle,
            instance,
            mirrored,
        }
    }
}

impl At<'_> {
    /// Returns the triangle's material.
    #[inline(always)]
    pub fn material(&self) -> usize {
        // The index is a slot for instances, a material for a flattened scene.
        let index = self.mesh.material_index.as_ref();
        let index = index.map_or(0, |index| index[self.triangle]);
        match &self.all.instanced {
            None => index as usize,
            Some((_, each)) => each.material(self.instance, index),
        }
    }

    /// Returns where the data of the triangle are.
    #[inline(always)]
    pub fn row(&self) -> Row {
        Row {
            index: self.first_row + self.triangle,
            instance: self.instance,
            mirrored: self.mirrored,
        }
    }

    /// Returns the number of the object: the instance, or in a flattened scene what [`Attributes::set_objects`] gave.
    pub fn object(&self) -> u32 {
        let given = self.all.objects.get(self.triangle);
        given.copied().unwrap_or(self.instance as u32)
    }

    /// Returns the shading normals at the triangle's corners in scene space, or `None` if the whole scene is flat.
    /// `corners`: vertices in scene space, for the normal of a flat mesh among smooth ones.
    #[inline(always)]
    pub fn normals(&self, corners: [[f32; 3]; 3]) -> Option<[[f32; 3]; 3]> {
        let own = self.mesh.corner_normals.as_ref();
        let own = own.map(|normals| normals[self.triangle]);
        let Some((_, each)) = &self.all.instanced else {
            return own;
        };
        // A flat mesh among smooth ones: use the normal of the face at all three corners.
        let Some([a, b, c]) = own else {
            return Some([face_normal(corners); 3]);
        };
        // Transform the normals to scene space.
        let matrix = &each.normal_matrix[self.instance];
        let turned = [a, b, c].map(|n| {
            // The order of additions is that of the flattened scene, whose normals have the same bits.
            let n = matrix.map(|row| (n[0] * row[0] + n[1] * row[1]) + n[2] * row[2]);
            if each.keeps_length[self.instance] {
                n
            } else {
                unit(n)
            }
        });
        // A mirrored instance lists its corners in the opposite order.
        let [a, b, c] = turned;
        Some(if self.mirrored { [a, c, b] } else { [a, b, c] })
    }
}

impl InstanceAttributes {
    /// Returns the material of a slot; slots past the end get the last one, negative ones the first.
    #[inline(always)]
    fn material(&self, instance: usize, slot: i32) -> usize {
        let (first, end) = (
            self.first_material[instance],
            self.first_material[instance + 1],
        );
        // Clamp the slot to those of the instance.
        let slot = slot.max(0).cast_unsigned().min(end - first - 1);
        self.materials[(first + slot) as usize] as usize
    }

    /// Checks the arrays of `count` instances.
    fn check(&self, count: usize, materials: usize) -> Result<()> {
        for (name, expected, got) in [
            ("first_material", count + 1, self.first_material.len()),
            ("normal_matrix", count, self.normal_matrix.len()),
            ("keeps_length", count, self.keeps_length.len()),
        ] {
            if expected != got {
                return Err(wrong_length(name, expected, got));
            }
        }
        check_materials("surfaces['materials']", &self.materials, materials)?;
        // Check that every range of materials has at least one element and that the last ends with the array.
        let mut ends = self.first_material.windows(2);
        let last = self.first_material.last();
        let incomplete = last.is_some_and(|&x| x as usize != self.materials.len());
        let empty = ends.position(|ends| ends[0] >= ends[1]);
        if let Some(i) = empty.or(incomplete.then_some(count)) {
            return Err(Error::Shape(format!(
                "surfaces['first_material'][{i}]: every instance needs a material, up to the number of all"
            )));
        }
        Ok(())
    }
}

impl MeshAttributes {
    /// Checks the length and the values of the arrays. `prefix` begins the message of an error.
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

/// Returns the number of the first triangle of an instance that has some.
fn first_triangle(instances: &Instances, instance: usize) -> u32 {
    // Halve the range of all triangles; their instances ascend.
    let count = u32::try_from(instances.count()).unwrap_or(u32::MAX);
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = low + (high - low) / 2;
        if instances.locate(middle).0 < instance {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

/// Returns the unit normal of a triangle, computed in f64 and rounded once, as in the arrays of a flattened scene.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the normals of a scene are f32"
)]
fn face_normal(corners: [[f32; 3]; 3]) -> [f32; 3] {
    // Follow the order of operations of the flattened scene, so that the bits are equal.
    let [a, b, c] = corners.map(widen);
    let n = cross(sub(b, a), sub(c, a));
    let squares = (n[0] * n[0] + n[1] * n[1]) + n[2] * n[2];
    let length = if squares == 0.0 { 1.0 } else { squares.sqrt() };
    n.map(|x| (x / length) as f32)
}

/// Divides a vector by its length; the zero vector stays.
fn unit(n: [f32; 3]) -> [f32; 3] {
    let squares = (n[0] * n[0] + n[1] * n[1]) + n[2] * n[2];
    let length = if squares == 0.0 { 1.0 } else { squares.sqrt() };
    n.map(|x| x / length)
}

/// The error for an array of the wrong length.
fn wrong_length(name: &str, expected: usize, got: usize) -> Error {
    Error::Shape(format!(
        "surfaces['{name}']: expected {expected}, got {got}"
    ))
}

/// Checks the number of meshes and the arrays of each.
fn check_meshes(meshes: &[MeshAttributes], instances: &Instances) -> Result<()> {
    if meshes.len() != instances.meshes().len() {
        let expected = instances.meshes().len();
        return Err(wrong_length("meshes", expected, meshes.len()));
    }
    for (i, (mesh, structure)) in meshes.iter().zip(instances.meshes()).enumerate() {
        let prefix = format!("surfaces['meshes'][{i}]: ");
        mesh.check(structure.scene().len(), &prefix)?;
    }
    Ok(())
}

/// Checks that every entry is a valid material.
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

/// Checks that there is one entry per triangle.
fn check_length(prefix: &str, name: &str, got: usize, triangles: usize) -> Result<()> {
    if got == triangles {
        return Ok(());
    }
    Err(Error::Shape(format!(
        "{prefix}{name} must have one entry per triangle: {triangles}, got {got}"
    )))
}
