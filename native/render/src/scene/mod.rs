// SPDX-License-Identifier: GPL-3.0-or-later
//! The scene of a render: structure, materials, lights and background.

use std::sync::Arc;

use crate::check::{Error, Result};
use crate::light::world::{World, WorldParams};
use crate::light::{LightParams, Lights};
use crate::material::albedo::Grids;
use crate::material::{Material, MaterialParams};
use crate::scene::attributes::{Attributes, InstancedAttributes, MeshAttributes};
use crate::scene::emitters::EmissionProbe;
use crate::scene::features::Features;
use crate::scene::indices::Indices;
use crate::scene::media::Media;
use crate::scene::touching::Touching;
use crate::values::image::Image;
use crate::values::program::Op;
use crate::values::varying::Varying;
use halfspace_ray::Tracer;

pub mod ahead;
pub mod attributes;
mod emitters;
pub mod facet;
pub mod features;
pub mod indices;
pub mod media;
pub mod surface;
pub mod touching;
pub mod tube;

/// A structure shared by several threads.
pub type SharedTracer = Arc<dyn Tracer + Send + Sync>;

/// Everything that a render shows and is lit by, except the camera.
pub struct RenderScene {
    pub(crate) tracer: SharedTracer,
    pub(crate) attributes: Attributes,
    pub(crate) materials: Arc<Vec<Material>>,
    pub(crate) images: Arc<Vec<Image>>,
    pub(crate) varying: Varying,
    pub(crate) lights: Lights,
    pub(crate) world: Arc<World>,
    pub(crate) indices: Arc<Indices>,
    pub(crate) media: Media,
    pub(crate) touching: Option<Touching>,
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
    /// Replaces material index and normals if the structure consists of instances.
    pub instanced: Option<InstancedAttributes>,
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

/// Which parts a scene shares with the same scene at another time; those of its parameters are ignored.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shared {
    /// Materials.
    pub materials: bool,
    /// Images.
    pub images: bool,
    /// Layers of [`Varying`].
    pub layers: bool,
    /// Attributes of the meshes of instances.
    pub meshes: bool,
    /// Background.
    pub world: bool,
    /// Object and material indices for passes.
    pub indices: bool,
}

/// The checked and compiled parts of a scene that do not depend on its structure.
struct Parts {
    materials: Arc<Vec<Material>>,
    images: Arc<Vec<Image>>,
    varying: Varying,
    attributes: Attributes,
    indices: Arc<Indices>,
    world: Arc<World>,
}

impl Parts {
    /// Compiles the parameters of a scene of `count` triangles, or takes the shared parts of another one.
    fn new(
        count: usize,
        params: SceneParams,
        like: Option<(&RenderScene, Shared)>,
    ) -> Result<Self> {
        let of = |part: fn(Shared) -> bool| {
            like.filter(|&(_, shared)| part(shared))
                .map(|(scene, _)| scene)
        };
        // Compile the materials, and check their references to images and layers.
        let materials = match of(|shared| shared.materials) {
            Some(scene) => Arc::clone(&scene.materials),
            None => Arc::new(compile_materials(&params.materials)?),
        };
        let images = match of(|shared| shared.images) {
            Some(scene) => Arc::clone(&scene.images),
            None => Arc::new(params.images),
        };
        let mut varying = params.varying;
        if let Some(scene) = of(|shared| shared.layers) {
            varying.layers.clone_from(&scene.varying.layers);
        }
        for (index, material) in materials.iter().enumerate() {
            check_references(material, index, images.len(), varying.layers.len())?;
        }
        let mut attributes = match params.instanced {
            Some(instanced) => {
                let known = of(|shared| shared.meshes).map(|scene| &scene.attributes);
                Attributes::instanced(instanced, materials.len(), known)?
            }
            None => {
                let mesh = MeshAttributes {
                    material_index: params.material_index,
                    corner_normals: params.corner_normals,
                };
                Attributes::flattened(mesh, count, materials.len())?
            }
        };
        varying.check(attributes.rows(), attributes.instances())?;
        let apart = |m: &Material| m.volume.is_some() || m.subsurface || m.traces_rays;
        if materials.iter().any(apart) {
            attributes.set_objects(&varying.object_index);
        }
        let indices = match of(|shared| shared.indices) {
            Some(scene) => Arc::clone(&scene.indices),
            None => Arc::new(params.indices),
        };
        indices.check(attributes.rows(), attributes.instances())?;
        // Prepare the background; whether it varies decides how it is sampled.
        let world = match of(|shared| shared.world) {
            Some(scene) => Arc::clone(&scene.world),
            None => Arc::new(World::new(&params.world, &images, &varying)?),
        };
        Ok(Self {
            materials,
            images,
            varying,
            attributes,
            indices,
            world,
        })
    }
}

impl RenderScene {
    /// Checks and compiles the parts, and determines the features the scene needs.
    ///
    /// # Errors
    /// If a number is not finite or out of range, or the size of an array does not match the structure's triangles;
    /// the message names the key.
    pub fn new(tracer: SharedTracer, params: SceneParams) -> Result<Self> {
        Self::assemble(tracer, params, None)
    }

    /// The same scene at another time: like [`Self::new`], without a copy of the parts that both share.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn later(&self, shared: Shared, tracer: SharedTracer, params: SceneParams) -> Result<Self> {
        Self::assemble(tracer, params, Some((self, shared)))
    }

    /// Makes a scene of these parameters, and of the shared parts of another scene.
    fn assemble(
        tracer: SharedTracer,
        mut params: SceneParams,
        like: Option<(&Self, Shared)>,
    ) -> Result<Self> {
        let lamps = std::mem::take(&mut params.lights);
        let Parts {
            materials,
            images,
            varying,
            attributes,
            indices,
            world,
        } = Parts::new(tracer.count(), params, like)?;
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
        let probe = EmissionProbe {
            tracer: &*tracer,
            attributes: &attributes,
            materials: &materials,
            images: &images,
            varying: &varying,
        };
        let mut lights = Lights::new(
            &lamps,
            &probe.emissive_triangles(),
            world.map(),
            world.visible,
            &images,
            &varying,
        )?;
        lights.limit_background(world.max_bounces, world.casts_shadow);
        let features = Features {
            media: world.volume.is_some() || used.clone().any(|m| m.volume.is_some()),
            ..Features::resolve(used, &lights, &world, attributes.smooth())
        };
        let touching = find_touching(&*tracer, &attributes, &materials);
        let mut scene = Self {
            touching,
            tracer,
            attributes,
            materials,
            images,
            varying,
            lights,
            world,
            indices,
            media: Media::default(),
            features,
        };
        scene.find_majorants();
        Ok(scene)
    }

    /// Returns the features that paths in this scene need.
    pub fn features(&self) -> Features {
        self.features
    }
}

/// Largest number of triangles of instances that are searched for surfaces that lie on each other (chosen): instances
/// can have more triangles than fit into memory.
const MOST_INSTANCED: usize = 1 << 22;

/// Finds the surfaces that lie on each other, if rays pass any.
fn find_touching(
    tracer: &dyn Tracer,
    attributes: &Attributes,
    materials: &[Material],
) -> Option<Touching> {
    if !materials.iter().any(Material::is_passable) {
        return None;
    }
    let passable = |id: u32| materials[attributes.at(id).material()].is_passable();
    match tracer.triangles() {
        Some(triangles) => Touching::find(tracer, triangles.live().iter().copied(), passable),
        None if tracer.count() <= MOST_INSTANCED => {
            Touching::find(tracer, 0..tracer.count() as u32, passable)
        }
        None => None,
    }
}

/// Compiles the materials, which share their albedo grids; without any, Blender's default.
fn compile_materials(params: &[MaterialParams]) -> Result<Vec<Material>> {
    let mut materials = Vec::with_capacity(params.len().max(1));
    let mut grids = Grids::after_last_scene();
    for (index, material) in params.iter().enumerate() {
        materials.push(Material::new(material, index, &mut grids)?);
    }
    if materials.is_empty() {
        materials.push(Material::new(&MaterialParams::default(), 0, &mut grids)?);
    }
    grids.keep();
    Ok(materials)
}

/// Returns an error if a program refers to an image or layer that does not exist. `index`: of the material.
fn check_references(material: &Material, index: usize, images: usize, layers: usize) -> Result<()> {
    for op in material.ops() {
        // Operations that refer to an image or a layer.
        let (what, reference, count) = match op {
            Op::Image { image, .. } => ("image", *image, images),
            Op::Attribute(layer, _) | Op::NormalMap(layer) => ("layer", *layer, layers),
            _ => continue,
        };
        if usize::from(reference) >= count {
            return Err(Error::Shape(format!(
                "materials[{index}]['program']: {what} {reference} is out of range for {count}"
            )));
        }
    }
    Ok(())
}
