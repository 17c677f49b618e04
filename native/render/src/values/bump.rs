// SPDX-License-Identifier: GPL-3.0-or-later
//! Bump: the shading normal of a surface that heights displace.

use crate::math::vector::{Frame, Vec3, vec3};
use crate::values::program::{Bump, Shift};
use crate::values::shading_point::ShadingPoint;

impl ShadingPoint<'_> {
    /// Unit vectors along the surface.
    fn axes(&self) -> [Vec3; 2] {
        let frame = Frame::around(self.geometric);
        [vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)].map(|axis| frame.to_world(axis))
    }

    /// The vector from the point to where a value is computed.
    fn step(&self, shift: Shift) -> Vec3 {
        match shift {
            Shift::None => Vec3::ZERO,
            Shift::X(width) => self.axes()[0] * (width * self.footprint),
            Shift::Y(width) => self.axes()[1] * (width * self.footprint),
        }
    }

    /// The position where a value is computed, in scene space.
    pub(super) fn position_at(&self, shift: Shift) -> Vec3 {
        self.position + self.step(shift)
    }

    /// The barycentric weights there, which may lie outside of the triangle.
    pub(super) fn weights_at(&self, shift: Shift) -> [f32; 3] {
        if shift == Shift::None {
            return self.weights;
        }
        // Solve for the step in terms of the edges, by the normal equations.
        let (step, [a, b]) = (self.step(shift), self.edges);
        let (aa, ab, bb) = (a.dot(a), a.dot(b), b.dot(b));
        let (sa, sb) = (step.dot(a), step.dot(b));
        let determinant = aa * bb - ab * ab;
        if determinant.is_nan() || determinant <= 0.0 {
            return self.weights;
        }
        let u = (sa * bb - sb * ab) / determinant;
        let v = (sb * aa - sa * ab) / determinant;
        let [w0, w1, w2] = self.weights;
        [w0 - u - v, w1 + u, w2 + v]
    }

    /// Returns the normal of the surface displaced along `normal` by heights, which are given at the point and
    /// next to it along both axes. `strength`: share of the displaced normal; `distance`: factor on the heights.
    ///
    /// The gradient on the surface follows from the differences as in Mikkelsen 2010, "Bump Mapping Unparametrized
    /// Surfaces on the GPU", with unit vectors in place of the screen's derivatives.
    pub fn bumped_normal(
        &self,
        bump: Bump,
        [center, x, y]: [f32; 3],
        strength: f32,
        distance: f32,
        normal: Vec3,
    ) -> Vec3 {
        let run = bump.width * self.footprint;
        if run.is_nan() || run <= 0.0 {
            return normal;
        }
        let object = self.object().filter(|_| bump.object);
        let [mut dx, mut dy] = self.axes();
        let mut n = normal;
        if let Some(object) = object {
            let [a, b, c] = object.to_object.map(|r| vec3(r[0], r[1], r[2]));
            [dx, dy] = [dx, dy].map(|v| vec3(a.dot(v), b.dot(v), c.dot(v)));
            n = self.normal_in_object(normal);
        }
        // Slopes along the axes, then the gradient on the surface.
        let slopes = [(x - center) / run, (y - center) / run];
        let (rx, ry) = (dy.cross(n), n.cross(dx));
        let determinant = dx.dot(rx);
        let gradient = rx * slopes[0] + ry * slopes[1];
        let height = if bump.invert { -distance } else { distance };
        let bent = n * determinant.abs() - gradient * (height * determinant.signum());
        let bent = bent.normalized_or(n);
        let strength = strength.max(0.0);
        let mut bumped = (bent * strength + n * (1.0 - strength)).normalized_or(n);
        if object.is_some() {
            bumped = self.normal_in_scene(bumped);
        }
        bumped.normalized_or(normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::program::Coordinate;
    use crate::values::shading_point::tests::point;
    use crate::values::varying::{Layer, ObjectFrame, Varying};

    const BUMP: Bump = Bump {
        width: 0.1,
        invert: false,
        object: false,
    };

    /// The normal of the plane z = 2x - y / 2 at a point.
    fn sloped(point: &ShadingPoint<'_>, bump: Bump, strength: f32) -> Vec3 {
        let heights = [Shift::None, Shift::X(0.1), Shift::Y(0.1)].map(|shift| {
            let [x, y, ..] = point.coordinate(Coordinate::Position, shift);
            2.0 * x - 0.5 * y
        });
        point.bumped_normal(bump, heights, strength, 1.0, point.normal)
    }

    #[test]
    fn a_sloped_height_has_the_normal_of_its_plane() {
        let varying = Varying::default();
        let point = point(&varying);
        let plane = vec3(-2.0, 0.5, 1.0).normalized();
        assert!((sloped(&point, BUMP, 1.0) - plane).length() < 1e-3);
        let lowered = sloped(
            &point,
            Bump {
                invert: true,
                ..BUMP
            },
            1.0,
        );
        assert!((lowered - vec3(2.0, -0.5, 1.0).normalized()).length() < 1e-3);
        assert_eq!(sloped(&point, BUMP, 0.0), point.normal);
        let flat = ShadingPoint {
            footprint: 0.0,
            ..point
        };
        assert_eq!(sloped(&flat, BUMP, 1.0), point.normal);
    }

    #[test]
    fn attributes_continue_linearly_beside_the_point() {
        let varying = Varying {
            layers: vec![Layer {
                width: 2,
                values: vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0].into(),
            }],
            ..Default::default()
        };
        let point = point(&varying);
        let [u, v, ..] = point.attribute(0);
        for shift in [Shift::X(2.0), Shift::Y(-3.0)] {
            let step = point.position_at(shift) - point.position;
            let [x, y, ..] = point.attribute_at(0, shift);
            assert!((x - u - step.x).abs() + (y - v - step.y).abs() < 1e-6);
            assert!(step.length() > 0.01);
        }
    }

    #[test]
    fn heights_in_the_space_of_an_object_grow_with_it() {
        let mut to_object = [[0.0; 4]; 3];
        for (k, row) in to_object.iter_mut().enumerate() {
            row[k] = 0.25;
        }
        let varying = Varying {
            objects: vec![ObjectFrame {
                to_object,
                generated: [[0.0; 3], [1.0; 3]],
                ..Default::default()
            }],
            ..Default::default()
        };
        let point = point(&varying);
        let bump = Bump {
            object: true,
            ..BUMP
        };
        // An object four times as large displaces by four times the height.
        let plane = vec3(-8.0, 2.0, 1.0).normalized();
        assert!((sloped(&point, bump, 1.0) - plane).length() < 1e-3);
    }
}
