// SPDX-License-Identifier: GPL-3.0-or-later
//! The mathematics of rendering: vectors, sines, random numbers, Fresnel's equations.

pub mod erf;
pub mod fresnel;
pub mod sampler;
pub mod trig;
pub mod vector;
