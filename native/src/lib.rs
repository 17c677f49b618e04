// SPDX-License-Identifier: GPL-3.0-or-later
//! Halfspace's native core: acceleration structures for ray tracing, the rays that traverse them, and the renderer on
//! top. One scene, many structures, one identical answer.
//!
//! ```
//! use halfspace::base::{Monitor, error::Result};
//! use halfspace::ray::{Hit, Ray, Tracer};
//! use halfspace::scene::Triangles;
//! use halfspace::{registry, structure::Structure};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<()> {
//! let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let scene = Arc::new(Triangles::new(vertices, vec![[0, 1, 2]])?);
//! let kd = Structure::build(scene, registry::parse("kd")?, 1, &Monitor::new())?;
//! let ray = Ray { o: [0.25, 0.25, 1.0], d: [0.0, 0.0, -1.0], t_min: 0.0, t_max: f32::INFINITY };
//! let mut hits = [Hit::MISS];
//! kd.closest(&[ray], &mut hits, None);
//! assert_eq!((hits[0].t, hits[0].triangle), (1.0, 0));
//! # Ok(())
//! # }
//! ```
//!
//! Each room is a crate, and imports only rooms above it in this list:
//!
//! - [`base`]: errors, memory limits, progress and cancellation;
//! - [`geom`]: vectors, boxes, polytopes, and the exact verdict on one ray and one triangle;
//! - [`scene`]: triangles, and the transforms of instances;
//! - [`ray`]: rays, frames, hits, counters, recordings;
//! - [`leaf`]: triangles in leaves, and their conservative f32 tests;
//! - [`nodes`]: memory layouts of trees;
//! - [`builders`]: the loops that fill nodes;
//! - [`trace`]: what all kernels share; brute force;
//! - [`single`], [`papers`]: kernels of single rays, and those that only papers need;
//! - [`group`]: packets and tiles;
//! - [`stream`]: streams, and rays in flight;
//! - [`beam`]: beams of tiles;
//! - [`polybeam`]: beams of polygons through octrees with links;
//! - [`structure`]: a built tree with the plan of its kernels, and instances;
//! - [`trees`]: one file per family of structures, and their [`registry`];
//! - [`nearest`]: closest points and overlaps of triangles;
//! - [`inspect`]: validation, statistics, polygons, leaf cells, ray paths, export;
//! - [`oracle`]: exact arithmetic, and the scenes of the tests;
//! - [`render`]: camera, sampler, materials, lights, integrator, film.
//!
//! The files that a configuration meets, in order: `trees/registry.rs` finds its row, `structure/spec.rs` reads its
//! values, `structure/effective.rs` refuses those without effect, the family's file in `trees` builds the tree with
//! `builders` and `nodes`, and its table of ways makes the plan (`structure/plan.rs`).
//!
//! The files that a ray of `kd:traversal=dir` meets, in order:
//!
//! 1. `structure/tracer.rs`: the batch, and the kernel of the plan that takes it;
//! 2. `structure/threads.rs`, `trace/batch/single.rs`: chunks on threads, then one ray after the other;
//! 3. `ray/columns.rs`, `ray/frame.rs`, `ray/frame_ray.rs`: the ray in the tree's frame, with error bounds;
//! 4. `single/planes/dir.rs`: the nodes, with `trace/stack.rs` and `nodes/planes/plane_tree.rs`;
//! 5. `leaf/blocks.rs`, `leaf/candidates`: the triangles of a leaf, and the f32 test that rejects most of them;
//! 6. `geom/verdict.rs`: the exact decision on each that is left;
//! 7. `ray/query.rs`: whether it becomes the hit.
//!
//! This crate only re-exports them. The Python module is the crate `python`.

pub use ::{
    halfspace_base as base, halfspace_beam as beam, halfspace_builders as builders,
    halfspace_geom as geom, halfspace_group as group, halfspace_inspect as inspect,
    halfspace_leaf as leaf, halfspace_nearest as nearest, halfspace_nodes as nodes,
    halfspace_oracle as oracle, halfspace_papers as papers, halfspace_polybeam as polybeam,
    halfspace_ray as ray, halfspace_render as render, halfspace_scene as scene,
    halfspace_single as single, halfspace_stream as stream, halfspace_structure as structure,
    halfspace_trace as trace, halfspace_trees as trees,
};
pub use halfspace_trees::registry;
