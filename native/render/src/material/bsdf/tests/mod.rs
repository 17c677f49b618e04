// SPDX-License-Identifier: GPL-3.0-or-later
//! Tests of [`super`].

use crate::material::albedo::Grids;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::material::{Material, MaterialParams};
use crate::values::program::{Op, Operand, Shift, Step};
use std::f32::consts::TAU;

use super::*;
use crate::math::sampler::PixelSampler;
use crate::math::vector::vec3;

mod energy;
mod filter;
mod lobes;

fn compile(params: MaterialParams) -> Material {
    Material::new(&params, 0, &mut Grids::default()).unwrap()
}

/// A material of one shader node with a white colour and this roughness.
fn node(kind: ClosureKind, roughness: f32, more: &[(Input, f32)]) -> Material {
    let mut closure = ClosureParams::new(kind);
    let white = [(Input::Color, 1.0), (Input::Roughness, roughness)];
    for &(input, value) in white.iter().chain(more) {
        closure.inputs[input as usize] = Operand::number(value);
    }
    compile(MaterialParams {
        closures: vec![closure],
        ..Default::default()
    })
}

/// A material of one white shader node whose `inputs` come from a program: the first register at each point is the
/// value of the first input, and so on.
fn varying(kind: ClosureKind, inputs: &[Input], more: &[(Input, f32)]) -> Material {
    let mut closure = ClosureParams::new(kind);
    for &(input, value) in [(Input::Color, 1.0)].iter().chain(more) {
        closure.inputs[input as usize] = Operand::number(value);
    }
    for (i, &input) in inputs.iter().enumerate() {
        closure.inputs[input as usize] = Operand::Register(i as u16);
    }
    let step = Step {
        op: Op::Attribute(0, Shift::None),
        args: Vec::new(),
    };
    compile(MaterialParams {
        closures: vec![closure],
        program: vec![step; inputs.len()],
        ..Default::default()
    })
}

/// The triangle's normal alone, without a mapped one.
const FLAT: Normals = Normals {
    geometric: vec3(0.0, 0.0, 1.0),
    mapped: None,
};

/// The BSDF seen from `wi`.
fn seen(material: &Material, wi: Vec3, inside: bool) -> Bsdf<true, true, MAX_LOBES> {
    filtered(material, wi, inside, LobeFilter::NONE)
}

/// The BSDF seen from `wi` by a path with this filter.
fn filtered(
    material: &Material,
    wi: Vec3,
    inside: bool,
    filter: LobeFilter,
) -> Bsdf<true, true, MAX_LOBES> {
    Bsdf::new(
        &material.closures,
        &[],
        wi,
        FLAT,
        inside,
        filter,
        &lobe::STRAIGHT,
    )
}

/// The viewing direction with this cosine, in the xz plane.
fn view(cos: f32) -> Vec3 {
    vec3((1.0 - cos * cos).sqrt(), 0.0, cos)
}

/// Albedo by Monte Carlo: the mean weight of `n` samples.
fn mean_weight(bsdf: &Bsdf<true, true, MAX_LOBES>, n: u32) -> f64 {
    let sampler = PixelSampler::new(3, 5, 7);
    let sum: f64 = (0..n)
        .filter_map(|i| bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)))
        .map(|s| f64::from(s.weight.mean()))
        .sum();
    sum / f64::from(n)
}

/// Albedo of a material whose inputs are constant.
fn albedo(material: &Material, cos: f32, inside: bool) -> f64 {
    mean_weight(&seen(material, view(cos), inside), 1 << 16)
}

/// Albedo, by `n` samples, of a material made by [`varying`] where its inputs have these values.
fn varying_albedo(material: &Material, inputs: &[f32], cos: f32, inside: bool, n: u32) -> f64 {
    let registers: Vec<_> = inputs.iter().map(|&x| [x; 4]).collect();
    let (closures, none) = (&material.closures, LobeFilter::NONE);
    let bsdf = Bsdf::new(
        closures,
        &registers,
        view(cos),
        FLAT,
        inside,
        none,
        &lobe::STRAIGHT,
    );
    mean_weight(&bsdf, n)
}

const WHITE: [f32; 3] = [1.0; 3];

#[test]
fn white_furnace_of_every_shader_node() {
    let principled = |more: &[(Input, f32)]| {
        let more = more.to_vec();
        move |roughness| node(ClosureKind::Principled, roughness, &more)
    };
    type Make = Box<dyn Fn(f32) -> Material>;
    let cases: Vec<(&str, Make)> = vec![
        ("Diffuse", Box::new(|r| node(ClosureKind::Diffuse, r, &[]))),
        (
            "rough diffuse",
            Box::new(|r| node(ClosureKind::Diffuse, 0.5, &[(Input::DiffuseRoughness, r)])),
        ),
        (
            "Translucent",
            Box::new(|r| node(ClosureKind::Translucent, r, &[])),
        ),
        (
            "rough base",
            Box::new(principled(&[(Input::DiffuseRoughness, 0.8)])),
        ),
        ("Glossy", Box::new(|r| node(ClosureKind::Glossy, r, &[]))),
        ("Glass", Box::new(|r| node(ClosureKind::Glass, r, &[]))),
        ("Principled", Box::new(principled(&[]))),
        (
            "without a layer",
            Box::new(principled(&[(Input::Specular, 0.0)])),
        ),
        ("metal", Box::new(principled(&[(Input::Metallic, 1.0)]))),
        (
            "transmission",
            Box::new(principled(&[(Input::Transmission, 1.0)])),
        ),
        (
            "mixed",
            Box::new(principled(&[
                (Input::Metallic, 0.3),
                (Input::Transmission, 0.5),
            ])),
        ),
        (
            "coated",
            Box::new(principled(&[
                (Input::CoatWeight, 1.0),
                (Input::CoatRoughness, 0.2),
            ])),
        ),
    ];
    for (name, make) in cases {
        for roughness in [0.0, 0.1, 0.5, 1.0] {
            let material = make(roughness);
            let mut wrong = Vec::new();
            for cos in [0.1, 0.4, 0.7, 1.0] {
                for inside in [false, true] {
                    let a = albedo(&material, cos, inside);
                    // The excess of Cycles' estimate of a layer's reflection is lost; near the horizon it takes
                    // a little less than is reflected.
                    let layered = ["rough base", "Principled", "mixed", "coated"].contains(&name);
                    let range = if layered {
                        0.985..=1.005
                    } else {
                        0.998..=1.002
                    };
                    if !range.contains(&a) {
                        wrong.push((cos, inside, a));
                    }
                }
            }
            assert!(wrong.is_empty(), "{name} roughness {roughness}: {wrong:?}");
        }
    }
    // The Refraction node does not compensate multiple scattering, as in Cycles: it loses energy when rough.
    let refraction = node(ClosureKind::Refraction, 0.0, &[]);
    assert!((albedo(&refraction, 0.6, false) - 1.0).abs() < 1e-5);
    assert!(albedo(&node(ClosureKind::Refraction, 0.5, &[]), 0.6, false) < 1.0);
}

#[test]
fn weak_refraction_loses_and_gains_nothing() {
    for roughness in [0.0, 0.5, 1.0] {
        let glass = node(ClosureKind::Glass, roughness, &[(Input::Ior, 1.0)]);
        let pane = [(Input::Transmission, 1.0), (Input::Ior, 1.0)];
        let principled = node(ClosureKind::Principled, roughness, &pane);
        for (material, cos) in [(&glass, 0.17), (&glass, 0.5), (&principled, 0.5)] {
            let a = albedo(material, cos, false);
            assert!((a - 1.0).abs() < 1e-3, "{roughness} {cos}: {a}");
        }
    }
}

#[test]
fn a_tint_of_reflections_in_glass_leaves_the_rest_to_pass() {
    for (roughness, tint) in [(0.0, 0.0), (0.0, 0.2), (0.4, 0.2)] {
        let tinted = [(Input::Transmission, 1.0), (Input::SpecularTint, tint)];
        let material = node(ClosureKind::Principled, roughness, &tinted);
        for cos in [0.2, 0.5, 1.0] {
            let a = albedo(&material, cos, false);
            assert!((a - 1.0).abs() < 0.01, "{roughness} {tint} {cos}: {a}");
        }
    }
}

#[test]
fn a_tint_of_reflections_never_takes_away_more_than_there_is() {
    // At indices this high the reflectance has its minimum between normal and grazing incidence; without a lower
    // bound a tinted reflection would be negative there.
    let tinted = [
        (Input::Transmission, 1.0),
        (Input::SpecularTint, 0.0),
        (Input::Ior, 30.0),
    ];
    let material = node(ClosureKind::Principled, 0.2, &tinted);
    for cos in [0.1, 0.2, 0.3, 0.6] {
        let bsdf = seen(&material, view(cos), false);
        for z in [0.1_f32, 0.3, 0.6, 0.9] {
            let (f, pdf) = bsdf.eval(vec3(-(1.0 - z * z).sqrt(), 0.0, z));
            assert!(f.x >= 0.0 && pdf >= 0.0, "{cos} {z}: {f:?} {pdf}");
        }
    }
}

#[test]
fn a_layer_of_less_index_gains_nothing_at_its_critical_angle() {
    for roughness in [0.0, 0.01, 0.05, 0.3] {
        let material = node(ClosureKind::Principled, roughness, &[(Input::Ior, 0.5)]);
        // The critical angle is 30 degrees.
        for degrees in [
            10.0_f32, 26.0, 28.0, 29.0, 29.5, 30.0, 30.5, 31.0, 33.0, 60.0,
        ] {
            let a = albedo(&material, degrees.to_radians().cos(), false);
            assert!((a - 1.0).abs() < 0.03, "{roughness} {degrees}: {a}");
        }
    }
}

#[test]
fn as_many_lobes_as_a_material_may_have_all_count() {
    let closure = |kind: ClosureKind, more: &[(Input, f32)]| {
        let mut closure = ClosureParams::new(kind);
        let white = [
            (Input::Weight, 1.0 / MAX_CLOSURES as f32),
            (Input::Color, 1.0),
        ];
        for &(input, value) in white.iter().chain(more) {
            closure.inputs[input as usize] = Operand::number(value);
        }
        closure
    };
    let rich = [(Input::CoatWeight, 0.5), (Input::Metallic, 0.5)];
    let mut closures = vec![closure(ClosureKind::Principled, &rich); MAX_PRINCIPLED];
    let params = |closures: &[ClosureParams]| MaterialParams {
        closures: closures.to_vec(),
        ..Default::default()
    };
    closures.resize(MAX_CLOSURES, closure(ClosureKind::Glossy, &[]));
    let a = albedo(&compile(params(&closures)), 0.6, false);
    assert!((a - 1.0).abs() < 0.003, "{a}");
    closures[MAX_PRINCIPLED] = closure(ClosureKind::Principled, &rich);
    let refused = Material::new(&params(&closures), 0, &mut Grids::default());
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("more than 4 of kind principled, got 5"),
        "{message}"
    );
}

#[test]
fn a_furnace_is_white_where_the_inputs_vary_as_well() {
    // Roughness, index and specular come from a program, so the grids replace the single tables.
    let inputs = [Input::Roughness, Input::Ior, Input::Specular];
    let material = varying(
        ClosureKind::Principled,
        &inputs,
        &[(Input::Transmission, 0.3)],
    );
    for (roughness, ior, specular) in [(0.23, 1.33, 0.3), (0.55, 1.6, 0.9), (0.97, 1.45, 0.5)] {
        for cos in [0.3, 0.8] {
            let a = varying_albedo(&material, &[roughness, ior, specular], cos, false, 1 << 15);
            assert!(
                (a - 1.0).abs() < 0.005,
                "{roughness} {ior} {specular} {cos}: {a}"
            );
        }
    }
}

#[test]
fn the_density_is_that_of_the_samples() {
    // The density integrates to the share of samples that were not lost, and the value to their mean weight; both
    // integrals use uniform directions over the whole sphere.
    let sampler = PixelSampler::new(1, 1, 1);
    for (metallic, transmission) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.5)] {
        for inside in [false, true] {
            let material = compile(MaterialParams {
                metallic,
                transmission,
                roughness: 0.6,
                ..Default::default()
            });
            let bsdf = seen(&material, view(0.6), inside);
            let n = 1 << 17;
            let (mut density, mut energy, mut kept, mut sampled) = (0.0, 0.0, 0.0, 0.0);
            for i in 0..n {
                let u = sampler.pair(i, 4);
                let z = 1.0 - 2.0 * u[1];
                let r = (1.0 - z * z).max(0.0).sqrt();
                let (sin, cos) = (TAU * u[0]).sin_cos();
                let (f, pdf) = bsdf.eval(vec3(r * cos, r * sin, z));
                density += f64::from(pdf) * 2.0 * f64::from(TAU);
                energy += f64::from(f.mean()) * 2.0 * f64::from(TAU);
                if let Some(s) = bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)) {
                    kept += 1.0;
                    sampled += f64::from(s.weight.mean());
                }
            }
            let n = f64::from(n);
            assert!(
                (density / n - kept / n).abs() < 0.01,
                "{metallic} {transmission} {inside}"
            );
            assert!(
                (energy / n - sampled / n).abs() < 0.01,
                "{metallic} {transmission} {inside}"
            );
        }
    }
}

#[test]
fn samples_fall_where_the_density_says() {
    // Compare the counts of samples in 12 × 12 bins of the sphere with the density integrated over each bin. The
    // stratified sampler keeps the noise of a count far below its square root.
    const BINS: usize = 12;
    let sampler = PixelSampler::new(9, 2, 5);
    for roughness in [0.3, 0.6] {
        for (metallic, transmission) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            for (inside, cos) in [(false, 0.5), (true, 0.9), (true, 0.5)] {
                let material = compile(MaterialParams {
                    metallic,
                    transmission,
                    roughness,
                    ..Default::default()
                });
                let bsdf = seen(&material, view(cos), inside);
                let bin = |w: Vec3| {
                    let z = ((0.5 * (w.z + 1.0)) * BINS as f32) as usize;
                    let turn = w.y.atan2(w.x) / TAU + 0.5;
                    z.min(BINS - 1) * BINS + ((turn * BINS as f32) as usize).min(BINS - 1)
                };
                let n = 1 << 17;
                let (mut counted, mut integrated) = ([0.0; BINS * BINS], [0.0; BINS * BINS]);
                for i in 0..n {
                    if let Some(s) = bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)) {
                        counted[bin(s.wo)] += 1.0 / f64::from(n);
                    }
                    let u = sampler.pair(i, 4);
                    let z = 1.0 - 2.0 * u[1];
                    let r = (1.0 - z * z).max(0.0).sqrt();
                    let (sin, cos) = (TAU * u[0]).sin_cos();
                    let w = vec3(r * cos, r * sin, z);
                    integrated[bin(w)] +=
                        f64::from(bsdf.eval(w).1) * 2.0 * f64::from(TAU) / f64::from(n);
                }
                for (i, (c, p)) in counted.iter().zip(integrated).enumerate() {
                    assert!(
                        (c - p).abs() < 2e-3 + 0.03 * p,
                        "metal {metallic} glass {transmission} rough {roughness} inside {inside} \
                         bin {} {}: {c} {p}",
                        i / BINS,
                        i % BINS
                    );
                }
            }
        }
    }
}

#[test]
fn reflection_is_reciprocal() {
    // Divide out the compensation of multiple scattering, which depends on the viewing side only (as in Cycles);
    // the rest is reciprocal: f(wi, wo) = f(wo, wi).
    let material = compile(MaterialParams {
        metallic: 1.0,
        roughness: 0.5,
        ..Default::default()
    });
    let (a, b) = (
        vec3(0.3, 0.2, 0.933).normalized(),
        vec3(-0.5, 0.4, 0.768).normalized(),
    );
    let value = |wi: Vec3, wo: Vec3| {
        let bsdf = seen(&material, wi, false);
        let scale = bsdf.facets[0].scale.x;
        bsdf.eval(wo).0.x / wo.z / scale
    };
    assert!((value(a, b) / value(b, a) - 1.0).abs() < 1e-4);
}

#[test]
fn a_mirror_reflects_and_a_window_refracts_by_snell() {
    let mirror = compile(MaterialParams {
        metallic: 1.0,
        roughness: 0.0,
        ..Default::default()
    });
    let bsdf = seen(&mirror, view(0.6), false);
    let s = bsdf.sample(0.5, [0.1, 0.9]).unwrap();
    assert_eq!((s.wo, s.pdf), (vec3(-0.8, 0.0, 0.6), f32::INFINITY));
    let glass = compile(MaterialParams {
        transmission: 1.0,
        roughness: 0.0,
        base_color: WHITE,
        ..Default::default()
    });
    let bsdf = seen(&glass, view(0.6), false);
    let s = bsdf.sample(0.999, [0.1, 0.9]).unwrap();
    assert!((s.wo.x + 0.8 / 1.5).abs() < 1e-6 && s.wo.z < 0.0);
    assert_eq!(bsdf.eval(s.wo).1, 0.0, "a window has no density");
}
