// SPDX-License-Identifier: GPL-3.0-or-later
//! Which rays see a thing: Blender's ray visibility of objects, lights and the world.

use super::place::RayKind;

/// A set of kinds of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Visibility(u8);

impl Visibility {
    /// Seen by every ray.
    pub const ALL: Self = Self(0b1_1111);
    /// Seen by every ray but those of the camera, as Blender makes lights.
    pub const NOT_BY_CAMERA: Self = Self::ALL.without(RayKind::Camera);

    const fn bit(kind: RayKind) -> u8 {
        1 << match kind {
            RayKind::Camera => 0,
            RayKind::Shadow => 1,
            RayKind::Diffuse => 2,
            RayKind::Glossy => 3,
            RayKind::Transmission => 4,
        }
    }

    /// Hidden from one kind more.
    #[must_use]
    pub const fn without(self, kind: RayKind) -> Self {
        Self(self.0 & !Self::bit(kind))
    }

    /// Whether rays of this kind see it.
    #[inline(always)]
    pub const fn to(self, kind: RayKind) -> bool {
        self.0 & Self::bit(kind) != 0
    }

    /// Whether every ray does.
    #[inline(always)]
    pub const fn is_all(self) -> bool {
        self.0 == Self::ALL.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thing_hidden_from_one_kind_is_seen_by_the_others() {
        let glossy_only_hidden = Visibility::ALL.without(RayKind::Glossy);
        assert!(!glossy_only_hidden.to(RayKind::Glossy) && glossy_only_hidden.to(RayKind::Camera));
        assert!(!Visibility::NOT_BY_CAMERA.is_all() && Visibility::ALL.is_all());
    }
}
