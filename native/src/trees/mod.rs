// SPDX-License-Identifier: GPL-3.0-or-later
//! One file per structure: its row for the registry, which candidates it proposes, its paper.

pub mod brute;
pub mod bvh_sah;
pub mod kd;
pub mod kd_sah;
