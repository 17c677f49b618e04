// SPDX-License-Identifier: GPL-3.0-or-later
//! The scene as the renderer sees it: a structure to ask, materials, lights, world.

use std::sync::Arc;

use super::albedo::Grids;
use super::attributes::{Attributes, InstanceAttributes, MeshAttributes};
use super::check::{Error, Result};
use super::features::Features;
use super::image::Image;
use super::indices::Indices;
use super::lights::{Glowing, LightParams, Lights};
use super::material::{Material, MaterialParams};
use super::place::{Place, RayKind, Varying};
use super::program::Op;
use super::vector::Vec3;
use super::world::{World, WorldParams};
use crate::instances::Instances;
use crate::traverse::Tracer;

/// A structure that several threads may share.
pub type SharedTracer = Arc<dyn Tracer + Send + Sync>;

/// Everything that is lit and seen; the camera is not part of it.
pub struct RenderScene {
    pub(super) tracer: SharedTracer,
    pub(super) attributes: Attributes,
    pub(super) materials: Vec<Material>,
    pub(super) images: Vec<Image>,
    pub(super) varying: Varying,
    pub(super) lights: Lights,
    pub(super) world: World,
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
    /// Images that materials show.
    pub images: Vec<Image>,
    /// What varies over the triangles.
    pub varying: Varying,
    /// Lights.
    pub lights: Vec<LightParams>,
    /// Background.
    pub world: WorldParams,
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
        let count = tracer.count();
        let mut materials = Vec::with_capacity(params.materials.len().max(1));
        let mut grids = Grids::default();
        for (index, material) in params.materials.iter().enumerate() {
            materials.push(Material::new(material, index, &mut grids)?);
        }
        if materials.is_empty() {
            materials.push(Material::new(&MaterialParams::default(), 0, &mut grids)?);
        }
        let mut varying = params.varying;
        varying.check(count)?;
        for (index, material) in materials.iter().enumerate() {
            check_references(material, index, params.images.len(), varying.layers.len())?;
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
                Attributes::flattened(mesh, count, materials.len())?
            }
        };
        params.indices.check(count)?;
        let mut world = World::new(&params.world, &params.images, &varying)?;
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
        let seen = Seen {
            tracer: &*tracer,
            attributes: &attributes,
            materials: &materials,
            images: &params.images,
            varying: &varying,
        };
        let lights = Lights::new(
            &params.lights,
            &seen.glowing(),
            world.take_map(),
            world.visible,
        )?;
        let features = Features::resolve(used, &lights, &world, attributes.smooth());
        Ok(Self {
            tracer,
            attributes,
            materials,
            images: params.images,
            varying,
            lights,
            world,
            indices: params.indices,
            features,
        })
    }

    /// What a path in this scene needs.
    pub fn features(&self) -> Features {
        self.features
    }
}

/// What is needed to find the triangles that glow.
struct Seen<'a> {
    tracer: &'a dyn Tracer,
    attributes: &'a Attributes,
    materials: &'a [Material],
    images: &'a [Image],
    varying: &'a Varying,
}

/// Where on a triangle its glow is looked at, to know about how bright it is.
const PROBES: [[f32; 3]; 4] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.8, 0.1, 0.1],
    [0.1, 0.8, 0.1],
    [0.1, 0.1, 0.8],
];

impl Seen<'_> {
    fn glowing(&self) -> Vec<Glowing> {
        if !self.materials.iter().any(|m| m.emits) {
            return Vec::new();
        }
        let mut registers = Vec::new();
        let mut out = Vec::new();
        // Instances are found by scattered rays alone: each place would be a light of its own.
        let Some(triangles) = self.tracer.triangles() else {
            return out;
        };
        for &triangle in triangles.live() {
            let material = &self.materials[self.attributes.at(triangle).material()];
            if !material.emits {
                continue;
            }
            let corners = triangles.corners(triangle).map(Vec3::from);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalized();
            let mut sum = 0.0;
            for weights in PROBES {
                let place = || Place {
                    varying: self.varying,
                    triangle: triangle as usize,
                    weights,
                    point: a * weights[0] + b * weights[1] + c * weights[2],
                    normal,
                    geometric: normal,
                    incoming: normal,
                    inside: false,
                    ray: RayKind::Diffuse,
                };
                let look = material.look(self.images, place, &mut registers);
                sum += look.emission.mean();
            }
            // A pattern may be dark at all probes and glow between them.
            let least = if material.has_fixed_look() { 0.0 } else { 1e-3 };
            out.push(Glowing {
                triangle,
                visible: material.visible,
                corners,
                radiance: (sum / PROBES.len() as f32).max(least),
            });
        }
        out
    }
}

/// Refuses programs that name an image or a layer which is not there.
fn check_references(material: &Material, index: usize, images: usize, layers: usize) -> Result<()> {
    for op in material.ops() {
        let (what, asked, there) = match op {
            Op::Image { image, .. } => ("image", *image, images),
            Op::Attribute(layer) | Op::NormalMap(layer) => ("layer", *layer, layers),
            _ => continue,
        };
        if usize::from(asked) >= there {
            return Err(Error::Shape(format!(
                "materials[{index}]['program']: {what} {asked} is out of range for {there}"
            )));
        }
    }
    Ok(())
}
