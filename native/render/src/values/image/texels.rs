// SPDX-License-Identifier: GPL-3.0-or-later
//! The numbers of an image as its file stores them: bytes, 16-bit integers, half or single precision.

use std::fmt;
use std::sync::Arc;

/// How a number is stored, in the byte order of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Format {
    /// 0 to 255 for 0 to 1.
    Bytes,
    /// 0 to 65535 for 0 to 1.
    Shorts,
    /// IEEE 754 half precision.
    Halves,
    /// IEEE 754 single precision.
    #[default]
    Floats,
}

impl Format {
    /// The formats by NumPy's names of their types.
    pub const NAMED: &'static [(&'static str, Self)] = &[
        ("uint8", Self::Bytes),
        ("uint16", Self::Shorts),
        ("float16", Self::Halves),
        ("float32", Self::Floats),
    ];

    /// Returns the bytes of a number.
    pub const fn size(self) -> usize {
        match self {
            Self::Bytes => 1,
            Self::Shorts | Self::Halves => 2,
            Self::Floats => 4,
        }
    }
}

/// Memory with the numbers of an image, which its owner may share with others.
#[derive(Clone)]
pub struct Memory(Arc<dyn AsRef<[u8]> + Send + Sync>);

impl Memory {
    /// Takes memory that nothing writes to.
    pub fn new(bytes: impl AsRef<[u8]> + Send + Sync + 'static) -> Self {
        Self(Arc::new(bytes))
    }

    /// Returns the bytes.
    #[inline(always)]
    pub fn bytes(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

impl Default for Memory {
    fn default() -> Self {
        Self::new([])
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.bytes().len())
    }
}

/// The numbers of an image, texel by texel, rows from the bottom up.
#[derive(Debug, Clone, Default)]
pub struct Texels {
    /// How numbers are stored.
    pub format: Format,
    /// Numbers of a texel: 1, a grey; 2, a grey and alpha; 3, a colour; or 4, a colour and alpha.
    pub channels: usize,
    /// The stored numbers.
    pub memory: Memory,
}

impl Texels {
    /// Returns the numbers of the memory, or of a copy with 0 for those that are not finite.
    pub(super) fn finite(self) -> Self {
        let repaired = match self.format {
            Format::Bytes | Format::Shorts => None,
            Format::Halves => repaired(self.memory.bytes(), |b| {
                // All bits of the exponent are set.
                u16::from_ne_bytes(b) & 0x7C00 != 0x7C00
            }),
            Format::Floats => repaired(self.memory.bytes(), |b| f32::from_ne_bytes(b).is_finite()),
        };
        Self {
            memory: repaired.map_or(self.memory, Memory::new),
            ..self
        }
    }
}

/// Returns a copy of numbers of `N` bytes with 0 for those that are not good; `None` if all are.
fn repaired<const N: usize>(bytes: &[u8], good: impl Fn([u8; N]) -> bool) -> Option<Vec<u8>> {
    let numbers = bytes.as_chunks::<N>().0;
    if numbers.iter().all(|&b| good(b)) {
        return None;
    }
    let kept = numbers
        .iter()
        .flat_map(|&b| if good(b) { b } else { [0; N] });
    Some(kept.collect())
}

/// Returns the number of these bits in half precision, which are finite.
#[inline(always)]
pub(super) fn from_half(bits: u16) -> f32 {
    let (sign, exponent) = (u32::from(bits & 0x8000) << 16, bits >> 10 & 0x1F);
    let fraction = u32::from(bits & 0x3FF);
    if exponent == 0 {
        // Numbers below 2^-14 are multiples of 2^-24.
        let magnitude = fraction as f32 * (1.0 / 16_777_216.0);
        return f32::from_bits(magnitude.to_bits() | sign);
    }
    f32::from_bits(sign | (u32::from(exponent) + 112) << 23 | fraction << 13)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_have_their_values() {
        for (bits, want) in [
            (0x0000, 0.0_f32),
            (0x8000, -0.0),
            (0x0001, 2.0_f32.powi(-24)),
            (0x83FF, -1023.0 * 2.0_f32.powi(-24)),
            (0x0400, 2.0_f32.powi(-14)),
            (0x3555, 0.333_251_95),
            (0x3C00, 1.0),
            (0xC000, -2.0),
            (0x7BFF, 65504.0),
        ] {
            assert_eq!(from_half(bits).to_bits(), want.to_bits(), "{bits:04x}");
        }
    }

    #[test]
    fn memory_is_copied_only_to_repair_it() {
        let texels = |format, bytes: &[u8]| Texels {
            format,
            channels: 1,
            memory: Memory::new(bytes.to_vec()),
        };
        let whole = texels(Format::Floats, &1.5_f32.to_ne_bytes());
        let before = whole.memory.bytes().as_ptr();
        assert_eq!(whole.finite().memory.bytes().as_ptr(), before);
        let torn = [f32::NAN, 2.0, f32::INFINITY]
            .map(f32::to_ne_bytes)
            .concat();
        let mended = texels(Format::Floats, &torn).finite();
        assert_eq!(
            mended.memory.bytes(),
            [0.0_f32, 2.0, 0.0].map(f32::to_ne_bytes).concat()
        );
        let torn = [0x7C00_u16, 0x3C00, 0xFE01].map(u16::to_ne_bytes).concat();
        let mended = texels(Format::Halves, &torn).finite();
        assert_eq!(
            mended.memory.bytes(),
            [0_u16, 0x3C00, 0].map(u16::to_ne_bytes).concat()
        );
    }
}
