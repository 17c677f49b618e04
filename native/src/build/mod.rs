// SPDX-License-Identifier: GPL-3.0-or-later
//! The loops that build trees. They name no tree: a structure answers one question of theirs
//! ("which planes would you try at this node?") and everything else is shared.

pub mod binned;
pub mod cell;
pub mod clip;
pub mod cost;
pub mod footprint;
pub mod global;
pub mod grid;
pub mod grid_order;
pub mod groups;
pub mod insertion;
pub mod lazy_tree;
pub mod leaves;
pub mod monitor;
pub mod object;
pub mod object_tree;
mod oblique_part;
pub mod octree;
pub mod octree_nodes;
pub mod overlap;
pub mod piece;
pub mod plane_objects;
pub mod plane_tree;
pub mod polytope;
pub mod preorder;
pub mod profile;
pub mod ropes;
pub mod shape;
pub mod slanted;
mod slanted_split;
pub mod slanted_tree;
pub mod space;
pub mod sweep;
pub mod tighten;

pub use monitor::{Held, Monitor};
