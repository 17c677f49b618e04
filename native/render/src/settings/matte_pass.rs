// SPDX-License-Identifier: GPL-3.0-or-later
//! The passes of Cryptomatte: the surfaces in each pixel, with the share that each covers.

/// Kind of things that Cryptomatte distinguishes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatteKind {
    /// Objects.
    Object,
    /// Materials.
    Material,
    /// Objects with all their children.
    Asset,
}

impl MatteKind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Object, Self::Material, Self::Asset];
}

/// Two ranks of the surfaces in a pixel, ordered by the share that they cover: identity and share of each, four
/// channels. Identities are hashes of names, reinterpreted as floats (Friedman and Jones 2015, "Fully automatic ID
/// mattes with support for motion blur and transparency").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MattePass {
    /// Kind of things that it distinguishes.
    pub kind: MatteKind,
    /// Number of ranks above it, halved; less than [`Self::LEVELS`].
    pub level: u8,
}

impl MattePass {
    /// Number of passes of each kind.
    pub const LEVELS: u8 = 8;

    /// All passes.
    pub fn all() -> impl Iterator<Item = Self> {
        MatteKind::ALL
            .into_iter()
            .flat_map(|kind| (0..Self::LEVELS).map(move |level| Self { kind, level }))
    }

    /// Returns the name in Blender, such as `CryptoObject00`.
    pub fn name(self) -> String {
        format!("Crypto{:?}{:02}", self.kind, self.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_kinds_and_levels() {
        let names: Vec<_> = MattePass::all().map(MattePass::name).collect();
        assert_eq!(names.len(), 24);
        assert_eq!(names[0], "CryptoObject00");
        assert_eq!(names[15], "CryptoMaterial07");
        assert_eq!(names[16], "CryptoAsset00");
    }
}
