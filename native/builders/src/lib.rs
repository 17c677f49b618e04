// SPDX-License-Identifier: GPL-3.0-or-later
//! The builders of trees. A structure supplies only a policy that proposes candidates; the loops are shared.

pub mod binned;
pub mod global;
pub mod grid;
pub mod grid_order;
pub mod groups;
pub mod hlbvh;
pub mod insertion;
pub mod middle;
mod morton;
pub mod object;
pub mod octree;
pub mod piece;
pub mod plane_boxes;
pub mod plane_objects;
pub mod ploc;
mod reach;
pub mod refit;
pub mod sides;
pub mod slanted;
pub mod slanted_split;
pub mod space;
pub mod spatial;
pub mod sweep;
