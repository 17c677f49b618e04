// SPDX-License-Identifier: GPL-3.0-or-later
//! Builds a kd-tree over four triangles, traces one ray and prints its nearest hit: `cargo run --example minimal`.

use halfspace::base::{Monitor, error::Error};
use halfspace::ray::{Hit, Ray, Tracer};
use halfspace::scene::Triangles;
use halfspace::{registry, structure::Structure};
use std::sync::Arc;

fn main() -> Result<(), Error> {
    // A tetrahedron: four vertices, four triangles by the numbers of their vertices.
    let vertices = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let scene = Arc::new(Triangles::new(vertices, triangles)?);
    let structure = Structure::build(scene, registry::parse("kd")?, 1, &Monitor::new())?;

    let ray = Ray {
        o: [0.25, 0.25, 2.0],
        d: [0.0, 0.0, -1.0],
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let mut hits = [Hit::MISS];
    structure.closest(&[ray], &mut hits, None);

    let hit = hits[0];
    assert!(hit.is_hit());
    println!(
        "triangle {} at t = {}, u = {}, v = {}",
        hit.triangle, hit.t, hit.u, hit.v
    );
    println!("the tree takes {} bytes", structure.bytes());
    Ok(())
}
