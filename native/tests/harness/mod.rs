// SPDX-License-Identifier: GPL-3.0-or-later
//! Fuzzing targets: every decoder of input and every builder, on numbers made from bytes.
//! The targets of `cargo fuzz` and the driver in `tests/bytes.rs` share this file.

use halfspace::base::Monitor;
use halfspace::base::error::Error;
use halfspace::inspect::validate::validate;
use halfspace::oracle::exact_closest;
use halfspace::ray::{Hit, Order, Ray, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::render::camera::filter::FilterKind;
use halfspace::render::camera::lens::LensParams;
use halfspace::render::camera::rolling::RollingParams;
use halfspace::render::camera::{CameraParams, Projection};
use halfspace::render::job::Job;
use halfspace::render::light::{AreaShape, LightKind, LightParams};
use halfspace::render::material::MaterialParams;
use halfspace::render::scene::indices::Indices;
use halfspace::render::scene::{RenderScene, SceneParams};
use halfspace::render::settings::{Falloff, Integrator, Mist, Pass, Settings};
use halfspace::render::values::linking::LightSets;
use halfspace::render::values::visibility::Visibility;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::row::Kind;
use halfspace::structure::spec::Config;
use halfspace::structure::way::{NODES, TRAVERSAL};
use std::sync::Arc;
use std::time::Duration;

/// Memory limit of a build in bytes: small inputs that need more are a fault.
const MEMORY: u64 = 256 << 20;

/// A target: accepts any bytes, and panics at a fault.
pub type Target = fn(&[u8]);

/// All targets, by name.
pub const TARGETS: [(&str, Target); 4] = [
    ("spec", spec),
    ("scene", scene),
    ("build_closest", build_closest),
    ("render", render),
];

/// Reads numbers from bytes; zeros follow the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        let (&first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        first
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// A small integer, a multiple of an eighth, or arbitrary bits.
    fn number(&mut self) -> f32 {
        match self.byte() % 8 {
            0..=3 => f32::from(self.byte().cast_signed() / 8),
            4 | 5 => f32::from(self.byte().cast_signed()) / 8.0,
            6 => f32::from(self.byte()) / 255.0,
            _ => f32::from_bits(self.word()),
        }
    }

    fn numbers<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.number())
    }

    fn matrix(&mut self) -> [[f64; 4]; 4] {
        std::array::from_fn(|_| self.numbers().map(f64::from))
    }

    /// A valid configuration of any structure.
    fn config(&mut self) -> Config {
        let tree = &TREES[usize::from(self.byte()) % TREES.len()];
        let mut spec = format!("{}:{}", tree.id, {
            let way = &tree.ways[usize::from(self.byte()) % tree.ways.len()];
            tree.spelled(way)
        });
        let own = ["robust", NODES, TRAVERSAL];
        for param in tree.params.iter().filter(|p| !own.contains(&p.name)) {
            let value = match (self.byte() % 4, param.kind) {
                (0, Kind::Integer { min, max }) => {
                    (min + i64::from(self.word()).rem_euclid(max - min + 1)).to_string()
                }
                (0, Kind::Float { min, max }) => {
                    (min + f64::from(self.byte()) / 255.0 * (max - min)).to_string()
                }
                (0, Kind::Choice(options)) => options[usize::from(self.byte()) % options.len()]
                    .name
                    .to_owned(),
                _ => continue,
            };
            // Leave out what has no effect next to the others.
            let more = format!("{spec},{}={value}", param.name);
            if registry::parse(&more).is_ok() {
                spec = more;
            }
        }
        registry::parse(&spec).expect("a valid configuration")
    }

    /// Up to 63 triangles over up to 255 vertices.
    fn triangles(&mut self) -> Arc<Triangles> {
        let vertices: Vec<_> = (0..self.byte().max(1)).map(|_| self.numbers()).collect();
        let count = u32::try_from(vertices.len()).expect("at most 255");
        let indices = (0..self.byte() % 64)
            .map(|_| [0; 3].map(|_: u8| self.word() % count))
            .collect();
        Arc::new(Triangles::new(vertices, indices).expect("all indices are in range"))
    }

    fn ray(&mut self) -> Ray {
        let limited = self.byte().is_multiple_of(4);
        Ray {
            o: self.numbers(),
            d: self.numbers(),
            t_min: if limited { self.number() } else { 0.0 },
            t_max: if limited {
                self.number()
            } else {
                f32::INFINITY
            },
        }
    }
}

fn built(scene: &Arc<Triangles>, config: Config) -> Structure {
    let monitor = Monitor::new();
    monitor.limit_memory(MEMORY);
    match Structure::build(scene.clone(), config, 1, &monitor) {
        // Two values within their ranges may still exclude each other.
        Err(Error::Spec(_)) => built(scene, registry::parse("kd").expect("valid")),
        built => built.expect("small input needs little memory"),
    }
}

/// Any text as a configuration: an error, or a configuration equal to that of its canonical text.
pub fn spec(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    match registry::parse(&text) {
        Ok(config) => {
            let again = registry::parse(&config.canonical()).expect("canonical text is valid");
            assert_eq!(config.canonical(), again.canonical());
        }
        Err(error) => assert!(matches!(error, Error::Spec(_)), "{error:?}"),
    }
}

/// Any vertices and any indices: an error, or a scene in which every triangle is live or dropped.
pub fn scene(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let vertices: Vec<_> = (0..bytes.byte()).map(|_| bytes.numbers()).collect();
    let indices: Vec<_> = (0..bytes.byte())
        .map(|_| {
            [0; 3].map(|_: u8| {
                u32::from(bytes.byte()).wrapping_mul(u32::from(bytes.byte() / 250) * 77 + 1)
            })
        })
        .collect();
    let count = indices.len();
    match Triangles::new(vertices, indices) {
        Ok(scene) => assert_eq!(scene.live().len() + scene.dropped(), count),
        Err(error) => assert!(matches!(error, Error::Shape(_)), "{error:?}"),
    }
}

/// Any triangles, structure and rays: the tree is valid, and its hits equal those of brute force and of exact
/// arithmetic.
pub fn build_closest(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let config = bytes.config();
    let name = config.canonical();
    let scene = bytes.triangles();
    let rays: Vec<_> = (0..bytes.byte() % 32 + 1).map(|_| bytes.ray()).collect();
    let structure = built(&scene, config);
    assert_eq!(validate(&structure), Vec::<String>::new(), "{name}");
    let brute = built(
        &scene,
        registry::parse("brute").expect("brute force is there"),
    );
    let mut expected = vec![Hit::MISS; rays.len()];
    let mut found = expected.clone();
    let mut occluded = vec![false; rays.len()];
    brute.closest(&rays, &mut expected, None);
    let mut in_tiles = expected.clone();
    structure.closest(&rays, &mut found, None);
    structure.closest_ordered(&rays, &mut in_tiles, None, Order::Tiles);
    structure.occluded(&rays, &mut occluded, None);
    for (i, ray) in rays.iter().enumerate() {
        let bits = |hit: &Hit| {
            [
                hit.t.to_bits(),
                hit.triangle,
                hit.u.to_bits(),
                hit.v.to_bits(),
            ]
        };
        assert_eq!(bits(&found[i]), bits(&expected[i]), "{name}: {ray:?}");
        let tiled = bits(&in_tiles[i]);
        assert_eq!(tiled, bits(&expected[i]), "{name}, in tiles: {ray:?}");
        assert_eq!(occluded[i], expected[i].is_hit(), "{name}: {ray:?}");
        if ray.o.iter().chain(&ray.d).all(|x| x.is_finite()) {
            let exact = exact_closest(&scene, ray).hit;
            assert_eq!(
                (found[i].t, found[i].triangle),
                (exact.t, exact.triangle),
                "{name}: {ray:?}"
            );
        }
    }
}

fn light(bytes: &mut Bytes<'_>) -> LightParams {
    let shapes = [
        AreaShape::Square,
        AreaShape::Rectangle,
        AreaShape::Disk,
        AreaShape::Ellipse,
    ];
    let [a, b, c] = bytes.numbers();
    LightParams {
        kind: match bytes.byte() % 4 {
            0 => LightKind::Point { radius: a },
            1 => LightKind::Spot {
                radius: a,
                size: b,
                blend: c,
            },
            2 => LightKind::Sun { angle: a },
            _ => LightKind::Area {
                shape: shapes[usize::from(bytes.byte()) % 4],
                size: a,
                size_y: b,
                spread: c,
            },
        },
        to_world: bytes.matrix(),
        power: bytes.numbers(),
        sphere: bytes.byte().is_multiple_of(2),
        casts_shadow: bytes.byte().is_multiple_of(2),
        visible: Visibility::NOT_BY_CAMERA,
        sets: LightSets {
            receivers: bytes.byte() % 32,
            blockers: bytes.byte() % 32,
        },
        group: 1,
        max_bounces: u32::from(bytes.byte()),
        program: None,
    }
}

fn material(bytes: &mut Bytes<'_>) -> MaterialParams {
    let [metallic, roughness, ior, transmission, specular, alpha] = bytes.numbers();
    MaterialParams {
        name: String::new(),
        base_color: bytes.numbers(),
        metallic,
        roughness,
        ior,
        transmission,
        specular,
        emission: bytes.numbers(),
        alpha,
        ..MaterialParams::default()
    }
}

/// The parts of a scene other than its triangles, of which there are `triangles`.
fn scene_params(bytes: &mut Bytes<'_>, triangles: usize) -> SceneParams {
    SceneParams {
        material_index: None,
        instanced: None,
        materials: (0..bytes.byte() % 3).map(|_| material(bytes)).collect(),
        corner_normals: (bytes.byte().is_multiple_of(2)).then(|| {
            (0..triangles)
                .map(|_| [0; 3].map(|_: u8| bytes.numbers()))
                .collect()
        }),
        lights: (0..bytes.byte() % 3).map(|_| light(bytes)).collect(),
        world: bytes.numbers::<3>().into(),
        indices: Indices {
            first: (0..bytes.byte() % 3).map(|_| bytes.word() % 8).collect(),
            object: (0..bytes.byte() % 3).map(|_| bytes.number()).collect(),
            material: (0..bytes.byte() % 3).map(|_| bytes.number()).collect(),
            uvs: Vec::new(),
            ..Default::default()
        },
        ..SceneParams::default()
    }
}

fn camera(bytes: &mut Bytes<'_>) -> CameraParams {
    CameraParams {
        projection: if bytes.byte().is_multiple_of(2) {
            Projection::Perspective
        } else {
            Projection::Orthographic
        },
        to_world: bytes.matrix(),
        window: bytes.numbers().map(f64::from),
        clip_start: f64::from(bytes.number()),
        clip_end: f64::from(bytes.number()),
        lens: LensParams {
            radius: f64::from(bytes.number()),
            blades: u32::from(bytes.byte()),
            rotation: f64::from(bytes.number()),
            ratio: f64::from(bytes.number()),
            focus: f64::from(bytes.number()),
        },
        motion: None,
        rolling: bytes.byte().is_multiple_of(2).then(|| RollingParams {
            duration: f64::from(bytes.number()),
            curve: (0..bytes.byte() % 4)
                .map(|_| f64::from(bytes.number()))
                .collect(),
        }),
        poses: (0..bytes.byte() % 4).map(|_| bytes.matrix()).collect(),
    }
}

fn settings(bytes: &mut Bytes<'_>) -> Settings {
    Settings {
        width: u32::from(bytes.byte() % 16),
        height: u32::from(bytes.byte() % 16),
        border: bytes
            .byte()
            .is_multiple_of(4)
            .then(|| [0; 4].map(|_: u8| u32::from(bytes.byte() % 20))),
        samples: u32::from(bytes.byte() % 4),
        integrator: [Integrator::Path, Integrator::Whitted, Integrator::Ambient]
            [usize::from(bytes.byte() % 3)],
        ambient_distance: bytes.number(),
        noise_threshold: bytes.number(),
        min_samples: u32::from(bytes.byte() % 4),
        time_limit: bytes.number(),
        mist: Mist {
            start: bytes.number(),
            depth: bytes.number(),
            falloff: Falloff::InverseQuadratic,
        },
        max_bounces: u32::from(bytes.byte() % 5),
        diffuse_bounces: u32::from(bytes.byte() % 5),
        glossy_bounces: u32::from(bytes.byte() % 5),
        transmission_bounces: u32::from(bytes.byte() % 5),
        volume_bounces: u32::from(bytes.byte() % 3),
        transparent_bounces: u32::from(bytes.byte() % 9),
        clamp_indirect: bytes.number(),
        clamp_direct: bytes.number(),
        filter_glossy: bytes.number(),
        caustics_reflective: bytes.byte().is_multiple_of(2),
        caustics_refractive: bytes.byte().is_multiple_of(2),
        secondary_beams: bytes.byte().is_multiple_of(2),
        seed: bytes.word(),
        film_transparent: bytes.byte().is_multiple_of(2),
        transparent_glass: bytes.number(),
        passes: Pass::all()
            .chain([Pass::Output(0), Pass::Group(0)])
            .collect(),
        step_samples: (bytes.byte().is_multiple_of(2)).then(|| u32::from(bytes.byte() % 3)),
        filter: if bytes.byte().is_multiple_of(2) {
            FilterKind::Box
        } else {
            FilterKind::BlackmanHarris
        },
        filter_width: bytes.number(),
        exposure: bytes.number(),
        record_rays: u32::from(bytes.byte() % 4),
    }
}

/// Any materials, lights, camera and settings: an error, or a render that ends in time without an error.
pub fn render(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let scene = bytes.triangles();
    let params = scene_params(&mut bytes, scene.len());
    let structure = built(&scene, registry::parse("kd").expect("the kd-tree is there"));
    let Ok(scene) = RenderScene::new(Arc::new(structure), params) else {
        return;
    };
    let camera = camera(&mut bytes);
    let settings = settings(&mut bytes);
    let Ok(job) = Job::start(Arc::new(scene), &camera, settings, 1) else {
        return;
    };
    assert!(
        job.wait(Duration::from_secs(600)),
        "a render of 15 x 15 pixels takes too long"
    );
    assert_eq!(job.error(), None);
}
