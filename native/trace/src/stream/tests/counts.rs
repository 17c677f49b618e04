// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams count their own visits: each ray visits what it visits alone, and shares the visits with others.

use super::answers::All;
use super::trees::{batch, frame_of};
use crate::kernel::Kernel;
use fearless_simd::Level;
use halfspace_oracle::cases::{Random, aimed, cloud, soup, strew};
use halfspace_ray::query::Query;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_scene::Triangles;

/// Trees whose children the octant alone puts in order; in others the first ray of a list does, and decides for the
/// rest which leaves come first.
const ORDERED: [&str; 7] = [
    "axis planes",
    "eight boxes",
    "four boxes",
    "two boxes",
    "intervals",
    "single",
    "octants",
];

/// Counts a batch; the answers are compared with those of the timed kernel.
fn counted<Q: Query>(
    kernel: &dyn Kernel<Q>,
    scene: &Triangles,
    rays: &[Ray],
    blank: Q::Answer,
) -> Vec<RayCounters>
where
    Q::Answer: PartialEq + std::fmt::Debug,
{
    let frame = frame_of(scene);
    let batch = batch(scene, &frame, rays, Level::new());
    let (mut timed, mut found) = (vec![blank; rays.len()], vec![blank; rays.len()]);
    let mut counters = vec![RayCounters::default(); rays.len()];
    kernel.trace(&batch, &mut timed);
    assert!(kernel.count(&batch, &mut found, &mut counters));
    assert_eq!(timed, found);
    counters
}

/// Compares the counters of rays that go together with those of rays that go alone.
fn compare<Q: Query>(
    name: &str,
    kernel: &dyn Kernel<Q>,
    (scene, rays): (&Triangles, &[Ray]),
    blank: Q::Answer,
) where
    Q::Answer: PartialEq + std::fmt::Debug,
{
    let together = counted(kernel, scene, rays, blank);
    let alone: Vec<_> = (rays.iter())
        .flat_map(|ray| counted(kernel, scene, std::slice::from_ref(ray), blank))
        .collect();
    assert!(alone.iter().all(|own| own.joined == 0), "{name}");
    let sum = |all: &[RayCounters], of: fn(&RayCounters) -> u32| all.iter().map(of).sum::<u32>();
    let nodes = |own: &RayCounters| own.steps() + own.leaves;
    assert!(sum(&alone, RayCounters::steps) > 0 && sum(&alone, |own| own.leaves) > 0);
    assert!(
        2 * sum(&together, nodes) < sum(&alone, nodes),
        "{name}: visits are shared"
    );
    if ORDERED.contains(&name) {
        for (own, all) in alone.iter().zip(&together) {
            assert_eq!(own.visits(), all.visits(), "{name}");
            assert_eq!(own.tests, all.tests, "{name}");
            assert_eq!(own.verdicts, all.verdicts, "{name}");
        }
    }
}

#[test]
fn rays_share_the_visits_that_they_make_alone() {
    let mut random = Random(11);
    let scene = soup(cloud(400, 0.2, &mut random));
    let mut rays = aimed(&scene, 600, &mut random);
    strew(&mut rays, 40);
    let all = All::new(&scene);
    for (name, kernel) in &all.closest {
        compare(name, &**kernel, (&scene, &rays), Hit::MISS);
    }
    for (name, kernel) in &all.shadow {
        compare(name, &**kernel, (&scene, &rays), false);
    }
}
