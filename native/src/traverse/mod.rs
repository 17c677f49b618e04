// SPDX-License-Identifier: GPL-3.0-or-later
//! How rays walk a built tree: one file per way of walking.
//!
//! The fast path runs in f32 and only ever *rejects*: a cell, a child or a triangle is skipped
//! when the error bounds prove that the ray cannot hit anything there. Whatever survives is put
//! to [`crate::geom::verdict`], which decides exactly. So a walk may be as quick and as inexact
//! as its bounds allow, and the answer is still the same for all of them.

pub mod batch;
pub mod block_boxes;
pub mod blocks;
pub mod bound;
pub mod box_flight;
pub mod box_packet;
pub mod box_tile;
pub mod box_tree;
pub mod bundle;
mod candidates;
pub mod cases;
pub mod dop_tree;
mod eight;
pub mod first_hit;
pub mod flight;
pub mod frame;
mod frame_ray;
pub mod frame_rows;
pub mod grid_step;
pub mod keep;
pub mod lanes;
mod late;
pub mod light_cube;
pub mod nested;
pub mod objects;
pub mod octree_beam;
pub mod octree_glassner;
pub mod octree_net;
pub mod octree_param;
pub mod octree_samet;
pub mod octree_step;
pub mod packet;
pub mod packet_leaf;
pub mod packet_walk;
pub mod path;
pub mod pending;
pub mod place;
pub mod plane_arvo;
pub mod plane_beam;
pub mod plane_boxes;
pub mod plane_dir;
pub mod plane_origin;
pub mod plane_packet;
pub mod plane_rope;
pub mod plane_seq;
pub mod plane_seq_1985;
pub mod plane_sung;
pub mod plane_ta_a;
pub mod plane_ta_b;
pub mod plane_ta_b_1997;
pub mod plane_ta_b_poly;
pub mod plane_tile;
pub mod plane_wide;
pub mod planes;
pub mod query;
pub mod ray;
pub mod reorder;
pub mod replay;
pub mod shadow_beam;
pub mod shadow_cache;
mod shadow_tile;
pub mod shaft;
pub mod shaft_tree;
pub mod slab_boxes;
pub mod slab_node;
pub mod slab_tree;
pub mod slab_wide;
pub mod slant_tree;
mod stream;
pub mod tile;
pub mod tile_leaf;
mod tile_nearest;
mod tile_verdict;
pub mod tile_walk;
pub mod view;
pub mod wide_tree;

pub use ray::Order;
pub use ray::{Hit, Ray, RayCounters, Tracer};
pub use stream::STREAM;
