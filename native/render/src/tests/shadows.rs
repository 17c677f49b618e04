// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadows, transparent surfaces and ray visibility.

use crate::camera::CameraParams;
use crate::light::world::WorldParams;
use crate::light::{AreaShape, LightKind, LightParams};
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::math::vector::vec3;
use crate::scene::SceneParams;
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, square};
use crate::values::linking::{LightSets, ObjectSets};
use crate::values::program::{Op, Operand, Step};
use crate::values::visibility::RayKind;
use crate::values::visibility::Visibility;

#[test]
fn a_transparent_sheet_transmits_its_share_of_light_and_view() {
    // A black sheet of opacity 0.25 over a lit floor.
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
    // With a transparent film, the sheet alone has an alpha equal to its opacity.
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
fn lights_are_visible_in_mirrors_but_not_to_the_camera() {
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
        spread: std::f32::consts::PI,
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
fn shadow_edges_have_the_geometric_position() {
    // A blocker ends at x = 0 at height 1; a point light at height 2 above x = 1 projects this edge to x = -1.
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

#[test]
fn a_smooth_sphere_has_no_facets_in_its_shadow() {
    // A coarse sphere with smooth normals below a sun: near the terminator, where flat triangles face away from the
    // light, the brightness must decrease smoothly.
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

#[test]
fn shadow_rays_pass_any_number_of_invisible_surfaces() {
    // Between a lamp and a floor lie more cards, invisible to shadow rays, than the limit for transparent surfaces.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let lamp = light(LightKind::Point { radius: 0.0 }, at(0.0, 0.0, 2.0), 100.0);
    let hidden = MaterialParams {
        visible: Visibility::ALL
            .without(RayKind::Shadow)
            .without(RayKind::Camera),
        ..matte(0.0)
    };
    let params = SceneParams {
        materials: vec![matte(0.8), hidden],
        lights: vec![lamp],
        ..Default::default()
    };
    let picture = |mesh: &Mesh| {
        let scene = mesh.scene(params.clone());
        mean(&run(&scene, &from_above(1.0), square(8, 4, 0), 1).0)
    };
    let open = picture(&mesh);
    for i in 0..200_u8 {
        mesh.floor(9.0, 0.5 + f32::from(i) / 256.0, 1);
    }
    let behind = picture(&mesh);
    assert!(
        open > 0.0 && (behind / open - 1.0).abs() < 1e-5,
        "{behind} {open}"
    );
}

#[test]
fn linked_lights_shine_on_their_receivers_and_are_shaded_by_their_blockers() {
    // A lamp above a card above a floor: with sets of the lamp, and the sets that floor and card are in.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    mesh.floor(9.0, 1.0, 1);
    let picture = |receivers: u8, blockers: u8, floor: u32, card: u32| {
        let lamp = LightParams {
            sets: LightSets {
                receivers,
                blockers,
            },
            ..light(LightKind::Point { radius: 0.0 }, at(0.0, 0.0, 2.0), 100.0)
        };
        let linked = |receives: u32, blocks: u32| MaterialParams {
            sets: ObjectSets { receives, blocks },
            ..matte(0.8)
        };
        let card = MaterialParams {
            visible: Visibility::ALL.without(RayKind::Camera),
            ..linked(1, card)
        };
        let scene = mesh.scene(SceneParams {
            materials: vec![linked(floor, 1), card],
            lights: vec![lamp],
            ..Default::default()
        });
        mean(&run(&scene, &from_above(1.0), square(8, 4, 0), 1).0)
    };
    // The card lets the light of lamps through whose blockers exclude it.
    let lit = picture(0, 2, 1, 0b001);
    assert!(lit > 0.0);
    assert_eq!(picture(0, 2, 1, 0b101), 0.0);
    assert_eq!(picture(0, 0, 1, 0b001), 0.0);
    // The floor receives the light of the sets that it is in.
    assert_eq!(picture(3, 2, 0b0001, 0b001), 0.0);
    assert_eq!(picture(3, 2, 0b1001, 0b001), lit);
}

#[test]
fn linked_emission_shines_on_its_receivers_and_is_shaded_by_its_blockers() {
    // A glowing sheet above a card above a floor, of which the camera sees the floor alone.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    mesh.floor(9.0, 1.0, 1);
    mesh.floor(1.0, 2.0, 2);
    let picture = |receivers: u8, blockers: u8, floor: u32, card: u32| {
        let linked = |receives: u32, blocks: u32| MaterialParams {
            sets: ObjectSets { receives, blocks },
            ..matte(0.8)
        };
        let unseen = |material: MaterialParams| MaterialParams {
            visible: Visibility::ALL.without(RayKind::Camera),
            ..material
        };
        let glow = MaterialParams {
            emission: [1.0; 3],
            emits_to: LightSets {
                receivers,
                blockers,
            },
            ..matte(0.0)
        };
        let scene = mesh.scene(SceneParams {
            materials: vec![linked(floor, 1), unseen(linked(1, card)), unseen(glow)],
            ..Default::default()
        });
        mean(&run(&scene, &from_above(1.0), square(8, 256, 0), 1).0)
    };
    // The card lets the light through if it is no blocker, whether rays are sampled by the sheet or by the floor.
    let lit = picture(0, 2, 1, 0b001);
    assert!(lit > 0.01, "{lit}");
    assert_eq!(picture(0, 2, 1, 0b101), 0.0);
    assert_eq!(picture(0, 0, 1, 0b001), 0.0);
    // The floor receives the light of the sets that it is in.
    assert_eq!(picture(3, 2, 0b0001, 0b001), 0.0);
    assert_eq!(picture(3, 2, 0b1001, 0b001), lit);
}

#[test]
fn the_transmittance_of_a_pane_does_not_depend_on_the_distance_of_the_light() {
    // A pane whose transparency depends on the viewing angle, with tilted normals, below lamps whose power makes
    // the irradiance equal at any distance.
    let lit = |distance: f32| {
        let mut mesh = Mesh::default();
        mesh.floor(9.0, 0.0, 0);
        mesh.floor(9.0, 1.0, 1);
        let mut closure = ClosureParams::new(ClosureKind::Transparent);
        closure.inputs[Input::Color as usize] = Operand::Register(0);
        let pane = MaterialParams {
            closures: vec![closure],
            program: vec![Step {
                op: Op::LayerFacing,
                args: vec![Operand::number(0.5)],
            }],
            ..Default::default()
        };
        let lean = vec3(0.95, 0.0, -0.3).normalized().array();
        let power = 100.0 * distance * distance;
        let lamp = light(
            LightKind::Point { radius: 0.0 },
            at(0.0, 0.0, f64::from(distance)),
            power,
        );
        let params = SceneParams {
            materials: vec![matte(0.8), pane],
            corner_normals: Some(vec![
                [[0.0, 0.0, 1.0]; 3],
                [[0.0, 0.0, 1.0]; 3],
                [lean; 3],
                [lean; 3],
            ]),
            lights: vec![lamp],
            ..Default::default()
        };
        let camera = CameraParams {
            clip_start: 7.5,
            ..from_above(0.01)
        };
        mean(&run(&mesh.scene(params), &camera, square(8, 16, 0), 1).0)
    };
    let (near, far) = (lit(6.0), lit(6000.0));
    assert!(
        near > 0.01 && (near / far - 1.0).abs() < 0.02,
        "{near} {far}"
    );
}

#[test]
fn a_transparent_film_shows_no_background() {
    for visible in [Visibility::ALL, Visibility::NOT_BY_CAMERA] {
        let mut mesh = Mesh::default();
        mesh.floor(0.1, 0.0, 0);
        let mut world = WorldParams::from([1.0; 3]);
        world.visible = visible;
        let params = SceneParams {
            materials: vec![matte(0.5)],
            world,
            ..Default::default()
        };
        let settings = Settings {
            film_transparent: true,
            ..square(9, 16, 0)
        };
        let (image, _) = run(&mesh.scene(params), &from_above(1.0), settings, 1);
        assert_eq!(image[..4], [0.0; 4], "{visible:?}");
    }
}
