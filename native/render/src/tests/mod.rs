// SPDX-License-Identifier: GPL-3.0-or-later
//! Whole renders against closed forms, against Cycles, and against each other.

mod brightness;
mod brute_force;
mod failures;
mod filter;
mod hair;
mod left_out;
mod light_passes;
mod motion;
mod negative;
mod passes;
mod programs_ahead;
mod record;
mod same_picture;
mod secondary_beams;
pub(crate) mod setup;
mod shadow_catchers;
mod shadows;
mod subsurface;
mod surfaces;
mod volumes;
