// SPDX-License-Identifier: GPL-3.0-or-later
//! The scene as the renderer sees it: a structure to ask, materials, lights, world.

use std::sync::Arc;

use super::attributes::{Attributes, InstanceAttributes, MeshAttributes};
use super::check::{Result, finite, within};
use super::features::Features;
use super::indices::Indices;
use super::lights::{LightParams, Lights};
use super::material::{Material, MaterialParams};
use super::vector::Vec3;
use crate::instances::Instances;
use crate::traverse::Tracer;

/// A structure that several threads may share.
pub type SharedTracer = Arc<dyn Tracer + Send + Sync>;

/// Everything that is lit and seen; the camera is not part of it.
pub struct RenderScene {
    pub(super) tracer: SharedTracer,
    pub(super) attributes: Attributes,
    pub(super) materials: Vec<Material>,
    pub(super) lights: Lights,
    pub(super) world: Vec3,
    pub(super) indices: Indices,
    features: Features,
}

/// The parts of a scene, before they are checked.
#[derive(Debug, Clone, Default)]
pub struct SceneParams {
    /// Material of each triangle; `None` = all use the first.
    pub material_index: Option<Vec<i32>>,
    /// Materials; empty = one of Blender's default.
    pub materials: Vec<MaterialParams>,
    /// Shading normals of each triangle's corners, not necessarily of unit length.
    pub corner_normals: Option<Vec<[[f32; 3]; 3]>>,
    /// Instead of these two, where the structure is instances: what their meshes and they themselves carry.
    pub placed: Option<(Arc<Instances>, Vec<MeshAttributes>, InstanceAttributes)>,
    /// Lights.
    pub lights: Vec<LightParams>,
    /// Background radiance.
    pub world: [f32; 3],
    /// Numbers of objects and materials.
    pub indices: Indices,
}

impl RenderScene {
    /// Checks and compiles the parts, and resolves what the scene needs.
    ///
    /// # Errors
    /// When a number is not finite or out of range, naming its key, or an array does not fit the
    /// structure's triangles.
    pub fn new(tracer: SharedTracer, params: SceneParams) -> Result<Self> {
        finite(&params.world, || "world['color']".into())?;
        for &c in &params.world {
            within(c.into(), 0.0, 1e30, || "world['color']".into())?;
        }
        let mut materials = Vec::with_capacity(params.materials.len().max(1));
        for (index, material) in params.materials.iter().enumerate() {
            materials.push(Material::new(material, index)?);
        }
        if materials.is_empty() {
            materials.push(Material::new(&MaterialParams::default(), 0)?);
        }
        let attributes = match params.placed {
            Some((instances, meshes, each)) => {
                Attributes::placed(instances, meshes, each, materials.len())?
            }
            None => {
                let mesh = MeshAttributes {
                    material_index: params.material_index,
                    corner_normals: params.corner_normals,
                };
                Attributes::flattened(mesh, tracer.count(), materials.len())?
            }
        };
        params.indices.check(tracer.count())?;
        let lights = Lights::new(&params.lights)?;
        let mut used = vec![false; materials.len()];
        let live = tracer
            .triangles()
            .map_or(&[][..], |triangles| triangles.live());
        attributes.mark_used(live.iter().copied(), &mut used);
        let used = materials
            .iter()
            .zip(&used)
            .filter(|(_, used)| **used)
            .map(|(m, _)| m);
        let features = Features::resolve(used, &lights, attributes.smooth());
        Ok(Self {
            tracer,
            attributes,
            materials,
            lights,
            world: Vec3::from(params.world),
            indices: params.indices,
            features,
        })
    }

    /// What a path in this scene needs.
    pub fn features(&self) -> Features {
        self.features
    }
}
