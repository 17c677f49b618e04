// SPDX-License-Identifier: GPL-3.0-or-later
//! Halfspace's native core: acceleration structures for ray tracing, the rays that walk them, and
//! the renderer on top. One scene, many structures, one identical answer.
//!
//! ```
//! use halfspace_native::build::Monitor;
//! use halfspace_native::scene::Triangles;
//! use halfspace_native::spec::Config;
//! use halfspace_native::structure::Structure;
//! use halfspace_native::traverse::{Hit, Ray, Tracer};
//! use std::sync::Arc;
//!
//! # fn main() -> halfspace_native::error::Result<()> {
//! let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let scene = Arc::new(Triangles::new(vertices, vec![[0, 1, 2]])?);
//! let kd = Structure::build(scene, Config::parse("kd")?, 1, &Monitor::new())?;
//! let ray = Ray { o: [0.25, 0.25, 1.0], d: [0.0, 0.0, -1.0], t_min: 0.0, t_max: f32::INFINITY };
//! let mut hits = [Hit::MISS];
//! kd.closest(&[ray], &mut hits, None);
//! assert_eq!((hits[0].t, hits[0].triangle), (1.0, 0));
//! # Ok(())
//! # }
//! ```
//!
//! The map, from the ground up. Two pairs know each other: a build fills the layout that its walk reads ([`build`],
//! [`traverse`]), and a row of the registry holds its build function ([`registry`], [`trees`], [`structure`]):
//!
//! - [`geom`]: vectors, boxes, and the exact verdict on one ray and one triangle;
//! - [`scene`]: the triangles that every structure indexes;
//! - [`spec`]: configuration strings, `id:key=value,...`;
//! - [`memory`]: how much of it work may take;
//! - [`build`]: the loops that build trees, their cost model, the monitor;
//! - [`traverse`]: the ray, and how it walks a built tree; one file per node layout and way of walking;
//! - [`trees`]: one file per structure: which planes or boxes it proposes, and its paper;
//! - [`registry`]: the only list of structures;
//! - [`structure`]: a built tree over a scene, ready to answer rays;
//! - [`instances`]: meshes with a structure each, placed any number of times; [`outline`]: what a place needs
//!   to know of its mesh;
//! - [`oracle`]: exact arithmetic, what everything else must agree with;
//! - [`validate`]: the invariants of a built tree; [`polygons`]: its planes, for drawing;
//! - [`regions`]: what its nodes cover; [`leaf_cells`]: its leaves, for drawing; [`ray_path`]: the way of a
//!   ray through it; [`leaf_depth`]: how deep the ways end;
//! - [`render`]: camera, sampler, materials, lights, integrator, film;
//! - `python`: the module `halfspace_native` (feature `python`).

pub mod build;
pub mod error;
pub mod geom;
pub mod instances;
pub mod leaf_cells;
pub mod leaf_depth;
pub mod memory;
pub mod oracle;
pub mod outline;
pub mod polygons;
#[cfg(feature = "python")]
mod python;
pub mod ray_path;
pub mod regions;
pub mod registry;
pub mod render;
pub mod scene;
pub mod spec;
pub mod structure;
pub mod traverse;
pub mod trees;
pub mod validate;
