// SPDX-License-Identifier: GPL-3.0-or-later
//! Pictures of hair: light passes through it, and none is lost.

use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::scene::SceneParams;
use crate::tests::setup::{Mesh, from_above, light, mean, run, square, tilted};
use crate::values::program::{Coordinate, Op, Operand, Shift, Step};
use crate::values::varying::{Layer, Varying};

/// A material of one hair shader without absorption, along an edge of each triangle.
fn hair(kind: ClosureKind, roughness: f32, strands: Option<u16>) -> MaterialParams {
    let mut closure = ClosureParams::new(kind);
    let mut set = |input: Input, value: Operand| closure.inputs[input as usize] = value;
    set(Input::Color, Operand::number(1.0));
    set(Input::Roughness, Operand::number(roughness));
    set(Input::RadialRoughness, Operand::number(roughness));
    set(Input::Ior, Operand::number(1.55));
    set(Input::Offset, Operand::number(0.05));
    set(Input::Tangent, Operand::Register(0));
    MaterialParams {
        closures: vec![closure],
        program: vec![Step {
            op: Op::Coordinate(Coordinate::EdgeU, Shift::None),
            args: Vec::new(),
        }],
        strands,
        ..Default::default()
    }
}

/// A smooth sphere of this material in white or in the light of a sun; the mean brightness of its middle.
fn sphere(material: MaterialParams, bounces: u32, sun: bool) -> f64 {
    let mut mesh = Mesh::default();
    let normals = mesh.sphere(3, 0);
    let layer = Layer {
        width: 3,
        values: vec![1.0; 9 * mesh.triangles.len()].into(),
    };
    let lights = if sun {
        vec![light(LightKind::Sun { angle: 0.1 }, tilted(2.5), 3.0)]
    } else {
        Vec::new()
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![material],
        corner_normals: Some(normals),
        varying: Varying {
            layers: vec![layer],
            ..Default::default()
        },
        world: [f32::from(u8::from(!sun)); 3].into(),
        lights,
        ..Default::default()
    });
    mean(&run(&scene, &from_above(0.6), square(8, 64, bounces), 2).0)
}

#[test]
fn white_hair_neither_gains_nor_loses_light() {
    for kind in [
        ClosureKind::Hair,
        ClosureKind::HairReflection,
        ClosureKind::HairTransmission,
    ] {
        for roughness in [0.1, 0.3, 1.0] {
            // A strand scatters light once; light within other meshes has further to go.
            for (strands, bounces) in [(Some(0), 1), (None, 40)] {
                let found = sphere(hair(kind, roughness, strands), bounces, false);
                assert!(
                    (found - 1.0).abs() < 2e-3,
                    "{kind:?} {roughness} {strands:?}: {found}"
                );
            }
        }
    }
}

#[test]
fn light_from_behind_passes_through_a_strand() {
    let of = |strands| sphere(hair(ClosureKind::Hair, 0.3, strands), 0, true);
    let (strand, mesh) = (of(Some(0)), of(None));
    assert!(strand > 0.05 && mesh < 0.2 * strand, "{strand} {mesh}");
}
