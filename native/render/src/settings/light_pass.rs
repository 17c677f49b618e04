// SPDX-License-Identifier: GPL-3.0-or-later
//! The light passes: the light of the combined pass, divided by the lobe that scattered it towards the camera.

/// A kind of lobe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobeKind {
    /// Diffuse reflection, and translucency.
    Diffuse,
    /// Reflection off facets.
    Glossy,
    /// Refraction.
    Transmission,
}

/// A part of the light of the combined pass, as in Cycles. Emission, environment, and the direct and indirect light of
/// all kinds of lobes, each multiplied by its colour, add up to the combined pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightPass {
    /// Light that the first surface scatters from a light, divided by the colour.
    Direct(LobeKind),
    /// Light that the first surface scatters from other surfaces, divided by the colour.
    Indirect(LobeKind),
    /// Albedo of the lobes of the first surface.
    Color(LobeKind),
    /// Light of surfaces and lamps that the camera sees.
    Emission,
    /// Light of the background that the camera sees.
    Environment,
}

use LightPass::{Color, Direct, Emission, Environment, Indirect};
use LobeKind::{Diffuse, Glossy, Transmission};

impl LightPass {
    /// All light passes.
    pub const ALL: [Self; 11] = [
        Direct(Diffuse),
        Indirect(Diffuse),
        Color(Diffuse),
        Direct(Glossy),
        Indirect(Glossy),
        Color(Glossy),
        Direct(Transmission),
        Indirect(Transmission),
        Color(Transmission),
        Emission,
        Environment,
    ];

    /// Returns the position in [`Self::ALL`].
    #[inline]
    pub const fn index(self) -> usize {
        let (lobe, part) = match self {
            Direct(lobe) => (lobe, 0),
            Indirect(lobe) => (lobe, 1),
            Color(lobe) => (lobe, 2),
            Emission => return 9,
            Environment => return 10,
        };
        3 * lobe as usize + part
    }

    /// Returns the name in Blender.
    pub const fn name(self) -> &'static str {
        match self {
            Direct(Diffuse) => "Diffuse Direct",
            Indirect(Diffuse) => "Diffuse Indirect",
            Color(Diffuse) => "Diffuse Color",
            Direct(Glossy) => "Glossy Direct",
            Indirect(Glossy) => "Glossy Indirect",
            Color(Glossy) => "Glossy Color",
            Direct(Transmission) => "Transmission Direct",
            Indirect(Transmission) => "Transmission Indirect",
            Color(Transmission) => "Transmission Color",
            Emission => "Emission",
            Environment => "Environment",
        }
    }

    /// Returns the pass by which this one is divided.
    pub const fn divisor(self) -> Option<Self> {
        match self {
            Direct(lobe) | Indirect(lobe) => Some(Color(lobe)),
            Color(_) | Emission | Environment => None,
        }
    }

    /// Whether the exposure applies: to light, not to colours.
    pub const fn is_exposed(self) -> bool {
        !matches!(self, Color(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_stand_at_their_indices_and_have_names_of_their_own() {
        let mut names = Vec::new();
        for (index, pass) in LightPass::ALL.into_iter().enumerate() {
            assert_eq!(pass.index(), index);
            assert!(!names.contains(&pass.name()), "{}", pass.name());
            names.push(pass.name());
        }
    }
}
