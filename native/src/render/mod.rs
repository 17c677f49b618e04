// SPDX-License-Identifier: GPL-3.0-or-later
//! The renderer: camera, sampler, integrator, film. It sees [`crate::traverse::Tracer`] only, never
//! a tree type.
//!
//! From the ground up:
//! - [`vector`], [`trig`], [`check`]: f32 vectors and frames; sines; checks that name the key;
//! - [`sampler`], [`filter`], [`lens`], [`camera`]: random numbers, the pixel filter, camera rays;
//! - [`image`], [`noise`], [`node_math`], [`place`], [`program`]: values that vary over a surface;
//! - [`fresnel`], [`ggx`], [`albedo`], [`closure`], [`material`], [`bsdf`]: what surfaces do with
//!   light;
//! - [`light_shapes`], [`light_tree`], [`world`], [`lights`]: where light comes from;
//! - [`visibility`]: which rays see what;
//! - [`attributes`]: what triangles carry, of a flattened scene or of instances;
//! - [`scene`], [`indices`], [`features`], [`surface`]: the scene, what it needs, a point of it;
//! - [`path`], [`integrator`], [`shade`], [`shadow_rays`]: paths, their rays in batches, what happens where they
//!   hit, whether light arrives there;
//! - [`settings`], [`film`], [`adaptive`], [`work`], [`calls`], [`job`]: the render itself.
//!
//! The image is a pure function of scene, camera and settings: every random number is a hash of
//! (pixel, seed, dimension, sample), a pixel's samples are added in order, and structures answer
//! alike bit for bit. So neither the structure nor the number of threads changes any pixel.

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
