// SPDX-License-Identifier: GPL-3.0-or-later
//! One file per structure: its row for the registry, which candidates it proposes, its paper.

pub mod bbox_gs;
pub mod beam_hh;
pub mod bih;
pub mod bih1;
pub mod bih4;
pub mod bih5;
pub mod bih_bvh;
pub mod bih_n;
pub mod bih_obl;
pub mod bih_sah;
pub mod brute;
pub mod bsp;
pub mod bsp_cn;
pub mod bsp_cn_axial;
pub mod bsp_hybrid;
pub mod bsp_ize;
pub mod bsp_random;
pub mod bsp_wn;
pub mod bsp_wn_area;
pub mod bvh_sah;
pub mod grid;
pub mod interval;
pub mod kd;
pub mod kd_median;
pub mod kd_sah;
pub mod lazy;
pub mod octree;
pub mod octree_arvo;
pub mod octree_beam;
pub mod octree_glassner;
pub mod octree_net;
pub mod octree_param;
pub mod octree_samet;
pub mod rbsp;

/// What hierarchies of objects leave out, whatever the scene.
const NO_PLANES: &str = "split planes: this structure parts triangles, not space";
