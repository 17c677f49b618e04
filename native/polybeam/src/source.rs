// SPDX-License-Identifier: GPL-3.0-or-later
//! Origin or direction that many rays of a batch have in common.

use halfspace_ray::Ray;

/// Number of rays that are compared.
pub const SAMPLES: usize = 16;

/// Origin or direction that rays have in common, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// The origin.
    Origin([f32; 3]),
    /// The direction.
    Direction([f32; 3]),
}

/// The commonest source of sampled rays.
#[derive(Debug, Clone, Copy)]
pub struct Common {
    /// The source.
    pub source: Source,
    /// Number of sampled rays that have it.
    pub samples: usize,
}

/// The sampled rays of those with these indices, which are not none, in their order.
pub fn sample<'a>(rays: &'a [Ray], ids: &[u32]) -> [&'a Ray; SAMPLES] {
    std::array::from_fn(|i| &rays[ids[i * ids.len() / SAMPLES] as usize])
}

/// The source that most of some sampled rays have, an origin if as many have it as a direction; `None` if only one ray
/// has it.
pub fn common(rays: &[Ray], ids: &[u32]) -> Option<Common> {
    if ids.len() < 2 {
        return None;
    }
    let some = sample(rays, ids);
    let bits = |v: [f32; 3]| v.map(f32::to_bits);
    let mut best: Option<Common> = None;
    let mut offer = |source: Source, samples: usize| {
        if best.is_none_or(|best| best.samples < samples) {
            best = Some(Common { source, samples });
        }
    };
    for ray in some {
        let same = |of: fn(&Ray) -> [f32; 3]| {
            let own = bits(of(ray));
            some.iter().filter(|other| bits(of(other)) == own).count()
        };
        offer(Source::Origin(ray.o), same(|ray| ray.o));
        offer(Source::Direction(ray.d), same(|ray| ray.d));
    }
    best.filter(|best| best.samples > SAMPLES.div_ceil(ids.len()))
}
