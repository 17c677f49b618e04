// SPDX-License-Identifier: GPL-3.0-or-later
//! Evaluation of the procedural textures.

use crate::math::vector::{Vec3, vec3};
use crate::values::program::{CellOutput, Cells, Noise, Op, Spread, Value, number, rgb, vector};
use crate::values::texture::fractal::Fractal;
use crate::values::texture::gabor::Gabor;
use crate::values::texture::pattern::{Bricks, Distortion, brick, magic, wave};
use crate::values::texture::radial::radial_tiling;
use crate::values::texture::voronoi::{Cell, Voronoi};
use crate::values::texture::{color, unit};

/// Evaluates an operation that is a procedural texture; black for any other. `arg`: returns an argument.
pub fn texture(op: &Op, arg: impl Fn(usize) -> Value) -> Value {
    let x = |k: usize| arg(k)[0];
    match op {
        Op::Noise(noise) => fractal(noise, &arg),
        Op::WhiteNoise(spread) => white(*spread, rgb(arg(0)), x(1)),
        Op::Voronoi(cells) => voronoi(cells, &arg),
        Op::Gabor(output, solid) => {
            let gabor = Gabor {
                frequency: x(2).max(0.001),
                isotropy: 1.0 - x(3).clamp(0.0, 1.0),
                output: *output,
            };
            let p = rgb(arg(0)) * x(1);
            number(if *solid {
                gabor.at_3d(p, rgb(arg(4)))
            } else {
                gabor.at_2d([p.x, p.y], x(4))
            })
        }
        Op::Wave(shape, profile) => {
            let distortion = Distortion {
                amount: x(2),
                detail: x(3),
                scale: x(4),
                roughness: x(5),
                phase: x(6),
            };
            number(wave(*shape, *profile, rgb(arg(0)) * x(1), distortion))
        }
        Op::Magic(depth) => vector(magic(*depth, rgb(arg(0)), x(1), x(2))),
        Op::RadialTiling(output, normalize) => {
            vector(radial_tiling(*output, *normalize, rgb(arg(0)), x(1), x(2)))
        }
        Op::Brick(rows, as_number) => {
            let bricks = Bricks {
                mortar: x(5),
                smooth: x(6),
                bias: x(7),
                width: x(8),
                height: x(9),
            };
            let (tint, mortar) = brick(*rows, bricks, rgb(arg(0)) * x(4));
            if *as_number {
                return number(mortar);
            }
            let stone = rgb(arg(1)) * (1.0 - tint) + rgb(arg(2)) * tint;
            vector(stone * (1.0 - mortar) + rgb(arg(3)) * mortar)
        }
        _ => [0.0; 4],
    }
}

/// The parameters of the Noise Texture. `x`: returns the first component of an argument.
#[inline(always)]
pub(super) fn fractal_of(noise: &Noise, x: impl Fn(usize) -> f32) -> Fractal {
    Fractal {
        kind: noise.kind,
        detail: x(3),
        roughness: x(4),
        lacunarity: x(5),
        offset: x(6),
        gain: x(7),
        distortion: x(8),
        normalize: noise.normalize,
    }
}

/// The Noise Texture.
fn fractal(noise: &Noise, arg: impl Fn(usize) -> Value) -> Value {
    let x = |k: usize| arg(k)[0];
    let fractal = fractal_of(noise, x);
    let (p, w) = (rgb(arg(0)) * x(2), x(1) * x(2));
    // A colour takes three evaluations, so it is computed only if it is used.
    macro_rules! at {
        ($p:expr) => {
            if noise.spread.color {
                vector(fractal.color_at($p))
            } else {
                number(fractal.at($p))
            }
        };
    }
    match noise.spread.dimensions {
        1 => at!([w]),
        2 => at!([p.x, p.y]),
        3 => at!(p.array()),
        _ => at!([p.x, p.y, p.z, w]),
    }
}

/// The White Noise Texture.
fn white(spread: Spread, p: Vec3, w: f32) -> Value {
    macro_rules! at {
        ($p:expr) => {
            if spread.color {
                vector(color($p))
            } else {
                number(unit($p))
            }
        };
    }
    match spread.dimensions {
        1 => at!([w]),
        2 => at!([p.x, p.y]),
        3 => at!(p.array()),
        _ => at!([p.x, p.y, p.z, w]),
    }
}

/// The Voronoi Texture.
fn voronoi(cells: &Cells, arg: impl Fn(usize) -> Value) -> Value {
    let x = |k: usize| arg(k)[0];
    let settings = Voronoi {
        feature: cells.feature,
        metric: cells.metric,
        normalize: cells.normalize,
        scale: x(2),
        detail: x(3),
        roughness: x(4),
        lacunarity: x(5),
        smoothness: x(6),
        exponent: x(7),
        randomness: x(8),
        earlier: cells.earlier,
    };
    let (p, w) = (rgb(arg(0)), x(1));
    // One coordinate is the fourth.
    match cells.dimensions {
        1 => {
            let found = settings.at([w]);
            output(cells.output, found, Vec3::ZERO, found.position[0])
        }
        2 => {
            let found = settings.at([p.x, p.y]);
            let [x, y] = found.position;
            output(cells.output, found, vec3(x, y, 0.0), 0.0)
        }
        3 => {
            let found = settings.at(p.array());
            output(cells.output, found, Vec3::from(found.position), 0.0)
        }
        _ => {
            let found = settings.at([p.x, p.y, p.z, w]);
            let [x, y, z, w] = found.position;
            output(cells.output, found, vec3(x, y, z), w)
        }
    }
}

/// Selects one output of a cell whose point is given as position and fourth coordinate.
fn output<const N: usize>(output: CellOutput, cell: Cell<N>, position: Vec3, w: f32) -> Value {
    match output {
        CellOutput::Distance | CellOutput::Radius => number(cell.distance),
        CellOutput::Color => vector(cell.color),
        CellOutput::Position => vector(position),
        CellOutput::W => number(w),
    }
}
