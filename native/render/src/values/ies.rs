// SPDX-License-Identifier: GPL-3.0-or-later
//! Photometric tables: the intensity of a light by direction, interpolated as in Cycles.

use std::f32::consts::{PI, TAU};

use crate::check::{Error, Result, finite};
use crate::math::vector::Vec3;

/// Differences of angles that count as none, radians.
const CLOSE: f32 = 1e-7;

/// Intensities over the sphere of directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Ies {
    /// Ascending angles around the z axis, and from -z, in radians; at least two each.
    horizontal: Vec<f32>,
    vertical: Vec<f32>,
    /// The values of all vertical angles, for each horizontal one.
    values: Vec<f32>,
}

impl Ies {
    /// Checks and keeps a table. `name`: for messages.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] if angles do not ascend or a size is wrong.
    pub fn new(
        horizontal: Vec<f32>,
        vertical: Vec<f32>,
        values: Vec<f32>,
        name: &str,
    ) -> Result<Self> {
        for (key, angles) in [("horizontal", &horizontal), ("vertical", &vertical)] {
            finite(angles, || format!("{name}['{key}']"))?;
            if angles.len() < 2 || angles.windows(2).any(|pair| pair[0] > pair[1]) {
                return Err(Error::Shape(format!(
                    "{name}['{key}'] must be at least two ascending angles"
                )));
            }
        }
        finite(&values, || format!("{name}['values']"))?;
        let expected = horizontal.len() * vertical.len();
        if values.len() != expected {
            return Err(Error::Shape(format!(
                "{name}['values']: expected {expected}, got {}",
                values.len()
            )));
        }
        Ok(Self {
            horizontal,
            vertical,
            values,
        })
    }

    /// Returns the intensity in a direction of any length; 0 where the table has none.
    pub fn at(&self, direction: Vec3) -> f32 {
        let d = direction.normalized_or(Vec3::ZERO);
        let (around, down) = (d.x.atan2(d.y) + PI, (-d.z).clamp(-1.0, 1.0).acos());
        let (Some((h, x)), Some((v, y))) =
            (place(&self.horizontal, around), place(&self.vertical, down))
        else {
            return 0.0;
        };
        // A table of a whole turn continues at its other end, one without its neighbours ends in equal values.
        let count = self.horizontal.len();
        let turns = self.horizontal[0] < CLOSE && self.horizontal[count - 1] > TAU - CLOSE;
        let before = match h {
            0 if turns => count - 2,
            0 => h,
            _ => h - 1,
        };
        let after = match h + 2 {
            next if next < count => next,
            _ if turns => 1,
            _ => h,
        };
        let column = |h| self.along(h, v, y);
        cubic([before, h, h + 1, after].map(column), x).max(0.0)
    }

    /// Interpolates the values of a horizontal angle. Beyond both poles the light is the same as before.
    fn along(&self, h: usize, v: usize, y: f32) -> f32 {
        let count = self.vertical.len();
        let values = &self.values[h * count..(h + 1) * count];
        let before = match v {
            0 if self.vertical[0] < CLOSE => 1,
            0 => 0,
            _ => v - 1,
        };
        let after = match v + 2 {
            next if next < count => next,
            _ if self.vertical[count - 1] > PI - CLOSE => count - 2,
            _ => v + 1,
        };
        cubic([before, v, v + 1, after].map(|v| values[v]), y)
    }
}

/// Returns the interval of ascending angles that contains one, and the position in it; `None` outside.
fn place(angles: &[f32], angle: f32) -> Option<(usize, f32)> {
    let last = angles.len() - 1;
    if angle.is_nan() || angle < angles[0] || angle >= angles[last] {
        return None;
    }
    let index = angles[1..=last].partition_point(|&end| end < angle);
    let (low, high) = (angles[index], angles[index + 1]);
    let share = if high > low {
        (angle - low) / (high - low)
    } else {
        0.0
    };
    Some((index, share))
}

/// A Catmull-Rom spline between the second and the third value.
fn cubic([a, b, c, d]: [f32; 4], x: f32) -> f32 {
    let cube = d - a + 3.0 * (b - c);
    let square = 2.0 * a - 5.0 * b + 4.0 * c - d;
    b + 0.5 * x * (c - a + x * (square + x * cube))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    fn table(values: Vec<f32>) -> Result<Ies> {
        Ies::new(vec![0.0, PI, TAU], vec![0.0, 0.5 * PI], values, "table")
    }

    #[test]
    fn directions_have_the_values_of_their_angles() {
        let ies = table(vec![1.0, 2.0, 3.0, 5.0, 1.0, 2.0]).unwrap();
        // Straight down, to the side, and above the last angle.
        assert!((ies.at(vec3(0.0, 1e-6, -3.0)) - 3.0).abs() < 1e-4);
        assert!((ies.at(vec3(0.0, 1.0, -1e-6)) - 5.0).abs() < 1e-4);
        assert_eq!(ies.at(vec3(0.3, 0.0, 1.0)), 0.0);
        assert_eq!(ies.at(Vec3::splat(f32::NAN)), 0.0);
    }

    #[test]
    fn wrong_tables_are_named() {
        let message = |result: Result<Ies>| result.unwrap_err().to_string();
        assert!(message(table(vec![1.0; 5])).contains("values"));
        assert!(message(table(vec![f32::NAN; 6])).contains("values"));
        let falling = Ies::new(vec![1.0, 0.0], vec![0.0, 1.0], vec![0.0; 4], "table");
        assert!(message(falling).contains("horizontal"));
    }
}
