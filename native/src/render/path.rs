// SPDX-License-Identifier: GPL-3.0-or-later
//! A path on its way: what it carries, and its random numbers.

use super::lights::Receiver;
use super::place::RayKind;
use super::sampler::PixelSampler;
use super::vector::Vec3;

/// A path passes through at most this many transparent surfaces, a shadow ray likewise.
pub const MOST_PASSED: u16 = 64;

/// And through so many that are hidden from it.
pub const MOST_UNSEEN: u16 = 1000;

/// Random pairs of a pixel: 0 the filter, 1 the lens, 2 and 3 free; then four per vertex.
const FIRST_VERTEX: u32 = 4;
const PAIRS_PER_VERTEX: u32 = 4;

/// A path between two of its vertices.
#[derive(Clone, Copy)]
pub struct Path {
    /// What light that it meets is taken times.
    pub throughput: Vec3,
    /// Density of the last direction; infinite after a mirror.
    pub pdf: f32,
    /// Where the path scattered last.
    pub receiver: Receiver,
    /// Distance from there to the ray's origin: surfaces passed through.
    pub passed: f32,
    sampler: PixelSampler,
    /// Which pixel sample of the tile's batch.
    pub slot: u32,
    /// How often it has scattered.
    pub bounce: u16,
    /// Surfaces met, scattered or passed: each has its own random numbers.
    vertex: u16,
    /// Transparent surfaces passed so far.
    transparent: u16,
    /// Surfaces passed so far that are not there for its rays.
    unseen: u16,
    /// Nothing has scattered yet.
    pub camera: bool,
    /// How it scattered last.
    pub kind: RayKind,
}

impl Path {
    /// Of a camera ray from this point.
    pub fn from_camera(o: [f32; 3], sampler: PixelSampler, slot: u32) -> Self {
        Self {
            throughput: Vec3::ONE,
            pdf: f32::INFINITY,
            receiver: Receiver {
                point: Vec3::from(o),
                normal: Vec3::ZERO,
            },
            passed: 0.0,
            sampler,
            slot,
            bounce: 0,
            vertex: 0,
            transparent: 0,
            unseen: 0,
            camera: true,
            kind: RayKind::Camera,
        }
    }

    /// The random numbers of the next vertex.
    #[inline(always)]
    pub fn at_vertex(&mut self, sample: u32) -> Numbers {
        let first = FIRST_VERTEX + PAIRS_PER_VERTEX * u32::from(self.vertex);
        self.vertex += 1;
        Numbers {
            sampler: self.sampler,
            sample,
            first,
        }
    }

    /// Passes a surface at this distance that is not there for its rays; says whether it may go on.
    #[inline(always)]
    pub fn pass_unseen(&mut self, distance: f32) -> bool {
        self.unseen += 1;
        self.passed += distance;
        self.unseen < MOST_UNSEEN
    }

    /// Passes a transparent surface at this distance; says whether it may go on.
    #[inline(always)]
    pub fn pass(&mut self, distance: f32) -> bool {
        self.transparent += 1;
        self.passed += distance;
        self.transparent < MOST_PASSED
    }

    /// Ends paths that carry little, in proportion, from the first bounce on; says whether this one goes on. The root
    /// keeps them a little longer, which suits images that are seen through a view transform (as in Cycles).
    #[inline(always)]
    pub fn survives(&mut self, roulette: f32) -> bool {
        if self.bounce == 0 {
            return true;
        }
        let survive = self.throughput.max_component().sqrt().min(1.0);
        if roulette >= survive {
            return false;
        }
        self.throughput *= 1.0 / survive;
        true
    }
}

/// The random numbers of one vertex of a path.
#[derive(Clone, Copy)]
pub struct Numbers {
    sampler: PixelSampler,
    sample: u32,
    first: u32,
}

impl Numbers {
    /// The next direction.
    #[inline(always)]
    pub fn direction(self) -> [f32; 2] {
        self.pair(0)
    }

    /// Which light, and which lobe.
    #[inline(always)]
    pub fn choices(self) -> [f32; 2] {
        self.pair(1)
    }

    /// A point of the light.
    #[inline(always)]
    pub fn light(self) -> [f32; 2] {
        self.pair(2)
    }

    /// Whether the path goes on, and whether it passes through.
    #[inline(always)]
    pub fn fate(self) -> [f32; 2] {
        self.pair(3)
    }

    #[inline(always)]
    fn pair(self, k: u32) -> [f32; 2] {
        self.sampler.pair(self.sample, self.first + k)
    }
}
