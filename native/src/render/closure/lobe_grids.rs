// SPDX-License-Identifier: GPL-3.0-or-later
//! Albedos of a closure's rough lobes, over what of it varies.

use std::sync::Arc;

use super::super::albedo::{Axis, Grid, Grids, Lobe};
use super::super::fresnel;
use super::{Closure, Input, Kind, at_least_some, coat_index, layer_index};

/// The indices that [`at_least_some`] leaves.
const LEAST_INDEX: f32 = 1e-3;
const MOST_INDEX: f32 = 1e3;

/// Albedo of a closure's rough lobes.
#[derive(Debug, Clone, Default)]
pub struct LobeGrids {
    /// Facets that reflect everything.
    pub reflection: Option<Arc<Grid>>,
    /// Dielectric layer.
    pub layer: Option<Arc<Grid>>,
    /// Coat: facets, and the dielectric.
    pub coat: Option<[Arc<Grid>; 2]>,
    /// Glass from outside and from inside.
    pub glass: Option<[Arc<Grid>; 2]>,
}

impl Closure {
    /// Looks its albedos up, or has them computed.
    pub(super) fn make_grids(&mut self, grids: &mut Grids) {
        let rough = |input: Input, this: &Self| {
            this.constant(input)
                .map_or(Axis::roughness(), |v| Axis::fixed(v.x.clamp(0.0, 1.0)))
        };
        let roughness = rough(Input::Roughness, self);
        let ior = self.constant(Input::Ior).map(|v| at_least_some(v.x));
        let any_index = Axis::index(LEAST_INDEX, MOST_INDEX);
        let boundary = ior.map_or(any_index, Axis::fixed);
        let principled = self.kind == Kind::Principled;
        let tints_glass = principled && self.can_differ(Input::SpecularTint, 1.0);
        if self.may_reflect() || (self.may_refract() && tints_glass) {
            self.grids.reflection = Some(grids.get(Lobe::Reflection, roughness, Axis::fixed(1.0)));
        }
        if principled && self.can_differ(Input::Specular, 0.0) {
            let index = match (ior, self.constant(Input::Specular)) {
                (Some(ior), Some(specular)) => Axis::fixed(layer_index(ior, specular.x)),
                (Some(ior), None) if ior < 1.0 => Axis::index(LEAST_INDEX, 1.0),
                (Some(_), None) => Axis::index(1.0, MOST_INDEX),
                (None, _) => any_index,
            };
            self.grids.layer = Some(grids.get(Lobe::Dielectric, roughness, index));
        }
        if principled && self.can_differ(Input::CoatWeight, 0.0) {
            let roughness = rough(Input::CoatRoughness, self);
            let index = self
                .constant(Input::CoatIor)
                .map_or(Axis::index(1.0, MOST_INDEX), |v| {
                    Axis::fixed(coat_index(v.x))
                });
            self.grids.coat = Some([
                grids.get(Lobe::Reflection, roughness, index),
                grids.get(Lobe::Dielectric, roughness, index),
            ]);
        }
        if self.may_refract() && self.kind != Kind::Refraction {
            // What the Glass node reflects is in no way held above what it reflects at normal incidence.
            let held = principled && ior.is_none_or(|ior| fresnel::least(ior) > 0.0);
            let [outside, inside] = if held {
                [Lobe::HeldGlass, Lobe::HeldGlassInside]
            } else {
                [Lobe::Glass, Lobe::GlassInside]
            };
            let outside = grids.get(outside, roughness, boundary);
            // A grid of all indices has their inverses as well.
            let inside = match ior {
                None => Arc::clone(&outside),
                Some(_) => grids.get(inside, roughness, boundary),
            };
            self.grids.glass = Some([outside, inside]);
        }
    }
}
