// SPDX-License-Identifier: GPL-3.0-or-later
//! The loops that build trees. They name no tree: a structure answers one question of theirs
//! ("which planes would you try at this node?") and everything else is shared.

pub mod binned;
pub mod cell;
pub mod clip;
pub mod cost;
pub mod footprint;
pub mod monitor;
pub mod object;
pub mod object_tree;
pub mod octree;
pub mod octree_nodes;
pub mod overlap;
pub mod plane_tree;
pub mod preorder;
pub mod space;
pub mod sweep;

pub use monitor::Monitor;
