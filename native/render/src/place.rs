// SPDX-License-Identifier: GPL-3.0-or-later
//! The inputs of a shading program at a point: attributes, coordinates and the kind of ray.

use crate::check::{Error, Result, finite};
use crate::program::{Coordinate, Value};
use crate::vector::{Vec3, vec3};

/// Values at the corners of all triangles: a UV map, a colour or tangents.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layer {
    /// Numbers per corner, 2 to 4.
    pub width: usize,
    /// Triangle by triangle, corner by corner; empty = missing everywhere.
    pub values: Vec<f32>,
}

/// Texture coordinates of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectFrame {
    /// Scene to object transform; rows.
    pub to_object: [[f32; 4]; 3],
    /// Offset and then factor that map a position in object space to 0..1 within the object's box.
    pub generated: [[f32; 3]; 2],
}

/// Data that vary over the triangles, other than geometry and normals.
#[derive(Debug, Clone, Default)]
pub struct Varying {
    /// Layers, by the indices that programs use.
    pub layers: Vec<Layer>,
    /// Texture coordinates of the objects.
    pub objects: Vec<ObjectFrame>,
    /// Object of each triangle; empty = all belong to the first.
    pub object_index: Vec<u32>,
    /// World position of the scene frame's origin.
    pub origin: [f32; 3],
}

impl Varying {
    /// Checks the sizes, and replaces layer values that are not finite by 0.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] with the name of the array at fault.
    pub fn check(&mut self, triangles: usize) -> Result<()> {
        for (i, layer) in self.layers.iter_mut().enumerate() {
            // A layer is either empty or has a value at every corner.
            let want = triangles * 3 * layer.width;
            if !(2..=4).contains(&layer.width) || ![0, want].contains(&layer.values.len()) {
                return Err(Error::Shape(format!(
                    "layers[{i}]: expected one entry of 2 to 4 numbers per corner of {triangles} \
                     triangles, got {} numbers",
                    layer.values.len()
                )));
            }
            layer
                .values
                .iter_mut()
                .filter(|v| !v.is_finite())
                .for_each(|v| *v = 0.0);
        }
        for (i, object) in self.objects.iter().enumerate() {
            finite(object.to_object.as_flattened(), || {
                format!("objects[{i}]['to_object']")
            })?;
            finite(object.generated.as_flattened(), || {
                format!("objects[{i}]['generated']")
            })?;
        }
        if !self.object_index.is_empty() && self.object_index.len() != triangles {
            return Err(Error::Shape(format!(
                "object_index must have one entry per triangle: {triangles}, got {}",
                self.object_index.len()
            )));
        }
        let most = self.objects.len();
        if let Some(i) = self.object_index.iter().position(|&o| o as usize >= most) {
            return Err(Error::Shape(format!(
                "object_index[{i}] is out of range for {most} objects"
            )));
        }
        finite(&self.origin, || "origin".into())
    }
}

/// The kind of a ray, which visibility and shading programs depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayKind {
    /// From the camera.
    Camera,
    /// To a light.
    Shadow,
    /// After a diffuse bounce.
    Diffuse,
    /// After a glossy reflection.
    Glossy,
    /// After a refraction.
    Transmission,
}

/// A point to be shaded.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// Data that vary over the triangles.
    pub varying: &'a Varying,
    /// The triangle; `usize::MAX` for the background.
    pub triangle: usize,
    /// Barycentric weights of the triangle's corners.
    pub weights: [f32; 3],
    /// Position in scene space.
    pub point: Vec3,
    /// Shading normal on the viewer's side.
    pub normal: Vec3,
    /// Geometric normal on the viewer's side.
    pub geometric: Vec3,
    /// Unit direction towards the viewer.
    pub incoming: Vec3,
    /// Whether the viewer is on the back of the triangle.
    pub inside: bool,
    /// The kind of ray that arrives here.
    pub ray: RayKind,
}

impl<'a> Place<'a> {
    /// The background in a unit direction.
    pub fn background(varying: &'a Varying, direction: Vec3, ray: RayKind) -> Self {
        Self {
            varying,
            triangle: usize::MAX,
            weights: [0.0; 3],
            point: direction,
            normal: -direction,
            geometric: -direction,
            incoming: -direction,
            inside: false,
            ray,
        }
    }

    /// Returns the cosine between shading normal and viewer, clamped to 0..1.
    pub fn cosine(&self) -> f32 {
        self.normal.dot(self.incoming).clamp(0.0, 1.0)
    }

    /// Returns a layer's value at the point: missing components are 0, the fourth 1.
    pub fn attribute(&self, layer: u16) -> Value {
        let mut out = [0.0, 0.0, 0.0, 1.0];
        // A missing layer, or one that does not cover the triangle, reads as zero.
        let Some(layer) = self.varying.layers.get(usize::from(layer)) else {
            return out;
        };
        let n = layer.width;
        let Some(corners) = layer
            .values
            .get(self.triangle.wrapping_mul(3 * n)..)
            .and_then(|rest| rest.get(..3 * n))
        else {
            return out;
        };
        // Interpolate each component between the corners.
        for (k, slot) in out.iter_mut().take(n).enumerate() {
            *slot = (0..3)
                .map(|c| self.weights[c] * corners[c * n + k])
                .sum::<f32>();
        }
        out
    }

    /// The object of the triangle.
    fn object(&self) -> Option<&'a ObjectFrame> {
        let index = self.varying.object_index.get(self.triangle);
        let index = index.map_or(0, |&i| i as usize);
        self.varying.objects.get(index)
    }

    /// Whether the place is a direction of the background.
    fn is_background(&self) -> bool {
        self.triangle == usize::MAX
    }

    /// Returns a coordinate of the point, see [`Coordinate`]; the fourth component is 1.
    pub fn coordinate(&self, which: Coordinate) -> Value {
        let truth = |yes: bool| Vec3::splat(f32::from(u8::from(yes)));
        // On the background, positions are the direction itself.
        let v = match which {
            Coordinate::Generated | Coordinate::Object | Coordinate::Position
                if self.is_background() =>
            {
                self.point
            }
            Coordinate::Position => self.point + Vec3::from(self.varying.origin),
            Coordinate::Object => self.in_object(),
            Coordinate::Generated => {
                // Without an object, generated coordinates equal those of object space.
                let [add, scale] = self
                    .object()
                    .map_or([[0.0; 3], [1.0; 3]], |o| o.generated)
                    .map(Vec3::from);
                (self.in_object() + add) * scale
            }
            Coordinate::ObjectNormal => self.object().map_or(self.outward(), |o| {
                // Normals transform by the inverse transpose of object-to-scene: the transpose of scene-to-object's
                // inverse.
                let [a, b, c] = columns_to_world(&o.to_object);
                let n = self.outward();
                vec3(a.dot(n), b.dot(n), c.dot(n)).normalized_or(n)
            }),
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
            Coordinate::GlossyRay => truth(self.ray == RayKind::Glossy),
            Coordinate::TransmissionRay => truth(self.ray == RayKind::Transmission),
        };
        [v.x, v.y, v.z, 1.0]
    }

    /// The position in object space.
    fn in_object(&self) -> Vec3 {
        let Some(object) = self.object() else {
            return self.point;
        };
        let p = self.point;
        let [x, y, z] = object
            .to_object
            .map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]);
        vec3(x, y, z)
    }

    /// The shading normal on the front of the triangle.
    fn outward(&self) -> Vec3 {
        if self.inside {
            -self.normal
        } else {
            self.normal
        }
    }

    /// Normalizes a normal on the front and turns it to the viewer's side.
    fn towards_viewer(&self, outward: Vec3) -> Vec3 {
        let normal = outward.normalized_or(self.outward());
        if self.inside { -normal } else { normal }
    }

    /// Returns the normal of a tangent-space map. `tangents`: layer of (x, y, z, sign of the bitangent); `color`:
    /// the map's value.
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
        // Work on the front of the triangle, where the map is defined; turn to the viewer at the end.
        let normal = self.outward();
        let sign = if sign < 0.0 { -1.0 } else { 1.0 };
        let bitangent = normal.cross(tangent) * sign;
        self.towards_viewer(tangent * c.x + bitangent * c.y + normal * c.z)
    }

    /// Returns the normal of a map in object space (`object`) or world space.
    pub fn normal_from_color(&self, object: bool, color: Vec3, strength: f32) -> Vec3 {
        let mut mapped = color * 2.0 - Vec3::ONE;
        if object && let Some(frame) = self.object() {
            // Covectors transform to the scene by the transpose of the scene-to-object map.
            let [x, y, z] = frame.to_object.map(|r| vec3(r[0], r[1], r[2]));
            mapped = x * mapped.x + y * mapped.y + z * mapped.z;
        }
        let normal = self.outward();
        let mapped = mapped.normalized_or(normal);
        self.towards_viewer(normal + (mapped - normal) * strength.max(0.0))
    }
}

/// Returns the columns of the inverse's linear part, up to a common positive factor.
fn columns_to_world(to_object: &[[f32; 4]; 3]) -> [Vec3; 3] {
    let [x, y, z] = to_object.map(|r| vec3(r[0], r[1], r[2]));
    // The determinant of a mirrored object is negative.
    let sign = 1.0_f32.copysign(x.dot(y.cross(z)));
    [y.cross(z), z.cross(x), x.cross(y)].map(|column| column * sign)
}

/// Bends a mapped normal towards the geometric one until the mirror direction of the viewer leaves the surface;
/// below it reflections would be black. `geometric` and `incoming` are unit vectors with a positive cosine.
///
/// In the plane of the two normals, with Ng as z axis and I = (x, z), a unit normal (sin, cos) mirrors I to a
/// direction of height 2 (x sin + z cos) cos - z. The normal for a given height follows from a quadratic equation
/// in cos².
pub fn reflecting_normal(geometric: Vec3, incoming: Vec3, mapped: Vec3) -> Vec3 {
    let iz = incoming.dot(geometric);
    // Keep the normal if its mirror direction is high enough already.
    let height = |n: Vec3| 2.0 * n.dot(incoming) * n.dot(geometric) - iz;
    let want = (0.9 * iz).min(0.01);
    if height(mapped) >= want {
        return mapped;
    }
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
        if height(n) >= want - 1e-4 && n.dot(mapped) > nearest {
            nearest = n.dot(mapped);
            best = n;
        }
    }
    best
}

/// Fraction of the light from a direction that a diffuse surface with a mapped normal receives, as in Cycles: 0 if
/// the two normals disagree about the side, otherwise the shadowing of facets that lean as far as the mapped
/// normal. Conty Estevez, Lecocq and Stein 2019, "A Microfacet-Based Shadowing Function to Solve the Bump
/// Terminator Problem", Ray Tracing Gems, chapter 12. All are unit vectors; `normal` is the surface's shading
/// normal.
#[inline(always)]
pub fn bump_shadow(normal: Vec3, mapped: Vec3, direction: Vec3) -> f32 {
    // Cosines of the light and of the mapped normal with the surface's own.
    let (lit, lean) = (normal.dot(direction), normal.dot(mapped));
    if (lit < 0.0) != (mapped.dot(direction) < 0.0) {
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

    fn place(varying: &Varying) -> Place<'_> {
        let up = vec3(0.0, 0.0, 1.0);
        Place {
            varying,
            triangle: 0,
            weights: [0.25, 0.25, 0.5],
            point: vec3(1.0, 2.0, 3.0),
            normal: up,
            geometric: up,
            incoming: up,
            inside: false,
            ray: RayKind::Camera,
        }
    }

    #[test]
    fn attributes_are_interpolated_and_missing_ones_are_zero() {
        let mut varying = Varying {
            layers: vec![Layer {
                width: 2,
                values: vec![0.0, 0.0, 1.0, f32::NAN, 1.0, 1.0],
            }],
            ..Default::default()
        };
        varying.check(1).unwrap();
        assert_eq!(place(&varying).attribute(0), [0.75, 0.5, 0.0, 1.0]);
        assert_eq!(place(&varying).attribute(7), [0.0, 0.0, 0.0, 1.0]);
        assert!(varying.check(2).is_err());
    }

    #[test]
    fn a_flat_map_leaves_the_normal_and_a_tilted_one_turns_it_towards_the_tangent() {
        let varying = Varying {
            layers: vec![Layer {
                width: 4,
                values: [1.0, 0.0, 0.0, 1.0].repeat(3),
            }],
            ..Default::default()
        };
        let place = place(&varying);
        let flat = place.mapped_normal(0, vec3(0.5, 0.5, 1.0), 1.0);
        assert_eq!(flat, place.normal);
        let tilted = place.mapped_normal(0, vec3(1.0, 0.5, 0.5), 1.0);
        assert!((tilted - vec3(1.0, 0.0, 0.0)).length() < 1e-6);
        let sideways = place.mapped_normal(0, vec3(0.5, 1.0, 1.0), 1.0);
        assert!(sideways.y > 0.5, "the bitangent is n × t");
        assert_eq!(
            place.mapped_normal(0, vec3(1.0, 0.5, 0.5), 0.0),
            place.normal
        );
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
                }],
                ..Default::default()
            };
            let [x, y, z, _] = place(&varying).coordinate(Coordinate::ObjectNormal);
            assert_eq!([x, y, z], [0.0, 0.0, f32::signum(scale[2])], "{scale:?}");
        }
    }

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
