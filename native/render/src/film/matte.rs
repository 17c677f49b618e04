// SPDX-License-Identifier: GPL-3.0-or-later
//! The surfaces in each pixel of a tile, with their numbers of samples: for Cryptomatte. All surfaces are kept, so the
//! order of the samples does not matter.

use crate::settings::{MatteKind, MattePass};

/// Identities of a sample's first surface, by [`MatteKind`]; 0 where there is none.
pub type Identities = [u32; MatteKind::ALL.len()];

/// Identities with their numbers of samples, for each pixel of a tile and each kind that is wanted.
pub struct Mattes {
    kinds: [Option<Vec<Pixel>>; MatteKind::ALL.len()],
}

/// The identities in a pixel, in order of their first sample, each with its number of samples.
type Pixel = Vec<(u32, u32)>;

impl Mattes {
    /// No surfaces in this number of pixels, for the kinds of these passes.
    pub fn new(passes: impl Iterator<Item = MattePass>, pixels: usize) -> Self {
        let mut kinds = [const { None }; MatteKind::ALL.len()];
        for pass in passes {
            kinds[pass.kind as usize].get_or_insert_with(|| vec![Pixel::new(); pixels]);
        }
        Self { kinds }
    }

    /// Adds the surface of one sample to a pixel.
    pub fn add(&mut self, pixel: usize, identities: &Identities) {
        for (kind, &identity) in self.kinds.iter_mut().zip(identities) {
            if let Some(pixels) = kind
                && identity != 0
            {
                let found = &mut pixels[pixel];
                match found.iter_mut().find(|(other, _)| *other == identity) {
                    Some((_, count)) => *count += 1,
                    None => found.push((identity, 1)),
                }
            }
        }
    }

    /// Returns the channels of a pass in a pixel that has this number of samples: the identity and the share of two
    /// surfaces, zeros where there are fewer. Surfaces of equal shares are ordered by their identities.
    pub fn ranks(&self, pass: MattePass, pixel: usize, samples: u32) -> [f32; 4] {
        let Some(pixels) = &self.kinds[pass.kind as usize] else {
            return [0.0; 4];
        };
        let mut found = pixels[pixel].clone();
        found.sort_unstable_by_key(|&(identity, count)| (std::cmp::Reverse(count), identity));
        let mut out = [0.0; 4];
        let ranks = found.into_iter().skip(2 * usize::from(pass.level));
        for (rank, (identity, count)) in out.chunks_exact_mut(2).zip(ranks) {
            rank[0] = f32::from_bits(identity);
            rank[1] = (f64::from(count) / f64::from(samples.max(1))) as f32;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_ranked_by_their_samples_then_by_their_identities() {
        let pass = |kind, level| MattePass { kind, level };
        let wanted = [pass(MatteKind::Object, 1), pass(MatteKind::Asset, 0)];
        let mut mattes = Mattes::new(wanted.into_iter(), 2);
        // Material identities are not wanted, and nothing is met in the last sample.
        for object in [7, 9, 5, 9, 3, 0] {
            mattes.add(1, &[object, 4, object / 5]);
        }
        let of = |identity, share| [f32::from_bits(identity), share];
        let (sixth, third) = ((1.0_f64 / 6.0) as f32, (1.0_f64 / 3.0) as f32);
        let ranks = |kind, level, pixel| mattes.ranks(pass(kind, level), pixel, 6);
        assert_eq!(
            ranks(MatteKind::Object, 0, 1),
            [of(9, third), of(3, sixth)].concat()[..]
        );
        assert_eq!(
            ranks(MatteKind::Object, 1, 1),
            [of(5, sixth), of(7, sixth)].concat()[..]
        );
        assert_eq!(ranks(MatteKind::Object, 2, 1), [0.0; 4]);
        assert_eq!(
            ranks(MatteKind::Asset, 0, 1)[..2],
            of(1, (4.0_f64 / 6.0) as f32)
        );
        assert_eq!(ranks(MatteKind::Material, 0, 1), [0.0; 4]);
        assert_eq!(ranks(MatteKind::Object, 0, 0), [0.0; 4]);
    }
}
