// SPDX-License-Identifier: GPL-3.0-or-later
//! Light linking: which objects a light shines on, and which objects shade it.
//!
//! Lights that list objects belong to numbered sets, from 1 to 31; 0 is the set of lights that list none. An object has
//! a bit for each set whose list it is in, and always bit 0.

/// Number of sets, including that of lights without a list.
pub const SETS: u8 = 32;

/// The sets of a light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LightSets {
    /// The set of the objects that the light shines on.
    pub receivers: u8,
    /// The set of the objects that cast its shadows.
    pub blockers: u8,
}

/// The lists that the objects of a material are in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObjectSets {
    /// Sets of lights that shine on the objects.
    pub receives: u32,
    /// Sets of lights that the objects shade.
    pub blocks: u32,
}

impl ObjectSets {
    /// In all lists.
    pub const ALL: Self = Self {
        receives: u32::MAX,
        blocks: u32::MAX,
    };

    /// Whether the objects shade a light of this set of blockers.
    #[inline(always)]
    pub const fn shades(self, blockers: u8) -> bool {
        contains(self.blocks, blockers)
    }
}

/// Whether the bit of a set is one of `bits`.
#[inline(always)]
pub const fn contains(bits: u32, set: u8) -> bool {
    bits >> (set % SETS) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_in_the_sets_of_its_bits() {
        let object = ObjectSets {
            receives: 0b101,
            blocks: 0b1,
        };
        assert!(object.shades(0) && !object.shades(2) && ObjectSets::ALL.shades(31));
        assert!(contains(object.receives, 2) && !contains(object.receives, 1));
    }
}
