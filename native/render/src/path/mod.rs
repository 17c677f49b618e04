// SPDX-License-Identifier: GPL-3.0-or-later
//! Paths of light: their rays in batches, shading at the hits, occlusion of light samples.

pub mod beams;
pub mod calls;
pub mod media;
pub mod points;
pub mod random;
pub mod record;
mod shade;
mod shadow_rays;
pub mod state;
pub mod walk;
pub mod wavefront;
pub mod work;
