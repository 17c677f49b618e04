// SPDX-License-Identifier: GPL-3.0-or-later
//! Sorts shadow rays as seen from their lights: by light, by the face of a cube around the light, and by the
//! position on that face, so that neighbours in the list are neighbours for the light.

use halfspace_geom::vec3::map;
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;
use halfspace_trace::shadow_cache::ShadowCache;

/// Bits of a position on a face, per axis.
const POSITION_BITS: u32 = 10;

/// Bits of the ray's index, below the position in a key. The bits above hold the face (3) and the light (6).
const NUMBER_BITS: u32 = 32;

/// The sort keys of the rays, ascending; the low 32 bits of a key are the ray's index.
pub fn sorted(rays: &[Ray], frame: &Frame) -> Vec<u64> {
    let lights = ShadowCache::new(frame);
    let size = frame.bounds().magnitude().max(f32::MIN_POSITIVE);
    let mut keys: Vec<_> = (0_u64..)
        .zip(rays)
        .map(|(i, ray)| {
            let light = lights.entry(ray) as u64;
            let face = (light << 3 | face(ray)) << (2 * POSITION_BITS + NUMBER_BITS);
            face | position(frame.point(ray.o), ray, size) << NUMBER_BITS | i
        })
        .collect();
    radsort::sort(&mut keys);
    keys
}

/// Whether two keys belong to the same light and face.
pub fn same_face(a: u64, b: u64) -> bool {
    (a ^ b) >> (2 * POSITION_BITS + NUMBER_BITS) == 0
}

/// The face of the cube around the light through which a ray reaches it: twice the dominant axis, plus its
/// sign.
fn face(ray: &Ray) -> u64 {
    let axis = dominant(ray.d);
    2 * axis as u64 + u64::from(ray.d[axis] > 0.0)
}

/// The axis of the largest absolute component; the first one of equals.
fn dominant(d: [f32; 3]) -> usize {
    let size = map(d, f32::abs);
    if size[0] >= size[1] && size[0] >= size[2] {
        0
    } else if size[1] >= size[2] {
        1
    } else {
        2
    }
}

/// The Morton code (Morton 1966) of the position on that face. For a ray that does not end, the face is a plane
/// across the direction, as large as the scene. `o` is the ray's origin in the frame, in which the scene has this
/// size.
fn position(o: [f32; 3], ray: &Ray, size: f32) -> u64 {
    let k = dominant(ray.d);
    let slope = 1.0 / ray.d[k];
    let [u, v] = [(k + 1) % 3, (k + 2) % 3].map(|a| {
        // Project to [-1, 1], quantize, and spread the bits.
        let tangent = ray.d[a] * slope;
        let x = if ray.t_max.is_finite() {
            tangent
        } else {
            0.5 * (o[a] - tangent * o[k]) / size
        };
        let cells = (1_u32 << POSITION_BITS) as f32;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, which is as good as any other order"
        )]
        let cell = ((0.5 + 0.5 * x) * cells).clamp(0.0, cells - 1.0) as u64;
        (0..POSITION_BITS).fold(0, |m, bit| m | (cell >> bit & 1) << (2 * bit))
    });
    u | v << 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_geom::Aabb;

    #[test]
    fn neighbours_for_the_light_are_neighbours_in_the_list() {
        // From a ring around the light: every ray is kept, and faces do not mix.
        let rays: Vec<_> = (0..1000)
            .map(|i| {
                let angle = (i * 377 % 1000) as f32 * 0.00628;
                let d = [-angle.cos(), -angle.sin(), 0.1];
                Ray {
                    o: d.map(|x| 1.0 - x),
                    d,
                    t_min: 0.0,
                    t_max: 1.0,
                }
            })
            .collect();
        let bounds = Aabb {
            min: [0.0; 3],
            max: [2.0; 3],
        };
        let keys = sorted(&rays, &Frame::new(bounds));
        let mut ids: Vec<_> = keys
            .iter()
            .map(|key| (key & 0xffff_ffff) as usize)
            .collect();
        let jumps = ids.windows(2).map(|pair| {
            let [a, b] = [rays[pair[0]].d, rays[pair[1]].d];
            (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max)
        });
        // Four faces, and no other jump.
        assert!(jumps.filter(|jump| *jump > 0.05).count() <= 3);
        assert_eq!(keys.chunk_by(|a, b| same_face(*a, *b)).count(), 4);
        ids.sort_unstable();
        assert!(ids.into_iter().eq(0..1000));
    }
}
