// SPDX-License-Identifier: GPL-3.0-or-later
//! What a scene needs, resolved once: everything else is left out of the path, and said so.

use super::lights::Lights;
use super::material::Material;
use super::place::RayKind;
use super::world::World;

/// What the scene's triangles and lights can make a path do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Features {
    /// Some light shines: sample it and trace shadow rays.
    pub lights: bool,
    /// Some light has a size and casts shadows: rays can meet it.
    pub lights_met: bool,
    /// Some material varies over its surface: run its program.
    pub textures: bool,
    /// Some material has a lobe that reflects off facets.
    pub glossy: bool,
    /// Some material has a glass lobe.
    pub glass: bool,
    /// Some material is not fully opaque: rays pass on, shadow rays gather opacity.
    pub transparency: bool,
    /// Some material is hidden from some rays: they pass.
    pub hidden: bool,
    /// Some material emits.
    pub emission: bool,
    /// The background varies over the directions.
    pub world: bool,
    /// Corner normals are given.
    pub smooth_normals: bool,
    /// Some material is there at all, that is, some triangle is.
    pub surfaces: bool,
}

impl Features {
    /// Looks at the materials that some triangle uses, and at the lights.
    pub fn resolve<'a>(
        used: impl Iterator<Item = &'a Material> + Clone,
        lights: &Lights,
        world: &World,
        smooth_normals: bool,
    ) -> Self {
        let any = |f: fn(&Material) -> bool| used.clone().any(f);
        Self {
            lights: !lights.is_empty(),
            lights_met: lights.any_met(),
            textures: any(|m| !m.program.is_empty()),
            glossy: any(|m| m.reflects),
            glass: any(|m| m.refracts),
            transparency: any(|m| m.transparent || !m.visible.to(RayKind::Shadow)),
            hidden: any(|m| !m.visible.is_all()),
            emission: any(|m| m.emits),
            world: world.constant().is_none(),
            smooth_normals,
            surfaces: any(|_| true),
        }
    }

    /// What is left out of the path, each with its reason.
    pub fn left_out(&self) -> Vec<String> {
        let rows = [
            (self.surfaces, "shading: no triangles"),
            (self.lights, "shadow rays: no lights"),
            (
                self.lights_met,
                "rays that meet lights: no light has a size",
            ),
            (
                self.textures,
                "textures: no material varies over its surface",
            ),
            (
                self.glossy,
                "mirror rays: no material is metallic or specular",
            ),
            (self.glass, "refraction: no material transmits"),
            (
                self.transparency,
                "transparent shadows: every material is opaque",
            ),
            (
                self.hidden,
                "ray visibility: every surface is there for all rays",
            ),
            (self.emission, "emission: no material emits"),
            (
                self.world,
                "a map of the background: it is the same in all directions",
            ),
            (self.smooth_normals, "smooth normals: none given"),
        ];
        rows.iter()
            .filter(|(present, _)| !present)
            .map(|(_, text)| (*text).to_owned())
            .collect()
    }
}
