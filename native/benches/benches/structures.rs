// SPDX-License-Identifier: GPL-3.0-or-later
//! Build and trace times of every structure on one generated scene: first its answers are proved
//! equal to brute force, then it is timed.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use halfspace::base::Monitor;
use halfspace::oracle::cases::{Random, aimed, grid, ray, soup};
use halfspace::ray::{Hit, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::structure::Structure;
use std::hint::black_box;

fn structures(criterion: &mut Criterion) {
    let scene = soup(grid(16, 0.3));
    let random = &mut Random(1);
    // Coherent: a pinhole view. Incoherent: rays between random corners of the scene.
    let coherent: Vec<_> = (0..1 << 14)
        .map(|i| {
            let (x, y) = ((i % 128) as f32 / 64.0 - 1.0, (i / 128) as f32 / 64.0 - 1.0);
            ray([8.0, -20.0, 8.0], [x, 2.0, y])
        })
        .collect();
    let incoherent = aimed(&scene, 1 << 14, random);
    let sets = [("coherent", coherent), ("incoherent", incoherent)];
    let build = |id: &str| {
        Structure::build(
            scene.clone(),
            registry::parse(id).unwrap(),
            1,
            &Monitor::new(),
        )
        .unwrap()
    };
    let closest = |structure: &Structure, rays: &[_]| {
        let mut hits = vec![Hit::MISS; rays.len()];
        structure.closest(rays, &mut hits, None);
        hits
    };
    let brute = build("brute");
    let proof: Vec<_> = sets
        .iter()
        .map(|(_, rays)| closest(&brute, &rays[..2000]))
        .collect();
    for tree in TREES.iter().filter(|tree| tree.id != "brute") {
        let structure = build(tree.id);
        for ((name, rays), reference) in sets.iter().zip(&proof) {
            assert!(
                closest(&structure, &rays[..2000]) == *reference,
                "{}, {name}",
                tree.id
            );
            let mut group = criterion.benchmark_group(*name);
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.bench_function(tree.id, |b| b.iter(|| black_box(closest(&structure, rays))));
        }
        criterion.bench_function(&format!("build/{}", tree.id), |b| b.iter(|| build(tree.id)));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = structures
}
criterion_main!(benches);
