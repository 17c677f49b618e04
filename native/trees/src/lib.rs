// SPDX-License-Identifier: GPL-3.0-or-later
//! One file per family of structures: the rows for the registry, the candidates that they propose, their papers, and the
//! plans of their kernels.

pub mod bbox_gs;
pub mod bih;
pub mod bih_obl;
pub mod boxes;
pub mod brute;
pub mod bsp;
pub mod bvh_hlbvh;
pub mod bvh_ploc;
pub mod bvh_sah;
pub mod grid;
pub mod kd;
pub mod kd_median;
pub mod kd_sah;
pub mod lazy;
pub mod leaf_tests;
pub mod left_out;
pub mod list;
pub mod obb;
pub mod objects;
pub mod octree;
pub mod params;
pub mod planes;
pub mod refit;
pub mod registry;
pub mod ways;
