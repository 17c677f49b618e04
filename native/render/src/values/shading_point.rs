// SPDX-License-Identifier: GPL-3.0-or-later
//! A point to be shaded: the inputs of a program other than its constants.

use crate::math::vector::{Vec3, vec3};
use crate::values::program::{Coordinate, Shift, Value};
use crate::values::rays::Surroundings;
use crate::values::varying::{ObjectFrame, Row, Varying};
use crate::values::view::{History, View};
use crate::values::visibility::RayKind;

/// A point to be shaded.
#[derive(Clone, Copy)]
pub struct ShadingPoint<'a> {
    /// Data that vary over the triangles.
    pub varying: &'a Varying,
    /// Where the data of the triangle are.
    pub row: Row,
    /// Barycentric weights of the triangle's corners.
    pub weights: [f32; 3],
    /// Position in scene space.
    pub position: Vec3,
    /// Shading normal on the viewer's side.
    pub normal: Vec3,
    /// Length of the interpolated normal before it was normalized; 1 on flat surfaces.
    pub length: f32,
    /// Geometric normal on the viewer's side.
    pub geometric: Vec3,
    /// Unit direction towards the viewer.
    pub incoming: Vec3,
    /// Whether the viewer is on the back of the triangle.
    pub inside: bool,
    /// The kind of ray that arrives here.
    pub ray: RayKind,
    /// Edges of the triangle from its first corner, in scene space.
    pub edges: [Vec3; 2],
    /// Width of a pixel at the point, in scene units; 0 where heights have no differences.
    pub footprint: f32,
    /// The camera; `None` where light arrives that no path has brought.
    pub view: Option<&'a View>,
    /// The path that arrives here.
    pub history: History,
    /// The number of probes along each axis of the object, where voxels return their largest value nearby; 0 = none.
    pub probes: u8,
    /// Geometry around the point; `None` where no rays are traced.
    pub around: Option<&'a dyn Surroundings>,
    /// The light that is shaded, instead of an object.
    pub lamp: Option<&'a ObjectFrame>,
}

impl<'a> ShadingPoint<'a> {
    /// The background in a unit direction.
    pub fn background(varying: &'a Varying, direction: Vec3, ray: RayKind) -> Self {
        Self {
            varying,
            row: Row::BACKGROUND,
            weights: [0.0; 3],
            position: direction,
            normal: -direction,
            length: 1.0,
            geometric: -direction,
            incoming: -direction,
            inside: false,
            ray,
            edges: [Vec3::ZERO; 2],
            footprint: 0.0,
            view: None,
            history: History::default(),
            probes: 0,
            around: None,
            lamp: None,
        }
    }

    /// Returns the cosine between shading normal and viewer, clamped to 0..1.
    pub fn cosine(&self) -> f32 {
        self.normal.dot(self.incoming).clamp(0.0, 1.0)
    }

    /// Returns a layer's value at the point: missing components are 0, the fourth 1.
    pub fn attribute(&self, layer: u16) -> Value {
        self.attribute_at(layer, Shift::None)
    }

    /// Returns a layer's value at the point or next to it, where it continues linearly.
    pub fn attribute_at(&self, layer: u16, shift: Shift) -> Value {
        let weights = self.weights_at(shift);
        let mut out = [0.0, 0.0, 0.0, 1.0];
        // A missing layer, or one that does not cover the triangle, reads as zero.
        let Some(layer) = self.varying.layers.get(usize::from(layer)) else {
            return out;
        };
        let n = layer.width;
        let Some(corners) = layer
            .values
            .get(self.row.index.wrapping_mul(3 * n)..)
            .and_then(|rest| rest.get(..3 * n))
        else {
            return out;
        };
        // Interpolate each component between the corners, in the order of the flattened scene.
        let order = self.row.corners();
        for (k, slot) in out.iter_mut().take(n).enumerate() {
            *slot = (0..3)
                .map(|c| weights[c] * corners[order[c] * n + k])
                .sum::<f32>();
        }
        out
    }

    /// Whether a line of this width around the triangle's edges covers the point. in_pixels: the width is in pixels
    /// instead of scene units. Half of a line lies on each of the triangles at an edge.
    pub(super) fn is_near_edge(&self, width: f32, in_pixels: bool) -> bool {
        let half = 0.5 * width * if in_pixels { self.footprint } else { 1.0 };
        let [u, v] = self.edges;
        // The distance to a side is the weight of the corner opposite to it times its height over that side.
        let area = u.cross(v).length();
        let sides = [(v - u).length(), v.length(), u.length()];
        !self.is_background()
            && (self.weights.iter().zip(sides)).any(|(weight, side)| weight * area < half * side)
    }

    /// Returns the value of the voxels with this number, counted from 1, at a position in object space; `absent` for
    /// any other number.
    pub fn voxels(&self, number: f32, position: Vec3, absent: Value) -> Value {
        let index = (number as usize).checked_sub(1);
        let Some(voxels) = index.and_then(|index| self.varying.grids.get(index)) else {
            return absent;
        };
        match self.probes {
            0 => voxels.at(position),
            probes => voxels.largest(position, f32::from(probes)),
        }
    }

    /// The object of the triangle, or the light.
    pub(super) fn object(&self) -> Option<&'a ObjectFrame> {
        if self.lamp.is_some() {
            return self.lamp;
        }
        let index = self.varying.object_index.get(self.row.index);
        let index = index.map_or(self.row.instance, |&i| i as usize);
        self.varying.objects.get(index)
    }

    /// Whether the point is a direction of the background.
    fn is_background(&self) -> bool {
        self.row.index == usize::MAX && self.lamp.is_none()
    }

    /// Returns a coordinate of the point or next to it, see [`Coordinate`]; the fourth component is 1.
    pub fn coordinate(&self, which: Coordinate, shift: Shift) -> Value {
        let truth = |yes: bool| Vec3::splat(f32::from(u8::from(yes)));
        // On the background, positions are the direction itself.
        let v = match which {
            Coordinate::Generated | Coordinate::Object | Coordinate::Position
                if self.is_background() =>
            {
                self.position
            }
            Coordinate::Position => self.position_at(shift) + Vec3::from(self.varying.origin),
            Coordinate::Object => self.in_object(shift),
            Coordinate::Generated => self.generated(shift),
            Coordinate::ObjectNormal => self.normal_in_object(self.outward()),
            Coordinate::Normal => self.normal,
            Coordinate::TrueNormal => self.geometric,
            Coordinate::Incoming => self.incoming,
            Coordinate::Reflection => {
                self.normal * (2.0 * self.normal.dot(self.incoming)) - self.incoming
            }
            Coordinate::Backfacing => truth(self.inside),
            Coordinate::CameraRay => truth(self.ray == RayKind::Camera),
            Coordinate::ShadowRay => truth(self.ray == RayKind::Shadow),
            Coordinate::DiffuseRay => truth(self.ray == RayKind::Diffuse),
            Coordinate::GlossyRay => {
                truth(matches!(self.ray, RayKind::Glossy | RayKind::Transmission))
            }
            Coordinate::VolumeRay => truth(self.ray == RayKind::Volume),
            Coordinate::EdgeU => self.edges[0] * self.facing(),
            Coordinate::EdgeV => self.edges[1] * self.facing(),
            Coordinate::Parametric => vec3(self.weights[0], self.weights[1], 0.0),
            Coordinate::TangentX | Coordinate::TangentY | Coordinate::TangentZ => {
                self.tangent_around(which)
            }
            _ => self.seen(which, shift),
        };
        [v.x, v.y, v.z, 1.0]
    }

    /// The position of the point or next to it within the object's box, from 0 to 1.
    pub(super) fn generated(&self, shift: Shift) -> Vec3 {
        // Without an object, generated coordinates equal those of object space.
        let [add, scale] = self
            .object()
            .map_or([[0.0; 3], [1.0; 3]], |o| o.generated)
            .map(Vec3::from);
        (self.in_object(shift) + add) * scale
    }

    /// The position of the point or next to it, in object space.
    pub(super) fn in_object(&self, shift: Shift) -> Vec3 {
        let p = self.position_at(shift);
        let Some(object) = self.object() else {
            return p;
        };
        let [x, y, z] = object
            .to_object
            .map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]);
        vec3(x, y, z)
    }

    /// Transforms a normal to object space.
    pub(super) fn normal_in_object(&self, n: Vec3) -> Vec3 {
        self.object().map_or(n, |o| {
            // Normals transform by the inverse transpose of scene-to-object: the transpose of its inverse's columns.
            let [a, b, c] = columns_to_world(&o.to_object);
            vec3(a.dot(n), b.dot(n), c.dot(n)).normalized_or(n)
        })
    }

    /// Transforms a normal of object space to the scene, without a change of length to 1.
    pub(super) fn normal_in_scene(&self, n: Vec3) -> Vec3 {
        self.object().map_or(n, |o| {
            // Covectors transform by the transpose of the scene-to-object map.
            let [x, y, z] = o.to_object.map(|r| vec3(r[0], r[1], r[2]));
            x * n.x + y * n.y + z * n.z
        })
    }

    /// 1 on the front of the triangle, -1 on its back.
    fn facing(&self) -> f32 {
        if self.inside { -1.0 } else { 1.0 }
    }

    /// The shading normal on the front of the triangle.
    pub(super) fn outward(&self) -> Vec3 {
        if self.inside {
            -self.normal
        } else {
            self.normal
        }
    }
}

/// Returns the columns of the inverse's linear part, up to a common positive factor.
pub(super) fn columns_to_world(to_object: &[[f32; 4]; 3]) -> [Vec3; 3] {
    let [x, y, z] = to_object.map(|r| vec3(r[0], r[1], r[2]));
    // The determinant of a mirrored object is negative.
    let sign = 1.0_f32.copysign(x.dot(y.cross(z)));
    [y.cross(z), z.cross(x), x.cross(y)].map(|column| column * sign)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::values::varying::Layer;

    pub(in crate::values) fn point(varying: &Varying) -> ShadingPoint<'_> {
        let up = vec3(0.0, 0.0, 1.0);
        ShadingPoint {
            varying,
            row: Row::flattened(0),
            weights: [0.25, 0.25, 0.5],
            position: vec3(1.0, 2.0, 3.0),
            normal: up,
            length: 1.0,
            geometric: up,
            incoming: up,
            inside: false,
            ray: RayKind::Camera,
            edges: [vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)],
            footprint: 0.01,
            view: None,
            history: History::default(),
            probes: 0,
            around: None,
            lamp: None,
        }
    }

    #[test]
    fn attributes_are_interpolated_and_missing_ones_are_zero() {
        let mut varying = Varying {
            layers: vec![Layer {
                width: 2,
                values: vec![0.0, 0.0, 1.0, f32::NAN, 1.0, 1.0].into(),
            }],
            ..Default::default()
        };
        varying.check(1, None).unwrap();
        assert_eq!(point(&varying).attribute(0), [0.75, 0.5, 0.0, 1.0]);
        assert_eq!(point(&varying).attribute(7), [0.0, 0.0, 0.0, 1.0]);
        assert!(varying.check(2, None).is_err());
    }

    #[test]
    fn the_normal_of_a_mirrored_object_points_outwards_in_its_own_space() {
        for scale in [[2.0, 1.0, 1.0], [-2.0, 1.0, 1.0], [-2.0, 1.0, -1.0]] {
            let mut to_object = [[0.0; 4]; 3];
            for (k, scale) in scale.into_iter().enumerate() {
                to_object[k][k] = 1.0 / scale;
            }
            let varying = Varying {
                objects: vec![ObjectFrame {
                    to_object,
                    generated: [[0.0; 3], [1.0; 3]],
                    ..Default::default()
                }],
                ..Default::default()
            };
            let [x, y, z, _] = point(&varying).coordinate(Coordinate::ObjectNormal, Shift::None);
            assert_eq!([x, y, z], [0.0, 0.0, f32::signum(scale[2])], "{scale:?}");
        }
    }
}
