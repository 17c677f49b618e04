// SPDX-License-Identifier: GPL-3.0-or-later
//! Values of a program at points that no ray meets, such as the vertices of a mesh that is displaced.

use crate::check::{Error, Result};
use crate::math::vector::Vec3;
use crate::values::image::Image;
use crate::values::program::{LANES, Op, Operand, Program, Step, Value, read, read_one};
use crate::values::shading_point::ShadingPoint;
use crate::values::varying::{Row, Varying};
use crate::values::view::History;
use crate::values::visibility::RayKind;
use halfspace_base::simd;

/// A program, and the points at which its result is computed.
#[derive(Debug, Default)]
pub struct Evaluation {
    /// The steps of the program.
    pub steps: Vec<Step>,
    /// The step with the result, or a constant.
    pub result: Option<Operand>,
    /// Images by the indices of the steps.
    pub images: Vec<Image>,
    /// Data that vary over the points: the first corner of "triangle" i belongs to point i.
    pub varying: Varying,
    /// Positions in scene space.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one for each point.
    pub normals: Vec<[f32; 3]>,
}

impl Evaluation {
    /// Returns the result at each point, as seen by a camera along the normal. Heights next to a point, which
    /// bump needs, are those of the point.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] for arrays, [`Error::Spec`] for a wrong program.
    pub fn run(mut self) -> Result<Vec<Value>> {
        // Check the arrays, the program and what its steps refer to.
        let count = self.positions.len();
        if self.normals.len() != count {
            let got = self.normals.len();
            return Err(Error::Shape(format!(
                "normals: expected {count}, one for each position, got {got}"
            )));
        }
        self.varying.check(count, None)?;
        let mut roots = [self.result.unwrap_or(Operand::number(0.0))];
        let program = Program::compile(&self.steps, &mut roots, "evaluation")?;
        for op in program.ops() {
            self.check_reference(op)?;
        }
        // Run the program at each point, or at eight together. Free lanes repeat the last point.
        let point = |i: usize| self.point(i, self.positions[i].into(), self.normals[i].into());
        let (mut registers, mut wide) = (Vec::new(), Vec::new());
        if !program.gains_in_lanes() {
            let points = (0..count).map(|i| {
                program.run(&self.images, &point(i), &mut registers);
                read(roots[0], &registers)
            });
            return Ok(points.collect());
        }
        let mut values = Vec::with_capacity(count);
        while values.len() < count {
            let begin = values.len();
            let points = std::array::from_fn(|lane| point((begin + lane).min(count - 1)));
            program.run_wide(simd::level(), &self.images, &points, &mut wide);
            let lanes = (0..LANES.min(count - begin)).map(|lane| read_one(roots[0], &wide, lane));
            values.extend(lanes);
        }
        Ok(values)
    }

    /// The point of this index.
    fn point(&self, index: usize, position: Vec3, normal: Vec3) -> ShadingPoint<'_> {
        ShadingPoint {
            varying: &self.varying,
            row: Row::flattened(index),
            weights: [1.0, 0.0, 0.0],
            position,
            normal,
            length: 1.0,
            geometric: normal,
            incoming: normal,
            inside: false,
            ray: RayKind::Camera,
            edges: [Vec3::ZERO; 2],
            footprint: 0.0,
            probes: 0,
            around: None,
            lamp: None,
            view: None,
            history: History::default(),
        }
    }

    /// Returns an error if an operation refers to an image or layer that does not exist.
    fn check_reference(&self, op: &Op) -> Result<()> {
        let (what, reference, count) = match op {
            Op::Image { image, .. } => ("image", *image, self.images.len()),
            Op::Attribute(layer, _) | Op::NormalMap(layer) => {
                ("layer", *layer, self.varying.layers.len())
            }
            _ => return Ok(()),
        };
        if usize::from(reference) < count {
            return Ok(());
        }
        Err(Error::Shape(format!(
            "evaluation['program']: {what} {reference} is out of range for {count}"
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::math_nodes::Math;
    use crate::values::program::{Coordinate, Noise, Shift, Spread};
    use crate::values::texture::fractal::{Fractal, NoiseKind};
    use crate::values::varying::Layer;

    /// The product of a layer's value and the position along x, at two points.
    fn evaluation() -> Evaluation {
        let product = Op::Math(Math::Multiply, false);
        let step = |op, args: &[u16]| Step {
            op,
            args: args.iter().map(|&r| Operand::Register(r)).collect(),
        };
        let mut multiply = step(product, &[0, 1]);
        multiply.args.push(Operand::number(0.0));
        Evaluation {
            steps: vec![
                step(Op::Attribute(0, Shift::None), &[]),
                step(Op::Coordinate(Coordinate::Position, Shift::None), &[]),
                multiply,
            ],
            result: Some(Operand::Register(2)),
            varying: Varying {
                layers: vec![Layer {
                    width: 3,
                    values: [[2.0; 9], [5.0; 9]].concat().into(),
                }],
                ..Default::default()
            },
            positions: vec![[3.0, 0.0, 0.0], [7.0, 0.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 2],
            ..Default::default()
        }
    }

    #[test]
    fn each_point_has_its_own_value() {
        let values = evaluation().run().unwrap();
        assert_eq!([values[0][0], values[1][0]], [6.0, 35.0]);
    }

    #[test]
    fn noise_at_many_points_is_that_at_each() {
        let noise = Op::Noise(Noise {
            spread: Spread {
                dimensions: 3,
                color: false,
            },
            kind: NoiseKind::Sum,
            normalize: true,
        });
        let at = |positions: &[[f32; 3]]| {
            let mut cloud = evaluation();
            let mut args = vec![Operand::Register(1)];
            args.extend([0.0, 3.0, 2.0, 0.5, 2.0, 0.0, 0.0, 0.0].map(Operand::number));
            cloud.steps[2] = Step {
                op: noise.clone(),
                args,
            };
            cloud.positions = positions.to_vec();
            cloud.normals = vec![[0.0, 0.0, 1.0]; positions.len()];
            cloud.varying.layers[0].values = vec![2.0; 9 * positions.len()].into();
            cloud.run().unwrap()
        };
        let positions: Vec<_> = (0..11_u8)
            .map(|i| [0.3 * f32::from(i), 1.7, -0.2])
            .collect();
        let fractal = Fractal {
            kind: NoiseKind::Sum,
            detail: 2.0,
            roughness: 0.5,
            lacunarity: 2.0,
            offset: 0.0,
            gain: 0.0,
            distortion: 0.0,
            normalize: true,
        };
        let expected = positions.iter().map(|p| fractal.at(p.map(|x| x * 3.0)));
        let expected: Vec<_> = expected.map(|x| [x, x, x, 1.0]).collect();
        assert_eq!(at(&positions), expected);
        assert!(at(&[]).is_empty());
    }

    #[test]
    fn a_constant_result_is_the_same_everywhere() {
        let mut constant = evaluation();
        constant.result = Some(Operand::number(4.0));
        assert_eq!(constant.run().unwrap(), vec![[4.0, 4.0, 4.0, 1.0]; 2]);
    }

    #[test]
    fn wrong_arrays_and_references_are_named() {
        let message = |change: fn(&mut Evaluation)| {
            let mut wrong = evaluation();
            change(&mut wrong);
            wrong.run().unwrap_err().to_string()
        };
        assert!(message(|e| e.normals.truncate(1)).contains("normals"));
        assert!(message(|e| e.varying.layers.clear()).contains("layer 0"));
        assert!(
            message(|e| e.varying.layers[0].values = vec![2.0; 9].into()).contains("layers[0]")
        );
        assert!(message(|e| e.result = Some(Operand::Register(9))).contains("evaluation"));
    }
}
