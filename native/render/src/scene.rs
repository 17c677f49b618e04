// SPDX-License-Identifier: GPL-3.0-or-later
//! The scene of a render: structure, materials, lights and background.

use std::sync::Arc;

use crate::albedo::Grids;
use crate::attributes::{Attributes, InstanceAttributes, MeshAttributes};
use crate::check::{Error, Result};
use crate::features::Features;
use crate::image::Image;
use crate::indices::Indices;
use crate::lights::{Glowing, LightParams, Lights};
use crate::material::{Material, MaterialParams};
use crate::place::{Place, RayKind, Varying};
use crate::program::Op;
use crate::vector::Vec3;
use crate::world::{World, WorldParams};
use halfspace_ray::Tracer;
use halfspace_structure::instances::Instances;

/// A structure shared by several threads.
pub type SharedTracer = Arc<dyn Tracer + Send + Sync>;

/// Everything that a render shows and is lit by, except the camera.
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

/// The parts of a scene before they are checked.
#[derive(Debug, Clone, Default)]
pub struct SceneParams {
    /// Material of each triangle; `None` = the first for all.
    pub material_index: Option<Vec<i32>>,
    /// Materials; empty = one with Blender's defaults.
    pub materials: Vec<MaterialParams>,
    /// Shading normals of each triangle's corners, of any length.
    pub corner_normals: Option<Vec<[[f32; 3]; 3]>>,
    /// Replaces the two above if the structure consists of instances: attributes of the meshes and of the
    /// instances.
    pub placed: Option<(Arc<Instances>, Vec<MeshAttributes>, InstanceAttributes)>,
    /// Images that materials and background use.
    pub images: Vec<Image>,
    /// Data that vary over the triangles.
    pub varying: Varying,
    /// Lights.
    pub lights: Vec<LightParams>,
    /// Background.
    pub world: WorldParams,
    /// Object and material indices for passes.
    pub indices: Indices,
}

impl RenderScene {
    /// Checks and compiles the parts, and determines the features the scene needs.
    ///
    /// # Errors
    /// If a number is not finite or out of range, or the size of an array does not match the structure's triangles;
    /// the message names the key.
    pub fn new(tracer: SharedTracer, params: SceneParams) -> Result<Self> {
        // Compile the materials, which share their albedo grids.
        let count = tracer.count();
        let mut materials = Vec::with_capacity(params.materials.len().max(1));
        let mut grids = Grids::default();
        for (index, material) in params.materials.iter().enumerate() {
            materials.push(Material::new(material, index, &mut grids)?);
        }
        if materials.is_empty() {
            materials.push(Material::new(&MaterialParams::default(), 0, &mut grids)?);
        }
        // Check the references to images, layers and materials.
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
        // Prepare the background; whether it varies decides how it is sampled.
        params.indices.check(count)?;
        let mut world = World::new(&params.world, &params.images, &varying)?;
        // Features depend only on materials that a live triangle uses.
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
        // Collect the emissive triangles and prepare the lights.
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

    /// Returns the features that paths in this scene need.
    pub fn features(&self) -> Features {
        self.features
    }
}

/// The parts of the scene that emission depends on.
struct Seen<'a> {
    tracer: &'a dyn Tracer,
    attributes: &'a Attributes,
    materials: &'a [Material],
    images: &'a [Image],
    varying: &'a Varying,
}

/// Barycentric weights at which a triangle's emission is probed, to estimate its brightness.
const PROBES: [[f32; 3]; 4] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.8, 0.1, 0.1],
    [0.1, 0.8, 0.1],
    [0.1, 0.1, 0.8],
];

impl Seen<'_> {
    /// Returns the emissive triangles with an estimate of their radiance.
    fn glowing(&self) -> Vec<Glowing> {
        if !self.materials.iter().any(|m| m.emits) {
            return Vec::new();
        }
        let mut registers = Vec::new();
        let mut out = Vec::new();
        // Emissive triangles of instances are found by scattered rays only; as lights, each instance would need its
        // own.
        let Some(triangles) = self.tracer.triangles() else {
            return out;
        };
        for &triangle in triangles.live() {
            // Skip triangles whose material cannot emit.
            let material = &self.materials[self.attributes.at(triangle).material()];
            if !material.emits {
                continue;
            }
            // Average the emission towards the normal over the probes.
            let corners = triangles.corners(triangle).map(Vec3::from);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalized();
            let mut sum = 0.0;
            for weights in PROBES {
                // Seen along the normal, as by a diffuse ray.
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
            // A texture may be dark at all probes and emit between them, so keep the estimate positive.
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

/// Returns an error if a program refers to an image or layer that does not exist.
fn check_references(material: &Material, index: usize, images: usize, layers: usize) -> Result<()> {
    for op in material.ops() {
        // Operations that refer to an image or a layer.
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
