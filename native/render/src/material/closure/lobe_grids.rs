// SPDX-License-Identifier: GPL-3.0-or-later
//! Albedo grids of a closure's rough lobes, over the inputs that vary.

use std::sync::Arc;

use crate::material::albedo::{Axis, Grid, Grids, Lobe};
use crate::material::closure::{Closure, ClosureKind, Input, clamp_index, coat_index, layer_index};
use crate::math::fresnel;

/// Lower end of the range of indices that [`clamp_index`] returns.
const MIN_INDEX: f32 = 1e-3;
/// Upper end of the same range.
const MAX_INDEX: f32 = 1e3;

/// Albedo grids of a closure's rough lobes; `None` where the closure cannot have the lobe.
#[derive(Debug, Clone, Default)]
pub struct LobeGrids {
    /// Facets that reflect all light.
    pub reflection: Option<Arc<Grid>>,
    /// Dielectric layer.
    pub layer: Option<Arc<Grid>>,
    /// Coat: white facets, and dielectric ones.
    pub coat: Option<[Arc<Grid>; 2]>,
    /// Glass from outside and from inside.
    pub glass: Option<[Arc<Grid>; 2]>,
}

impl Closure {
    /// Fetches the grids from `grids`, which computes the missing ones.
    pub(super) fn make_grids(&mut self, grids: &mut Grids) {
        // Take a single level for constant inputs and all levels for others.
        let rough = |input: Input, this: &Self| {
            this.constant(input)
                .map_or(Axis::roughness(), |v| Axis::fixed(v.x.clamp(0.0, 1.0)))
        };
        let roughness = rough(Input::Roughness, self);
        let ior = self.constant(Input::Ior).map(|v| clamp_index(v.x));
        let any_index = Axis::index(MIN_INDEX, MAX_INDEX);
        let boundary = ior.map_or(any_index, Axis::fixed);
        // Coloured reflection of glass needs the albedo of white facets too.
        let principled = self.kind == ClosureKind::Principled;
        let tints_glass = principled && self.can_differ(Input::SpecularTint, 1.0);
        // White facets: for the compensation of every reflection, and of tinted glass.
        if self.may_reflect() || (self.may_refract() && tints_glass) {
            self.grids.reflection = Some(grids.get(Lobe::Reflection, roughness, Axis::fixed(1.0)));
        }
        // Dielectric layer: its index depends on two inputs.
        if principled && self.can_differ(Input::Specular, 0.0) {
            let index = match (ior, self.constant(Input::Specular)) {
                (Some(ior), Some(specular)) => Axis::fixed(layer_index(ior, specular.x)),
                (Some(ior), None) if ior < 1.0 => Axis::index(MIN_INDEX, 1.0),
                (Some(_), None) => Axis::index(1.0, MAX_INDEX),
                (None, _) => any_index,
            };
            self.grids.layer = Some(grids.get(Lobe::Dielectric, roughness, index));
        }
        // Coat: never below index 1.
        if principled && self.can_differ(Input::CoatWeight, 0.0) {
            let roughness = rough(Input::CoatRoughness, self);
            let index = self
                .constant(Input::CoatIor)
                .map_or(Axis::index(1.0, MAX_INDEX), |v| {
                    Axis::fixed(coat_index(v.x))
                });
            self.grids.coat = Some([
                grids.get(Lobe::Reflection, roughness, index),
                grids.get(Lobe::Dielectric, roughness, index),
            ]);
        }
        // Glass from both sides; the Refraction node has no compensation.
        if self.may_refract() && self.kind != ClosureKind::Refraction {
            // Only Principled bounds its reflectance from below, at high indices; the Glass node never does.
            let bounded = principled && ior.is_none_or(|ior| fresnel::min_reflectance(ior) > 0.0);
            let [outside, inside] = if bounded {
                [Lobe::BoundedGlass, Lobe::BoundedGlassInside]
            } else {
                [Lobe::Glass, Lobe::GlassInside]
            };
            let outside = grids.get(outside, roughness, boundary);
            // The range of all indices contains their inverses, so one grid serves both sides.
            let inside = match ior {
                None => Arc::clone(&outside),
                Some(_) => grids.get(inside, roughness, boundary),
            };
            self.grids.glass = Some([outside, inside]);
        }
    }
}
