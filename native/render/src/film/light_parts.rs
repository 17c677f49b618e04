// SPDX-License-Identifier: GPL-3.0-or-later
//! The light of a sample by light pass, and the shares of the lobes in a path's light.

use crate::math::vector::{Vec3, vec3};
use crate::settings::{LightPass, LobeKind};

/// Shares, per channel, of kinds of lobes in the light that a path's first surface scatters; refraction has the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shares {
    diffuse: Vec3,
    glossy: Vec3,
}

impl Shares {
    /// All light comes from diffuse lobes.
    pub const DIFFUSE: Self = Self {
        diffuse: Vec3::ONE,
        glossy: Vec3::ZERO,
    };

    /// All light comes from one kind of lobes.
    pub fn only(kind: LobeKind) -> Self {
        let share = |other| if kind == other { Vec3::ONE } else { Vec3::ZERO };
        Self {
            diffuse: share(LobeKind::Diffuse),
            glossy: share(LobeKind::Glossy),
        }
    }

    /// The shares of `diffuse` and `glossy` in `all`; 0 in channels where that is 0.
    pub fn of(diffuse: Vec3, glossy: Vec3, all: Vec3) -> Self {
        let share = |part: f32, all: f32| if all == 0.0 { 0.0 } else { part / all };
        let shares = |part: Vec3| {
            vec3(
                share(part.x, all.x),
                share(part.y, all.y),
                share(part.z, all.z),
            )
        };
        Self {
            diffuse: shares(diffuse),
            glossy: shares(glossy),
        }
    }
}

/// The light of one sample of one pixel, by [`LightPass::index`].
#[derive(Debug, Clone, Copy)]
pub struct LightParts([[f32; 3]; LightPass::ALL.len()]);

impl LightParts {
    /// No light.
    pub const EMPTY: Self = Self([[0.0; 3]; LightPass::ALL.len()]);

    /// Returns the light of a pass.
    pub fn at(&self, pass: LightPass) -> &[f32; 3] {
        &self.0[pass.index()]
    }

    /// Adds light to a pass.
    pub fn add(&mut self, pass: LightPass, light: Vec3) {
        for (sum, value) in self.0[pass.index()].iter_mut().zip(light.array()) {
            *sum += value;
        }
    }

    /// Adds light that the first surface scattered. `indirect`: whether another surface had scattered it before.
    pub fn add_scattered(&mut self, light: Vec3, shares: &Shares, indirect: bool) {
        let pass = if indirect {
            LightPass::Indirect
        } else {
            LightPass::Direct
        };
        let Shares { diffuse, glossy } = *shares;
        self.add(pass(LobeKind::Diffuse), light * diffuse);
        self.add(pass(LobeKind::Glossy), light * glossy);
        let rest = Vec3::ONE - diffuse - glossy;
        self.add(pass(LobeKind::Transmission), light * rest);
    }
}

/// Divides the sums of a pixel by those of its colour. A channel without colour takes the mean of the channels that
/// have one, so that grey light stays grey, as in Cycles.
pub fn divided(light: [f64; 3], color: [f64; 3]) -> [f64; 3] {
    let known = |k: usize| (color[k] != 0.0).then(|| light[k] / color[k]);
    let quotients = [known(0), known(1), known(2)];
    let (sum, count) = quotients
        .iter()
        .flatten()
        .fold((0.0, 0.0), |(sum, count), q| (sum + q, count + 1.0));
    let mean = if count > 0.0 { sum / count } else { 0.0 };
    quotients.map(|quotient| quotient.unwrap_or(mean))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scattered_light_is_divided_without_loss() {
        let all = vec3(1.0, 0.0, 0.5);
        let shares = Shares::of(vec3(0.25, 0.0, 0.5), vec3(0.5, 0.0, 0.0), all);
        let mut parts = LightParts::EMPTY;
        let light = vec3(4.0, 3.0, 2.0);
        parts.add_scattered(light, &shares, true);
        let kinds = [LobeKind::Diffuse, LobeKind::Glossy, LobeKind::Transmission];
        let found = kinds.map(|kind| *parts.at(LightPass::Indirect(kind)));
        assert_eq!(found, [[1.0, 0.0, 2.0], [2.0, 0.0, 0.0], [1.0, 3.0, 0.0]]);
        for kind in kinds {
            let mut parts = LightParts::EMPTY;
            parts.add_scattered(light, &Shares::only(kind), false);
            assert_eq!(*parts.at(LightPass::Direct(kind)), light.array());
        }
    }

    #[test]
    fn channels_without_colour_take_the_mean_of_the_others() {
        assert_eq!(divided([1.0, 2.0, 0.0], [0.5, 0.5, 0.0]), [2.0, 4.0, 3.0]);
        assert_eq!(divided([1.0, 2.0, 3.0], [0.0; 3]), [0.0; 3]);
    }
}
