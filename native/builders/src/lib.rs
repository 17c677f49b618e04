// SPDX-License-Identifier: GPL-3.0-or-later
//! The loops that fill nodes. A structure only proposes candidates; everything else is shared.

pub mod binned;
pub mod global;
pub mod grid;
pub mod grid_order;
pub mod groups;
pub mod insertion;
pub mod object;
pub mod octree;
pub mod piece;
pub mod plane_boxes;
pub mod plane_objects;
pub mod slanted;
pub mod slanted_split;
pub mod space;
pub mod sweep;
