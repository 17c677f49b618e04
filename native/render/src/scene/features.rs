// SPDX-License-Identifier: GPL-3.0-or-later
//! The features that a scene needs, determined once per scene: code for the others is left out of the path, and the
//! render reports which.

use crate::light::Lights;
use crate::light::world::World;
use crate::material::Material;
use crate::values::program::Op;
use crate::values::visibility::RayKind;

/// The features that the scene's materials and lights need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Features {
    /// At least one light: light samples and shadow rays are needed.
    pub lights: bool,
    /// At least one light has a size and casts shadows: scattered rays can hit it.
    pub lights_hittable: bool,
    /// At least one material varies over its surface: its program has to run.
    pub textures: bool,
    /// At least one material's program runs ahead of shading.
    pub programs_ahead: bool,
    /// At least one material's program traces rays.
    pub program_rays: bool,
    /// At least one material has a lobe that reflects off facets, or a rough diffuse one.
    pub glossy: bool,
    /// At least one material has a lobe that refracts, or a translucent one.
    pub glass: bool,
    /// At least one material has lobes with frames or shapes of their own: stretched facets, sheen, toon, several
    /// normals.
    pub lobes: bool,
    /// At least one material scatters light below its surface.
    pub subsurface: bool,
    /// At least one material is not opaque, does not shade all lights, or is that of shadow catchers: rays pass through
    /// surfaces, shadow rays accumulate their transmittance.
    pub transparency: bool,
    /// A program reads the number of transparent surfaces that a ray has passed.
    pub counts_passed: bool,
    /// At least one material is invisible to some kinds of rays, which pass through it.
    pub hidden: bool,
    /// At least one material is a hole in the picture.
    pub holes: bool,
    /// At least one material has a portal.
    pub portals: bool,
    /// At least one material is that of shadow catchers.
    pub catchers: bool,
    /// At least one material emits.
    pub emission: bool,
    /// The background depends on the direction.
    pub world: bool,
    /// A material or the background has a volume: rays traverse media.
    pub media: bool,
    /// At least one mesh has corner normals.
    pub smooth_normals: bool,
    /// At least one material is in use, that is, there is a triangle.
    pub surfaces: bool,
}

impl Features {
    /// Determines the features from the materials in use, the lights and the background; all but `media`.
    pub fn resolve<'a>(
        used: impl Iterator<Item = &'a Material> + Clone,
        lights: &Lights,
        world: &World,
        smooth_normals: bool,
    ) -> Self {
        // A feature is needed if one used material needs it.
        let any = |f: fn(&Material) -> bool| used.clone().any(f);
        Self {
            lights: !lights.is_empty(),
            lights_hittable: lights.any_hittable(),
            textures: any(|m| !m.program.is_empty()),
            programs_ahead: any(|m| m.runs_ahead),
            program_rays: any(|m| m.traces_rays),
            glossy: any(|m| m.reflects),
            glass: any(|m| m.refracts),
            lobes: any(|m| m.lobes),
            subsurface: any(|m| m.subsurface),
            transparency: any(|m| m.transparent || m.catcher || !m.visible.to(RayKind::Shadow))
                || any(|m| !m.portals.is_empty() || m.strands.is_some())
                || lights.any_blockers(),
            counts_passed: any(|m| m.ops().any(Op::counts_passed)),
            hidden: any(|m| !m.visible.is_all() || m.strands.is_some()),
            holes: any(|m| m.hole),
            portals: any(|m| !m.portals.is_empty()),
            catchers: any(|m| m.catcher),
            emission: any(|m| m.emits),
            world: world.constant().is_none(),
            media: false,
            smooth_normals,
            surfaces: any(|_| true),
        }
    }

    /// Describes the features that are left out of the path, each with its reason.
    pub fn left_out(&self) -> Vec<String> {
        // Without triangles nothing is shaded: no line may speak of materials or shadows then.
        if !self.surfaces {
            return vec!["shading: no triangles".to_owned()];
        }
        // One row per feature: whether it is present, and what is left out if not. Without lights the first row
        // covers them all.
        let rows = [
            (self.lights, "shadow rays: no lights"),
            (
                self.lights_hittable || !self.lights,
                "rays that meet lights: no lamp with a size casts shadows",
            ),
            (
                self.textures,
                "textures: no material varies over its surface",
            ),
            (
                self.program_rays,
                "rays of programs: no ambient occlusion, bevel or raycast",
            ),
            (
                self.glossy,
                "mirror rays: no material is metallic, specular or roughly diffuse",
            ),
            (self.glass, "refraction: no material transmits"),
            (
                self.lobes,
                "further lobes: no anisotropy, sheen, toon, hair, thin film, conductor or second normal",
            ),
            (
                self.subsurface,
                "walks below surfaces: no material has subsurface scattering",
            ),
            (
                self.transparency,
                "transparent shadows: every material is opaque",
            ),
            (
                self.hidden,
                "ray visibility: every surface is there for all rays",
            ),
            (self.portals, "portals: no material is one"),
            (self.emission, "emission: no material emits"),
            (
                self.world,
                "a map of the background: it is the same in all directions",
            ),
            (self.smooth_normals, "smooth normals: none given"),
            (
                self.media,
                "media: neither a material nor the world has a volume",
            ),
        ];
        rows.iter()
            .filter(|(present, _)| !present)
            .map(|(_, text)| (*text).to_owned())
            .collect()
    }
}
