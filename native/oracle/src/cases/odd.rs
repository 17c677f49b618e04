// SPDX-License-Identifier: GPL-3.0-or-later
//! Invalid and unusual rays: components that are not finite, zero directions, empty intervals.

use halfspace_ray::Ray;

/// Makes every `every`-th of the rays invalid or unusual, in seven alternating ways, and leaves the others
/// unchanged.
pub fn strew(rays: &mut [Ray], every: usize) {
    const ODD: [f32; 5] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -1e30];
    for (i, ray) in rays.iter_mut().step_by(every.max(1)).enumerate() {
        let (number, k) = (ODD[i / 7 % ODD.len()], i % 3);
        // Change one component, the direction, or the interval.
        match i % 7 {
            0 => ray.o[k] = number,
            1 => ray.d[k] = number,
            2 => ray.t_min = number,
            3 => ray.t_max = number,
            4 => ray.d = [0.0; 3],
            5 => (ray.t_min, ray.t_max) = (ray.t_max, ray.t_min),
            _ if i % 2 == 0 => ray.d[k] *= 1e-40,
            _ => ray.d[k] = f32::from_bits(1),
        }
    }
}
