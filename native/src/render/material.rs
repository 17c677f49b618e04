// SPDX-License-Identifier: GPL-3.0-or-later
//! Materials: a constant-valued subset of Blender's Principled BSDF, compiled into lobes.
//!
//! Lobes and weights follow Cycles (Blender 5.2): metal with weight `metallic`; of the rest glass
//! with weight `transmission`; of the rest a dielectric coat of the index `ior`, scaled by
//! `specular`, over a Lambertian base that receives what the coat lets through. Rough lobes are
//! scaled to lose no energy ("multiscatter GGX").

use super::albedo::Table;
use super::check::{Result, finite, within};
use super::fresnel;
use super::ggx::Ggx;
use super::vector::Vec3;

/// A material as its user describes it. All colours linear.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialParams {
    /// For messages.
    pub name: String,
    /// Colour of the base, the metal and (its square root, per boundary) the glass; at least 0.
    pub base_color: [f32; 3],
    /// Share of metal, 0..1.
    pub metallic: f32,
    /// 0 = mirror, 1 = fully rough.
    pub roughness: f32,
    /// Index of refraction, above 0.
    pub ior: f32,
    /// Share of glass in what is not metal, 0..1.
    pub transmission: f32,
    /// Principled's "IOR level": 0.5 leaves the coat's reflectance as `ior` gives it, 0 = no coat.
    pub specular: f32,
    /// Emitted radiance, both sides.
    pub emission: [f32; 3],
    /// 1 = opaque, 0 = invisible.
    pub alpha: f32,
}

impl Default for MaterialParams {
    /// Blender's default Principled BSDF.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [0.8; 3],
            metallic: 0.0,
            roughness: 0.5,
            ior: 1.5,
            transmission: 0.0,
            specular: 0.5,
            emission: [0.0; 3],
            alpha: 1.0,
        }
    }
}

/// The metal lobe.
#[derive(Debug, Clone)]
pub struct Metal {
    /// Share of the material.
    pub weight: f32,
    /// Reflectance at normal incidence.
    pub f0: Vec3,
    /// Mean reflectance between facets, for the light that bounces more than once.
    pub multiple: Vec3,
}

/// The dielectric coat over the base.
#[derive(Debug, Clone)]
pub struct Coat {
    /// Share of the material.
    pub weight: f32,
    /// Relative index of refraction.
    pub eta: f32,
    /// Mean reflectance between facets.
    pub multiple: f32,
    /// Albedo of a single bounce.
    pub single: Table,
}

/// The glass lobe.
#[derive(Debug, Clone)]
pub struct Glass {
    /// Share of the material.
    pub weight: f32,
    /// Index of the inside over that of the outside.
    pub ior: f32,
    /// Filter of each passage through the boundary.
    pub tint: Vec3,
    /// Albedo of a single bounce, seen from outside and from inside.
    pub single: [Table; 2],
    /// Cosine-weighted means of `single`.
    pub mean: [f32; 2],
}

/// A material ready for shading.
#[derive(Debug, Clone)]
pub struct Material {
    /// Opacity.
    pub alpha: f32,
    /// Emitted radiance.
    pub emission: Vec3,
    /// Facets of all rough lobes.
    pub ggx: Ggx,
    /// Albedo of a single bounce off facets that reflect everything; present with metal or coat.
    pub facets: Option<(Table, f32)>,
    /// Metal, if any.
    pub metal: Option<Metal>,
    /// Glass, if any.
    pub glass: Option<Glass>,
    /// Coat, if any.
    pub coat: Option<Coat>,
    /// Albedo of the Lambertian base, before the coat takes its part.
    pub diffuse: Vec3,
}

impl Material {
    /// Checks and compiles. Weights and roughness outside 0..1 are clamped as Blender clamps them.
    ///
    /// # Errors
    /// When a number is not finite, a colour is negative, or `ior` is not positive.
    pub fn new(params: &MaterialParams, index: usize) -> Result<Self> {
        let name = |key: &str| format!("materials[{index}]['{key}'] of '{}'", params.name);
        finite(&params.base_color, || name("base_color"))?;
        finite(&params.emission, || name("emission"))?;
        for (key, value) in [
            ("metallic", params.metallic),
            ("roughness", params.roughness),
            ("transmission", params.transmission),
            ("alpha", params.alpha),
        ] {
            finite(&[value], || name(key))?;
        }
        for &c in &params.base_color {
            within(c.into(), 0.0, 1e6, || name("base_color"))?;
        }
        for &c in &params.emission {
            within(c.into(), 0.0, 1e30, || name("emission"))?;
        }
        within(params.ior.into(), 1e-3, 1e3, || name("ior"))?;
        within(params.specular.into(), 0.0, 1e3, || name("specular"))?;
        let [metallic, transmission, roughness, alpha] = [
            params.metallic,
            params.transmission,
            params.roughness,
            params.alpha,
        ]
        .map(|v| v.clamp(0.0, 1.0));
        let base = Vec3::from(params.base_color);
        let clamped = base.map(|c| c.min(1.0));
        let ggx = Ggx::new(roughness);
        let rest = (1.0 - metallic) * (1.0 - transmission);

        let metal = (metallic > CUTOFF).then(|| Metal {
            weight: metallic,
            f0: clamped,
            multiple: fresnel::schlick_mean(clamped),
        });
        let eta = coat_index(params.ior, params.specular);
        let coat = (rest > CUTOFF && (eta - 1.0).abs() > 1e-6).then(|| Coat {
            weight: rest,
            eta,
            multiple: fresnel::dielectric_mean(eta),
            single: Table::dielectric_reflection(ggx, eta),
        });
        let glass_weight = (1.0 - metallic) * transmission;
        let glass = (glass_weight > CUTOFF).then(|| {
            let single = [
                Table::glass(ggx, params.ior),
                Table::glass(ggx, 1.0 / params.ior),
            ];
            let mean = [single[0].mean(), single[1].mean()];
            Glass {
                weight: glass_weight,
                ior: params.ior,
                tint: clamped.map(f32::sqrt),
                single,
                mean,
            }
        });
        let facets = (metal.is_some() || coat.is_some()).then(|| {
            let table = Table::reflection(ggx);
            let mean = table.mean();
            (table, mean)
        });
        Ok(Self {
            alpha,
            emission: Vec3::from(params.emission),
            ggx,
            facets,
            metal,
            glass,
            coat,
            diffuse: base * rest,
        })
    }

    /// Whether some lobe has a density, so that light samples are worth a ray.
    #[inline(always)]
    pub fn has_density(&self) -> bool {
        !self.ggx.is_smooth() || self.diffuse.max_component() > 0.0
    }
}

/// Weights below this are dropped, as in Cycles.
const CUTOFF: f32 = 1e-5;

/// Index of the coat: `specular` scales the reflectance at normal incidence, 0.5 leaves it.
fn coat_index(ior: f32, specular: f32) -> f32 {
    if specular == 0.5 {
        return ior;
    }
    let eta = fresnel::ior_from_f0(fresnel::f0_from_ior(ior) * 2.0 * specular);
    if ior < 1.0 { 1.0 / eta } else { eta }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobes_appear_only_where_they_weigh_something() {
        let default = Material::new(&MaterialParams::default(), 0).unwrap();
        assert!(default.metal.is_none() && default.glass.is_none() && default.coat.is_some());
        let matte = MaterialParams {
            specular: 0.0,
            ..Default::default()
        };
        let matte = Material::new(&matte, 0).unwrap();
        assert!(matte.coat.is_none() && matte.facets.is_none());
        let metal = MaterialParams {
            metallic: 1.0,
            ..Default::default()
        };
        let metal = Material::new(&metal, 0).unwrap();
        assert!(metal.metal.is_some() && metal.coat.is_none());
        assert_eq!(metal.diffuse, Vec3::ZERO);
    }

    #[test]
    fn a_bad_value_is_named_with_its_material() {
        let bad = MaterialParams {
            name: "Glass".into(),
            ior: -1.0,
            ..Default::default()
        };
        let message = Material::new(&bad, 3).unwrap_err().to_string();
        assert!(
            message.contains("materials[3]['ior'] of 'Glass'"),
            "{message}"
        );
        let nan = MaterialParams {
            roughness: f32::NAN,
            ..Default::default()
        };
        assert!(
            Material::new(&nan, 0)
                .unwrap_err()
                .to_string()
                .contains("roughness")
        );
    }
}
