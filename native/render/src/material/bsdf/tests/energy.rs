// SPDX-License-Identifier: GPL-3.0-or-later
//! Energy conservation: no surface returns more light than it receives.

use super::*;

#[test]
fn an_index_that_varies_gains_nothing_wherever_it_lies() {
    let glass = [(Input::Transmission, 1.0)];
    for (kind, more) in [
        (ClosureKind::Glass, &[][..]),
        (ClosureKind::Principled, &glass),
        (ClosureKind::Principled, &[]),
    ] {
        let material = varying(kind, &[Input::Roughness, Input::Ior], more);
        for ior in [0.1_f32, 0.3, 0.5, 0.7, 0.9, 1.1, 1.5, 5.0, 20.0, 50.0] {
            let critical = (1.0 - ior * ior).max(0.0).sqrt();
            for roughness in [0.03, 0.22, 0.37, 0.8, 1.0] {
                for cos in [0.1, 0.5, 0.8, 1.0, critical + 0.005, critical - 0.02] {
                    if !(0.05..=1.0).contains(&cos) {
                        continue;
                    }
                    for inside in [false, true] {
                        let a = varying_albedo(&material, &[roughness, ior], cos, inside, 1 << 12);
                        assert!(
                            a < 1.04,
                            "{kind:?} index {ior} roughness {roughness} cos {cos} inside {inside}: {a}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn a_tint_of_reflections_gains_nothing_at_high_indices_and_roughness() {
    let glass = (Input::Transmission, 1.0);
    let opaque = (Input::Transmission, 0.0);
    for (lobes, tint) in [(glass, 0.0), (glass, 0.5), (opaque, 0.0), (opaque, 2.0)] {
        for ior in [1.5, 3.0, 10.0, 50.0] {
            for roughness in [0.1, 0.5, 1.0] {
                let more = [lobes, (Input::SpecularTint, tint), (Input::Ior, ior)];
                let material = node(ClosureKind::Principled, roughness, &more);
                for cos in [0.1, 0.3, 0.6, 1.0] {
                    let a = albedo(&material, cos, false);
                    let name = format!("{lobes:?} {tint} {ior} {roughness} {cos}: {a}");
                    assert!((0.98..1.006).contains(&a), "{name}");
                }
            }
        }
    }
}

#[test]
fn translucency_keeps_the_light_of_the_base() {
    let lit =
        |more: &[(Input, f32)], cos| albedo(&node(ClosureKind::Principled, 0.5, more), cos, false);
    for more in [
        &[][..],
        &[(Input::CoatWeight, 1.0)],
        &[(Input::SheenWeight, 0.5)],
    ] {
        for cos in [0.2, 1.0] {
            let plain = lit(more, cos);
            for share in [0.4, 1.0] {
                let through = lit(&[more, &[(Input::Translucency, share)]].concat(), cos);
                assert!(
                    (through - plain).abs() < 0.01,
                    "{more:?} {share} {cos}: {through} {plain}"
                );
            }
        }
    }
}

#[test]
fn a_coat_lets_through_what_it_does_not_reflect() {
    // A white coat over a black base: light from below passes in the share that is not reflected.
    for (roughness, ior) in [(0.0, 1.5), (0.3, 1.5), (0.7, 2.0)] {
        let coat = [
            (Input::Color, 0.0),
            (Input::Specular, 0.0),
            (Input::CoatWeight, 1.0),
            (Input::CoatRoughness, roughness),
            (Input::CoatIor, ior),
        ];
        let material = node(ClosureKind::Principled, 0.5, &coat);
        for cos in [0.1, 0.5, 1.0] {
            let through = material.closures[0].through_coat(&[], cos).mean();
            let reflected = albedo(&material, cos, false);
            let all = f64::from(through) + reflected;
            // The excess of Cycles' estimate of the reflection is lost.
            assert!(
                (0.985..1.004).contains(&all),
                "{roughness} {ior} {cos}: {all}"
            );
        }
    }
    // A coat of weight one half absorbs half of what crosses it straight.
    let half = [
        (Input::CoatWeight, 0.5),
        (Input::CoatIor, 1.0),
        (Input::CoatTint, 0.5),
    ];
    let closure = &node(ClosureKind::Principled, 0.5, &half).closures[0];
    assert!((closure.through_coat(&[], 1.0).x - 0.75).abs() < 1e-6);
    assert!((closure.through_coat(&[], 0.5).x - 0.625).abs() < 1e-6);
    let bare = node(ClosureKind::Principled, 0.5, &[]);
    assert_eq!(bare.closures[0].through_coat(&[], 0.5), Vec3::ONE);
}
