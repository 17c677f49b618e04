// SPDX-License-Identifier: GPL-3.0-or-later
//! What a walk did, in order: for showing the way of one ray.

use super::query::Count;
use super::ray::RayCounters;

/// The record of one ray.
#[derive(Debug, Clone, Default)]
pub struct Record {
    /// The sums.
    pub counters: RayCounters,
    /// The leaves whose triangles were tested, in order: where their blocks begin, and how many
    /// triangles they hold.
    pub leaves: Vec<(u32, usize)>,
}

/// What is kept of the walks of a batch, beside the answers.
pub enum Watch<'a> {
    /// Nothing, which costs nothing.
    Nothing,
    /// What each ray cost.
    Count(&'a mut [RayCounters]),
    /// All that happens to the only ray of the batch.
    Record(&'a mut Record),
}

impl<'a> From<Option<&'a mut [RayCounters]>> for Watch<'a> {
    fn from(counters: Option<&'a mut [RayCounters]>) -> Self {
        counters.map_or(Self::Nothing, Self::Count)
    }
}

impl<'a> Watch<'a> {
    /// What each ray counts with; `None` for nothing.
    pub fn counts(self) -> Option<impl Iterator<Item = Count<'a>>> {
        let (counters, leaves) = match self {
            Self::Nothing => return None,
            Self::Count(counters) => (counters, None),
            Self::Record(record) => (
                std::slice::from_mut(&mut record.counters),
                Some(&mut record.leaves),
            ),
        };
        // Of a record there is one, for the only ray.
        let leaves = std::iter::once(leaves).chain(std::iter::repeat_with(|| None));
        let both = counters.iter_mut().zip(leaves);
        Some(both.map(|(counters, leaves)| Count { counters, leaves }))
    }

    /// The counters, one per ray, for walks that can only count.
    pub fn counters(self) -> Option<&'a mut [RayCounters]> {
        match self {
            Self::Nothing => None,
            Self::Count(counters) => Some(counters),
            Self::Record(record) => Some(std::slice::from_mut(&mut record.counters)),
        }
    }
}
