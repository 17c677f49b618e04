// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams count their own visits: each ray visits what it visits alone, and shares the visits with others.

use super::answers::All;
use super::trees::{batch, frame_of};
use crate::kernel::Kernel;
use crate::stream::OCTANTS;
use crate::stream::lists::small;
use fearless_simd::Level;
use halfspace_oracle::cases::{Random, aimed, cloud, soup, strew};
use halfspace_ray::query::Query;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_scene::Triangles;

/// Trees whose children the octant alone puts in order; in others the first ray of a list does, and decides for the
/// rest which leaves come first.
const ORDERED: [&str; 11] = [
    "axis planes",
    "eight boxes",
    "four boxes",
    "two boxes",
    "intervals",
    "single",
    "octants",
    "two intervals",
    "four intervals",
    "eight intervals",
    "cells",
];

/// Number of times that each ray is sent.
const COPIES: usize = 4;

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

/// Number of visits to nodes and leaves that these rays pay for.
fn paid(all: &[RayCounters]) -> u32 {
    all.iter().map(|own| own.steps() + own.leaves).sum()
}

/// Number of visits that these rays share with another ray, which pays.
fn shared(all: &[RayCounters]) -> u32 {
    all.iter().map(|own| own.joined).sum()
}

/// Compares the counters of rays that go together with those of rays that go alone, and with those of the same rays,
/// each sent several times.
fn compare<Q: Query>(
    name: &str,
    kernel: &dyn Kernel<Q>,
    scene: &Triangles,
    rays: &[Ray],
    blank: Q::Answer,
) where
    Q::Answer: PartialEq + std::fmt::Debug,
{
    let together = counted(kernel, scene, rays, blank);
    let alone: Vec<_> = (rays.iter())
        .flat_map(|ray| counted(kernel, scene, std::slice::from_ref(ray), blank))
        .collect();
    assert!(alone.iter().all(|own| own.joined == 0), "{name}");
    assert!(alone.iter().any(|own| own.steps() > 0) && alone.iter().any(|own| own.leaves > 0));
    // Alone, each ray pays for its visit to the root; together, one ray of an octant does.
    let at_root: u32 = alone.iter().map(|own| u32::from(own.steps() > 0)).sum();
    assert!(at_root > 100, "{name}: {at_root} rays enter the tree");
    assert!(
        paid(&together) + at_root <= paid(&alone) + small(OCTANTS),
        "{name}: visits are shared"
    );
    // Equal rays visit the same nodes: the first pays, the others join.
    let repeated: Vec<_> = rays.iter().flat_map(|&ray| [ray; COPIES]).collect();
    let repeated = counted(kernel, scene, &repeated, blank);
    assert_eq!(paid(&repeated), paid(&together), "{name}: equal rays");
    let visits = paid(&together) + shared(&together);
    assert_eq!(
        paid(&repeated) + shared(&repeated),
        small(COPIES) * visits,
        "{name}: equal rays"
    );
    if ORDERED.contains(&name) {
        assert_eq!(visits, paid(&alone), "{name}: a visit is paid or shared");
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
        compare(name, &**kernel, &scene, &rays, Hit::MISS);
    }
    for (name, kernel) in &all.shadow {
        compare(name, &**kernel, &scene, &rays, false);
    }
}

/// Packets and tiles count what they do, and find the same.
#[test]
fn packets_and_tiles_count_themselves() {
    let mut random = Random(12);
    let scene = soup(cloud(400, 0.2, &mut random));
    let mut rays = aimed(&scene, 600, &mut random);
    strew(&mut rays, 40);
    let groups = All::new(&scene).groups;
    let spent = |all: &[RayCounters]| (paid(all), all.iter().map(|own| own.tests).sum::<u32>());
    for (name, kernel) in &groups.closest {
        let (visits, tests) = spent(&counted(&**kernel, &scene, &rays, Hit::MISS));
        assert!(kernel.counts() && visits > 600 && tests > 600, "{name}");
    }
    for (name, kernel) in &groups.shadow {
        let (visits, tests) = spent(&counted(&**kernel, &scene, &rays, false));
        assert!(kernel.counts() && visits > 600 && tests > 600, "{name}");
    }
}
