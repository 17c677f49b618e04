// SPDX-License-Identifier: GPL-3.0-or-later
//! One file per structure: its row for the registry, which candidates it proposes, its paper.

pub mod bbox_gs;
pub mod bih;
pub mod bih1;
pub mod bih4;
pub mod bih5;
pub mod bih_bvh;
pub mod bih_n;
pub mod bih_sah;
pub mod brute;
pub mod bvh_sah;
pub mod interval;
pub mod kd;
pub mod kd_sah;
pub mod octree;
pub mod octree_arvo;
pub mod octree_beam;
pub mod octree_glassner;
pub mod octree_net;
pub mod octree_param;
pub mod octree_samet;
