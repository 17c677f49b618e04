// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through hierarchies of objects.

pub mod boxes;
pub mod dops;
pub mod intervals;
pub mod obb;
pub mod slab_boxes;
pub mod slabs;
pub mod slanted;
pub mod wide_slabs;
