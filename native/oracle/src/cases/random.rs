// SPDX-License-Identifier: GPL-3.0-or-later
//! Random numbers for generated scenes.

/// A small pseudorandom generator (splitmix64; Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// Returns the next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a uniform number in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 16_777_216.0
    }

    /// Returns a uniform point of the cube from `low` to `high`.
    pub fn point(&mut self, low: f32, high: f32) -> [f32; 3] {
        std::array::from_fn(|_| low + (high - low) * self.unit())
    }

    /// Returns an integer below `n`.
    #[expect(clippy::cast_possible_truncation, reason = "less than n")]
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

impl Random {
    /// Returns a finite number of any exponent and sign, uniform in the bits of its representation.
    pub fn wild(&mut self) -> f32 {
        loop {
            #[expect(clippy::cast_possible_truncation, reason = "32 random bits")]
            let x = f32::from_bits(self.bits() as u32);
            if x.is_finite() {
                return x;
            }
        }
    }

    /// Returns one of the elements.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}
