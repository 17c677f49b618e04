// SPDX-License-Identifier: GPL-3.0-or-later
//! Whole renders against closed forms, against Cycles, and against each other.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::camera::{CameraParams, Projection};
use super::job::{Job, Statistics};
use super::lights::{AreaShape, LightKind, LightParams};
use super::material::MaterialParams;
use super::scene::{RenderScene, SceneParams};
use super::settings::{Pass, Settings};
use super::vector::{Vec3, vec3};
use super::visibility::Visibility;
use crate::scene::Triangles;
use crate::traverse::{Hit, Ray, RayCounters, Tracer};

/// Every triangle for every ray, in f64, in ascending or descending order. A renderer's test must
/// not depend on a tree.
struct Plain {
    triangles: Triangles,
    reversed: bool,
}

impl Plain {
    fn hit(&self, ray: &Ray, id: u32) -> Option<Hit> {
        let wide = |a: [f32; 3]| a.map(f64::from);
        let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let [a, b, c] = self.triangles.corners(id).map(wide);
        let (o, d) = (wide(ray.o), wide(ray.d));
        let (e1, e2) = (sub(b, a), sub(c, a));
        let p = cross(d, e2);
        let det = dot(e1, p);
        if det == 0.0 {
            return None;
        }
        let s = sub(o, a);
        let u = dot(s, p) / det;
        let q = cross(s, e1);
        let v = dot(d, q) / det;
        let t = (dot(e2, q) / det) as f32;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        (inside && t >= ray.t_min && t <= ray.t_max).then_some(Hit {
            t,
            triangle: id,
            u: u as f32,
            v: v as f32,
        })
    }
}

impl Tracer for Plain {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.triangles)
    }

    fn count(&self) -> usize {
        self.triangles.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.triangles.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        let live = self.triangles.live();
        for (ray, best) in rays.iter().zip(hits) {
            *best = Hit::MISS;
            for k in 0..live.len() {
                let id = live[if self.reversed { live.len() - 1 - k } else { k }];
                if let Some(hit) = self.hit(ray, id)
                    && (hit.t, hit.triangle) < (best.t, best.triangle)
                {
                    *best = hit;
                }
            }
        }
        for c in counters.into_iter().flatten() {
            *c = RayCounters {
                steps_axis: 2,
                steps_oblique: 1,
                tests: 5,
                ..Default::default()
            };
        }
    }

    fn occluded(&self, rays: &[Ray], out: &mut [bool], _: Option<&mut [RayCounters]>) {
        for (ray, out) in rays.iter().zip(out) {
            *out = self
                .triangles
                .live()
                .iter()
                .any(|&id| self.hit(ray, id).is_some());
        }
    }
}

/// Vertices and quads, two triangles each.
#[derive(Default)]
struct Mesh {
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    materials: Vec<i32>,
}

impl Mesh {
    fn quad(&mut self, corners: [[f32; 3]; 4], material: i32) {
        let n = self.vertices.len() as u32;
        self.vertices.extend(corners);
        self.triangles
            .extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
        self.materials.extend([material; 2]);
    }

    /// A square of half size `h` at height `z`, facing up.
    fn floor(&mut self, h: f32, z: f32, material: i32) {
        self.quad([[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]], material);
    }

    /// An axis-aligned cube around the origin, facing outwards.
    fn cube(&mut self, h: f32, material: i32) {
        for axis in 0..3 {
            for side in [-h, h] {
                let corner = |a: f32, b: f32| {
                    let mut p = [0.0; 3];
                    p[axis] = side;
                    p[(axis + 1) % 3] = a;
                    p[(axis + 2) % 3] = b;
                    p
                };
                let mut q = [corner(-h, -h), corner(h, -h), corner(h, h), corner(-h, h)];
                if side < 0.0 {
                    q.reverse();
                }
                self.quad(q, material);
            }
        }
    }

    /// A sphere of radius 1 by subdividing an octahedron; returns its corner normals.
    fn sphere(&mut self, levels: u32, material: i32) -> Vec<[[f32; 3]; 3]> {
        let (x, y, z) = (
            vec3(1.0, 0.0, 0.0),
            vec3(0.0, 1.0, 0.0),
            vec3(0.0, 0.0, 1.0),
        );
        let mut faces = Vec::new();
        for (sx, sy, sz) in [(1., 1., 1.), (-1., 1., -1.), (1., -1., -1.), (-1., -1., 1.)] {
            faces.push([x * sx, y * sy, z * sz]);
        }
        for (sx, sy, sz) in [(-1., 1., 1.), (1., -1., 1.), (1., 1., -1.), (-1., -1., -1.)] {
            faces.push([y * sy, x * sx, z * sz]);
        }
        for _ in 0..levels {
            let mid = |a: Vec3, b: Vec3| (a + b).normalized();
            faces = faces
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (mid(a, b), mid(b, c), mid(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let corners: Vec<_> = faces.iter().map(|f| f.map(Vec3::array)).collect();
        for face in &corners {
            let n = self.vertices.len() as u32;
            self.vertices.extend(face);
            self.triangles.push([n, n + 1, n + 2]);
            self.materials.push(material);
        }
        corners
    }

    fn tracer(&self, reversed: bool) -> Arc<Plain> {
        let triangles = Triangles::new(self.vertices.clone(), self.triangles.clone()).unwrap();
        Arc::new(Plain {
            triangles,
            reversed,
        })
    }

    fn scene(&self, params: SceneParams) -> Arc<RenderScene> {
        let params = SceneParams {
            material_index: Some(self.materials.clone()),
            ..params
        };
        Arc::new(RenderScene::new(self.tracer(false), params).unwrap())
    }
}

fn matte(albedo: f32) -> MaterialParams {
    MaterialParams {
        base_color: [albedo; 3],
        specular: 0.0,
        ..Default::default()
    }
}

fn at(x: f64, y: f64, z: f64) -> [[f64; 4]; 4] {
    [
        [1.0, 0.0, 0.0, x],
        [0.0, 1.0, 0.0, y],
        [0.0, 0.0, 1.0, z],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// At (0, 0, 2), turned about the X axis.
fn tilted(angle: f64) -> [[f64; 4]; 4] {
    let (s, c) = angle.sin_cos();
    [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, c, -s, 0.0],
        [0.0, s, c, 2.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

fn scaled(mut m: [[f64; 4]; 4], x: f64, y: f64) -> [[f64; 4]; 4] {
    for row in &mut m {
        row[0] *= x;
        row[1] *= y;
    }
    m
}

fn light(kind: LightKind, to_world: [[f64; 4]; 4], power: f32) -> LightParams {
    LightParams {
        kind,
        to_world,
        power: [power; 3],
        casts_shadow: true,
        visible: Visibility::NOT_BY_CAMERA,
    }
}

/// Looks straight down on the origin from height 8, at a window of half size `h`.
fn from_above(h: f64) -> CameraParams {
    CameraParams {
        projection: Projection::Orthographic,
        to_world: at(0.0, 0.0, 8.0),
        window: [-h, h, -h, h],
        clip_start: 0.1,
        clip_end: 100.0,
        ..Default::default()
    }
}

fn square(size: u32, samples: u32, max_bounces: u32) -> Settings {
    Settings {
        width: size,
        height: size,
        samples,
        max_bounces,
        ..Default::default()
    }
}

fn run(
    scene: &Arc<RenderScene>,
    camera: &CameraParams,
    settings: Settings,
    threads: usize,
) -> (Vec<f32>, Statistics) {
    let [x0, y0, x1, y1] = settings.region();
    let job = Job::start(Arc::clone(scene), camera, settings, threads).unwrap();
    assert!(job.wait(Duration::from_secs(600)), "the render did not end");
    assert_eq!(job.error(), None);
    let mut out = vec![0.0; ((x1 - x0) * (y1 - y0) * 4) as usize];
    job.copy_into(Pass::Combined, &mut out).unwrap();
    (out, job.statistics())
}

/// Mean of the red channel.
fn mean(image: &[f32]) -> f64 {
    let sum: f64 = image.chunks_exact(4).map(|p| f64::from(p[0])).sum();
    sum / (image.len() / 4) as f64
}

fn lit_floor(lights: Vec<LightParams>, samples: u32) -> f64 {
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.8)],
        lights,
        ..Default::default()
    });
    mean(&run(&scene, &from_above(0.01), square(8, samples, 0), 1).0)
}

/// Blender 5.2.3's Cycles, 512 samples, a grey (0.8) diffuse plane seen from above at the origin,
/// light at (0, 0, 2) unless said otherwise, 100 W or 1 W/m²; and the closed form where there is
/// one.
#[test]
fn lights_are_as_bright_as_in_cycles() {
    use std::f64::consts::PI;
    let g = 0.8 / PI;
    let intensity = 100.0 / (4.0 * PI);
    let spot = |radius, blend| LightKind::Spot {
        radius,
        size: 1.0,
        blend,
    };
    let area = |shape, size, size_y| LightKind::Area {
        shape,
        size,
        size_y,
    };
    let sun = |degrees: f32| LightKind::Sun {
        angle: degrees.to_radians(),
    };
    let above = at(0.0, 0.0, 2.0);
    // Irradiance under the middle of a rectangle of half sizes a, b at distance h, radiance 1.
    let rectangle = |a: f64, b: f64| {
        let h = 2.0_f64;
        2.0 * (a / (a * a + h * h).sqrt() * (b / (a * a + h * h).sqrt()).atan()
            + b / (b * b + h * h).sqrt() * (a / (b * b + h * h).sqrt()).atan())
    };
    let fade = {
        let x = ((0.4_f64.cos() - 0.5_f64.cos()) / ((1.0 - 0.5_f64.cos()) * 0.5)).min(1.0);
        x * x * (3.0 - 2.0 * x)
    };
    let cases: [(&str, LightParams, f64, Option<f64>); 15] = [
        (
            "point",
            light(LightKind::Point { radius: 0.0 }, above, 100.0),
            0.506_593_3,
            Some(g * intensity / 4.0),
        ),
        (
            "soft point",
            light(LightKind::Point { radius: 0.5 }, above, 100.0),
            0.476_795_6,
            Some(g * intensity / 4.25),
        ),
        (
            "soft point aside",
            light(LightKind::Point { radius: 1.0 }, at(2.0, 0.0, 2.0), 100.0),
            0.159_212_3,
            None,
        ),
        (
            "spot",
            light(spot(0.0, 0.15), above, 100.0),
            0.506_593_3,
            Some(g * intensity / 4.0),
        ),
        (
            "spot tilted",
            light(spot(0.0, 0.5), tilted(0.4), 100.0),
            0.403_400_8,
            Some(g * intensity / 4.0 * fade),
        ),
        (
            "spot scaled",
            light(spot(0.0, 0.5), scaled(tilted(0.4), 2.0, 3.0), 100.0),
            0.506_593_3,
            Some(g * intensity / 4.0),
        ),
        (
            "soft spot",
            light(spot(0.5, 0.5), tilted(0.4), 100.0),
            0.248_739_0,
            None,
        ),
        ("sun", light(sun(0.0), above, 1.0), 0.254_646_9, Some(g)),
        (
            "wide sun",
            light(sun(60.0), above, 1.0),
            0.254_647_9,
            Some(g),
        ),
        (
            "sun tilted",
            light(sun(0.0), tilted(0.7), 1.0),
            0.194_765_1,
            Some(g * 0.7_f64.cos()),
        ),
        (
            "square",
            light(area(AreaShape::Square, 1.0, 0.0), above, 100.0),
            1.871_048_2,
            Some(g * 100.0 / PI * rectangle(0.5, 0.5)),
        ),
        (
            "rectangle",
            light(area(AreaShape::Rectangle, 2.0, 1.0), above, 100.0),
            1.685_311_1,
            Some(g * 50.0 / PI * rectangle(1.0, 0.5)),
        ),
        (
            "disk",
            light(area(AreaShape::Disk, 1.0, 0.0), above, 100.0),
            1.907_169_6,
            Some(g * 100.0 / PI / 4.25),
        ),
        (
            "ellipse",
            light(area(AreaShape::Ellipse, 2.0, 1.0), above, 100.0),
            1.758_349_4,
            None,
        ),
        (
            "square tilted",
            light(area(AreaShape::Square, 1.0, 0.0), tilted(0.6), 100.0),
            1.617_975_7,
            None,
        ),
    ];
    for (name, light, cycles, closed) in cases {
        let ours = lit_floor(vec![light.clone()], 256);
        assert!(
            (ours / cycles - 1.0).abs() < 3e-3,
            "{name}: {ours}, Cycles {cycles}"
        );
        if let Some(closed) = closed {
            assert!(
                (ours / closed - 1.0).abs() < 2e-3,
                "{name}: {ours}, closed form {closed}"
            );
        }
    }
}

#[test]
fn light_samples_and_scattered_rays_agree() {
    // A light without shadows is only sampled, one with shadows is met as well; with nothing in
    // the way both must give the same mean, which they do only if every density is right.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let above = at(0.3, -0.4, 1.0);
    let kinds = [
        LightKind::Point { radius: 0.6 },
        LightKind::Spot {
            radius: 0.6,
            size: 1.5,
            blend: 0.3,
        },
        LightKind::Sun { angle: 0.7 },
        LightKind::Area {
            shape: AreaShape::Rectangle,
            size: 1.0,
            size_y: 2.0,
        },
        LightKind::Area {
            shape: AreaShape::Ellipse,
            size: 1.0,
            size_y: 2.0,
        },
    ];
    for roughness in [0.3, 0.9] {
        for kind in kinds {
            let both = [true, false].map(|casts_shadow| {
                let light = LightParams {
                    casts_shadow,
                    ..light(kind, above, 10.0)
                };
                // A second light, so that the choice of the light is part of the densities.
                let other = LightParams {
                    casts_shadow,
                    ..self::light(LightKind::Point { radius: 0.2 }, at(1.0, 1.0, 1.0), 3.0)
                };
                let material = MaterialParams {
                    roughness,
                    ..Default::default()
                };
                let params = SceneParams {
                    materials: vec![material],
                    lights: vec![light, other],
                    ..Default::default()
                };
                mean(
                    &run(
                        &mesh.scene(params),
                        &from_above(0.5),
                        square(16, 1024, 0),
                        2,
                    )
                    .0,
                )
            });
            let difference = (both[0] / both[1] - 1.0).abs();
            assert!(
                difference < 5e-3,
                "{kind:?} roughness {roughness}: {both:?}"
            );
        }
    }
}

#[test]
fn a_closed_room_glows_by_the_geometric_series() {
    // Inside a closed room whose walls emit 1 and reflect a, the radiance is 1 / (1 - a)
    // everywhere; cut after b bounces: (1 - a^(b + 2)) / (1 - a).
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let material = MaterialParams {
        emission: [1.0; 3],
        ..matte(0.5)
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![material],
        ..Default::default()
    });
    let camera = CameraParams {
        clip_start: 0.0,
        ..Default::default()
    };
    for (bounces, expected) in [(0, 1.5), (1, 1.75), (30, 2.0)] {
        let value = mean(&run(&scene, &camera, square(8, 256, bounces), 1).0);
        assert!((value - expected).abs() < 0.01, "{bounces}: {value}");
    }
}

#[test]
fn white_furnace_on_solids() {
    // Whatever a lossless solid does with light, in front of a world of radiance 1 it vanishes.
    let white = [1.0; 3];
    let solids = [
        ("diffuse", matte(1.0), 1e-6),
        (
            "mirror",
            MaterialParams {
                metallic: 1.0,
                roughness: 0.0,
                ..Default::default()
            },
            1e-6,
        ),
        (
            "metal",
            MaterialParams {
                metallic: 1.0,
                roughness: 0.6,
                ..Default::default()
            },
            2e-3,
        ),
        (
            "glass",
            MaterialParams {
                transmission: 1.0,
                roughness: 0.0,
                ..Default::default()
            },
            2e-3,
        ),
        (
            "frosted",
            MaterialParams {
                transmission: 1.0,
                roughness: 0.4,
                ..Default::default()
            },
            6e-3,
        ),
        (
            "coated",
            MaterialParams {
                roughness: 0.3,
                ..Default::default()
            },
            2e-3,
        ),
    ];
    for (name, material, tolerance) in solids {
        let mut mesh = Mesh::default();
        mesh.cube(1.0, 0);
        let material = MaterialParams {
            base_color: white,
            ..material
        };
        let params = SceneParams {
            materials: vec![material],
            world: white.into(),
            ..Default::default()
        };
        let mut camera = from_above(1.4);
        camera.to_world = {
            // Askew, so that three sides are seen.
            let (s, c) = 0.6_f64.sin_cos();
            [
                [c, 0.0, s, 6.0 * s],
                [s * s, c, -s * c, -6.0 * s * c],
                [-s * c, s, c * c, 6.0 * c * c],
                [0.0, 0.0, 0.0, 1.0],
            ]
        };
        let value = mean(&run(&mesh.scene(params), &camera, square(16, 256, 60), 2).0);
        assert!((value - 1.0).abs() < tolerance, "{name}: {value}");
    }
}

/// A scene with something of everything.
fn rich() -> (Mesh, SceneParams) {
    let mut mesh = Mesh::default();
    let sphere = mesh.sphere(2, 1);
    let mut normals = sphere;
    mesh.floor(3.0, -1.0, 0);
    mesh.quad(
        [
            [-2.0, 1.5, -1.0],
            [2.0, 1.5, -1.0],
            [2.0, 1.5, 2.0],
            [-2.0, 1.5, 2.0],
        ],
        2,
    );
    mesh.quad(
        [
            [1.0, -1.0, -1.0],
            [2.0, -1.0, -1.0],
            [2.0, -1.0, 1.0],
            [1.0, -1.0, 1.0],
        ],
        3,
    );
    normals.extend([[[0.0, 0.0, 1.0]; 3]; 2]);
    normals.extend([[[0.0, -1.0, 0.0]; 3]; 4]);
    let params = SceneParams {
        materials: vec![
            MaterialParams::default(),
            MaterialParams {
                transmission: 0.7,
                roughness: 0.1,
                ..Default::default()
            },
            MaterialParams {
                metallic: 1.0,
                roughness: 0.2,
                ..Default::default()
            },
            MaterialParams {
                alpha: 0.4,
                emission: [0.5, 0.2, 0.1],
                ..Default::default()
            },
        ],
        corner_normals: Some(normals),
        lights: vec![
            light(LightKind::Point { radius: 0.1 }, at(1.0, -2.0, 3.0), 100.0),
            light(LightKind::Sun { angle: 0.1 }, tilted(0.5), 1.0),
            light(
                LightKind::Area {
                    shape: AreaShape::Disk,
                    size: 1.0,
                    size_y: 1.0,
                },
                at(0.0, 0.0, 3.0),
                50.0,
            ),
        ],
        world: [0.1, 0.2, 0.3].into(),
        ..Default::default()
    };
    (mesh, params)
}

fn overview() -> CameraParams {
    let (s, c) = 1.2_f64.sin_cos();
    CameraParams {
        to_world: [
            [1.0, 0.0, 0.0, 0.2],
            [0.0, c, -s, -6.0 * s],
            [0.0, s, c, 6.0 * c],
            [0.0, 0.0, 0.0, 1.0],
        ],
        window: [-0.5, 0.5, -0.4, 0.4],
        ..Default::default()
    }
}

#[test]
fn threads_structures_and_steps_do_not_change_a_bit() {
    let (mesh, params) = rich();
    let params = SceneParams {
        material_index: Some(mesh.materials.clone()),
        ..params
    };
    let base = Settings {
        width: 70,
        height: 45,
        samples: 5,
        max_bounces: 4,
        ..Default::default()
    };
    let scenes = [false, true]
        .map(|reversed| Arc::new(RenderScene::new(mesh.tracer(reversed), params.clone()).unwrap()));
    let (reference, _) = run(&scenes[0], &overview(), base.clone(), 1);
    assert!(mean(&reference) > 0.05, "the picture is not black");
    for (scene, threads, step_samples) in [
        (0, 2, None),
        (0, 5, Some(1)),
        (1, 1, Some(3)),
        (1, 3, Some(5)),
    ] {
        let settings = Settings {
            step_samples,
            ..base.clone()
        };
        let (image, _) = run(&scenes[scene], &overview(), settings, threads);
        assert!(
            image == reference,
            "scene {scene} threads {threads} steps {step_samples:?}"
        );
    }
    // A border shows the same pixels as the full frame.
    let border = Settings {
        border: Some([13, 7, 50, 40]),
        ..base.clone()
    };
    let (part, _) = run(&scenes[0], &overview(), border, 2);
    for (i, pixel) in part.chunks_exact(4).enumerate() {
        let full = ((i / 37 + 7) * 70 + i % 37 + 13) * 4;
        assert_eq!(pixel, &reference[full..full + 4], "border pixel {i}");
    }
    let (other, _) = run(&scenes[0], &overview(), Settings { seed: 1, ..base }, 2);
    assert!(other != reference, "the seed matters");
}

#[test]
fn what_a_scene_lacks_costs_nothing() {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let world = [1.0; 3];
    let bare = mesh.scene(SceneParams {
        materials: vec![matte(0.5)],
        world: world.into(),
        ..Default::default()
    });
    let left_out = bare.features().left_out().join("\n");
    for words in [
        "shadow rays: no lights",
        "refraction: no material transmits",
        "mirror rays",
        "smooth normals: none given",
        "transparent shadows",
        "emission",
        "rays that meet lights",
    ] {
        assert!(left_out.contains(words), "{words} in {left_out}");
    }
    let settings = square(16, 4, 3);
    let work = run(&bare, &from_above(2.0), settings.clone(), 1).1.work;
    assert!(work.rays_primary == 16 * 16 * 4 && work.rays_secondary > 0);
    assert_eq!(
        (work.rays_shadow, work.shaded_glass, work.shaded_glossy),
        (0, 0, 0),
        "no light, glass or mirror"
    );
    assert_eq!((work.normals_fetched, work.lights_asked), (0, 0));
    // Each feature brings its own work back, and its line is gone.
    let gloss = MaterialParams::default();
    let glass = MaterialParams {
        transmission: 1.0,
        ..matte(0.5)
    };
    let sun = vec![light(LightKind::Sun { angle: 0.2 }, at(0.0, 0.0, 1.0), 1.0)];
    let normals = Some(vec![[[0.0, 0.0, 1.0]; 3]; mesh.triangles.len()]);
    let with = |params: SceneParams| {
        let scene = mesh.scene(SceneParams {
            world: world.into(),
            ..params
        });
        (
            run(&scene, &from_above(2.0), settings.clone(), 1).1.work,
            scene.features().left_out(),
        )
    };
    let (work, lines) = with(SceneParams {
        materials: vec![gloss],
        ..Default::default()
    });
    assert!(work.shaded_glossy > 0 && !lines.iter().any(|l| l.starts_with("mirror")));
    let (work, lines) = with(SceneParams {
        materials: vec![glass],
        ..Default::default()
    });
    assert!(work.shaded_glass > 0 && !lines.iter().any(|l| l.starts_with("refraction")));
    let (work, lines) = with(SceneParams {
        materials: vec![matte(0.5)],
        lights: sun,
        ..Default::default()
    });
    assert!(work.rays_shadow > 0 && work.lights_asked > 0);
    assert!(!lines.iter().any(|l| l.starts_with("shadow rays")));
    let (work, lines) = with(SceneParams {
        materials: vec![matte(0.5)],
        corner_normals: normals,
        ..Default::default()
    });
    assert!(work.normals_fetched > 0 && !lines.iter().any(|l| l.starts_with("smooth")));
    // A material nobody uses counts as absent.
    let unused = mesh.scene(SceneParams {
        materials: vec![
            matte(0.5),
            MaterialParams {
                transmission: 1.0,
                ..Default::default()
            },
        ],
        ..Default::default()
    });
    assert!(!unused.features().glass);
    // With a black world and point lights the ray after the last bounce is not traced.
    let point = vec![light(
        LightKind::Point { radius: 0.0 },
        at(0.0, 0.0, 4.0),
        9.0,
    )];
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.5)],
        lights: point,
        ..Default::default()
    });
    assert_eq!(
        run(&scene, &from_above(2.0), square(16, 4, 0), 1)
            .1
            .work
            .rays_secondary,
        0
    );
}

#[test]
fn passes_hold_what_they_say() {
    let mut mesh = Mesh::default();
    mesh.floor(1.0, 3.0, 0);
    let scene = mesh.scene(SceneParams {
        world: [0.5; 3].into(),
        ..Default::default()
    });
    let settings = Settings {
        passes: Pass::ALL.to_vec(),
        film_transparent: true,
        ..square(8, 3, 1)
    };
    let job = Job::start(scene, &from_above(2.0), settings, 1).unwrap();
    assert!(job.wait(Duration::from_secs(60)) && job.samples_done() == 3);
    let get = |pass: Pass| {
        let mut out = vec![-1.0; 64 * pass.channels()];
        job.copy_into(pass, &mut out).unwrap();
        out
    };
    let (middle, corner) = (3 * 8 + 3, 0);
    let depth = get(Pass::Depth);
    assert!((depth[middle] - 5.0).abs() < 1e-5 && depth[corner] == 1e10);
    let normal = get(Pass::Normal);
    assert_eq!(normal[middle * 3..middle * 3 + 3], [0.0, 0.0, 1.0]);
    let position = get(Pass::Position);
    assert!((position[middle * 3 + 2] - 3.0).abs() < 1e-6);
    assert!(
        (position[middle * 3] + 0.25).abs() < 0.75 * 0.5,
        "half a pixel is 0.25"
    );
    let combined = get(Pass::Combined);
    assert_eq!(
        (
            combined[corner * 4],
            combined[corner * 4 + 3],
            combined[middle * 4 + 3]
        ),
        (0.0, 0.0, 1.0)
    );
    assert_eq!(
        (get(Pass::TraversalSteps)[0], get(Pass::TriangleTests)[0]),
        (3.0, 5.0)
    );
    assert_eq!(get(Pass::SampleCount)[middle], 3.0);
    let work = job.statistics().work;
    assert_eq!((work.steps, work.tests), (3 * 64 * 3, 5 * 64 * 3));
}

#[test]
fn transparency_lets_through_its_share_of_light_and_view() {
    // A sheet of opacity 0.25 that reflects nothing, over a lit floor.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let sun = vec![light(LightKind::Sun { angle: 0.0 }, at(0.0, 0.0, 1.0), 1.0)];
    let sheet = MaterialParams {
        alpha: 0.25,
        ..matte(0.0)
    };
    let materials = vec![matte(0.8), sheet];
    let params = SceneParams {
        materials,
        lights: sun,
        ..Default::default()
    };
    let open = mean(
        &run(
            &mesh.scene(params.clone()),
            &from_above(1.0),
            square(16, 64, 0),
            1,
        )
        .0,
    );
    mesh.floor(9.0, 1.0, 1);
    let (image, stats) = run(&mesh.scene(params), &from_above(1.0), square(16, 64, 0), 1);
    assert!(
        (mean(&image) / open - 0.75 * 0.75).abs() < 0.01,
        "{} {open}",
        mean(&image)
    );
    assert!(stats.work.rays_shadow > 0);
    // Alone before a transparent film its alpha is its opacity.
    let mut alone = Mesh::default();
    alone.floor(9.0, 1.0, 0);
    let sheet = MaterialParams {
        alpha: 0.25,
        ..matte(0.0)
    };
    let scene = alone.scene(SceneParams {
        materials: vec![sheet],
        ..Default::default()
    });
    let settings = Settings {
        film_transparent: true,
        ..square(16, 64, 0)
    };
    let (image, _) = run(&scene, &from_above(1.0), settings, 1);
    let alpha: f32 = image.chunks_exact(4).map(|p| p[3]).sum::<f32>() / 256.0;
    assert!((alpha - 0.25).abs() < 0.01, "{alpha}");
}

#[test]
fn lights_are_seen_in_mirrors_but_not_by_the_camera() {
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let mirror = MaterialParams {
        base_color: [1.0; 3],
        metallic: 1.0,
        roughness: 0.0,
        ..Default::default()
    };
    let area = LightKind::Area {
        shape: AreaShape::Square,
        size: 20.0,
        size_y: 0.0,
    };
    let lights = vec![light(area, at(0.0, 0.0, 2.0), 100.0)];
    let scene = mesh.scene(SceneParams {
        materials: vec![mirror],
        lights,
        ..Default::default()
    });
    let radiance = 100.0 / (std::f64::consts::PI * 400.0);
    let (image, _) = run(&scene, &from_above(1.0), square(8, 4, 0), 1);
    assert!((mean(&image) / radiance - 1.0).abs() < 1e-4);
}

#[test]
fn shadow_edges_lie_where_geometry_puts_them() {
    // A blocker's edge at x = 0, height 1; a point light at height 2 over x = 1 throws it to
    // x = -1.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    mesh.quad(
        [
            [-9.0, -9.0, 1.0],
            [0.0, -9.0, 1.0],
            [0.0, 9.0, 1.0],
            [-9.0, 9.0, 1.0],
        ],
        0,
    );
    let lights = vec![light(
        LightKind::Point { radius: 0.0 },
        at(1.0, 0.0, 2.0),
        100.0,
    )];
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.8)],
        lights,
        ..Default::default()
    });
    let mut camera = from_above(2.0);
    camera.clip_start = 7.5; // Below the blocker.
    let (image, _) = run(&scene, &camera, square(64, 1, 0), 1);
    for (x, pixel) in image.chunks_exact(4).take(64).enumerate() {
        let position = (x as f32 + 0.5) / 16.0 - 2.0;
        if (position + 1.0).abs() > 0.1 {
            assert_eq!(pixel[0] > 0.0, position > -1.0, "at {position}");
        }
    }
}

/// Answers slowly, or fails on demand.
struct Troublesome {
    inner: Arc<Plain>,
    per_ray: Duration,
    fail_after: Option<u64>,
    calls: AtomicU64,
    longest: AtomicU64,
}

impl Tracer for Troublesome {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.inner.triangles)
    }

    fn count(&self) -> usize {
        self.inner.triangles.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.inner.triangles.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        let call = self.calls.fetch_add(1, Ordering::Relaxed);
        assert!(self.fail_after.is_none_or(|n| call < n), "planted failure");
        self.longest.fetch_max(rays.len() as u64, Ordering::Relaxed);
        std::thread::sleep(self.per_ray * rays.len() as u32);
        self.inner.closest(rays, hits, counters);
    }

    fn occluded(&self, rays: &[Ray], out: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.inner.occluded(rays, out, counters);
    }
}

fn troublesome(per_ray: Duration, fail_after: Option<u64>) -> (Arc<Troublesome>, Arc<RenderScene>) {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let inner = mesh.tracer(false);
    let tracer = Arc::new(Troublesome {
        inner,
        per_ray,
        fail_after,
        calls: AtomicU64::new(0),
        longest: AtomicU64::new(0),
    });
    let scene = RenderScene::new(tracer.clone(), SceneParams::default()).unwrap();
    (tracer, Arc::new(scene))
}

#[test]
fn a_cancelled_render_stops_within_a_call_and_keeps_what_it_has() {
    let per_ray = Duration::from_micros(200);
    let (tracer, scene) = troublesome(per_ray, None);
    let settings = Settings {
        width: 256,
        height: 256,
        samples: 1000,
        ..Default::default()
    };
    let job = Job::start(scene, &from_above(2.0), settings, 2).unwrap();
    assert!(!job.wait(Duration::from_millis(400)));
    job.cancel();
    let started = tracer.calls.load(Ordering::Relaxed);
    assert!(job.wait(Duration::from_secs(60)));
    // Each worker ends the call it is in, or one that it begins meanwhile; no call is long.
    assert!(tracer.calls.load(Ordering::Relaxed) <= started + 2);
    let longest = tracer.longest.load(Ordering::Relaxed) as u32;
    assert!(
        per_ray * longest <= Duration::from_millis(50),
        "{longest} rays"
    );
    assert!(job.is_cancelled() && job.error().is_none() && job.progress() < 1.0);
    let mut out = vec![0.0; 256 * 256 * 4];
    job.copy_into(Pass::Combined, &mut out).unwrap();
    assert!(out.iter().all(|v| v.is_finite()));
}

#[test]
fn a_panic_in_a_worker_becomes_an_error_text() {
    let (_, scene) = troublesome(Duration::ZERO, Some(20));
    let settings = Settings {
        width: 256,
        height: 256,
        samples: 4,
        ..Default::default()
    };
    let job = Job::start(scene, &from_above(2.0), settings, 2).unwrap();
    assert!(job.wait(Duration::from_secs(10)));
    let error = job.error().expect("an error");
    assert!(error.contains("planted failure"), "{error}");
    assert!(!job.is_cancelled(), "failed, not cancelled");
}

#[test]
fn an_empty_scene_shows_its_world() {
    let mesh = Mesh::default();
    let scene = mesh.scene(SceneParams {
        world: [0.25, 0.5, 1.0].into(),
        ..Default::default()
    });
    let (image, stats) = run(&scene, &overview(), square(9, 2, 4), 2);
    assert!(image.chunks_exact(4).all(|p| p == [0.25, 0.5, 1.0, 1.0]));
    assert_eq!(stats.work.rays_secondary, 0);
    assert!(scene.features().left_out()[0].contains("no triangles"));
}

#[test]
fn bad_scenes_are_refused_by_name() {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let n = mesh.triangles.len();
    let mut index = vec![0; n];
    index[4] = 7;
    let mut normals = vec![[[0.0, 0.0, 1.0]; 3]; n];
    normals[2][1][0] = f32::NAN;
    let bad_light = LightParams {
        power: [f32::NAN; 3],
        ..light(LightKind::Sun { angle: 0.1 }, at(0.0, 0.0, 0.0), 1.0)
    };
    let wide = light(LightKind::Sun { angle: 9.0 }, at(0.0, 0.0, 0.0), 1.0);
    let cases = [
        (
            "material_index[4]: 7",
            SceneParams {
                material_index: Some(index),
                ..Default::default()
            },
        ),
        (
            "one entry per triangle: 12, got 1",
            SceneParams {
                material_index: Some(vec![0]),
                ..Default::default()
            },
        ),
        (
            "corner_normals[2]",
            SceneParams {
                corner_normals: Some(normals),
                ..Default::default()
            },
        ),
        (
            "lights[0]['power']",
            SceneParams {
                lights: vec![bad_light],
                ..Default::default()
            },
        ),
        (
            "lights[0]['angle']",
            SceneParams {
                lights: vec![wide],
                ..Default::default()
            },
        ),
        (
            "world['color']",
            SceneParams {
                world: [f32::INFINITY, 0.0, 0.0].into(),
                ..Default::default()
            },
        ),
    ];
    for (words, params) in cases {
        let error = RenderScene::new(mesh.tracer(false), params)
            .err()
            .expect(words)
            .to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    }
}

#[test]
fn a_smooth_sphere_has_no_facets_in_its_shadow() {
    // A coarse sphere with smooth normals under a sun: next to the terminator, where the flat
    // triangles turn away from the light, brightness must still fall off steadily.
    let mut mesh = Mesh::default();
    let normals = mesh.sphere(3, 0);
    let sun = vec![light(
        LightKind::Sun { angle: 0.0 },
        [
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ],
        1.0,
    )];
    let params = SceneParams {
        materials: vec![matte(0.8)],
        corner_normals: Some(normals),
        lights: sun,
        ..Default::default()
    };
    let (image, _) = run(&mesh.scene(params), &from_above(1.0), square(65, 16, 0), 2);
    // Along the middle row the exact value is 0.8 / π × x.
    let row = &image[32 * 65 * 4..33 * 65 * 4];
    let mut worst = 0.0_f32;
    for (i, pixel) in row.chunks_exact(4).enumerate().skip(35).take(22) {
        let x = (i as f32 + 0.5) / 32.5 - 1.0;
        let exact = 0.8 * std::f32::consts::FRAC_1_PI * x;
        worst = worst.max((pixel[0] - exact).abs());
    }
    assert!(worst < 0.02, "{worst}");
}
