// SPDX-License-Identifier: GPL-3.0-or-later
//! Kinds of rays, and the ray visibility of objects, lights and background, as in Blender.

/// The kind of a ray, which visibility and shading programs depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayKind {
    /// From the camera.
    Camera,
    /// To a light.
    Shadow,
    /// After a diffuse bounce.
    Diffuse,
    /// After a glossy reflection.
    Glossy,
    /// After a refraction.
    Transmission,
    /// After scattering in a volume.
    Volume,
    /// Of no such kind: of the node Raycast, and as programs of lights see all rays.
    Plain,
}

/// The set of ray kinds that see an object, a light or the background.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Visibility(u8);

impl Visibility {
    /// Visible to all rays.
    pub const ALL: Self = Self(0b111_1111);
    /// Visible to all rays except camera rays: Blender's default for lights.
    pub const NOT_BY_CAMERA: Self = Self::ALL.without(RayKind::Camera);

    /// The bit of a kind of rays.
    const fn bit(kind: RayKind) -> u8 {
        1 << match kind {
            RayKind::Camera => 0,
            RayKind::Shadow => 1,
            RayKind::Diffuse => 2,
            RayKind::Glossy => 3,
            RayKind::Transmission => 4,
            RayKind::Volume => 5,
            RayKind::Plain => 6,
        }
    }

    /// Removes one kind of rays from the set.
    #[must_use]
    pub const fn without(self, kind: RayKind) -> Self {
        Self(self.0 & !Self::bit(kind))
    }

    /// Whether rays of this kind are in the set.
    #[inline(always)]
    pub const fn to(self, kind: RayKind) -> bool {
        self.0 & Self::bit(kind) != 0
    }

    /// Whether all kinds are in the set.
    #[inline(always)]
    pub const fn is_all(self) -> bool {
        self.0 == Self::ALL.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hiding_from_one_kind_keeps_the_others() {
        let glossy_only_hidden = Visibility::ALL.without(RayKind::Glossy);
        assert!(!glossy_only_hidden.to(RayKind::Glossy) && glossy_only_hidden.to(RayKind::Camera));
        assert!(!Visibility::NOT_BY_CAMERA.is_all() && Visibility::ALL.is_all());
    }
}
