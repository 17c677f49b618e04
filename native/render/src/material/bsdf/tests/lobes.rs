// SPDX-License-Identifier: GPL-3.0-or-later
//! Lobes with frames and shapes of their own: energy, densities, reciprocity, odd values.

use super::*;
use crate::material::bump::bump_shadow;
use crate::material::microfacets::Distribution;

/// A white material of one node with these inputs and this distribution.
fn made(
    kind: ClosureKind,
    distribution: Distribution,
    roughness: f32,
    more: &[(Input, f32)],
) -> Material {
    let mut closure = ClosureParams::new(kind);
    closure.distribution = distribution;
    closure.multiscatter = distribution == Distribution::Ggx;
    let white = [(Input::Color, 1.0), (Input::Roughness, roughness)];
    for &(input, value) in white.iter().chain(more) {
        closure.inputs[input as usize] = Operand::number(value);
    }
    compile(MaterialParams {
        closures: vec![closure],
        ..Default::default()
    })
}

/// One material of each kind of lobe.
fn cases(roughness: f32) -> Vec<(&'static str, Material)> {
    use Distribution::{AshikhminShirley, Beckmann, Ggx};
    let stretched = [(Input::Anisotropy, 0.7), (Input::Rotation, 0.15)];
    let sheen = [(Input::SheenWeight, 0.8), (Input::SheenRoughness, 0.4)];
    let conductor = [(Input::Color, 0.2), (Input::Extinction, 3.5)];
    let smooth = [(Input::Smooth, 0.3)];
    let film = [(Input::FilmThickness, 420.0)];
    use ClosureKind::{
        Conductor, Glass, Glossy, Principled, Refraction, Sheen, ToonDiffuse, ToonGlossy, Velvet,
    };
    vec![
        ("stretched gloss", made(Glossy, Ggx, roughness, &stretched)),
        (
            "stretched base",
            made(Principled, Ggx, roughness, &stretched),
        ),
        ("Beckmann", made(Glossy, Beckmann, roughness, &stretched)),
        ("Beckmann glass", made(Glass, Beckmann, roughness, &[])),
        (
            "Beckmann window",
            made(Refraction, Beckmann, roughness, &[]),
        ),
        (
            "Ashikhmin",
            made(Glossy, AshikhminShirley, roughness, &stretched),
        ),
        ("conductor", made(Conductor, Ggx, roughness, &conductor)),
        ("film on glass", made(Glass, Ggx, roughness, &film)),
        ("film on a base", made(Principled, Ggx, roughness, &film)),
        (
            "film on metal",
            made(
                Principled,
                Ggx,
                roughness,
                &[film[0], (Input::Metallic, 1.0)],
            ),
        ),
        (
            "film on a conductor",
            made(
                Conductor,
                Ggx,
                roughness,
                &[film[0], conductor[0], conductor[1]],
            ),
        ),
        ("sheen layer", made(Principled, Ggx, roughness, &sheen)),
        ("fibers", made(Sheen, Ggx, roughness, &[])),
        ("velvet", made(Velvet, Ggx, roughness, &[])),
        ("toon", made(ToonDiffuse, Ggx, roughness, &smooth)),
        ("glossy toon", made(ToonGlossy, Ggx, roughness, &smooth)),
    ]
}

/// Viewing directions off the axes of symmetry.
fn views() -> [Vec3; 3] {
    [0.25_f32, 0.6, 0.98].map(|cos| {
        let r = (1.0 - cos * cos).sqrt();
        vec3(0.8 * r, -0.6 * r, cos)
    })
}

/// Integrals over the sphere of value, density and density multiplied by the coordinates, by directions of evenly
/// spread cosines and azimuths.
fn integrals(bsdf: &Bsdf<true, true, { MAX_LOBES }>) -> [f64; 5] {
    let n = 1 << 9;
    let mut sums = [0.0; 5];
    for i in 0..2 * n {
        for j in 0..n {
            let z = (i as f32 + 0.5) / n as f32 - 1.0;
            let r = (1.0 - z * z).sqrt();
            let (s, c) = (TAU * (j as f32 + 0.5) / n as f32).sin_cos();
            let (f, pdf) = bsdf.eval(vec3(r * c, r * s, z));
            assert!(f.is_finite() && pdf.is_finite() && pdf >= 0.0);
            sums[0] += f64::from(f.mean());
            for (sum, x) in sums[1..].iter_mut().zip([1.0, r * c, r * s, z]) {
                *sum += f64::from(pdf * x);
            }
        }
    }
    sums.map(|sum| sum * f64::from(TAU) / f64::from(n * n))
}

#[test]
fn densities_and_values_integrate_to_what_is_sampled() {
    let sampler = PixelSampler::new(3, 1, 4);
    for roughness in [0.45, 0.8] {
        for (name, material) in cases(roughness) {
            assert!(material.lobes, "{name}");
            for wi in views() {
                let bsdf = seen(&material, wi, false);
                let integrated = integrals(&bsdf);
                let n = 1 << 15;
                let mut sampled = [0.0; 5];
                for i in 0..n {
                    if let Some(s) = bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)) {
                        let moments = [s.weight.mean(), 1.0, s.wo.x, s.wo.y, s.wo.z];
                        for (sum, x) in sampled.iter_mut().zip(moments) {
                            *sum += f64::from(x) / f64::from(n);
                        }
                    }
                }
                let what = format!("{name} {roughness} {wi:?}: {integrated:?} {sampled:?}");
                for (a, b) in integrated.iter().zip(sampled) {
                    assert!((a - b).abs() < 6e-3, "{what}");
                }
                assert!(integrated[0] < 1.06, "{what}");
            }
        }
    }
}

#[test]
fn a_furnace_is_white() {
    // The light that a layer of sheen does not reflect reaches the base, and a toon cone returns all light.
    for roughness in [0.1, 0.5, 1.0] {
        for weight in [0.3, 1.0] {
            let sheen = [
                (Input::SheenWeight, weight),
                (Input::SheenRoughness, roughness),
            ];
            let base = [sheen[0], sheen[1], (Input::Specular, 0.0)];
            let material = made(ClosureKind::Principled, Distribution::Ggx, 0.5, &base);
            for cos in [0.2, 0.6, 1.0] {
                let a = albedo(&material, cos, false);
                assert!(
                    (a - 1.0).abs() < 2e-3,
                    "sheen {roughness} {weight} {cos}: {a}"
                );
            }
        }
    }
    // A film divides light otherwise between both sides and loses none.
    let film = [(Input::FilmThickness, 420.0), (Input::FilmIor, 1.8)];
    for (roughness, within) in [(0.0, 2e-3), (0.3, 5e-3), (0.7, 0.02)] {
        let glass = made(ClosureKind::Glass, Distribution::Ggx, roughness, &film);
        for inside in [false, true] {
            let a = albedo(&glass, 0.6, inside);
            assert!((a - 1.0).abs() < within, "film {roughness} {inside}: {a}");
        }
    }
    let toon = made(ClosureKind::ToonDiffuse, Distribution::Ggx, 0.6, &[]);
    assert!((albedo(&toon, 0.6, false) - 1.0).abs() < 2e-3);
    // Facets that are as wide along as across are compensated exactly. Stretched ones are compensated as if they were,
    // as in Cycles: along the wide axis some light is lost, and none is gained anywhere.
    for (anisotropy, lowest) in [(1e-4, 0.998), (0.5, 0.88)] {
        let more = [(Input::Anisotropy, anisotropy)];
        let gloss = made(ClosureKind::Glossy, Distribution::Ggx, 0.5, &more);
        for wi in views() {
            let a = mean_weight(&seen(&gloss, wi, false), 1 << 15);
            assert!((lowest..1.04).contains(&a), "{anisotropy} {wi:?}: {a}");
        }
    }
}

#[test]
fn lobes_are_reciprocal_where_the_model_is() {
    let (a, b) = (
        vec3(0.3, 0.2, 0.933).normalized(),
        vec3(-0.5, 0.4, 0.768).normalized(),
    );
    for (name, material) in cases(0.5) {
        if ![
            "Beckmann",
            "Ashikhmin",
            "conductor",
            "velvet",
            "stretched gloss",
        ]
        .contains(&name)
        {
            continue;
        }
        let value = |wi: Vec3, wo: Vec3| {
            // The compensation of multiple scattering depends on the viewer only, as in Cycles.
            let bsdf = seen(&material, wi, false);
            bsdf.eval(wo).0.x / wo.z / bsdf.lobes[0].scale.x
        };
        let ratio = value(a, b) / value(b, a);
        assert!((ratio - 1.0).abs() < 1e-3, "{name}: {ratio}");
    }
}

#[test]
fn a_closure_with_a_normal_of_its_own_is_lit_from_there() {
    // A diffuse closure, without a normal or with one, in a material whose glossy closure has another.
    let lean = vec3(0.6, 0.0, 0.8);
    let mut leaning = ClosureParams::new(ClosureKind::Glossy);
    leaning.inputs[Input::Weight as usize] = Operand::number(0.0);
    leaning.normal = Some(Operand::color(lean.array()));
    let both = |closures: Vec<ClosureParams>| {
        compile(MaterialParams {
            closures,
            ..Default::default()
        })
    };
    let up = vec3(0.0, 0.0, 1.0);
    for own in [None, Some(vec3(-0.36, -0.48, 0.8))] {
        let mut flat = ClosureParams::new(ClosureKind::Diffuse);
        flat.inputs[Input::Color as usize] = Operand::number(1.0);
        flat.normal = own.map(|n| Operand::color(n.array()));
        let material = both(vec![leaning.clone(), flat]);
        // The shading frame is on the leaning normal.
        let frame = Frame::around(lean);
        let above = frame.to_local(up);
        let normals = Normals {
            geometric: above,
            mapped: Some([above, vec3(0.0, 0.0, 1.0)]),
        };
        let none = LobeFilter::NONE;
        let bsdf: Bsdf<true, true, { MAX_LOBES }> =
            Bsdf::new(&material.closures, &[], above, normals, false, none, &frame);
        let wo = vec3(0.0, 0.6, 0.8);
        let (f, pdf) = bsdf.eval(frame.to_local(wo));
        let normal = own.unwrap_or(up);
        let density = normal.dot(wo) / std::f32::consts::PI;
        let want = density * bump_shadow(up, normal, wo);
        assert!(
            (f.x - want).abs() < 1e-5 && (pdf - density).abs() < 1e-5,
            "{own:?}: {f:?}"
        );
    }
    assert!(!both(vec![leaning]).lobes, "a single normal needs no lobes");
}

#[test]
fn odd_values_give_finite_light() {
    use ClosureKind::{Conductor, Glossy, Principled, Sheen, ToonDiffuse, ToonGlossy, Velvet};
    let kinds = [
        Conductor,
        Glossy,
        Principled,
        Sheen,
        ToonDiffuse,
        ToonGlossy,
        Velvet,
    ];
    let sampler = PixelSampler::new(1, 1, 1);
    for kind in kinds {
        for odd in [-1e30, -1.0, 0.0, 1e-20, 1.0, 7.0, 1e30] {
            let inputs = [
                Input::Roughness,
                Input::Anisotropy,
                Input::Rotation,
                Input::Tangent,
                Input::CoatNormal,
                Input::SheenWeight,
                Input::SheenRoughness,
                Input::SheenTint,
                Input::Smooth,
                Input::Extinction,
                Input::FilmThickness,
                Input::FilmIor,
            ];
            let mut more = inputs.map(|input| (input, odd)).to_vec();
            more.push((Input::CoatWeight, 0.5));
            let material = made(kind, Distribution::Ggx, odd, &more);
            let bsdf = seen(&material, views()[0], false);
            for i in 0..64 {
                let u = sampler.pair(i, 1);
                if let Some(s) = bsdf.sample(sampler.pair(i, 0)[0], u) {
                    assert!(s.weight.is_finite() && s.wo.is_finite(), "{kind:?} {odd}");
                    let (f, pdf) = bsdf.eval(s.wo);
                    assert!(f.is_finite() && !pdf.is_nan(), "{kind:?} {odd}");
                }
            }
        }
    }
}
