// SPDX-License-Identifier: GPL-3.0-or-later
//! Corrections for shading normals that differ from the geometric one: reflections below the surface, and the
//! terminator.

use crate::math::vector::Vec3;

/// Bends a normal, mapped or interpolated, towards the geometric one until the mirror direction of the viewer leaves
/// the surface; below it reflections would be black. `geometric` and `incoming` are unit vectors with a positive cosine.
#[inline(always)]
pub fn reflecting_normal(geometric: Vec3, incoming: Vec3, mapped: Vec3) -> Vec3 {
    // Keep the normal if its mirror direction is high enough already.
    let iz = incoming.dot(geometric);
    let want = (0.9 * iz).min(0.01);
    if mirrored_height(geometric, incoming, mapped) >= want {
        return mapped;
    }
    bent_to(want, geometric, incoming, mapped)
}

/// Returns the cosine between the geometric normal and the direction in which `normal` mirrors the viewer.
#[inline(always)]
fn mirrored_height(geometric: Vec3, incoming: Vec3, normal: Vec3) -> f32 {
    2.0 * normal.dot(incoming) * normal.dot(geometric) - incoming.dot(geometric)
}

/// Returns the normal in the plane of both that mirrors the viewer to this height.
///
/// In the plane of the two normals, with Ng as z axis and I = (x, z), a unit normal (sin, cos) mirrors I to a
/// direction of height 2 (x sin + z cos) cos - z. The normal for a given height follows from a quadratic equation
/// in cos².
#[cold]
#[inline(never)]
fn bent_to(want: f32, geometric: Vec3, incoming: Vec3, mapped: Vec3) -> Vec3 {
    let iz = incoming.dot(geometric);
    // The tangent direction in the plane of both normals.
    let axis = (mapped - geometric * mapped.dot(geometric)).normalized_or(Vec3::ZERO);
    let ix = incoming.dot(axis);
    // 2 ix sqrt(s (1 - s)) + 2 iz s = want + iz =: t, with s = cos²; squared:
    // 4 (ix² + iz²) s² - 4 (ix² + iz t) s + t² = 0.
    let t = want + iz;
    let a = 4.0 * (ix * ix + iz * iz);
    let b = -4.0 * (ix * ix + iz * t);
    let discriminant = (b * b - 4.0 * a * t * t).max(0.0).sqrt();
    // Take the solution closest to the mapped normal among those that reach the height.
    let mut best = geometric;
    let mut nearest = f32::NEG_INFINITY;
    for s in [
        (-b + discriminant) / (2.0 * a),
        (-b - discriminant) / (2.0 * a),
    ] {
        if !(0.0..=1.0 + 1e-6).contains(&s) {
            continue;
        }
        let s = s.min(1.0);
        let n = axis * (1.0 - s).max(0.0).sqrt() + geometric * s.sqrt();
        if mirrored_height(geometric, incoming, n) >= want - 1e-4 && n.dot(mapped) > nearest {
            nearest = n.dot(mapped);
            best = n;
        }
    }
    best
}

/// Fraction of the light from a direction that a diffuse surface with a mapped normal receives, as in Cycles: 0 if
/// the two normals disagree about the side or the mapped one points below the surface, otherwise the shadowing of
/// facets that lean as far as the mapped normal. Conty Estevez, Lecocq and Stein 2019, "A Microfacet-Based Shadowing
/// Function to Solve the Bump Terminator Problem", Ray Tracing Gems, chapter 12. All are unit vectors; `normal` is the
/// surface's shading normal.
#[inline(always)]
pub fn bump_shadow(normal: Vec3, mapped: Vec3, direction: Vec3) -> f32 {
    // Cosines of the light and of the mapped normal with the surface's own.
    let (lit, lean) = (normal.dot(direction), normal.dot(mapped));
    if lean < 0.0 || (lit < 0.0) != (mapped.dot(direction) < 0.0) {
        return 0.0;
    }
    let tan2 = |cos: f32| {
        let c2 = (cos * cos).min(1.0);
        (1.0 - c2) / c2.max(1e-12)
    };
    // The roughness whose facets lean as far as the mapped normal, and Smith's G1 for it.
    let alpha2 = (0.125 * tan2(lean)).min(1.0);
    2.0 / (1.0 + (1.0 + alpha2 * tan2(lit)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    #[test]
    fn a_leaning_normal_is_shadowed_towards_the_horizon() {
        let (up, lean) = (vec3(0.0, 0.0, 1.0), vec3(0.6, 0.0, 0.8));
        assert_eq!(bump_shadow(up, lean, up), 1.0);
        // alpha² = tan² 36.87° / 8 = 0.0703; at 60° tan² = 3.
        let sixty = vec3(0.75_f32.sqrt(), 0.0, 0.5);
        let want = 2.0 / (1.0 + (1.0 + 0.0703125 * 3.0_f32).sqrt());
        assert!((bump_shadow(up, lean, sixty) - want).abs() < 1e-5);
        let below = vec3(0.995, 0.0, -0.0999);
        assert_eq!(bump_shadow(up, lean, below), 0.0, "behind the surface");
        assert_eq!(bump_shadow(up, up, vec3(1.0, 0.0, 0.0)), 1.0);
        // A mapped normal beyond a right angle receives nothing, whatever the side of the light.
        let beyond = vec3(0.995, 0.0, -0.0999);
        for light in [sixty, vec3(0.995, 0.0, 0.0999), vec3(0.6, 0.64, -0.48)] {
            assert_eq!(bump_shadow(up, beyond, light), 0.0, "{light:?}");
        }
    }

    #[test]
    fn a_bent_normal_reflects_off_the_surface() {
        let up = vec3(0.0, 0.0, 1.0);
        for i in 1..60 {
            let t = i as f32 * 0.025;
            for azimuth in [0.0, 1.0, 2.0, 3.0_f32] {
                let incoming = vec3(t.sin(), 0.0, t.cos());
                let mapped = vec3(-0.8 * azimuth.cos(), 0.8 * azimuth.sin(), 0.6);
                let n = reflecting_normal(up, incoming, mapped);
                let r = n * (2.0 * n.dot(incoming)) - incoming;
                assert!((n.length() - 1.0).abs() < 1e-4);
                assert!(r.z > 0.0, "{t} {azimuth}: {n:?} {r:?}");
            }
        }
    }
}
