// SPDX-License-Identifier: GPL-3.0-or-later
//! The contract of every structure, for every row of the registry and every traversal: the hits of brute force bit
//! for bit, valid trees, the same tree on any number of threads.

mod all_ways;
#[path = "common/cores.rs"]
mod cores;
mod far_scenes;
mod hard;
#[path = "hard/turns.rs"]
mod turns;
mod watertight;

use all_ways::{specs, with};
use cores::on_all_cores;
use halfspace::base::Monitor;
use halfspace::base::error::Error;
use halfspace::inspect::validate::validate;
use halfspace::oracle::cases::{Case, Random, aimed, grid, lattice_rays, ray, soup};
use halfspace::oracle::{exact_closest, levels};
use halfspace::ray::{Hit, Ray, RayCounters, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::row::{Kind, Only};
use halfspace::structure::way::{NODES, TRAVERSAL};
use std::sync::Arc;

/// Builds a structure; its tree is kept where brute force would be less work.
fn build(scene: &Arc<Triangles>, spec: &str, threads: usize) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build_kept(scene.clone(), config, threads, &Monitor::new()).unwrap()
}

fn closest(structure: &Structure, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    structure.closest(rays, &mut hits, None);
    hits
}

fn same(a: &Hit, b: &Hit) -> bool {
    a.triangle == b.triangle
        && [(a.t, b.t), (a.u, b.u), (a.v, b.v)]
            .iter()
            .all(|(x, y)| x.to_bits() == y.to_bits())
}

/// Returns the number of rays whose nearest hit or any hit differs from the reference.
fn differences(tracer: &impl Tracer, rays: &[Ray], reference: &[Hit]) -> usize {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    tracer.closest(rays, &mut hits, None);
    tracer.occluded(rays, &mut occluded, None);
    hits.iter()
        .zip(reference)
        .zip(&occluded)
        .filter(|((hit, expected), occluded)| {
            !same(hit, expected) || **occluded != expected.is_hit()
        })
        .count()
}

/// Whether a configuration chooses only how rays go through a tree that another one has too.
fn of_rays(spec: &str) -> bool {
    spec.contains("traversal=") || spec.contains("leaves=")
}

#[test]
fn every_structure_answers_like_brute_force() {
    // Run the cases on all cores: this is the longest of all tests.
    let (specs, sets) = (specs(), levels());
    let cases: Vec<_> = hard::cases(7).into_iter().enumerate().collect();
    on_all_cores(cases, |(c, case)| {
        let Case {
            name, scene, rays, ..
        } = case;
        let reference = closest(&build(&scene, "brute", 1), &rays);
        for (i, spec) in specs.iter().enumerate() {
            // Where a machine is emulated, each way through a tree meets every second case.
            if hard::share() > 1 && of_rays(spec) && (c + i) % 2 == 1 {
                continue;
            }
            // Trace a third of the rays, another third for the next specification.
            let third = i % 3;
            let rays: Vec<_> = rays.iter().copied().skip(third).step_by(3).collect();
            let reference: Vec<_> = reference.iter().copied().skip(third).step_by(3).collect();
            let structure = build(&scene, spec, 1);
            assert_eq!(validate(&structure), Vec::<String>::new(), "{name}, {spec}");
            let wrong = differences(&structure, &rays, &reference);
            assert_eq!(wrong, 0, "{name}, {spec}: of {} rays", rays.len());
            // Trace some of the rays on each instruction set.
            let some: Vec<_> = rays.iter().copied().step_by(8).collect();
            let expected: Vec<_> = reference.iter().copied().step_by(8).collect();
            for (set, level) in turns::in_turn(&sets, c / 2 + i) {
                let wrong = differences(&structure.at_level(*level), &some, &expected);
                assert_eq!(wrong, 0, "{name}, {spec}, {set}: of {} rays", some.len());
            }
        }
    });
}

#[test]
fn brute_force_answers_like_exact_arithmetic() {
    for Case {
        name, scene, rays, ..
    } in hard::cases(7)
    {
        let step = (rays.len() / 250).max(1);
        let rays: Vec<_> = rays.into_iter().step_by(step).collect();
        let hits = closest(&build(&scene, "brute", 1), &rays);
        for (ray, hit) in rays.iter().zip(&hits) {
            let exact = exact_closest(&scene, ray).hit;
            assert!(same(hit, &exact), "{name}: {ray:?} {hit:?} {exact:?}");
        }
    }
}

#[test]
fn the_ray_interval_is_closed() {
    let scene = soup(grid(3, 0.2));
    let mut rays = aimed(&scene, 400, &mut Random(3));
    let hits = closest(&build(&scene, "brute", 1), &rays);
    for spec in specs() {
        let structure = build(&scene, &spec, 1);
        for (ray, hit) in rays.iter_mut().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
            let mut within = |t_min: f32, t_max: f32| {
                (ray.t_min, ray.t_max) = (t_min, t_max);
                closest(&structure, std::slice::from_ref(ray))[0]
            };
            assert!(
                same(&within(hit.t, hit.t), hit),
                "{spec}: t_min = t_max = t"
            );
            assert!(same(&within(0.0, hit.t), hit), "{spec}: t_max = t");
            assert!(
                !within(0.0, hit.t.next_down()).is_hit() || hit.t == 0.0,
                "{spec}: t_max below t"
            );
            assert!(
                within(hit.t.next_up(), f32::INFINITY).t > hit.t,
                "{spec}: t_min above t"
            );
            assert!(
                !within(hit.t.next_up(), hit.t).is_hit(),
                "{spec}: t_min above t_max"
            );
        }
    }
}

#[test]
fn scaled_directions_hit_the_same_triangle() {
    let scene = soup(grid(3, 0.4));
    let rays = aimed(&scene, 300, &mut Random(5));
    for spec in specs() {
        let structure = build(&scene, &spec, 1);
        let hits = closest(&structure, &rays);
        for power in [-60, -20, 20, 60] {
            let scale = 2.0_f32.powi(power);
            let scaled: Vec<_> = rays
                .iter()
                .map(|r| Ray {
                    d: r.d.map(|x| x * scale),
                    ..*r
                })
                .collect();
            for (hit, expected) in closest(&structure, &scaled).iter().zip(&hits) {
                assert_eq!(hit.triangle, expected.triangle, "{spec}: 2^{power}");
                assert_eq!(hit.t * scale, expected.t, "{spec}: 2^{power}");
            }
        }
    }
}

#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    // Large enough for several tasks.
    let scene = soup(grid(7, 0.3));
    for spec in specs() {
        let (one, two, again) = (
            build(&scene, &spec, 1),
            build(&scene, &spec, 2),
            build(&scene, &spec, 2),
        );
        for other in [&two, &again] {
            assert!(one.built().same_nodes(other.built()), "{spec}: nodes");
            assert!(one.built().leaves == other.built().leaves, "{spec}: leaves");
        }
    }
}

#[test]
fn counting_changes_no_answer() {
    let scene = soup(grid(4, 0.0));
    let rays = lattice_rays(4, &mut Random(9), 500);
    for spec in specs() {
        let structure = build(&scene, &spec, 1);
        let plain = closest(&structure, &rays);
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.closest(&rays, &mut hits, Some(&mut counters));
        assert!(hits.iter().zip(&plain).all(|(a, b)| same(a, b)), "{spec}");
        let verdicts: u32 = counters.iter().map(|c| c.verdicts).sum();
        let found = hits.iter().filter(|h| h.is_hit()).count();
        assert!(
            verdicts as usize >= found,
            "{spec}: every hit had its verdict"
        );
    }
}

#[test]
fn zero_and_nan_directions_hit_nothing() {
    let scene = soup(grid(2, 0.0));
    for spec in specs() {
        let structure = build(&scene, &spec, 1);
        for d in [[0.0; 3], [-0.0, 0.0, -0.0], [f32::NAN, 1.0, 0.0]] {
            assert!(
                !closest(&structure, &[ray([0.5, 0.5, 0.5], d)])[0].is_hit(),
                "{spec}: {d:?}"
            );
        }
        assert!(
            !closest(&structure, &[ray([f32::NAN; 3], [1.0; 3])])[0].is_hit(),
            "{spec}"
        );
    }
}

#[test]
fn large_leaves_are_counted() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let scene = Triangles::new(corners.to_vec(), vec![[0, 1, 2]; 100]).unwrap();
    let scene = Arc::new(scene);
    let mut large = 0;
    for tree in TREES {
        let shape = build(&scene, tree.id, 1).shape();
        // The triangles coincide, so a spatial subdivision ends with all of them in one leaf or in several.
        let expected = shape.leaf_max > 64;
        assert_eq!(shape.leaves_large > 0, expected, "{}", tree.id);
        large += usize::from(expected);
    }
    assert!(large > 20, "only {large} structures have a large leaf");
}

#[test]
fn a_cancelled_build_ends_with_an_error() {
    let scene = soup(grid(6, 0.0));
    for spec in specs() {
        let monitor = Monitor::new();
        monitor.cancel();
        let result = Structure::build(scene.clone(), registry::parse(&spec).unwrap(), 1, &monitor);
        assert_eq!(result.err(), Some(Error::Cancelled), "{spec}");
    }
}

/// Builders count at least the memory of the tree against the limit, and not much more.
#[test]
fn a_build_beyond_its_memory_is_refused() {
    let scene = soup(grid(8, 0.3));
    for spec in specs() {
        let bytes = build(&scene, &spec, 1).bytes() as u64;
        let within = |limit: u64, threads: usize| {
            let monitor = Monitor::new();
            monitor.limit_memory(limit);
            let config = registry::parse(&spec).unwrap();
            Structure::build(scene.clone(), config, threads, &monitor)
        };
        let most = if hard::share() > 1 && of_rays(&spec) {
            1
        } else {
            2
        };
        for threads in 1..=most {
            for limit in [0, bytes] {
                let error = within(limit, threads).err();
                assert!(
                    matches!(&error, Some(Error::Memory(text)) if text.starts_with("memory_limit: ")),
                    "{spec}, {limit} of {bytes} bytes: {error:?}"
                );
            }
            // An empty leaf is counted with eleven times its final size, most of it in queues of the layout; a
            // clipped triangle with all its corners takes a kilobyte while it is queued for the split.
            let enough = within(12 * bytes + 2048 * scene.len() as u64, threads);
            assert!(enough.is_ok(), "{spec}, {bytes} bytes: {:?}", enough.err());
        }
    }
}

/// In a scene so small that products of its coordinates with reciprocal directions overflow, no axis locates a ray,
/// and a ray without a lower end of its interval reaches all nodes, also where a node has no child.
#[test]
fn unbounded_rays_pass_through_denormal_scenes() {
    let mut random = Random(5);
    let corners: Vec<_> = (0..400)
        .flat_map(|_| {
            let at = random.point(-1.0, 1.0);
            let mut corner = || {
                let by = random.point(-0.1, 0.1);
                [0, 1, 2].map(|k: usize| (at[k] + by[k]) * 1e-42)
            };
            [corner(), corner(), corner()]
        })
        .collect();
    let scene = soup(corners);
    let rays: Vec<_> = (0..64)
        .map(|i| {
            let mut ray = ray([0.0, 0.0, 10.0], [0.0, 0.0, -1.0]);
            ray.o[0] = 1e-42 * random.point(-1.0, 1.0)[0];
            ray.t_min = if i % 2 == 0 { f32::NEG_INFINITY } else { -1e30 };
            ray
        })
        .collect();
    let reference = closest(&build(&scene, "brute", 1), &rays);
    for spec in specs() {
        let found = differences(&build(&scene, &spec, 1), &rays, &reference);
        assert_eq!(found, 0, "{spec}");
    }
}

#[test]
fn extreme_parameters_build_valid_trees() {
    let scene = soup(grid(3, 0.3));
    let rays = aimed(&scene, 300, &mut Random(11));
    let reference = closest(&build(&scene, "brute", 1), &rays);
    for tree in TREES {
        for param in tree.all_params() {
            let ends = match param.kind {
                Kind::Integer { min, max } => vec![min.to_string(), max.to_string()],
                Kind::Float { min, max } => vec![min.to_string(), max.to_string()],
                // Other tests go over all ways.
                Kind::Choice(_) if [NODES, TRAVERSAL].contains(&param.name) => continue,
                Kind::Choice(options) => options.iter().map(|o| o.name.to_owned()).collect(),
            };
            for end in ends.iter().filter(|_| param.name != "robust") {
                let mut spec = format!("{}:{}={end}", tree.id, param.name);
                // Meet the conditions of parameters that have no effect with the defaults.
                let own = match param.kind {
                    Kind::Choice(options) => options.iter().find(|o| o.name == *end),
                    _ => None,
                };
                for need in param.needs.iter().chain(own.map_or(&[][..], |o| o.needs)) {
                    let other = tree.all_params().find(|p| p.name == need.key).unwrap();
                    if let Only::Options(options) = need.only
                        && !need.holds(&other.default)
                    {
                        spec = with(&spec, &format!("{}={}", need.key, options[0]));
                    }
                }
                let structure = build(&scene, &spec, 1);
                assert_eq!(validate(&structure), Vec::<String>::new(), "{spec}");
                assert_eq!(differences(&structure, &rays, &reference), 0, "{spec}");
            }
        }
    }
}

/// The comparison above can fail: traversals as published, without error bounds, return wrong hits here.
#[test]
fn traversals_without_error_bounds_are_caught() {
    let scene = soup(grid(5, 0.0));
    let mut random = Random(7);
    let mut rays = lattice_rays(5, &mut random, 4000);
    rays.extend(aimed(&scene, 4000, &mut random));
    let reference = closest(&build(&scene, "brute", 1), &rays);
    let scalar = ["auto", "ta-b", "ta-a", "sung", "arvo", "seq", "rope"];
    let scalar = scalar.map(|way| format!("kd:robust=none,leaves=scalar,traversal={way}"));
    let eight = [
        "kd:robust=none",
        "kd:robust=none,traversal=dir",
        "kd:robust=none,traversal=ta-a",
        "kd:robust=none,traversal=sung",
        "kd:robust=none,traversal=arvo",
        "kd:robust=none,traversal=seq",
        "kd:robust=none,traversal=rope",
        "kd:robust=none,traversal=ropetree",
        "bsp-random:robust=none,traversal=ta-b-poly",
        "kd:robust=none,traversal=packet8",
        "kd:robust=none,nodes=wide",
        "bsp-wn-plus-kd:robust=none,k=4,seed=1",
        "bsp-random:robust=none",
        "bih:robust=none",
        "bih5:robust=none",
        "bih1:robust=none",
        "bih4:robust=none",
        "bih-n:robust=none",
        "bih-sah:robust=none",
        "bih:robust=none,leaves=scalar",
        "bih1:robust=none,leaves=scalar",
        "bih4:robust=none,leaves=scalar",
        "bih-bvh:robust=none,leaves=scalar",
        "bih-obl:robust=none,leaves=scalar",
        "bvh-sah:robust=none,leaves=scalar",
        "bvh-sah:robust=none,leaves=scalar,width=2",
        "bbox-gs:robust=none,leaves=scalar",
        "bbox-gs:robust=none,leaves=scalar,slabs=7",
        "grid:robust=none,leaves=scalar",
        "bih-bvh:robust=none",
        "bih-obl:robust=none",
        "bbox-gs:robust=none",
        "bbox-gs:slabs=7,robust=none",
    ];
    for spec in scalar.iter().map(String::as_str).chain(eight) {
        let structure = build(&scene, spec, 1);
        assert!(differences(&structure, &rays, &reference) > 0, "{spec}");
    }
}

/// A distance below the smallest float rounds to zero, and zero counts: also for a triangle slightly behind the
/// origin, if the direction is so long that the distance underflows.
#[test]
fn distances_that_round_to_zero_are_hits_at_zero() {
    let size = 2.0_f32.powi(-25);
    let wall =
        |x: f32| [[x, -1.0, -1.0], [x, 2.0, -1.0], [x, -1.0, 2.0]].map(|p| p.map(|x| x * size));
    let scene = soup([-0.25, 0.25, 1.0].into_iter().flat_map(wall).collect());
    let mut rays = vec![ray([0.0; 3], [2.0_f32.powi(126), 0.0, 0.0]); 3];
    rays[1].t_max = 0.0;
    rays[2].d[0] = -rays[2].d[0];
    for spec in specs() {
        let hits = closest(&build(&scene, &spec, 1), &rays);
        for (ray, hit) in rays.iter().zip(hits) {
            assert_eq!((hit.t, hit.triangle), (0.0, 0), "{spec}: {ray:?}");
            assert_eq!(exact_closest(&scene, ray).hit.triangle, 0);
        }
    }
}

#[test]
fn every_build_reports_all_its_work_once() {
    let scene = soup(grid(8, 0.3));
    for tree in TREES.iter().filter(|tree| tree.id != "brute") {
        for spec in tree.spelled_ways() {
            let monitor = Monitor::new();
            let config = registry::parse(&spec).unwrap();
            Structure::build(scene.clone(), config, 2, &monitor).unwrap();
            let advanced = monitor.advanced();
            assert!((advanced - 1.0).abs() < 1e-6, "{spec}: {advanced}");
        }
    }
}
