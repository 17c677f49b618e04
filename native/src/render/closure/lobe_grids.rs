// SPDX-License-Identifier: GPL-3.0-or-later
//! Albedos of a closure's rough lobes, over what of it varies.

use std::sync::Arc;

use super::super::albedo::{Axis, Grid, Grids, Lobe};
use super::super::fresnel;
use super::{Closure, Input, Kind, at_least_some, layer_index};

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
        let boundary = ior.map_or(Axis::index(0.5), Axis::fixed);
        if self.may_reflect() {
            self.grids.reflection = Some(grids.get(Lobe::Reflection, roughness, Axis::fixed(1.0)));
        }
        if self.kind == Kind::Principled && self.can_differ(Input::Specular, 0.0) {
            let index = match (ior, self.constant(Input::Specular)) {
                (Some(ior), Some(specular)) => Axis::fixed(layer_index(ior, specular.x)),
                (Some(ior), None) => Axis::index((2.0 * fresnel::f0_from_ior(ior)).sqrt()),
                (None, _) => Axis::index(0.6),
            };
            self.grids.layer = Some(grids.get(Lobe::Dielectric, roughness, index));
        }
        if self.kind == Kind::Principled && self.can_differ(Input::CoatWeight, 0.0) {
            let roughness = rough(Input::CoatRoughness, self);
            let index = self
                .constant(Input::CoatIor)
                .map_or(Axis::index(0.5), |v| Axis::fixed(at_least_some(v.x)));
            self.grids.coat = Some([
                grids.get(Lobe::Reflection, roughness, index),
                grids.get(Lobe::Dielectric, roughness, index),
            ]);
        }
        if self.may_refract() && self.kind != Kind::Refraction {
            self.grids.glass = Some([
                grids.get(Lobe::Glass, roughness, boundary),
                grids.get(Lobe::GlassInside, roughness, boundary),
            ]);
        }
    }
}
