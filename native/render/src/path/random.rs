// SPDX-License-Identifier: GPL-3.0-or-later
//! The random numbers of a path's vertices.

use crate::math::sampler::PixelSampler;

/// First random pair of a path's vertices: 0 is for the filter, 1 for the lens, 2 for the time, 3 is unused.
const FIRST_VERTEX: u32 = 4;
/// Random pairs of a vertex: direction, choices, light, survival.
const PAIRS_PER_VERTEX: u32 = 4;

/// Random numbers in [0, 1) that select one of several lights or lobes, and a point or direction of it.
#[derive(Clone, Copy)]
pub struct Selection {
    /// Selects the light or lobe.
    pub choice: f32,
    /// Selects the point or direction.
    pub u: [f32; 2],
}

/// The random numbers of one vertex of a path.
#[derive(Clone, Copy)]
pub struct VertexSamples {
    sampler: PixelSampler,
    sample: u32,
    first: u32,
    /// The numbers of its four pairs: first numbers, then second ones.
    pairs: [[f32; 4]; 2],
}

impl VertexSamples {
    /// The numbers of vertex number `vertex` of a path of sample `sample`.
    #[inline(always)]
    pub fn new(sampler: PixelSampler, sample: u32, vertex: u16) -> Self {
        let first = FIRST_VERTEX + PAIRS_PER_VERTEX * u32::from(vertex);
        Self {
            sampler,
            sample,
            first,
            pairs: sampler.pairs(sample, [0, 1, 2, 3].map(|k| first + k)),
        }
    }

    /// For the next direction.
    #[inline(always)]
    pub fn direction(self) -> [f32; 2] {
        self.pair(0)
    }

    /// For the choice of a light and of a lobe.
    #[inline(always)]
    pub fn choices(self) -> [f32; 2] {
        self.pair(1)
    }

    /// For a point on the light.
    #[inline(always)]
    pub fn light(self) -> [f32; 2] {
        self.pair(2)
    }

    /// For a point on the light with this number, where several are sampled; 0 is [`Self::light`].
    #[inline(always)]
    pub fn light_of(self, number: u32) -> [f32; 2] {
        if number == 0 {
            return self.light();
        }
        // The pairs of other lights lie far beyond those of all vertices.
        self.sampler
            .pair(self.sample, self.first + 2 + (number << 24))
    }

    /// For Russian roulette and for passing transparent surfaces.
    #[inline(always)]
    pub fn survival(self) -> [f32; 2] {
        self.pair(3)
    }

    #[inline(always)]
    fn pair(self, k: usize) -> [f32; 2] {
        [self.pairs[0][k], self.pairs[1][k]]
    }
}
