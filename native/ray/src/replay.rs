// SPDX-License-Identifier: GPL-3.0-or-later
//! Replays of traversals without their triangle tests, which measure the traversal alone, as papers on traversal do. A
//! first run records the hit of each leaf; a replay then visits the same nodes in the same order and reads no triangle.

use crate::counters::Counters;
use crate::ray::{Hit, Ray, RayCounters};

/// Number of rays replayed and timed together: prepared beforehand, and few enough to stay in cache.
pub const CHUNK: usize = 1024;

/// A leaf that improved the best hit.
#[derive(Debug, Clone, Copy)]
struct Event {
    /// Index of the leaf among those the ray visits, from 1.
    leaf: u32,
    hit: Hit,
}

/// The recorded hits of consecutive rays.
#[derive(Debug, Default)]
pub struct Record {
    events: Vec<Event>,
    rays: Vec<RecordedRay>,
}

/// The part of a [`Record`] that belongs to one ray.
#[derive(Debug, Clone, Copy)]
struct RecordedRay {
    /// Index of the ray's first event.
    first: usize,
    /// Number of leaves that the ray visits.
    leaves: u32,
}

impl Record {
    /// Begins the next ray.
    pub fn begin(&mut self) {
        self.rays.push(RecordedRay {
            first: self.events.len(),
            leaves: 0,
        });
    }

    /// Records the visit of a leaf.
    pub fn visit(&mut self) {
        if let Some(ray) = self.rays.last_mut() {
            ray.leaves += 1;
        }
    }

    /// Records a better hit in the current leaf.
    pub fn improved(&mut self, hit: Hit) {
        let Some(&RecordedRay { first, leaves }) = self.rays.last() else {
            return;
        };
        // Keep only the last improvement of a leaf.
        if self.events.len() > first && self.events.last().is_some_and(|e| e.leaf == leaves) {
            self.events.pop();
        }
        self.events.push(Event { leaf: leaves, hit });
    }

    /// Returns the recorded leaves of ray `i`.
    #[inline(always)]
    pub fn replay(&self, i: usize) -> Replay<'_> {
        let RecordedRay { first, leaves } = self.rays[i];
        let end = (self.rays.get(i + 1)).map_or(self.events.len(), |next| next.first);
        Replay {
            events: &self.events[first..end],
            leaf: 0,
            leaves,
        }
    }
}

/// The recorded leaves of one ray, consumed by its replay.
pub struct Replay<'a> {
    /// Events that are not replayed yet.
    events: &'a [Event],
    /// Number of leaves replayed so far.
    leaf: u32,
    /// Number of recorded leaves.
    leaves: u32,
}

impl Replay<'_> {
    /// Returns whether all recorded leaves and events have been replayed.
    #[inline(always)]
    pub fn is_over(&self) -> bool {
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

/// Rays and their recorded traversals of one structure.
#[derive(Debug)]
pub struct Recording {
    /// The rays.
    pub rays: Vec<Ray>,
    /// Whether the query was any-hit.
    pub any: bool,
    /// Counters of each ray.
    pub counters: Vec<RayCounters>,
    /// The recorded hits.
    pub record: Record,
}
