// SPDX-License-Identifier: GPL-3.0-or-later
//! The samples of a tile that are rendered together, with what passes that are rarely filled need of them.

use crate::film::catcher::Caught;
use crate::film::{Film, Identities, LightParts, PixelSample};
use crate::settings::Pass;

/// Samples of all pixels of a tile, sample index by sample index, row by row. The other arrays are empty unless a pass
/// needs them.
#[derive(Default)]
pub struct Batch {
    /// The samples.
    pub samples: Vec<PixelSample>,
    /// The light of each sample by light pass.
    pub parts: Vec<LightParts>,
    /// The identities of each sample's first surface.
    pub identities: Vec<Identities>,
    /// The values that the material of each sample's first surface outputs, [`Film::outputs`] per sample.
    pub outputs: Vec<[f32; 4]>,
    /// The light of each light group, [`Film::groups`] per sample.
    pub groups: Vec<[f32; 3]>,
    /// The motion of each sample's first surface, and 1 where there is one.
    pub motion: Vec<[f32; 5]>,
    /// Values of each sample's shadow catcher.
    pub caught: Vec<Caught>,
}

impl Batch {
    /// Empties the batch and makes room for this number of samples of the passes of a film.
    pub fn reset(&mut self, film: &Film, count: usize) {
        self.samples.clear();
        self.samples.resize(count, PixelSample::EMPTY);
        self.parts.clear();
        if film.divides_light() {
            self.parts.resize(count, LightParts::EMPTY);
        }
        self.identities.clear();
        if film.identifies() {
            self.identities.resize(count, Identities::default());
        }
        self.outputs.clear();
        self.outputs.resize(count * film.outputs(), [0.0; 4]);
        self.motion.clear();
        if film.fills(Pass::Vector) {
            self.motion.resize(count, [0.0; 5]);
        }
        self.caught.clear();
        if film.catches() {
            self.caught.resize(count, Caught::default());
        }
        self.groups.clear();
        self.groups.resize(count * film.groups(), [0.0; 3]);
    }

    /// Returns the light of the light groups of a sample, of which there are `count`.
    pub fn groups_of(&self, sample: usize, count: usize) -> &[[f32; 3]] {
        &self.groups[sample * count..(sample + 1) * count]
    }

    /// Returns the outputs of a sample's material, of which there are `count`.
    pub fn outputs_of(&self, sample: usize, count: usize) -> &[[f32; 4]] {
        &self.outputs[sample * count..(sample + 1) * count]
    }
}
