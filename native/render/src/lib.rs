// SPDX-License-Identifier: GPL-3.0-or-later
//! The renderer: camera, sampler, integrator, film. It traces rays through [`halfspace_ray::ray::Tracer`] only and
//! does not depend on any tree type.
//!
//! From the bottom up:
//! - [`vector`], [`trig`], [`check`]: f32 vectors and frames; sines; input checks whose errors name the key;
//! - [`sampler`], [`filter`], [`lens`], [`camera`]: random numbers, the pixel filter, camera rays;
//! - [`image`], [`noise`], [`node_math`], [`place`], [`program`]: values that vary over a surface;
//! - [`fresnel`], [`ggx`], [`albedo`], [`closure`], [`material`], [`bsdf`]: scattering at surfaces;
//! - [`light_shapes`], [`light_tree`], [`world`], [`lights`]: light sources and how they are sampled;
//! - [`visibility`]: which kinds of rays see an object or a light;
//! - [`attributes`]: per-triangle data of a flattened scene or of instances;
//! - [`scene`], [`indices`], [`features`], [`surface`]: the scene, the features it needs, one surface point;
//! - [`path`], [`integrator`], [`shade`], [`shadow_rays`]: paths, their rays in batches, shading at the hits,
//!   occlusion of light samples;
//! - [`settings`], [`film`], [`adaptive`], [`work`], [`calls`], [`job`]: settings, accumulation and scheduling of a
//!   render.
//!
//! The image is a pure function of scene, camera and settings: every random number is a hash of (pixel, seed,
//! dimension, sample), the samples of a pixel are added in order, and all structures return bit-identical hits. So
//! neither the structure nor the number of threads changes any pixel.

pub mod adaptive;
pub mod albedo;
pub mod attributes;
pub mod bsdf;
pub mod calls;
pub mod camera;
pub mod check;
pub mod closure;
pub mod features;
pub mod film;
pub mod filter;
pub mod fresnel;
pub mod ggx;
pub mod image;
pub mod indices;
pub mod integrator;
pub mod job;
pub mod lens;
pub mod light_shapes;
pub mod light_tree;
pub mod lights;
pub mod material;
pub mod node_math;
pub mod noise;
pub mod path;
pub mod place;
pub mod program;
pub mod sampler;
pub mod scene;
pub mod settings;
mod shade;
mod shadow_rays;
pub mod surface;
pub mod trig;
pub mod vector;
pub mod visibility;
pub mod work;
pub mod world;

#[cfg(test)]
mod tests;
