// SPDX-License-Identifier: GPL-3.0-or-later
//! Lobes widened or dropped by the settings of a render.

use crate::material::bsdf::tests::{compile, filtered, mean_weight, node, seen, view};
use crate::material::bsdf::{Bsdf, LobeFilter, MAX_LOBES};
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::material::{Material, MaterialParams, ggx::Ggx};
use crate::values::program::Operand;

fn widened(min_width: f32) -> LobeFilter {
    LobeFilter {
        min_width,
        ..LobeFilter::NONE
    }
}

/// Without reflections, refractions or both.
fn without(reflections: bool, refractions: bool) -> LobeFilter {
    LobeFilter {
        reflections,
        refractions,
        ..LobeFilter::NONE
    }
}

fn bsdf(material: &Material, filter: LobeFilter) -> Bsdf<true, true, { MAX_LOBES }> {
    filtered(material, view(0.7), false, filter)
}

#[test]
fn widening_raises_the_width_and_never_lowers_it() {
    assert_eq!(Ggx::new(0.9).widened(0.25), Ggx::new(0.9));
    assert_eq!(Ggx::MIRROR.widened(0.25), Ggx::new(0.5));
    assert_eq!(Ggx::MIRROR.widened(0.0), Ggx::MIRROR);
}

#[test]
fn a_widened_mirror_has_a_density_and_the_energy_of_its_width() {
    for kind in [ClosureKind::Glossy, ClosureKind::Glass] {
        let mirror = node(kind, 0.0, &[]);
        assert!(!seen(&mirror, view(0.7), false).has_density());
        let soft = bsdf(&mirror, widened(0.25));
        assert!(soft.has_density());
        // Like a lobe of that roughness without compensation of multiple scattering.
        let mut closure = ClosureParams::new(kind);
        closure.inputs[Input::Color as usize] = Operand::number(1.0);
        closure.multiscatter = false;
        let rough = compile(MaterialParams {
            closures: vec![closure],
            ..Default::default()
        });
        let (found, expected) = (
            mean_weight(&soft, 20_000),
            mean_weight(&bsdf(&rough, LobeFilter::NONE), 20_000),
        );
        assert!(
            (found - expected).abs() < 1e-3,
            "{kind:?}: {found} {expected}"
        );
    }
}

#[test]
fn dropped_reflections_leave_the_base_undimmed() {
    let principled = node(
        ClosureKind::Principled,
        0.3,
        &[(Input::Color, 0.5), (Input::CoatWeight, 1.0)],
    );
    let base = mean_weight(&bsdf(&principled, without(false, true)), 1000);
    assert!((base - 0.5).abs() < 1e-6, "{base}");
    let all = mean_weight(&bsdf(&principled, LobeFilter::NONE), 20_000);
    assert!(all > 0.51, "{all}");
    for kind in [ClosureKind::Glossy, ClosureKind::Refraction] {
        let reflects = kind == ClosureKind::Glossy;
        let gone = bsdf(&node(kind, 0.3, &[]), without(!reflects, reflects));
        assert!(gone.sample(0.5, [0.5; 2]).is_none());
        assert!(!gone.has_density());
    }
}

#[test]
fn glass_splits_into_its_two_parts() {
    for roughness in [0.0, 0.4] {
        let glass = node(ClosureKind::Glass, roughness, &[]);
        let energy = |filter| mean_weight(&bsdf(&glass, filter), 50_000);
        let (reflected, refracted) = (energy(without(true, false)), energy(without(false, true)));
        let all = energy(LobeFilter::NONE);
        assert!(
            reflected > 0.02 && refracted > 0.8,
            "{reflected} {refracted}"
        );
        // The compensation of rough glass is that of the refracted part.
        let tolerance = if roughness > 0.0 { 0.01 } else { 1e-4 };
        let error = (reflected + refracted - all).abs();
        assert!(error < tolerance, "{roughness}: {error}");
        assert!(!bsdf(&glass, without(false, false)).has_density());
        assert!(
            bsdf(&glass, without(false, false))
                .sample(0.5, [0.5; 2])
                .is_none()
        );
    }
}
