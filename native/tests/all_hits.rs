// SPDX-License-Identifier: GPL-3.0-or-later
//! All hits of rays, and hits with visible triangles: the same for every structure and traversal as those that the
//! verdict on each triangle alone returns.

mod common;
mod hard;

use common::build;
use halfspace::base::Monitor;
use halfspace::geom::Transform;
use halfspace::geom::verdict::verdict_within;
use halfspace::oracle::cases::{Case, Random, aimed, grid, soup};
use halfspace::ray::counters::Log;
use halfspace::ray::query::{Any, Closest};
use halfspace::ray::rays::Limits;
use halfspace::ray::selection::{Filtered, Gathered};
use halfspace::ray::{Hit, HitKey, Order, Ray, Rays, SelectiveTracer, Tracer};
use halfspace::registry::TREES;
use halfspace::scene::Triangles;
use halfspace::structure::instances::{Instance, Instances};
use halfspace::structure::selective::{self, AllHits, Masks, RayMasks};
use halfspace::structure::way;
use std::cell::RefCell;
use std::sync::Arc;

fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    let bits = |hit: &Hit| {
        [
            hit.t.to_bits(),
            hit.triangle,
            hit.u.to_bits(),
            hit.v.to_bits(),
        ]
    };
    hits.iter().map(bits).collect()
}

/// The hits of one ray by the verdict on every triangle alone, in the order of all hits.
fn expected(scene: &Triangles, ray: &Ray) -> Vec<Hit> {
    let mut hits: Vec<_> = (scene.live().iter())
        .filter_map(|&id| {
            let found = verdict_within(ray.o, ray.d, scene.corners(id), [ray.t_min, ray.t_max])?;
            ray.reaches(found.t).then_some(Hit {
                t: found.t,
                triangle: id,
                u: found.u,
                v: found.v,
            })
        })
        .collect();
    let key = |hit: &Hit| HitKey::new(hit.t, hit.triangle);
    hits.sort_by(|a, b| key(a).order(key(b)));
    hits
}

/// All hits of rays on the calling thread.
fn gathered(tracer: &dyn SelectiveTracer, rays: &[Ray], most: usize) -> Vec<Vec<Hit>> {
    let mut lists = vec![Gathered::new(most); rays.len()];
    let mut each = lists.iter_mut();
    tracer.observe(rays, false, &mut |_, _| (), &mut |_| {
        Log::Hits(each.next().unwrap())
    });
    lists.into_iter().map(Gathered::finish).collect()
}

/// The hits that a filter was asked about, each once and in order, and the answers of the rays.
fn sifted(
    tracer: &dyn Tracer,
    rays: &[Ray],
    filter: impl Fn(&Hit) -> Filtered,
) -> (Vec<Vec<Hit>>, Vec<Hit>) {
    let asked = RefCell::new(vec![Gathered::new(usize::MAX); rays.len()]);
    let mut hits = vec![Hit::MISS; rays.len()];
    tracer.sift(rays, &mut hits, &|i, hit| {
        asked.borrow_mut()[i].add(*hit);
        filter(hit)
    });
    let asked = asked.into_inner().into_iter().map(Gathered::finish);
    (asked.collect(), hits)
}

/// Compares rays that a filter is asked about with all their hits.
fn agree_sifted(tracer: &dyn Tracer, rays: &[Ray], right: &[Vec<Hit>], named: &str) {
    let (asked, hits) = sifted(tracer, rays, |_| Filtered::Passed);
    let (ended, _) = sifted(tracer, rays, |_| Filtered::Ended);
    let (_, odd) = sifted(tracer, rays, |hit| match hit.triangle % 2 {
        0 => Filtered::Passed,
        _ => Filtered::Kept,
    });
    for (i, right) in right.iter().enumerate() {
        let named = format!("{named}: {:?}", rays[i]);
        assert_eq!(bits(&asked[i]), bits(right), "{named}");
        assert!(!hits[i].is_hit(), "{named}");
        assert_eq!(ended[i].is_empty(), right.is_empty(), "{named}");
        let first = right.iter().find(|hit| hit.triangle % 2 == 1);
        let first = first.copied().unwrap_or(Hit::MISS);
        assert_eq!(bits(&[odd[i]]), bits(&[first]), "{named}");
    }
}

/// Every structure with its default traversal and with each of single rays, as lazily built trees too.
fn specs() -> Vec<String> {
    let mut specs = [
        "kd:lazy=1",
        "kd:leaves=scalar",
        "kd:leaves=scalar,mailbox=hashed",
        "bsp-wn:leaves=scalar",
        "bvh-sah:splits=4",
    ]
    .map(str::to_owned)
    .to_vec();
    for tree in TREES {
        specs.push(tree.id.to_owned());
        let ways = tree.ways.iter().zip(tree.spelled_ways());
        specs.extend(
            ways.filter(|(way, _)| way.rays == way::Rays::Single)
                .map(|(_, spec)| spec),
        );
    }
    specs
}

/// Rays as arrays.
struct Arrays {
    origins: Vec<[f32; 3]>,
    directions: Vec<[f32; 3]>,
    t_min: Vec<f32>,
    t_max: Vec<f32>,
}

impl Arrays {
    fn new(rays: &[Ray]) -> Self {
        Self {
            origins: rays.iter().map(|ray| ray.o).collect(),
            directions: rays.iter().map(|ray| ray.d).collect(),
            t_min: rays.iter().map(|ray| ray.t_min).collect(),
            t_max: rays.iter().map(|ray| ray.t_max).collect(),
        }
    }

    fn rays(&self) -> Rays<'_> {
        Rays {
            origins: &self.origins,
            directions: &self.directions,
            t_min: Limits::Each(&self.t_min),
            t_max: Limits::Each(&self.t_max),
            order: Order::None,
            monitor: None,
        }
    }
}

#[test]
fn every_structure_finds_all_hits_on_every_extreme_case() {
    let specs = specs();
    for (
        c,
        Case {
            name, scene, rays, ..
        },
    ) in hard::cases(11).into_iter().enumerate()
    {
        let rays: Vec<_> = rays.into_iter().step_by(9).collect();
        let right: Vec<_> = rays.iter().map(|ray| expected(&scene, ray)).collect();
        // Build a third of the structures over each case; three cases in a row have all.
        for spec in specs
            .iter()
            .skip(c % 3)
            .step_by(3)
            .map(String::as_str)
            .chain(["brute"])
        {
            let structure = build(&scene, spec);
            let found = gathered(&structure, &rays, usize::MAX);
            for ((hits, right), ray) in found.iter().zip(&right).zip(&rays) {
                assert_eq!(bits(hits), bits(right), "{name}, {spec}: {ray:?}");
            }
            agree_sifted(&structure, &rays, &right, &format!("{name}, {spec}"));
        }
    }
}

/// A cloud of triangles, and rays with many hits.
fn crowd() -> (Arc<Triangles>, Vec<Ray>) {
    let scene = soup(grid(12, 0.7));
    let rays = aimed(&scene, 3000, &mut Random(5));
    (scene, rays)
}

#[test]
fn the_nearest_hits_are_the_first_of_all() {
    let (scene, rays) = crowd();
    let arrays = Arrays::new(&rays);
    for spec in [
        "kd",
        "bsp-wn",
        "bih",
        "octree-net",
        "grid",
        "bvh-sah",
        "brute",
    ] {
        let structure = build(&scene, spec);
        let all = selective::all_hits(&structure, arrays.rays(), 2, usize::MAX).unwrap();
        let few = selective::all_hits(&structure, arrays.rays(), 2, 3).unwrap();
        let counts = selective::count_hits(&structure, arrays.rays(), 2).unwrap();
        let mut nearest = vec![Hit::MISS; rays.len()];
        structure.closest(&rays, &mut nearest, None);
        let of = |hits: &AllHits, i: usize| bits(&hits.hits[hits.offsets[i]..hits.offsets[i + 1]]);
        let mut most = 0;
        for (i, nearest) in nearest.iter().enumerate() {
            let (all, few) = (of(&all, i), of(&few, i));
            assert_eq!(counts[i] as usize, all.len(), "{spec}");
            assert_eq!(all[..all.len().min(3)], few, "{spec}");
            let first = if nearest.is_hit() {
                bits(&[*nearest])
            } else {
                Vec::new()
            };
            assert_eq!(all[..all.len().min(1)], first, "{spec}");
            most = most.max(all.len());
        }
        assert!(most > 3, "{spec}: no ray has more hits than are kept");
        let none = selective::all_hits(&structure, arrays.rays(), 1, 0).unwrap();
        assert_eq!(none.hits, [], "{spec}");
    }
}

#[test]
fn rays_meet_the_triangles_that_their_masks_allow() {
    let (scene, rays) = crowd();
    let arrays = Arrays::new(&rays);
    let triangles: Vec<_> = (0..scene.len()).map(|i| 1 << (i * 7 % 5)).collect();
    let own: Vec<_> = (0..rays.len()).map(|i| 1 << (i % 6)).collect();
    for spec in [
        "kd",
        "rbsp-kd",
        "bih",
        "octree-param",
        "kd:nodes=boxes",
        "brute",
    ] {
        let structure = build(&scene, spec);
        let all = gathered(&structure, &rays, usize::MAX);
        let masks = Masks {
            triangles: &triangles,
            rays: RayMasks::Each(&own),
        };
        let nearest = selective::visible::<Closest>(&structure, arrays.rays(), 2, masks).unwrap();
        let blocked = selective::visible::<Any>(&structure, arrays.rays(), 2, masks).unwrap();
        for (i, hits) in all.iter().enumerate() {
            let seen = hits
                .iter()
                .find(|hit| triangles[hit.triangle as usize] & own[i] != 0);
            let right = seen.copied().unwrap_or(Hit::MISS);
            assert_eq!(bits(&[nearest[i]]), bits(&[right]), "{spec}");
            assert_eq!(blocked[i], right.is_hit(), "{spec}");
        }
    }
}

#[test]
fn masks_of_another_length_are_refused_by_name() {
    let (scene, rays) = crowd();
    let (structure, arrays) = (build(&scene, "kd"), Arrays::new(&rays));
    let ones = vec![1; scene.len()];
    for (triangles, rays, name) in [
        (&ones[1..], RayMasks::Same(1), "triangle_mask"),
        (&ones[..], RayMasks::Each(&ones[..1]), "ray_mask"),
    ] {
        let masks = Masks { triangles, rays };
        let refused = selective::visible::<Any>(&structure, arrays.rays(), 1, masks).unwrap_err();
        assert!(refused.to_string().contains(name), "{refused}");
    }
}

#[test]
fn instances_have_the_hits_of_the_flattened_scene() {
    let meshes = vec![
        Arc::new(build(&soup(grid(3, 0.8)), "bvh-sah")),
        Arc::new(build(&soup(grid(2, 0.6)), "kd")),
    ];
    let instances: Vec<_> = (0..6)
        .map(|i| {
            let s = if i % 2 == 0 { 1.0 } else { -0.7 };
            Instance {
                mesh: i % 2,
                transform: Transform {
                    linear: [[s, 0.2, 0.0], [0.0, 1.0, -0.3], [0.1, 0.0, 1.1]],
                    offset: [0.9 * f64::from(i), 0.1 * f64::from(i), 0.0],
                },
            }
        })
        .collect();
    let instances = Instances::build(meshes, &instances, &Monitor::new()).unwrap();
    let (vertices, indices) = instances.flattened().unwrap();
    let scene = Arc::new(Triangles::new(vertices, indices).unwrap());
    let rays = aimed(&scene, 1500, &mut Random(9));
    let right = gathered(&build(&scene, "brute"), &rays, usize::MAX);
    assert!(right.iter().any(|hits| hits.len() > 4));
    let found = gathered(&instances, &rays, usize::MAX);
    for (found, right) in found.iter().zip(&right) {
        assert_eq!(bits(found), bits(right));
    }
    agree_sifted(&instances, &rays, &right, "instances");
    // Hide every third triangle, also from any-hit rays.
    let arrays = Arrays::new(&rays);
    let triangles: Vec<_> = (0..scene.len()).map(|i| u32::from(i % 3 != 0)).collect();
    let masks = Masks {
        triangles: &triangles,
        rays: RayMasks::Same(1),
    };
    let blocked = selective::visible::<Any>(&instances, arrays.rays(), 1, masks).unwrap();
    for (blocked, right) in blocked.iter().zip(&right) {
        assert_eq!(*blocked, right.iter().any(|hit| hit.triangle % 3 != 0));
    }
}
