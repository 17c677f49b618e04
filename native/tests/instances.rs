// SPDX-License-Identifier: GPL-3.0-or-later
//! Instances return bit for bit the hits of brute force over the flattened scene, for all transforms and all
//! structures of the meshes.

mod hard;

use halfspace::base::Monitor;
use halfspace::geom::Transform;
use halfspace::oracle::cases::{Random, aimed, grid, lattice_rays, soup};
use halfspace::ray::{Hit, Ray, RayCounters, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::instances::nested::{self, Part};
use halfspace::structure::instances::top::Top;
use halfspace::structure::instances::{Instance, Instances};
use std::sync::Arc;

fn build(scene: &Arc<Triangles>, spec: &str) -> Arc<Structure> {
    let config = registry::parse(spec).unwrap();
    Arc::new(Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap())
}

/// A bumpy sphere with shared vertices around `centre`, which may be far from the origin of the mesh.
fn ball(rings: u32, centre: [f32; 3]) -> Arc<Triangles> {
    let sectors = 2 * rings;
    let mut vertices = Vec::new();
    for i in 0..=rings {
        for j in 0..sectors {
            let (theta, phi) = (
                f64::from(i) / f64::from(rings) * std::f64::consts::PI,
                f64::from(j) / f64::from(sectors) * std::f64::consts::TAU,
            );
            let r = 1.0 + 0.1 * (3.0 * phi).sin() * (5.0 * theta).sin();
            let p = [
                theta.sin() * phi.cos(),
                theta.sin() * phi.sin(),
                theta.cos(),
            ];
            vertices.push(std::array::from_fn(|k| (p[k] * r) as f32 + centre[k]));
        }
    }
    let mut indices = Vec::new();
    for i in 0..rings {
        for j in 0..sectors {
            let at = |i: u32, j: u32| i * sectors + j % sectors;
            indices.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            indices.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Arc::new(Triangles::new(vertices, indices).unwrap())
}

/// Triangles without area in the mesh, to which rounding may give one.
fn flat() -> Arc<Triangles> {
    let mut vertices = Vec::new();
    for i in 0..40_u8 {
        let x = f32::from(i) / 16.0;
        vertices.extend([
            [x, x, 0.5],
            [x + 1.0, x + 2.0, 1.5],
            [x + 3.0, x + 6.0, 3.5],
        ]);
    }
    vertices.extend([[0.0; 3], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0], [f32::NAN; 3]]);
    let mut indices: Vec<_> = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    indices.extend([[120, 121, 122], [120, 121, 123], [120, 120, 122]]);
    Arc::new(Triangles::new(vertices, indices).unwrap())
}

struct Numbers(Random);

impl Numbers {
    fn unit(&mut self) -> f64 {
        self.0.below(1 << 20) as f64 / f64::from(1 << 20)
    }

    fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Returns a transform that rotates, scales by `scale`, and for some `variant` mirrors, shears or scales unevenly.
    fn transform(&mut self, scale: f64, spread: f64, variant: usize) -> Transform {
        let q: [f64; 4] = std::array::from_fn(|_| self.signed());
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-3);
        let [w, x, y, z] = q.map(|c| c / length);
        let mut linear = [
            [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - z * w),
                2.0 * (x * z + y * w),
            ],
            [
                2.0 * (x * y + z * w),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - x * w),
            ],
            [
                2.0 * (x * z - y * w),
                2.0 * (y * z + x * w),
                1.0 - 2.0 * (x * x + y * y),
            ],
        ];
        let columns = match variant % 5 {
            1 => [-1.0, 1.0, 1.0],
            2 => [1e-2, 1.0, 30.0],
            3 => [-1.0, 0.5, -2.0],
            _ => [1.0; 3],
        };
        for row in &mut linear {
            if variant % 5 == 4 {
                row[2] += 3.0 * row[0] - 0.5 * row[1];
            }
            for (entry, column) in row.iter_mut().zip(columns) {
                *entry *= scale * column;
            }
        }
        let offset = std::array::from_fn(|_| spread * self.signed());
        Transform { linear, offset }
    }
}

fn translation(offset: [f64; 3]) -> Transform {
    Transform {
        linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        offset,
    }
}

/// Rays of all kinds for a flattened scene: through corners, edges and faces, from far and near, along the
/// lattice, and from the surfaces themselves.
fn rays(scene: &Arc<Triangles>, count: usize, random: &mut Random) -> Vec<Ray> {
    let mut rays = aimed(scene, count, random);
    rays.extend(lattice_rays(4, random, count / 4));
    let near: Vec<_> = (rays.iter().step_by(4))
        .map(|ray| Ray {
            o: std::array::from_fn(|k| ray.o[k] + 0.999 * ray.d[k]),
            d: ray.d.map(|x| x * 1e-3),
            t_min: -5.0,
            t_max: 3e3,
        })
        .collect();
    rays.extend(near);
    rays
}

fn bits(hit: &Hit) -> [u32; 4] {
    [
        hit.t.to_bits(),
        hit.triangle,
        hit.u.to_bits(),
        hit.v.to_bits(),
    ]
}

fn differences(tracer: &impl Tracer, rays: &[Ray], expected: &[Hit]) -> usize {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    tracer.closest(rays, &mut hits, None);
    tracer.occluded(rays, &mut occluded, None);
    let mut wrong = 0;
    for i in 0..rays.len() {
        if bits(&hits[i]) != bits(&expected[i]) || occluded[i] != expected[i].is_hit() {
            wrong += 1;
        }
    }
    wrong
}

/// Every node layout and traversal.
fn specs() -> Vec<String> {
    let mut specs = Vec::new();
    for tree in TREES {
        // Tiles differ only for tiles of rays, which do not come in instances.
        let tiles = |spec: &String| spec.contains("traversal=tile");
        specs.extend((tree.spelled_ways().into_iter()).filter(|spec| !tiles(spec)));
    }
    specs
}

/// Name, meshes, instances.
type Scene = (&'static str, Vec<Arc<Triangles>>, Vec<Instance>);

/// Scenes of instances.
fn scenes() -> Vec<Scene> {
    let mut numbers = Numbers(Random(5));
    let mut instances =
        |meshes: usize, count: usize, scales: &[f64], spread: f64| -> Vec<Instance> {
            (0..count)
                .map(|i| Instance {
                    mesh: u32::try_from(i % meshes).unwrap(),
                    transform: numbers.transform(scales[i % scales.len()], spread, i),
                })
                .collect()
        };
    let balls = vec![ball(6, [0.0; 3]), ball(4, [300.0, -200.0, 50.0])];
    let boxes = vec![soup(grid(2, 0.0))];
    let mut scenes = vec![
        ("turned", balls.clone(), instances(2, 24, &[1.0], 6.0)),
        (
            "scaled",
            balls.clone(),
            instances(2, 25, &[1e-4, 1.0, 1e4], 20.0),
        ),
        (
            "tiny and far",
            balls[..1].to_vec(),
            instances(1, 12, &[1e-4], 1e3),
        ),
        (
            "absurd",
            balls[..1].to_vec(),
            instances(1, 10, &[1e-12, 1e9], 1e5),
        ),
        ("flat", vec![flat()], instances(1, 12, &[1.0, 0.3], 2.0)),
    ];
    // Touching boxes on the lattice: every ray along it lies in walls.
    let mut lattice = Vec::new();
    for i in 0..8_u8 {
        let at = |bit: u8| 2.0 * f64::from(i >> bit & 1);
        lattice.push(Instance {
            mesh: 0,
            transform: translation([at(0), at(1), at(2)]),
        });
    }
    // Two instances at the same position: the smaller index wins.
    lattice.extend_from_within(..2);
    scenes.push(("lattice", boxes, lattice));
    scenes
}

fn flattened(instances: &Instances) -> Arc<Triangles> {
    let (vertices, triangles) = instances.flattened().unwrap();
    Arc::new(Triangles::new(vertices, triangles).unwrap())
}

#[test]
fn two_levels_answer_like_brute_force_over_the_flattened_scene() {
    for (name, meshes, placements) in scenes() {
        let over = |top: Top, spec: &str| {
            let meshes = meshes.iter().map(|mesh| build(mesh, spec)).collect();
            Instances::build_with(top, meshes, &placements, &Monitor::new()).unwrap()
        };
        let flat = flattened(&over(Top::Sah, "bvh-sah"));
        let rays = rays(&flat, 1500, &mut Random(11));
        let mut expected = vec![Hit::MISS; rays.len()];
        build(&flat, "brute").closest(&rays, &mut expected, None);
        let hits = expected.iter().filter(|hit| hit.is_hit()).count();
        assert!(
            hits > rays.len() / 20,
            "{name}: {hits} of {} hit",
            rays.len()
        );
        for (i, spec) in specs().iter().enumerate() {
            // Alternate the ways to build the upper tree.
            let (_, top) = Top::NAMED[i % Top::NAMED.len()];
            let instances = over(top, spec);
            assert_eq!(instances.count(), flat.len());
            let some: Vec<_> = rays.iter().copied().skip(i % 3).step_by(3).collect();
            let wanted: Vec<_> = expected.iter().copied().skip(i % 3).step_by(3).collect();
            let wrong = differences(&instances, &some, &wanted);
            assert_eq!(wrong, 0, "{name}, {spec}: of {} rays", some.len());
            for &id in flat.live().iter().step_by(7) {
                let (a, b) = (instances.corners(id), flat.corners(id));
                let same = a.as_flattened().iter().zip(b.as_flattened());
                assert!(
                    same.clone().all(|(x, y)| x.to_bits() == y.to_bits()),
                    "{name} {id}"
                );
            }
        }
    }
}

#[test]
fn instances_of_instances_answer_like_brute_force_over_the_flattened_scene() {
    let mut numbers = Numbers(Random(8));
    let mut places = |parts: usize, count: usize, scale: f64, spread: f64| -> Vec<Instance> {
        (0..count)
            .map(|i| Instance {
                mesh: u32::try_from(i % parts).unwrap(),
                transform: numbers.transform(scale, spread, i),
            })
            .collect()
    };
    // A tree holds a mesh twice and another, a row three trees, and the scene rows and single meshes.
    let balls: Vec<_> = [ball(4, [0.0; 3]), ball(3, [2.0, 0.0, 1.0])]
        .iter()
        .map(|scene| build(scene, "kd"))
        .collect();
    let mesh = |i: usize| Part::Mesh(Arc::clone(&balls[i]));
    let over = |parts: &[Part], placed: &[Instance]| {
        let (meshes, placed) = nested::expand(parts, placed).unwrap();
        Arc::new(Instances::build(meshes, &placed, &Monitor::new()).unwrap())
    };
    let (mut of_tree, of_row) = (places(2, 4, 0.5, 2.0), places(1, 3, 1.5, 4.0));
    // A dropped instance keeps its numbers at any depth.
    of_tree[2].transform.linear = [[0.0; 3]; 3];
    let tree = over(&[mesh(0), mesh(1)], &of_tree);
    let row = over(&[Part::Group(Arc::clone(&tree))], &of_row);
    let scene = over(
        &[Part::Group(Arc::clone(&row)), mesh(1)],
        &places(2, 6, 1.0, 6.0),
    );
    assert_eq!(scene.len(), 3 * of_row.len() * of_tree.len() + 3);
    assert_eq!(scene.dropped().count(), 3 * of_row.len());
    let flat = flattened(&scene);
    let rays = rays(&flat, 1500, &mut Random(3));
    let mut expected = vec![Hit::MISS; rays.len()];
    build(&flat, "brute").closest(&rays, &mut expected, None);
    assert!(expected.iter().filter(|hit| hit.is_hit()).count() > rays.len() / 20);
    assert_eq!(differences(&*scene, &rays, &expected), 0);
    // An instance of a group is each of its instances, transformed by the product.
    let one = over(
        &[Part::Group(Arc::clone(&tree))],
        &[Instance {
            mesh: 0,
            transform: translation([0.0; 3]),
        }],
    );
    assert_eq!(
        flattened(&one).vertices()[..40],
        flattened(&tree).vertices()[..40]
    );
    // The properties of meshes are listed by part.
    let group = Part::Group(Arc::clone(&row));
    assert_eq!(
        nested::expand(&[mesh(0), group, mesh(0)], &[])
            .unwrap()
            .0
            .len(),
        4
    );
    // Wrong indices and too many instances are refused.
    let wrong = [Instance {
        mesh: 2,
        transform: translation([0.0; 3]),
    }];
    let message = nested::expand(&[mesh(0)], &wrong).unwrap_err().to_string();
    assert!(message.contains("mesh[0]: 2 is out of range for 1 meshes"));
}

#[test]
fn copies_are_of_meshes_with_an_area_as_many_as_their_limit_allows() {
    let away = |x: f64| translation([1e6 + x, 3.0, 5.0]);
    let line = vec![[0.0; 3], [1.0; 3], [2.0; 3]];
    let line = Arc::new(Triangles::new(line, vec![[0, 1, 2]]).unwrap());
    let empty = Arc::new(Triangles::new(Vec::new(), Vec::new()).unwrap());
    let meshes = [&line, &empty, &ball(2, [0.0; 3])].map(|scene| build(scene, "kd"));
    let placed: Vec<_> = (0..4200)
        .map(|i| Instance {
            mesh: if i < 4 { i % 2 } else { 2 },
            transform: Transform {
                linear: [
                    [if i % 3 == 0 { -1.0 } else { 1.0 }, 0.0, 0.0],
                    [0.0, 1.0, 0.0],
                    [0.0, 0.0, 1.0],
                ],
                ..away(f64::from(i) * 4.0)
            },
        })
        .collect();
    let built =
        |placed: &[Instance]| Instances::build(meshes.to_vec(), placed, &Monitor::new()).unwrap();
    assert_eq!(built(&placed[..4]).copied(), 0);
    assert_eq!(built(&placed).copied(), 4096);
    // Mirrored copies, several of one mesh.
    let some = built(&placed[..24]);
    assert_eq!(some.copied(), 20);
    let flat = flattened(&some);
    let rays = aimed(&flat, 500, &mut Random(9));
    let mut expected = vec![Hit::MISS; rays.len()];
    build(&flat, "brute").closest(&rays, &mut expected, None);
    assert_eq!(differences(&some, &rays, &expected), 0);
}

#[test]
fn instances_in_one_another_share_a_structure() {
    let mut numbers = Numbers(Random(12));
    let mut crowd: Vec<_> = (0..120)
        .map(|i| Instance {
            mesh: u32::from(i % 7 == 0),
            transform: Transform {
                offset: [3.0, 0.0, 1.0],
                ..numbers.transform(1.0, 0.0, usize::from(i % 3 == 0))
            },
        })
        .collect();
    // A dropped instance interrupts the numbers, single ones lie before, beside and after the crowd.
    crowd[50].transform.linear = [[0.0; 3]; 3];
    let single = |x: f64| Instance {
        mesh: 0,
        transform: translation([x, 0.5, 0.0]),
    };
    crowd.splice(0..0, [single(-9.0), single(9.0)]);
    crowd.push(single(3.0));
    crowd.push(single(-9.0));
    let scenes = [ball(3, [0.0; 3]), ball(2, [0.0; 3])];
    for spec in [
        "kd:traversal=dir",
        "bvh-sah:traversal=ordered",
        "bih:traversal=ordered",
    ] {
        let meshes = scenes.iter().map(|scene| build(scene, spec)).collect();
        let instances = Instances::build(meshes, &crowd, &Monitor::new()).unwrap();
        assert!(
            (119..=120).contains(&instances.copied()),
            "{}",
            instances.copied()
        );
        let flat = flattened(&instances);
        let rays = rays(&flat, 800, &mut Random(6));
        let mut expected = vec![Hit::MISS; rays.len()];
        build(&flat, "brute").closest(&rays, &mut expected, None);
        assert_eq!(differences(&instances, &rays, &expected), 0, "{spec}");
        // A ray enters the crowd once, and not each of 120 instances: single ones beside it add some leaves to those of one
        // structure over all.
        let leaves = |tracer: &dyn Tracer| -> u32 {
            let mut counters = vec![RayCounters::default(); rays.len()];
            let mut hits = vec![Hit::MISS; rays.len()];
            tracer.closest(&rays, &mut hits, Some(&mut counters));
            counters.iter().map(|one| one.leaves).sum()
        };
        let (own, flat) = (leaves(&instances), leaves(&*build(&flat, spec)));
        assert!(
            own < 4 * flat,
            "{spec}: {own} leaves, {flat} in one structure"
        );
    }
}

#[test]
fn rays_at_a_far_instance_test_what_they_test_at_the_origin() {
    let scene = ball(24, [0.0; 3]);
    for spec in ["bvh-sah", "kd", "bih"] {
        let tested = |away: f64| {
            let placed = [Instance {
                mesh: 0,
                transform: translation([away, -0.5 * away, away]),
            }];
            let instances =
                Instances::build(vec![build(&scene, spec)], &placed, &Monitor::new()).unwrap();
            let flat = flattened(&instances);
            let rays = aimed(&flat, 300, &mut Random(4));
            let (mut hits, mut counters) = (
                vec![Hit::MISS; rays.len()],
                vec![RayCounters::default(); rays.len()],
            );
            instances.closest(&rays, &mut hits, Some(&mut counters));
            let mut expected = vec![Hit::MISS; rays.len()];
            build(&flat, "brute").closest(&rays, &mut expected, None);
            assert_eq!(
                differences(&instances, &rays, &expected),
                0,
                "{spec}, {away}"
            );
            let sum = |of: fn(&RayCounters) -> u32| -> u64 {
                counters.iter().map(|one| u64::from(of(one))).sum()
            };
            (
                sum(|one| one.tests),
                sum(|one| one.verdicts),
                instances.copied(),
            )
        };
        let (near, verdicts, copied) = tested(0.0);
        assert_eq!(copied, 0);
        for away in [3e3, 3e5, 1e6] {
            let (far, decided, copied) = tested(away);
            assert_eq!(copied, usize::from(away > 1e4));
            // Coarse rounding makes triangles larger and many of them lines.
            assert!(
                far < 3 * near,
                "{spec}, {away}: {far} tests, {near} at the origin"
            );
            assert!(
                decided < 2 * verdicts,
                "{spec}, {away}: {decided} verdicts, {verdicts} there"
            );
        }
    }
}

#[test]
fn every_extreme_case_is_the_same_as_an_instance() {
    // Use the identity, whose flattened scene is the case itself, and mirrored scales by powers of two, which round
    // nothing; the rays are transformed likewise.
    let exact = |scale: f64| Transform {
        linear: [[-scale, 0.0, 0.0], [0.0, 0.0, scale], [0.0, scale, 0.0]],
        offset: [0.0; 3],
    };
    let along = |ray: &Ray, scale: f32| Ray {
        o: [-scale * ray.o[0], scale * ray.o[2], scale * ray.o[1]],
        d: [-scale * ray.d[0], scale * ray.d[2], scale * ray.d[1]],
        ..*ray
    };
    let specs = [
        "kd",
        "bvh-sah",
        "bih",
        "bsp-wn-plus-kd:k=6",
        "rbsp",
        "octree-net",
        "bbox-gs:slabs=7",
    ];
    let (mut placed, all) = (0, hard::cases(7));
    let count = all.len();
    for case in all {
        let rays: Vec<_> = case.rays.iter().copied().step_by(3).collect();
        let spec = specs[case.name.len() % specs.len()];
        let mut expected = vec![Hit::MISS; rays.len()];
        build(&case.scene, "brute").closest(&rays, &mut expected, None);
        for scale in [0.0_f32, 1.0 / 8192.0, 16384.0] {
            let transform = if scale == 0.0 {
                translation([0.0; 3])
            } else {
                exact(f64::from(scale))
            };
            let single = [Instance { mesh: 0, transform }];
            let meshes = vec![build(&case.scene, spec)];
            let instances = Instances::build(meshes, &single, &Monitor::new()).unwrap();
            let moved: Vec<_> = match scale {
                0.0 => rays.clone(),
                scale => rays.iter().map(|ray| along(ray, scale)).collect(),
            };
            let flat = flattened(&instances);
            let mut wanted = vec![Hit::MISS; rays.len()];
            build(&flat, "brute").closest(&moved, &mut wanted, None);
            // Only transforms near the end of the range of f32 are dropped.
            if scale == 0.0 && instances.dropped().next().is_none() {
                assert_eq!(wanted, expected, "{}", case.name);
                placed += 1;
            }
            let wrong = differences(&instances, &moved, &wanted);
            assert_eq!(wrong, 0, "{}, {spec}, scale {scale}", case.name);
        }
    }
    assert!(placed + 2 > count, "{placed} of {count}");
}

#[test]
fn without_error_bounds_answers_differ() {
    let (_, meshes, placements) = scenes().swap_remove(0);
    let meshes = (meshes.iter())
        .map(|mesh| build(mesh, "kd:robust=none"))
        .collect();
    let instances = Instances::build(meshes, &placements, &Monitor::new()).unwrap();
    let flat = flattened(&instances);
    let rays = rays(&flat, 1500, &mut Random(11));
    let mut expected = vec![Hit::MISS; rays.len()];
    build(&flat, "brute").closest(&rays, &mut expected, None);
    assert!(differences(&instances, &rays, &expected) > 0);
}

#[test]
fn every_instruction_set_and_counting_give_the_same_answers() {
    let (_, meshes, placements) = scenes().swap_remove(0);
    let meshes = meshes.iter().map(|mesh| build(mesh, "kd")).collect();
    let instances = Instances::build(meshes, &placements, &Monitor::new()).unwrap();
    let flat = flattened(&instances);
    let rays = rays(&flat, 500, &mut Random(3));
    let mut expected = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    instances.closest(&rays, &mut expected, Some(&mut counters));
    assert!(counters.iter().any(|c| c.tests > 0 && c.leaves > 0));
    #[cfg(target_arch = "x86_64")]
    {
        use fearless_simd::Level;
        let best = Level::new();
        let mut levels = vec![best];
        levels.extend(best.as_sse4_2().map(Level::Sse4_2));
        levels.extend(best.as_avx2().map(Level::Avx2));
        for level in levels {
            assert_eq!(differences(&instances.at_level(level), &rays, &expected), 0);
        }
    }
}

#[test]
fn bad_transforms_are_dropped_and_the_rest_keep_their_numbers() {
    let mesh = ball(4, [0.0; 3]);
    let count = mesh.len();
    let mut flat = translation([5.0, 0.0, 0.0]);
    flat.linear[1] = [0.0; 3];
    let with = |offset: f64| translation([offset, 0.0, 0.0]);
    let placements: Vec<_> = [
        with(f64::NAN),
        with(0.0),
        flat,
        with(f64::INFINITY),
        with(3.0),
        with(1e300),
    ]
    .map(|transform| Instance { mesh: 0, transform })
    .to_vec();
    let meshes = vec![build(&mesh, "kd")];
    let instances = Instances::build(meshes.clone(), &placements, &Monitor::new()).unwrap();
    assert_eq!(instances.dropped().collect::<Vec<_>>(), [0, 2, 3, 5]);
    let ray = Ray {
        o: [3.01, 0.02, 9.0],
        d: [0.0, 0.0, -1.0],
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let mut hits = [Hit::MISS];
    instances.closest(&[ray], &mut hits, None);
    assert_eq!(hits[0].triangle as usize / count, 4);
    assert_eq!(instances.locate(hits[0].triangle).0, 4);

    // No instance at all, and a mesh index out of range.
    let none = Instances::build(meshes.clone(), &[], &Monitor::new()).unwrap();
    none.closest(&[ray], &mut hits, None);
    assert!(!hits[0].is_hit() && none.is_empty() && none.count() == 0);
    let wrong = [Instance {
        mesh: 1,
        transform: with(0.0),
    }];
    let error = Instances::build(meshes, &wrong, &Monitor::new()).unwrap_err();
    assert_eq!(error.to_string(), "mesh[0]: 1 is out of range for 1 meshes");
}
