// SPDX-License-Identifier: GPL-3.0-or-later
//! Prints what every structure answers, as one number per structure and instruction set, so that two machines can be
//! compared: `cargo run --release --example answers [RAYS]`.
//!
//! Each line holds the structure, the instruction set, the number of rays and of hits, the bytes of the tree, and a
//! hash of all bits of all answers. The scene and the rays consist of additions and multiplications in f32, which IEEE
//! 754 defines to the last bit: a line differs between machines only if the structure or its answers do. Ends with an
//! error if two structures, or two instruction sets, differ on this machine.

use halfspace::base::{Monitor, simd};
use halfspace::oracle::cases::{Random, aimed, cloud, everywhere, grid, lattice_rays, soup};
use halfspace::ray::{Hit, Ray, Tracer};
use halfspace::registry;
use halfspace::scene::Triangles;
use halfspace::structure::{Structure, tracer::AtLevel};
use rayon::prelude::*;
use std::error::Error;
use std::sync::Arc;

/// Rays per call: whole packets and tiles, and enough calls for all threads.
const BATCH: usize = 4096;

/// Triangles in general position around the origin, next to cubes whose faces, edges and corners coincide.
fn scene() -> Arc<Triangles> {
    let mut corners = cloud(1_500, 0.2, &mut Random(1));
    corners.extend(grid(4, 0.0));
    soup(corners)
}

/// Half of the rays start and point anywhere, a quarter aim at vertices and edges, a quarter follow the faces of cubes.
fn rays(scene: &Triangles, count: usize) -> Vec<Ray> {
    let mut random = Random(2);
    let quarter = count / 4;
    let mut rays = aimed(scene, quarter, &mut random);
    rays.extend(lattice_rays(4, &mut random, quarter));
    rays.extend(everywhere(count - 2 * quarter, &mut random));
    rays
}

/// The nearest hit of each ray, and whether anything is hit.
fn answers(tracer: &AtLevel<'_>, rays: &[Ray]) -> (Vec<Hit>, Vec<bool>) {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    (rays.par_chunks(BATCH))
        .zip(hits.par_chunks_mut(BATCH))
        .zip(occluded.par_chunks_mut(BATCH))
        .for_each(|((rays, hits), occluded)| {
            tracer.closest(rays, hits, None);
            tracer.occluded(rays, occluded, None);
        });
    (hits, occluded)
}

/// FNV-1a over the bits of all answers, 32 bits at a time.
fn hash(hits: &[Hit], occluded: &[bool]) -> u64 {
    let words = hits.iter().zip(occluded).flat_map(|(hit, any)| {
        let numbers = [hit.t, hit.u, hit.v].map(f32::to_bits);
        [
            numbers[0],
            numbers[1],
            numbers[2],
            hit.triangle,
            (*any).into(),
        ]
    });
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
        (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let count = std::env::args()
        .nth(1)
        .map_or(Ok(1_000_000), |n| n.parse())?;
    let scene = scene();
    let rays = rays(&scene, count);
    let mut reference = None;
    for tree in registry::TREES {
        let config = registry::parse(tree.id)?;
        let structure = Structure::build(scene.clone(), config, 1, &Monitor::new())?;
        for (name, level) in simd::levels() {
            let (hits, occluded) = answers(&structure.at_level(level), &rays);
            let found = hits.iter().filter(|hit| hit.is_hit()).count();
            let hash = hash(&hits, &occluded);
            let (id, bytes) = (tree.id, structure.bytes());
            println!("{id:<20} {name:<8} {count} {found} {bytes} {hash:016x}");
            if *reference.get_or_insert(hash) != hash {
                return Err(
                    format!("{id} on {name} answers otherwise than the lines above").into(),
                );
            }
        }
    }
    Ok(())
}
