// SPDX-License-Identifier: GPL-3.0-or-later
//! One file per structure: its row for the registry, which candidates it proposes, its paper.

pub mod bih;
pub mod brute;
pub mod bvh_sah;
pub mod kd;
pub mod kd_sah;
pub mod octree;
pub mod octree_arvo;
pub mod octree_beam;
pub mod octree_glassner;
pub mod octree_net;
pub mod octree_param;
pub mod octree_samet;
