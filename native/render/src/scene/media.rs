// SPDX-License-Identifier: GPL-3.0-or-later
//! The media of a scene: the volumes of its materials and of the background, and bounds of those that vary.

use std::collections::HashMap;

use crate::material::Material;
use crate::math::vector::Vec3;
use crate::medium::Volume;
use crate::medium::mixture::Mixture;
use crate::medium::stack::Inside;
use crate::scene::RenderScene;
use crate::values::program::Value;
use crate::values::shading_point::ShadingPoint;
use crate::values::varying::Row;
use crate::values::view::{History, View};
use crate::values::visibility::RayKind;

/// Points along each axis of an object's box at which a volume that varies is probed for its largest extinction.
const PROBES: u8 = 33;

/// Factor on the largest extinction found. Where a volume is denser all the same, tracking stays unbiased and only
/// gets noisier.
const MARGIN: f32 = 1.25;

/// A ray that asks for the media on its way.
#[derive(Clone, Copy)]
pub struct MediumRay<'a> {
    /// Origin.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Kind of the ray.
    pub kind: RayKind,
    /// The camera.
    pub view: Option<&'a View>,
    /// See [`ShadingPoint::probes`].
    pub probes: u8,
}

/// Bounds known of the media of a scene, other than the volumes of its materials and its background.
#[derive(Default)]
pub struct Media {
    /// Bounds of the extinction of volumes that vary, by object and material.
    majorants: HashMap<(u32, u32), f32>,
}

impl Media {
    /// Returns the bound of the extinction of a medium that varies; 0 if it is nowhere.
    pub fn majorant(&self, medium: &Inside) -> f32 {
        let key = (medium.object, medium.material);
        self.majorants.get(&key).copied().unwrap_or(0.0)
    }
}

impl RenderScene {
    /// Returns the volume of a medium.
    pub fn volume(&self, medium: &Inside) -> Option<&Volume> {
        if medium.is_world() {
            return self.world.volume.as_ref();
        }
        self.materials[medium.material as usize].volume.as_ref()
    }

    /// Adds the coefficients of a medium at a distance along a ray to `mixture`. `registers`: scratch memory.
    pub fn add_medium(
        &self,
        medium: &Inside,
        ray: &MediumRay<'_>,
        distance: f32,
        registers: &mut Vec<Value>,
        mixture: &mut Mixture,
    ) {
        let Some(volume) = self.volume(medium) else {
            return;
        };
        let position = ray.origin + ray.direction * distance;
        let row = if medium.is_world() {
            Row::BACKGROUND
        } else {
            self.attributes.at(medium.triangle).row()
        };
        let point = || ShadingPoint {
            varying: &self.varying,
            row,
            weights: [0.0; 3],
            position,
            normal: -ray.direction,
            length: 1.0,
            geometric: -ray.direction,
            incoming: -ray.direction,
            inside: false,
            ray: ray.kind,
            edges: [Vec3::ZERO; 2],
            footprint: 0.0,
            view: ray.view,
            history: History::default(),
            probes: ray.probes,
            around: None,
            lamp: None,
        };
        volume.add_to(&self.images, point, registers, mixture);
    }

    /// Probes the volumes that vary in the boxes of their objects.
    pub(super) fn find_majorants(&mut self) {
        let mut registers = Vec::new();
        let mut mixture = Mixture::default();
        for (medium, [low, high]) in self.boxes_of_varying_media() {
            let mut largest = 0.0_f32;
            // Probe a lattice that includes the faces of the box.
            let n = u32::from(PROBES);
            for i in 0..n * n * n {
                let share = [i % n, i / n % n, i / n / n].map(|k| k as f32 / (n - 1) as f32);
                let ray = MediumRay {
                    origin: low + (high - low) * Vec3::from(share),
                    direction: Vec3::from([0.0, 0.0, 1.0]),
                    kind: RayKind::Volume,
                    view: None,
                    // A turned object fills its box only in part.
                    probes: PROBES / 2,
                };
                mixture.clear();
                self.add_medium(&medium, &ray, 0.0, &mut registers, &mut mixture);
                // Emission without extinction needs points to be sampled at, too.
                let glow = mixture.emission.max_abs().min(1.0);
                largest = largest.max(mixture.extinction.max_abs()).max(glow);
            }
            let key = (medium.object, medium.material);
            self.media.majorants.insert(key, largest * MARGIN);
        }
    }

    /// Returns the media that vary, each with the box around its object's triangles.
    fn boxes_of_varying_media(&self) -> Vec<(Inside, [Vec3; 2])> {
        let varies = |m: &Material| m.volume.as_ref().is_some_and(|v| !v.is_uniform());
        if !self.materials.iter().any(varies) {
            return Vec::new();
        }
        let mut boxes: HashMap<(u32, u32), (Inside, [Vec3; 2])> = HashMap::new();
        for id in 0..self.tracer.count() as u32 {
            let at = self.attributes.at(id);
            let material = at.material();
            if !varies(&self.materials[material]) {
                continue;
            }
            // Grow the box of the object by the corners that are finite.
            let object = at.object();
            let medium = Inside {
                material: material as u32,
                object,
                triangle: id,
            };
            let corners = self.tracer.corners(id).map(Vec3::from);
            let entry = boxes.entry((object, material as u32));
            let (_, bounds) =
                entry.or_insert((medium, [Vec3::splat(f32::MAX), Vec3::splat(f32::MIN)]));
            for corner in corners.iter().filter(|c| c.is_finite()) {
                let each = |f: fn(f32, f32) -> f32, a: Vec3, b: Vec3| {
                    Vec3::from([f(a.x, b.x), f(a.y, b.y), f(a.z, b.z)])
                };
                bounds[0] = each(f32::min, bounds[0], *corner);
                bounds[1] = each(f32::max, bounds[1], *corner);
            }
        }
        boxes.into_values().collect()
    }
}
