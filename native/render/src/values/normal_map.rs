// SPDX-License-Identifier: GPL-3.0-or-later
//! Normal maps: the shading normal that a colour describes in tangent, object or world space.

use crate::math::vector::{Vec3, vec3};
use crate::values::shading_point::ShadingPoint;

impl ShadingPoint<'_> {
    /// Normalizes a normal on the front and turns it to the viewer's side.
    fn towards_viewer(&self, outward: Vec3) -> Vec3 {
        let normal = outward.normalized_or(self.outward());
        if self.inside { -normal } else { normal }
    }

    /// Returns the normal of a tangent-space map. `tangents`: layer of (x, y, z, sign of the bitangent) in object space;
    /// `color`: the map's value.
    pub fn mapped_normal(&self, tangents: u16, color: Vec3, strength: f32) -> Vec3 {
        // Without tangents the map has no effect.
        let [x, y, z, sign] = self.attribute(tangents);
        let tangent = vec3(x, y, z);
        if tangent == Vec3::ZERO {
            return self.normal;
        }
        // Decode the colour to -1..1, and scale it by the strength; the z component fades to 1.
        let strength = strength.max(0.0);
        let mut c = color * 2.0 - Vec3::ONE;
        c.x *= strength;
        c.y *= strength;
        c.z = 1.0 + (c.z - 1.0) * strength.min(1.0);
        // Work on the front of the triangle in object space, where the map is defined: there tangent, bitangent and
        // normal are perpendicular. As in Cycles, neither tangent nor normal has unit length between the corners.
        let normal = self.normal_in_object(self.outward()) * self.length;
        let sign = if sign < 0.0 { -1.0 } else { 1.0 };
        let bitangent = normal.cross(tangent) * sign;
        let mapped = tangent * c.x + bitangent * c.y + normal * c.z;
        self.towards_viewer(self.normal_in_scene(mapped))
    }

    /// Returns the normal of a map in object space (`object`) or world space.
    pub fn normal_from_color(&self, object: bool, color: Vec3, strength: f32) -> Vec3 {
        let mut mapped = color * 2.0 - Vec3::ONE;
        if object {
            mapped = self.normal_in_scene(mapped);
        }
        let normal = self.outward();
        let mapped = mapped.normalized_or(normal);
        self.towards_viewer(normal + (mapped - normal) * strength.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::shading_point::tests::point;
    use crate::values::varying::{Layer, Varying};

    #[test]
    fn a_flat_map_keeps_the_normal_and_a_tilted_one_turns_it_towards_the_tangent() {
        let varying = Varying {
            layers: vec![Layer {
                width: 4,
                values: [1.0, 0.0, 0.0, 1.0].repeat(3).into(),
            }],
            ..Default::default()
        };
        let point = point(&varying);
        let flat = point.mapped_normal(0, vec3(0.5, 0.5, 1.0), 1.0);
        assert_eq!(flat, point.normal);
        let tilted = point.mapped_normal(0, vec3(1.0, 0.5, 0.5), 1.0);
        assert!((tilted - vec3(1.0, 0.0, 0.0)).length() < 1e-6);
        let sideways = point.mapped_normal(0, vec3(0.5, 1.0, 1.0), 1.0);
        assert!(sideways.y > 0.5, "the bitangent is n × t");
        assert_eq!(
            point.mapped_normal(0, vec3(1.0, 0.5, 0.5), 0.0),
            point.normal
        );
    }
}
