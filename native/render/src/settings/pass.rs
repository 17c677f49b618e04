// SPDX-License-Identifier: GPL-3.0-or-later
//! The passes of the film.

use std::borrow::Cow;

use crate::check::{Error, Result};
use crate::settings::light_pass::LightPass;
use crate::settings::matte_pass::MattePass;

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
    /// Motion of the first surface or the background in pixels: from its place in this picture to that in the one
    /// before, and from that in the one after to its place; mean of the samples that have one.
    Vector,
    /// Light of shadow catchers among all objects, divided by that among shadow catchers alone; see
    /// [`crate::film::catcher`].
    ShadowCatcher,
    /// Roughness of the first surface, as its nodes give it; mean of the samples.
    Roughness,
    /// A part of the light.
    Light(LightPass),
    /// Two ranks of the surfaces in a pixel.
    Matte(MattePass),
    /// A value that the material of the first surface outputs, of this number below [`Pass::OUTPUTS`]; mean of the
    /// samples.
    Output(u8),
    /// The light of a light group of this number below [`Pass::GROUPS`].
    Group(u8),
}

impl Pass {
    /// Number of values that materials can output.
    pub const OUTPUTS: u8 = 64;

    /// Number of light groups.
    pub const GROUPS: u8 = 64;

    /// The passes that are neither light nor mattes nor numbered.
    const PLAIN: [Self; 16] = [
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
        Self::Vector,
        Self::ShadowCatcher,
        Self::Roughness,
    ];

    /// All passes that are not numbered.
    pub fn all() -> impl Iterator<Item = Self> {
        let light = LightPass::ALL.into_iter().map(Self::Light);
        let mattes = MattePass::all().map(Self::Matte);
        Self::PLAIN.into_iter().chain(light).chain(mattes)
    }

    /// Returns the pass by which this one is divided.
    pub fn divisor(self) -> Option<Self> {
        match self {
            Self::Light(pass) => pass.divisor().map(Self::Light),
            _ => None,
        }
    }

    /// Returns the other pass whose sums this one is computed from.
    pub fn source(self) -> Option<Self> {
        match self {
            Self::ShadowCatcher => Some(Self::Combined),
            _ => self.divisor(),
        }
    }

    /// Returns the number of the output.
    pub fn output(self) -> Option<u8> {
        match self {
            Self::Output(number) => Some(number),
            _ => None,
        }
    }

    /// Whether samples carry values for this pass alone.
    pub fn is_extra(self) -> bool {
        matches!(
            self,
            Self::Light(_)
                | Self::Matte(_)
                | Self::Output(_)
                | Self::Group(_)
                | Self::Vector
                | Self::Roughness
        )
    }

    /// Returns the number of the light group.
    pub fn group(self) -> Option<u8> {
        match self {
            Self::Group(number) => Some(number),
            _ => None,
        }
    }

    /// Returns the matte.
    pub fn matte(self) -> Option<MattePass> {
        match self {
            Self::Matte(pass) => Some(pass),
            _ => None,
        }
    }

    /// Returns the name, which except for numbered passes is that in Blender.
    pub fn name(self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
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
            Self::Vector => "Vector",
            Self::ShadowCatcher => "Shadow Catcher",
            Self::Roughness => "Roughness",
            Self::Light(pass) => pass.name(),
            Self::Matte(pass) => return Cow::Owned(pass.name()),
            Self::Output(number) => return Cow::Owned(format!("Output {number}")),
            Self::Group(number) => return Cow::Owned(format!("Light Group {number}")),
        })
    }

    /// Returns the number of channels.
    pub fn channels(self) -> usize {
        match self {
            Self::Combined | Self::Matte(_) | Self::Output(_) | Self::Vector => 4,
            Self::Normal
            | Self::Position
            | Self::Uv
            | Self::Albedo
            | Self::ShadowCatcher
            | Self::Light(_)
            | Self::Group(_) => 3,
            _ => 1,
        }
    }

    /// Returns the number of sums that the film keeps per pixel: one for each channel. Mattes are counted instead,
    /// shadow catchers have sums of their own, and vectors a number of samples of their own.
    pub fn sums(self) -> usize {
        match self {
            Self::Matte(_) | Self::ShadowCatcher => 0,
            Self::Vector => 5,
            _ => self.channels(),
        }
    }

    /// Returns the pass with this name.
    ///
    /// # Errors
    /// [`Error::Spec`] with the names of all passes.
    pub fn named(name: &str) -> Result<Self> {
        let outputs = (0..Self::OUTPUTS).map(Self::Output);
        let groups = (0..Self::GROUPS).map(Self::Group);
        let mut passes = Self::all().chain(outputs).chain(groups);
        passes.find(|p| p.name() == name).ok_or_else(|| {
            let known: Vec<_> = Self::all().map(Self::name).collect();
            Error::Spec(format!(
                "settings['passes']: no pass is called '{name}'; known: {}, Output 0 to {}, Light Group 0 to {}",
                known.join(", "),
                Self::OUTPUTS - 1,
                Self::GROUPS - 1
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
