// SPDX-License-Identifier: GPL-3.0-or-later
//! Regular patterns, with the values of Blender's textures: waves, bricks and magic.

use std::f32::consts::{FRAC_PI_2, TAU};

use crate::math::vector::{Vec3, vec3};
use crate::values::math_nodes::named;
use crate::values::texture::fractal::{Fractal, NoiseKind};

named! {
    /// Shape and direction of a wave.
    WaveShape {
        BandsX = "BANDS X", BandsY = "BANDS Y", BandsZ = "BANDS Z", Diagonal = "BANDS DIAGONAL",
        RingsX = "RINGS X", RingsY = "RINGS Y", RingsZ = "RINGS Z", Spherical = "RINGS SPHERICAL",
    }
}

named! {
    /// The course of a wave over its phase.
    Profile {
        Sine = "SIN", Saw = "SAW", Triangle = "TRI",
    }
}

/// Parameters of the noise that distorts a wave, and the phase of the wave.
#[derive(Debug, Clone, Copy)]
pub struct Distortion {
    /// Amplitude of the noise in radians.
    pub amount: f32,
    /// Octaves of the noise after the first.
    pub detail: f32,
    /// Frequency of the noise.
    pub scale: f32,
    /// Amplitude of each octave divided by that of the previous one.
    pub roughness: f32,
    /// Added to the phase, in radians.
    pub phase: f32,
}

/// Returns the wave at a position: 0..1.
pub fn wave(shape: WaveShape, profile: Profile, p: Vec3, distortion: Distortion) -> f32 {
    // Avoid steps at whole coordinates.
    let p = (p + Vec3::splat(1e-6)) * 0.999_999;
    let mut phase = match shape {
        WaveShape::BandsX => 20.0 * p.x,
        WaveShape::BandsY => 20.0 * p.y,
        WaveShape::BandsZ => 20.0 * p.z,
        WaveShape::Diagonal => 10.0 * (p.x + p.y + p.z),
        WaveShape::RingsX => 20.0 * vec3(0.0, p.y, p.z).length(),
        WaveShape::RingsY => 20.0 * vec3(p.x, 0.0, p.z).length(),
        WaveShape::RingsZ => 20.0 * vec3(p.x, p.y, 0.0).length(),
        WaveShape::Spherical => 20.0 * p.length(),
    };
    phase += distortion.phase;
    if distortion.amount != 0.0 {
        let noise = Fractal {
            kind: NoiseKind::Sum,
            detail: distortion.detail,
            roughness: distortion.roughness,
            lacunarity: 2.0,
            offset: 0.0,
            gain: 0.0,
            distortion: 0.0,
            normalize: true,
        };
        phase += distortion.amount * (2.0 * noise.at((p * distortion.scale).array()) - 1.0);
    }
    let turns = phase / TAU;
    match profile {
        Profile::Sine => 0.5 + 0.5 * (phase - FRAC_PI_2).sin(),
        Profile::Saw => turns - turns.floor(),
        Profile::Triangle => 2.0 * (turns - (turns + 0.5).floor()).abs(),
    }
}

/// How rows of bricks differ. A frequency of 0 turns both off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rows {
    /// Shift of every n-th row, relative to the width of a brick.
    pub offset: f32,
    /// The n of the shifted rows.
    pub offset_frequency: u32,
    /// Factor on the width of the bricks of every n-th row.
    pub squash: f32,
    /// The n of the squashed rows.
    pub squash_frequency: u32,
}

/// Sizes of bricks and mortar.
#[derive(Debug, Clone, Copy)]
pub struct Bricks {
    /// Width of the mortar from the edge of a brick.
    pub mortar: f32,
    /// Share of the mortar over which it fades into the brick.
    pub smooth: f32,
    /// Added to the tint.
    pub bias: f32,
    /// Width of a brick.
    pub width: f32,
    /// Height of a row.
    pub height: f32,
}

/// Returns the tint of the brick at a position, a random share of its second colour, and the share of mortar.
pub fn brick(rows: Rows, bricks: Bricks, p: Vec3) -> (f32, f32) {
    let row = (p.y / bricks.height).floor() as i32;
    let every = |n: u32| row % n as i32 == 0;
    let (mut width, mut offset) = (bricks.width, 0.0);
    if rows.offset_frequency > 0 && rows.squash_frequency > 0 {
        if every(rows.squash_frequency) {
            width *= rows.squash;
        }
        if every(rows.offset_frequency) {
            offset = width * rows.offset;
        }
    }
    // The position within the brick, and its distance from the nearest edge.
    let column = ((p.x + offset) / width).floor() as i32;
    let x = p.x + offset - width * column as f32;
    let y = p.y - bricks.height * row as f32;
    let edge = x.min(y).min((width - x).min(bricks.height - y));
    let number = (row as u32) << 16;
    let tint = integer_noise(number.wrapping_add(column as u32 & 0xffff)) + bricks.bias;
    let mortar = if edge >= bricks.mortar {
        0.0
    } else if bricks.smooth == 0.0 {
        1.0
    } else {
        let t = ((1.0 - edge / bricks.mortar) / bricks.smooth).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    (tint.clamp(0.0, 1.0), mortar)
}

/// Noise over whole numbers: 0..1.
fn integer_noise(n: u32) -> f32 {
    let n = n.wrapping_add(1013) & 0x7fff_ffff;
    let n = (n >> 13) ^ n;
    let cubic = n
        .wrapping_mul(n)
        .wrapping_mul(60_493)
        .wrapping_add(19_990_303);
    let mixed = n.wrapping_mul(cubic).wrapping_add(1_376_312_589) & 0x7fff_ffff;
    0.5 * (mixed as f32 / 1_073_741_824.0)
}

/// Returns the magic texture's colour: nested sines of the position, `depth` of them.
pub fn magic(depth: u32, p: Vec3, scale: f32, distortion: f32) -> Vec3 {
    let p = p.map(|x| (x * scale) % TAU);
    let mut x = ((p.x + p.y + p.z) * 5.0).sin();
    let mut y = ((-p.x + p.y - p.z) * 5.0).cos();
    let mut z = -((-p.x - p.y + p.z) * 5.0).cos();
    if depth > 0 {
        (x, y, z) = (x * distortion, y * distortion, z * distortion);
    }
    // Each further level replaces one coordinate by a wave of all three.
    for level in 1..=depth.min(10) {
        let (axis, value) = match level {
            1 => (1, -(x - y + z).cos()),
            2 => (0, (x - y - z).cos()),
            3 => (2, (-x - y - z).sin()),
            4 => (0, -(-x + y - z).cos()),
            5 => (1, -(-x + y + z).sin()),
            6 => (1, -(-x + y + z).cos()),
            7 => (0, (x + y + z).cos()),
            8 => (2, (x + y - z).sin()),
            9 => (0, -(-x - y + z).cos()),
            _ => (1, -(x - y + z).sin()),
        };
        *[&mut x, &mut y, &mut z][axis] = value * distortion;
    }
    let norm = if distortion == 0.0 {
        1.0
    } else {
        0.5 / distortion
    };
    vec3(0.5 - x * norm, 0.5 - y * norm, 0.5 - z * norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: Distortion = Distortion {
        amount: 0.0,
        detail: 2.0,
        scale: 1.0,
        roughness: 0.5,
        phase: 0.0,
    };

    #[test]
    fn waves_have_their_profile_along_their_axis() {
        let at = |profile, turns: f32| {
            wave(
                WaveShape::BandsX,
                profile,
                vec3(turns * TAU / 20.0, 5.0, -3.0),
                STILL,
            )
        };
        for (profile, values) in [
            (Profile::Sine, [0.0, 0.5, 1.0]),
            (Profile::Saw, [0.0, 0.25, 0.5]),
            (Profile::Triangle, [0.0, 0.5, 1.0]),
        ] {
            for (turns, want) in [0.0, 0.25, 0.5].into_iter().zip(values) {
                assert!(
                    (at(profile, turns) - want).abs() < 1e-3,
                    "{profile:?} {turns}"
                );
            }
        }
        let rings = wave(WaveShape::RingsZ, Profile::Saw, vec3(0.0, 0.1, 9.0), STILL);
        assert!((rings - 2.0 / TAU).abs() < 1e-3);
        let bent = Distortion {
            amount: 2.0,
            ..STILL
        };
        let p = vec3(0.3, 0.7, 0.2);
        let [a, b] = [STILL, bent].map(|d| wave(WaveShape::BandsX, Profile::Sine, p, d));
        assert_ne!(a, b);
    }

    #[test]
    fn mortar_surrounds_bricks_and_rows_are_shifted() {
        let rows = Rows {
            offset: 0.5,
            offset_frequency: 2,
            squash: 1.0,
            squash_frequency: 2,
        };
        let bricks = Bricks {
            mortar: 0.02,
            smooth: 0.0,
            bias: 0.0,
            width: 0.5,
            height: 0.25,
        };
        let mortar = |x: f32, y: f32| brick(rows, bricks, vec3(x, y, 0.0)).1;
        // Row 0 is shifted by half a brick: an edge is at x = 0.25, and in row 1 at x = 0.5.
        assert_eq!([mortar(0.25, 0.1), mortar(0.5, 0.1)], [1.0, 0.0]);
        assert_eq!([mortar(0.25, 0.4), mortar(0.5, 0.4)], [0.0, 1.0]);
        assert_eq!(mortar(0.1, 0.255), 1.0);
        let tints: Vec<_> = (0..9)
            .map(|i| brick(rows, bricks, vec3(i as f32, 0.4, 0.0)).0)
            .collect();
        assert!(tints.windows(2).all(|pair| pair[0] != pair[1]), "{tints:?}");
    }

    #[test]
    fn magic_stays_within_its_range() {
        for depth in 0..12 {
            for i in 0..100 {
                let c = magic(depth, vec3(0.1, -0.3, 0.7) * i as f32, 5.0, 1.0);
                assert!(
                    c.array().iter().all(|v| (-0.5..=1.5).contains(v)),
                    "{depth}: {c:?}"
                );
            }
        }
    }
}
