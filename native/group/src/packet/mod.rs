// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets of 4, 8 or 16 consecutive rays of a batch, one ray per SIMD lane (Wald et al. 2001; Wald 2004).
//!
//! The rays of a packet are split into groups of equal direction signs, because the near child of an axis plane
//! is then the same for the whole group. A ray alone in its group, and an irregular ray, is traced by the
//! single-ray traversal.
//!
//! Each ray keeps its own interval in every node and is active while that interval is not empty. The nodes
//! where a ray is active are thus those of its own single-ray traversal, and its hit does not depend on the
//! other rays.

pub mod boxes;
mod bundle;
pub mod kernel;
pub mod leaf;
pub mod nodes;
pub mod planes;
pub mod slab_boxes;
pub mod traversal;

mod fill;
mod hits;
mod prepare;
mod rays;

pub use rays::{Group, Packet};

use crate::tile::{LANES, Row};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, f32x16};

/// Number of rays of the largest packet.
pub const MOST: usize = LANES;

/// A packet width: the number of rays and the vector type that holds one number of each.
pub trait Width: Sync {
    /// The vector with one f32 lane per ray.
    type Vector<S: Simd>: SimdFloat<S, Element = f32>;
    /// Number of rays, equal to the number of lanes.
    const RAYS: usize;
}

/// Packets of 4.
#[derive(Debug)]
pub struct Four;

/// Packets of 8.
#[derive(Debug)]
pub struct Eight;

/// Packets of 16.
#[derive(Debug)]
pub struct Sixteen;

impl Width for Four {
    type Vector<S: Simd> = f32x4<S>;
    const RAYS: usize = 4;
}

impl Width for Eight {
    type Vector<S: Simd> = f32x8<S>;
    const RAYS: usize = 8;
}

impl Width for Sixteen {
    type Vector<S: Simd> = f32x16<S>;
    const RAYS: usize = 16;
}

/// Loads the first `L::RAYS` lanes of a row.
#[inline(always)]
pub fn load<S: Simd, L: Width>(simd: S, row: &Row) -> L::Vector<S> {
    L::Vector::from_slice(simd, &row[..L::RAYS])
}

/// Loads one vector per axis.
#[inline(always)]
pub fn load3<S: Simd, L: Width>(simd: S, rows: &[Row; 3]) -> [L::Vector<S>; 3] {
    [
        load::<S, L>(simd, &rows[0]),
        load::<S, L>(simd, &rows[1]),
        load::<S, L>(simd, &rows[2]),
    ]
}

/// Stores a vector into the first `L::RAYS` lanes of a row.
#[inline(always)]
pub fn store<S: Simd, L: Width>(vector: L::Vector<S>, row: &mut Row) {
    vector.store_slice(&mut row[..L::RAYS]);
}

/// Mask of the active lanes, those with `enter <= leave`. A NaN in either bound makes its lane inactive.
#[inline(always)]
pub fn live<S: Simd, L: Width>(enter: L::Vector<S>, leave: L::Vector<S>) -> u64 {
    enter.simd_le(leave).to_bitmask()
}
