// SPDX-License-Identifier: GPL-3.0-or-later
//! The passes of the film.

use crate::check::{Error, Result};

/// A pass of the film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pass {
    /// Premultiplied RGBA, scene-linear.
    Combined,
    /// Depth along the view axis, of the first sample; 1e10 where it hit nothing.
    Depth,
    /// Mist at the first surface: 0 near, 1 far or without a surface; mean of the samples.
    Mist,
    /// Shading normal of the first surface in scene space; mean of the samples.
    Normal,
    /// Position of the first surface in scene space, of the first sample.
    Position,
    /// UV of the first surface, and 1 where there is one; mean of the samples.
    Uv,
    /// Index of the first surface's object, of the first sample.
    ObjectIndex,
    /// Index of the first surface's material, of the first sample.
    MaterialIndex,
    /// Albedo of the first surface, for denoisers; mean of the samples.
    Albedo,
    /// Inner nodes visited by the camera ray; mean of the samples.
    TraversalSteps,
    /// Triangles tested by the camera ray; mean of the samples.
    TriangleTests,
    /// Depth of the last leaf that the camera ray tested; mean of the samples.
    LeafDepth,
    /// Number of samples so far.
    SampleCount,
}

impl Pass {
    /// All passes.
    pub const ALL: [Self; 13] = [
        Self::Combined,
        Self::Depth,
        Self::Mist,
        Self::Normal,
        Self::Position,
        Self::Uv,
        Self::ObjectIndex,
        Self::MaterialIndex,
        Self::Albedo,
        Self::TraversalSteps,
        Self::TriangleTests,
        Self::LeafDepth,
        Self::SampleCount,
    ];

    /// Returns the name in Blender.
    pub fn name(self) -> &'static str {
        match self {
            Self::Combined => "Combined",
            Self::Depth => "Depth",
            Self::Mist => "Mist",
            Self::Normal => "Normal",
            Self::Position => "Position",
            Self::Uv => "UV",
            Self::ObjectIndex => "Object Index",
            Self::MaterialIndex => "Material Index",
            Self::Albedo => "Denoising Albedo",
            Self::TraversalSteps => "Traversal Steps",
            Self::TriangleTests => "Triangle Tests",
            Self::LeafDepth => "Leaf Depth",
            Self::SampleCount => "Sample Count",
        }
    }

    /// Returns the number of channels.
    pub fn channels(self) -> usize {
        match self {
            Self::Combined => 4,
            Self::Normal | Self::Position | Self::Uv | Self::Albedo => 3,
            _ => 1,
        }
    }

    /// Returns the pass with this name.
    ///
    /// # Errors
    /// [`Error::Spec`] with the names of all passes.
    pub fn named(name: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|p| p.name() == name)
            .ok_or_else(|| {
                let known = Self::ALL.map(Self::name).join(", ");
                Error::Spec(format!(
                    "settings['passes']: no pass is called '{name}'; known: {known}"
                ))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_pass_is_an_error_that_lists_all() {
        let error = Pass::named("Depht").unwrap_err().to_string();
        assert!(error.contains("Depth"), "{error}");
    }
}
