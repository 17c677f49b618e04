// SPDX-License-Identifier: GPL-3.0-or-later
//! Ray portals: parts of a material where paths go on at another point, in another direction.

use crate::math::vector::Vec3;
use crate::values::program::{Operand, Value, read, rgb};

/// A portal, whose inputs are constants or registers of the material's program.
#[derive(Debug, Clone, Copy)]
pub struct Portal {
    color: Operand,
    position: Operand,
    direction: Operand,
}

impl Portal {
    /// The portal of these operands: colour multiplied by weight, position in world space, direction.
    pub fn new(&[color, position, direction]: &[Operand; 3]) -> Self {
        Self {
            color,
            position,
            direction,
        }
    }

    /// Returns the factor on light that comes through, without negative parts.
    pub fn color(&self, registers: &[Value]) -> Vec3 {
        rgb(read(self.color, registers)).map(|x| x.max(0.0))
    }

    /// Returns the position in world space where rays go on, and their direction, of any length; 0 for that of the ray.
    pub fn exit(&self, registers: &[Value]) -> [Vec3; 2] {
        [self.position, self.direction].map(|operand| rgb(read(operand, registers)))
    }
}
