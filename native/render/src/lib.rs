// SPDX-License-Identifier: GPL-3.0-or-later
//! The renderer: camera, sampler, integrator, film. It traces rays through [`halfspace_ray::ray::Tracer`] only and
//! does not depend on any tree type.
//!
//! Each room imports only rooms above it:
//! - [`check`]: input checks whose errors name the key;
//! - [`math`]: vectors, sines, random numbers, Fresnel's equations;
//! - [`camera`]: camera rays, the lens, the pixel filter;
//! - [`values`]: programs, images and attributes that vary over a surface;
//! - [`medium`]: scattering inside volumes;
//! - [`material`]: scattering at surfaces;
//! - [`light`]: light sources, the background, and how they are sampled;
//! - [`scene`]: the scene, the features it needs, one surface point;
//! - [`settings`]: settings and passes of a render;
//! - [`film`]: accumulation of samples, adaptive sampling;
//! - [`path`]: paths, their rays in batches, shading at the hits, occlusion of light samples;
//! - [`job`]: the threads of a render, its progress and its end.
//!
//! The image is a pure function of scene, camera and settings: every random number is a hash of (pixel, seed,
//! dimension, sample), the samples of a pixel are added in order, and all structures return bit-identical hits. So
//! neither the structure nor the number of threads changes any pixel.

pub mod camera;
pub mod check;
pub mod film;
pub mod job;
pub mod light;
pub mod material;
pub mod math;
pub mod medium;
pub mod path;
pub mod scene;
pub mod settings;
pub mod values;

#[cfg(test)]
mod tests;
