// SPDX-License-Identifier: GPL-3.0-or-later
//! Values of camera and path for programs, and transformations between the spaces of world, object and camera.

use crate::math::vector::{Vec3, vec3};
use crate::values::program::{Coordinate, Shift, Space, Value, VectorKind};
use crate::values::shading_point::{ShadingPoint, columns_to_world};
use crate::values::visibility::RayKind;

/// The frame of a camera in scene space, as programs use it.
#[derive(Debug, Clone)]
pub struct View {
    /// Position.
    pub origin: Vec3,
    /// Unit vectors to the right, up, and along the view.
    pub axes: [Vec3; 3],
    /// Left, right, bottom and top edge of the picture, at depth 1 for perspective.
    pub window: [f32; 4],
    /// Whether the rays meet in the origin.
    pub perspective: bool,
}

impl View {
    /// Returns a vector in camera space.
    fn direction(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(v));
        vec3(x, y, z)
    }

    /// Returns the position in the picture of a point in camera space, from 0 to 1 along each side.
    fn window(&self, p: Vec3) -> Vec3 {
        let [left, right, bottom, top] = self.window;
        let depth = if self.perspective { p.z } else { 1.0 };
        let [x, y] = [p.x / depth, p.y / depth];
        vec3(
            (x - left) / (right - left),
            (y - bottom) / (top - bottom),
            0.0,
        )
    }
}

/// A path up to a point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct History {
    /// Length of the ray since the path scattered.
    pub length: f32,
    /// Number of transparent surfaces passed.
    pub transparent: u16,
    /// Number of portals passed.
    pub portals: u16,
    /// How the path scattered last.
    pub last: Turn,
    /// The bounces.
    pub bounces: Bounces,
}

/// How a ray left the surface where it scattered last, in addition to its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Turn {
    /// Whether it went through the surface.
    pub through: bool,
    /// Whether no other direction was possible.
    pub singular: bool,
}

/// Numbers of bounces of a path, up to 255 each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Bounces {
    /// All bounces.
    pub all: u8,
    /// Diffuse ones.
    pub diffuse: u8,
    /// Glossy ones.
    pub glossy: u8,
    /// Refractions.
    pub transmission: u8,
}

impl ShadingPoint<'_> {
    /// Returns a coordinate that depends on the camera or on the path; 0 where there is none.
    pub(super) fn seen(&self, which: Coordinate, shift: Shift) -> Vec3 {
        let History {
            length,
            transparent,
            portals,
            last,
            bounces,
        } = self.history;
        let count = |n: u8| Vec3::splat(f32::from(n));
        let truth = |yes: bool| count(u8::from(yes));
        let ray = self.ray;
        match which {
            Coordinate::TransmissionRay => {
                let scattered = ray == RayKind::Diffuse && last.through;
                return truth(scattered || ray == RayKind::Transmission);
            }
            Coordinate::ReflectionRay => {
                let kind = matches!(ray, RayKind::Diffuse | RayKind::Glossy);
                return truth(kind && !last.through);
            }
            Coordinate::SingularRay => return truth(last.singular),
            Coordinate::PortalDepth => return Vec3::splat(f32::from(portals)),
            Coordinate::RayLength => return Vec3::splat(length),
            Coordinate::RayDepth => return count(bounces.all),
            Coordinate::DiffuseDepth => return count(bounces.diffuse),
            Coordinate::GlossyDepth => return count(bounces.glossy),
            Coordinate::TransmissionDepth => return count(bounces.transmission),
            Coordinate::TransparentDepth => return Vec3::splat(f32::from(transparent)),
            _ => {}
        }
        // All others are relative to the camera.
        let Some(view) = self.view else {
            return Vec3::ZERO;
        };
        let p = view.direction(self.position_at(shift) - view.origin);
        match which {
            Coordinate::Camera => p,
            Coordinate::ViewVector => p.normalized_or(Vec3::ZERO),
            Coordinate::ViewDepth => Vec3::splat(p.z),
            Coordinate::ViewDistance => Vec3::splat(p.length()),
            Coordinate::Window => view.window(p),
            _ => Vec3::ZERO,
        }
    }

    /// Returns the direction around an axis of the object's box, perpendicular to the shading normal.
    pub(super) fn tangent_around(&self, axis: Coordinate) -> Vec3 {
        let p = self.generated(Shift::None) - Vec3::splat(0.5);
        let around = match axis {
            Coordinate::TangentX => vec3(0.0, -p.z, p.y),
            Coordinate::TangentY => vec3(-p.z, 0.0, p.x),
            _ => vec3(-p.y, p.x, 0.0),
        };
        let n = self.normal;
        let around = self.normal_to_scene(around);
        n.cross(around.cross(n).normalized_or(Vec3::ZERO))
            .normalized_or(Vec3::ZERO)
    }

    /// Returns a value of the object.
    pub fn object_value(&self, column: u16) -> Value {
        let values = self.object().map(|object| &object.values);
        let value = values.and_then(|values| values.get(usize::from(column)));
        value.copied().unwrap_or([0.0; 4])
    }

    /// Transforms a vector between two spaces.
    pub fn transformed(&self, v: Vec3, kind: VectorKind, from: Space, to: Space) -> Vec3 {
        if from == to {
            return match kind {
                VectorKind::Normal => v.normalized_or(Vec3::ZERO),
                _ => v,
            };
        }
        // Positions are relative to the scene's origin in between; other vectors do not depend on it.
        let origin = Vec3::from(self.varying.origin);
        let scene = match from {
            Space::World if kind == VectorKind::Point => v - origin,
            Space::World => v,
            Space::Object => self.object_to_scene(v, kind),
            Space::Camera => self.view.map_or(v, |view| {
                let [x, y, z] = view.axes;
                let turned = x * v.x + y * v.y + z * v.z;
                if kind == VectorKind::Point {
                    turned + view.origin
                } else {
                    turned
                }
            }),
        };
        let out = match to {
            Space::World if kind == VectorKind::Point => scene + origin,
            Space::World => scene,
            Space::Object => self.scene_to_object(scene, kind),
            Space::Camera => self.view.map_or(scene, |view| {
                if kind == VectorKind::Point {
                    view.direction(scene - view.origin)
                } else {
                    view.direction(scene)
                }
            }),
        };
        if kind == VectorKind::Normal {
            out.normalized_or(Vec3::ZERO)
        } else {
            out
        }
    }

    /// Transforms from scene space to object space.
    fn scene_to_object(&self, v: Vec3, kind: VectorKind) -> Vec3 {
        let Some(object) = self.object() else {
            return v;
        };
        if kind == VectorKind::Normal {
            return self.normal_in_object(v);
        }
        let w = f32::from(u8::from(kind == VectorKind::Point));
        let [x, y, z] = object
            .to_object
            .map(|r| r[0] * v.x + r[1] * v.y + r[2] * v.z + r[3] * w);
        vec3(x, y, z)
    }

    /// Transforms from object space to scene space.
    fn object_to_scene(&self, v: Vec3, kind: VectorKind) -> Vec3 {
        let Some(object) = self.object() else {
            return v;
        };
        if kind == VectorKind::Normal {
            return self.normal_to_scene(v);
        }
        // Solve the linear part by its adjugate.
        let rows = object.to_object;
        let v = if kind == VectorKind::Point {
            v - vec3(rows[0][3], rows[1][3], rows[2][3])
        } else {
            v
        };
        let [x, y, z] = columns_to_world(&rows);
        let determinant = vec3(rows[0][0], rows[0][1], rows[0][2]).dot(x);
        (x * v.x + y * v.y + z * v.z) * (1.0 / determinant)
    }

    /// Transforms a normal from object space to scene space, up to its length.
    fn normal_to_scene(&self, n: Vec3) -> Vec3 {
        self.object().map_or(n, |object| {
            let [x, y, z] = object.to_object.map(|r| vec3(r[0], r[1], r[2]));
            x * n.x + y * n.y + z * n.z
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::shading_point::tests::point;
    use crate::values::varying::{ObjectFrame, Varying};

    /// A scene of one turned, scaled and moved object.
    fn varying() -> Varying {
        Varying {
            objects: vec![ObjectFrame {
                to_object: [
                    [0.0, 2.0, 0.0, 1.0],
                    [-1.0, 0.0, 0.5, 2.0],
                    [0.0, 0.0, -3.0, 0.5],
                ],
                generated: [[0.0; 3], [1.0; 3]],
                values: vec![[1.0, 2.0, 3.0, 0.5]],
            }],
            origin: [10.0, 0.0, 0.0],
            ..Default::default()
        }
    }

    fn view() -> View {
        View {
            origin: vec3(1.0, 2.0, 13.0),
            axes: [
                vec3(1.0, 0.0, 0.0),
                vec3(0.0, 1.0, 0.0),
                vec3(0.0, 0.0, -1.0),
            ],
            window: [-1.0, 1.0, -0.5, 0.5],
            perspective: true,
        }
    }

    #[test]
    fn transformations_and_their_inverses_cancel() {
        let (varying, view) = (varying(), view());
        let mut point = point(&varying);
        point.view = Some(&view);
        let spaces = [Space::World, Space::Object, Space::Camera];
        let v = vec3(0.6, 0.0, -0.8);
        for kind in [VectorKind::Point, VectorKind::Vector, VectorKind::Normal] {
            for (from, to) in spaces.iter().flat_map(|a| spaces.map(|b| (*a, b))) {
                let there = point.transformed(v, kind, from, to);
                let back = point.transformed(there, kind, to, from);
                assert!(
                    (back - v).length() < 1e-5,
                    "{kind:?} {from:?} {to:?}: {back:?}"
                );
                assert!(from == to || there != v, "{kind:?} {from:?} {to:?}");
            }
        }
    }

    #[test]
    fn the_camera_sees_the_point_ahead_and_missing_values_are_zero() {
        let (varying, view) = (varying(), view());
        let mut point = point(&varying);
        assert_eq!(point.seen(Coordinate::ViewDepth, Shift::None), Vec3::ZERO);
        point.view = Some(&view);
        let seen = |which| point.seen(which, Shift::None);
        assert_eq!(seen(Coordinate::Camera), vec3(0.0, 0.0, 10.0));
        assert_eq!(seen(Coordinate::Window), vec3(0.5, 0.5, 0.0));
        assert_eq!(seen(Coordinate::ViewDistance), Vec3::splat(10.0));
        assert_eq!(point.object_value(0), [1.0, 2.0, 3.0, 0.5]);
        assert_eq!(point.object_value(1), [0.0; 4]);
    }

    #[test]
    fn tangents_are_perpendicular_to_the_normal() {
        let varying = varying();
        let point = point(&varying);
        for axis in [
            Coordinate::TangentX,
            Coordinate::TangentY,
            Coordinate::TangentZ,
        ] {
            let t = point.tangent_around(axis);
            assert!(t.dot(point.normal).abs() < 1e-6 && (t.length() - 1.0).abs() < 1e-5);
        }
    }
}
