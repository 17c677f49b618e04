// SPDX-License-Identifier: GPL-3.0-or-later
//! Recorded rays of a render, by kind, for measurements with the rays that a picture consists of.
//!
//! Each ray has a priority that is a hash of its own bits, and of each kind those of least priority are kept: a uniform
//! choice without replacement (bottom-k sampling: Cohen and Kaplan 2007, "Summarizing Data using Bottom-k Sketches")
//! that depends neither on the structure nor on the number of threads.

use std::collections::{BTreeMap, BinaryHeap};
use std::sync::{Mutex, PoisonError};

use crate::values::visibility::RayKind;
use halfspace_ray::Ray;

/// Bounce from which on rays of a kind are no longer distinguished by their bounce, which bounds the number of kinds.
const LAST_BOUNCE: u16 = 8;

/// What a recorded ray is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Purpose {
    /// Number of times its path has scattered, at most [`LAST_BOUNCE`].
    bounce: u16,
    /// Kind of the ray.
    name: &'static str,
    /// Whether it continues behind a surface that is transparent or invisible to it.
    continued: bool,
    /// Whether any hit answers it.
    any: bool,
}

impl Purpose {
    /// A ray of a path, traced for its nearest hit. `walks`: whether it is part of a random walk below a surface.
    pub fn of_path(kind: RayKind, bounce: u16, continued: bool, walks: bool) -> Self {
        let name = if walks { "subsurface" } else { name(kind) };
        Self::new(name, bounce, continued, false)
    }

    /// A shadow ray from the surface that a path meets after this number of bounces.
    pub fn of_shadow(bounce: u8, continued: bool, any: bool) -> Self {
        Self::new(name(RayKind::Shadow), bounce.into(), continued, any)
    }

    fn new(name: &'static str, bounce: u16, continued: bool, any: bool) -> Self {
        let bounce = bounce.min(LAST_BOUNCE);
        Self {
            bounce,
            name,
            continued,
            any,
        }
    }

    /// Returns the name, such as "diffuse 1" or "shadow 0 nearest continued".
    fn text(self) -> String {
        let Self { bounce, name, .. } = self;
        let passes = name == "shadow" && !self.any;
        let nearest = if passes { " nearest" } else { "" };
        let continued = if self.continued { " continued" } else { "" };
        match name {
            "camera" => format!("{name}{continued}"),
            _ => format!("{name} {bounce}{nearest}{continued}"),
        }
    }
}

/// The name of a kind of rays.
fn name(kind: RayKind) -> &'static str {
    match kind {
        RayKind::Camera => "camera",
        RayKind::Shadow => "shadow",
        RayKind::Diffuse => "diffuse",
        RayKind::Glossy => "glossy",
        RayKind::Transmission => "transmission",
        RayKind::Volume => "volume",
        RayKind::Plain => "plain",
    }
}

/// The recorded rays of one kind.
pub struct Recorded {
    /// Name of the kind; that of shadow rays ends in the bounce of the path that they leave.
    pub name: String,
    /// Whether any hit answers the rays; otherwise the nearest.
    pub any: bool,
    /// Number of rays of the kind that were traced.
    pub traced: u64,
    /// The rays kept, in random order.
    pub rays: Vec<Ray>,
}

/// Priority and bits of a ray.
type Entry = (u64, [u32; 8]);

/// The rays of one kind so far.
#[derive(Default)]
struct Choice {
    traced: u64,
    /// The largest entry is on top.
    kept: BinaryHeap<Entry>,
}

/// Records rays of all threads of a render.
pub struct Recorder {
    /// Largest number of rays to keep of each kind.
    limit: usize,
    choices: Mutex<BTreeMap<Purpose, Choice>>,
}

impl Recorder {
    /// A recorder of at most `limit` rays of each kind.
    pub fn new(limit: usize) -> Self {
        Self {
            limit,
            choices: Mutex::default(),
        }
    }

    /// Records rays that are about to be traced.
    pub fn take<'a>(&self, rays: impl Iterator<Item = (Purpose, &'a Ray)>) {
        let mut choices = self.choices.lock().unwrap_or_else(PoisonError::into_inner);
        for (purpose, ray) in rays {
            let choice = choices.entry(purpose).or_default();
            choice.traced += 1;
            let entry = entry(ray);
            // Replace the ray of largest priority once there are enough.
            if choice.kept.len() < self.limit {
                choice.kept.push(entry);
            } else if let Some(mut largest) = choice.kept.peek_mut()
                && entry < *largest
            {
                *largest = entry;
            }
        }
    }

    /// Returns the rays recorded so far, from bounce to bounce.
    pub fn recorded(&self) -> Vec<Recorded> {
        let choices = self.choices.lock().unwrap_or_else(PoisonError::into_inner);
        let rays = |choice: &Choice| {
            let mut kept: Vec<_> = choice.kept.iter().copied().collect();
            kept.sort_unstable();
            kept.into_iter().map(|(_, bits)| ray(bits)).collect()
        };
        choices
            .iter()
            .map(|(purpose, choice)| Recorded {
                name: purpose.text(),
                any: purpose.any,
                traced: choice.traced,
                rays: rays(choice),
            })
            .collect()
    }
}

/// Returns the priority and the bits of a ray.
fn entry(ray: &Ray) -> Entry {
    let ([x, y, z], [dx, dy, dz]) = (ray.o, ray.d);
    let bits = [x, y, z, dx, dy, dz, ray.t_min, ray.t_max].map(f32::to_bits);
    let priority = bits
        .iter()
        .fold(0, |hash: u64, &bits| mixed(hash ^ u64::from(bits)));
    (priority, bits)
}

/// Returns the ray of these bits.
fn ray(bits: [u32; 8]) -> Ray {
    let [x, y, z, dx, dy, dz, t_min, t_max] = bits.map(f32::from_bits);
    Ray {
        o: [x, y, z],
        d: [dx, dy, dz],
        t_min,
        t_max,
    }
}

/// The next number of SplitMix64 after this state (Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number
/// Generators").
fn mixed(state: u64) -> u64 {
    let state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    state ^ (state >> 31)
}
