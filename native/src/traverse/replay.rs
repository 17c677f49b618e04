// SPDX-License-Identifier: GPL-3.0-or-later
//! Walks without their triangle tests: what each leaf answered is recorded once, and a replay visits
//! the same nodes in the same order without touching a triangle. So the time of walking is measured
//! alone, which is what papers on traversal compare.

use super::query::Counters;
use super::ray::{Hit, Ray, RayCounters};

/// Rays that are replayed, and timed, together: framed beforehand, and few enough to stay in cache.
pub const CHUNK: usize = 1024;

/// A leaf with a hit better than those before.
#[derive(Debug, Clone, Copy)]
struct Event {
    /// Which of the leaves visited by the ray, counted from 1.
    leaf: u32,
    hit: Hit,
}

/// What the leaves of one ray after another answered.
#[derive(Debug, Default)]
pub struct Record {
    events: Vec<Event>,
    /// Per ray: where its events begin, and how many leaves it visited.
    rays: Vec<(usize, u32)>,
}

impl Record {
    /// The next ray begins.
    pub fn begin(&mut self) {
        self.rays.push((self.events.len(), 0));
    }

    /// It visits a leaf.
    pub(super) fn visit(&mut self) {
        if let Some((_, leaves)) = self.rays.last_mut() {
            *leaves += 1;
        }
    }

    /// The leaf has a better hit.
    pub(super) fn improved(&mut self, hit: Hit) {
        let Some(&(first, leaf)) = self.rays.last() else {
            return;
        };
        // Of several better ones in one leaf the last counts.
        if self.events.len() > first && self.events.last().is_some_and(|e| e.leaf == leaf) {
            self.events.pop();
        }
        self.events.push(Event { leaf, hit });
    }

    /// What ray `i` needs to be replayed.
    #[inline(always)]
    pub(super) fn replay(&self, i: usize) -> Replay<'_> {
        let (first, leaves) = self.rays[i];
        let end = self.rays.get(i + 1).map_or(self.events.len(), |r| r.0);
        Replay {
            events: &self.events[first..end],
            leaf: 0,
            leaves,
        }
    }
}

/// The recorded leaves of one ray.
pub struct Replay<'a> {
    events: &'a [Event],
    leaf: u32,
    leaves: u32,
}

impl Replay<'_> {
    /// Whether as many leaves were visited as when recorded, and all that answered.
    #[inline(always)]
    pub(super) fn is_over(&self) -> bool {
        self.events.is_empty() && self.leaf == self.leaves
    }
}

impl Counters for Replay<'_> {
    const REPLAY: bool = true;

    #[inline(always)]
    fn replay(&mut self) -> Option<Hit> {
        self.leaf += 1;
        match self.events {
            [event, rest @ ..] if event.leaf == self.leaf => {
                self.events = rest;
                Some(event.hit)
            }
            _ => None,
        }
    }
}

/// Rays whose walks through one structure were recorded.
#[derive(Debug)]
pub struct Recording {
    /// The rays.
    pub rays: Vec<Ray>,
    /// Whether any hit was asked for, or the nearest.
    pub any: bool,
    /// What each cost.
    pub counters: Vec<RayCounters>,
    /// What its leaves answered.
    pub record: Record,
}
