// SPDX-License-Identifier: GPL-3.0-or-later
//! Images as textures, with the lookup rules of Cycles.

use crate::check::{Error, Result};

pub mod projection;
pub mod texels;

use texels::{Format, Memory, Texels, from_half};

/// Interpolation between texel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Bilinear.
    Linear,
    /// The nearest texel.
    Closest,
    /// By cubic B-splines, which smooth.
    Cubic,
}

/// Continuation outside of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extension {
    /// The image is repeated.
    Repeat,
    /// The border texels are continued.
    Extend,
    /// Transparent black.
    Clip,
    /// The image is repeated, mirrored every other time.
    Mirror,
}

/// Colour of a missing image: Blender's pink.
const MISSING: [f32; 4] = [1.0, 0.0, 1.0, 1.0];

/// An image; rows from the bottom up. Or the tiles of one, each over a unit square.
#[derive(Debug, Clone, Default)]
pub struct Image {
    width: usize,
    height: usize,
    texels: Texels,
    /// Whether colours are sRGB-encoded.
    encoded: bool,
    /// UDIM numbers, 1001 for the first square, and what is there.
    tiles: Vec<(u32, Image)>,
}

/// Texels between which a value lies: columns and rows, `None` outside of a clipped image, and their weights.
struct Around<const N: usize> {
    columns: [Option<usize>; N],
    rows: [Option<usize>; N],
    across: [f32; N],
    up: [f32; N],
}

impl Image {
    /// An image of `width * height` texels; numbers that are not finite become 0. `encoded`: colours are sRGB and are
    /// decoded after interpolation, as in Cycles. An image without texels is allowed and shows the pink of Blender's
    /// missing images.
    ///
    /// # Errors
    /// [`Error::Shape`] if the memory does not match, or the texels do not have one to four channels.
    pub fn new(
        width: usize,
        height: usize,
        texels: Texels,
        encoded: bool,
        name: &str,
    ) -> Result<Self> {
        // The product of untrusted sizes may overflow.
        let count = width.checked_mul(height);
        let needed = count.and_then(|n| n.checked_mul(texels.channels * texels.format.size()));
        let got = texels.memory.bytes().len();
        if needed != Some(got) || !(1..=4).contains(&texels.channels) {
            return Err(Error::Shape(format!(
                "{name}: expected {width} x {height} texels of 1 to 4 numbers, got {got} bytes"
            )));
        }
        Ok(Self {
            width,
            height,
            texels: texels.finite(),
            encoded,
            tiles: Vec::new(),
        })
    }

    /// An image in single precision, four numbers for each texel.
    ///
    /// # Errors
    /// As [`Image::new`].
    pub fn from_floats(
        width: usize,
        height: usize,
        texels: &[[f32; 4]],
        encoded: bool,
        name: &str,
    ) -> Result<Self> {
        let numbers = texels.as_flattened().iter();
        let bytes: Vec<u8> = numbers.flat_map(|x| x.to_ne_bytes()).collect();
        let texels = Texels {
            format: Format::Floats,
            channels: 4,
            memory: Memory::new(bytes),
        };
        Self::new(width, height, texels, encoded, name)
    }

    /// An image of these tiles, by their UDIM numbers; between them it is missing.
    pub fn from_tiles(tiles: Vec<(u32, Self)>) -> Self {
        Self {
            tiles,
            ..Self::default()
        }
    }

    /// Returns width and height, those of the largest tile.
    pub fn size(&self) -> [usize; 2] {
        let sizes = self.tiles.iter().map(|(_, tile)| tile.size());
        sizes.fold([self.width, self.height], |a, b| {
            [a[0].max(b[0]), a[1].max(b[1])]
        })
    }

    /// Returns the linear colour and alpha at (u, v), with (0, 0) at the lower left corner and (1, 1) at the upper
    /// right. `unassociate`: divide the colour by alpha before decoding, as in Cycles.
    #[inline]
    pub fn at(
        &self,
        u: f32,
        v: f32,
        interpolation: Interpolation,
        extension: Extension,
        unassociate: bool,
    ) -> [f32; 4] {
        if !self.tiles.is_empty() {
            return match self.tile(u, v) {
                Some((tile, u, v)) => tile.at(u, v, interpolation, extension, unassociate),
                None => MISSING,
            };
        }
        // Interpolate the stored values; alpha and encoding follow, in the order of Cycles.
        let mut found = self.stored_at(u, v, interpolation, extension);
        if unassociate && found[3] != 0.0 && found[3] != 1.0 {
            let scale = 1.0 / found[3];
            found[..3].iter_mut().for_each(|c| *c *= scale);
        }
        if !self.encoded {
            return found;
        }
        let [r, g, b, a] = found;
        [from_srgb(r), from_srgb(g), from_srgb(b), a]
    }

    /// The tile at (u, v), and the place on it. Ten tiles form a row.
    fn tile(&self, u: f32, v: f32) -> Option<(&Self, f32, f32)> {
        // Down to -1 exclusive the first tile counts, as in Cycles.
        if !(u > -1.0 && u < 10.0 && v > -1.0 && v < 1e6) {
            return None;
        }
        let (column, row) = (u as u32, v as u32);
        let number = 1001 + 10 * row + column;
        let (_, tile) = self.tiles.iter().find(|(n, _)| *n == number)?;
        Some((tile, u - column as f32, v - row as f32))
    }

    /// The value at (u, v) before decoding.
    #[inline(always)]
    fn stored_at(
        &self,
        u: f32,
        v: f32,
        interpolation: Interpolation,
        extension: Extension,
    ) -> [f32; 4] {
        if self.width == 0 || self.height == 0 {
            return MISSING;
        }
        // A program may divide by zero; such coordinates show nothing.
        if !u.is_finite() || !v.is_finite() {
            return [0.0; 4];
        }
        // Use f64, so that repetitions far from the origin still resolve single texels.
        let (x, y) = (
            f64::from(u) * self.width as f64,
            f64::from(v) * self.height as f64,
        );
        match interpolation {
            Interpolation::Closest => {
                self.mixed(&self.around(x.floor(), y.floor(), extension, 0.0, [1.0], [1.0]))
            }
            Interpolation::Linear => {
                let ((x, s), (y, t)) = (split(x), split(y));
                self.mixed(&self.around(x, y, extension, 0.0, [1.0 - s, s], [1.0 - t, t]))
            }
            Interpolation::Cubic => {
                let ((x, s), (y, t)) = (split(x), split(y));
                self.mixed(&self.around(x, y, extension, -1.0, spline(s), spline(t)))
            }
        }
    }

    /// The texels from (x, y) + `first` on, with these weights.
    #[inline(always)]
    fn around<const N: usize>(
        &self,
        x: f64,
        y: f64,
        extension: Extension,
        first: f64,
        across: [f32; N],
        up: [f32; N],
    ) -> Around<N> {
        Around {
            columns: std::array::from_fn(|k| wrap(x + first + k as f64, self.width, extension)),
            rows: std::array::from_fn(|k| wrap(y + first + k as f64, self.height, extension)),
            across,
            up,
        }
    }

    /// The weighted sum of texels.
    #[inline(always)]
    fn mixed<const N: usize>(&self, around: &Around<N>) -> [f32; 4] {
        let bytes = self.texels.memory.bytes();
        match self.texels.format {
            Format::Bytes => self.sum(around, bytes, |[byte]| f32::from(byte) * (1.0 / 255.0)),
            Format::Shorts => self.sum(around, bytes, |short| {
                f32::from(u16::from_ne_bytes(short)) * (1.0 / 65535.0)
            }),
            Format::Halves => self.sum(around, bytes, |half| from_half(u16::from_ne_bytes(half))),
            Format::Floats => self.sum(around, bytes, f32::from_ne_bytes),
        }
    }

    /// The weighted sum of texels whose numbers have `B` bytes.
    #[inline(always)]
    fn sum<const N: usize, const B: usize>(
        &self,
        around: &Around<N>,
        bytes: &[u8],
        decode: impl Fn([u8; B]) -> f32,
    ) -> [f32; 4] {
        let numbers = bytes.as_chunks::<B>().0;
        match self.texels.channels {
            1 => {
                // Grey is opaque, also outside of a clipped image.
                let [grey] = self.weighted(around, |index| [decode(numbers[index])]);
                [grey, grey, grey, 1.0]
            }
            2 => {
                let texels = numbers.as_chunks::<2>().0;
                let [grey, alpha] = self.weighted(around, |index| texels[index].map(&decode));
                [grey, grey, grey, alpha]
            }
            3 => {
                // Alpha is that of opaque texels, 0 outside of a clipped image.
                let texels = numbers.as_chunks::<3>().0;
                self.weighted(around, |index| {
                    let [red, green, blue] = texels[index].map(&decode);
                    [red, green, blue, 1.0]
                })
            }
            _ => {
                let texels = numbers.as_chunks::<4>().0;
                self.weighted(around, |index| texels[index].map(&decode))
            }
        }
    }

    /// The weighted sum of texels of `C` numbers. `texel`: returns the one with this index.
    #[inline(always)]
    fn weighted<const N: usize, const C: usize>(
        &self,
        around: &Around<N>,
        texel: impl Fn(usize) -> [f32; C],
    ) -> [f32; C] {
        // Read all texels before the sums: memory is slower than both.
        let texels = around.rows.map(|row| {
            around.columns.map(|column| match (column, row) {
                (Some(x), Some(y)) => texel(y * self.width + x),
                _ => [0.0; C],
            })
        });
        let mut out = [0.0; C];
        for k in 0..C {
            // A sum begins with its first term, so that a single texel is exact.
            let along = |row: &[[f32; C]; N]| {
                let terms = row.iter().zip(around.across).map(|(t, w)| w * t[k]);
                terms.reduce(|a, b| a + b).unwrap_or(0.0)
            };
            let rows = texels.iter().zip(around.up).map(|(row, w)| w * along(row));
            out[k] = rows.reduce(|a, b| a + b).unwrap_or(0.0);
        }
        out
    }
}

/// Splits a coordinate into the texel whose centre is below it, and the share of the way to the next.
#[inline(always)]
fn split(x: f64) -> (f64, f32) {
    let whole = (x - 0.5).floor();
    (whole, (x - 0.5 - whole) as f32)
}

/// The weights of four texels, of which the second is at 0 and the third at 1, in the cubic B-spline at `t`.
#[inline(always)]
fn spline(t: f32) -> [f32; 4] {
    const SIXTH: f32 = 1.0 / 6.0;
    let s = 1.0 - t;
    [
        SIXTH * s * s * s,
        SIXTH * (4.0 + t * t * (3.0 * t - 6.0)),
        SIXTH * (4.0 + s * s * (3.0 * s - 6.0)),
        SIXTH * t * t * t,
    ]
}

/// The sRGB transfer function, encoded to linear, with a relative error below 2e-6 up to 1.
#[inline(always)]
fn from_srgb(c: f32) -> f32 {
    /// Minimax polynomial of s^0.8 for s from 0.3 to 1 (fitted by iterated least squares), the constant first.
    const POWER: [f32; 8] = [
        0.027_668_176,
        1.434_725,
        -1.294_036_1,
        2.067_303,
        -2.434_359,
        1.859_278,
        -0.816_613_4,
        0.156_035_22,
    ];
    let x = (c + 0.055) * (1.0 / 1.055);
    if c <= 0.04045 {
        c.max(0.0) * (1.0 / 12.92)
    } else if x <= 1.0 {
        // With s = √x, x^2.4 is x² s^0.8. The system's power differs in its last bits from machine to machine.
        let s = x.sqrt();
        x * x * POWER.iter().rev().fold(0.0, |sum, k| sum * s + k)
    } else {
        x.powf(2.4)
    }
}

/// Returns `at` modulo `n`, from 0 to below `n`, for whole numbers of which `n` is below 2^32.
#[inline(always)]
fn modulo(at: f64, n: f64) -> f64 {
    // Below 2^51 the rounded quotient has the right floor, and the product is exact.
    const EXACT: f64 = (1_u64 << 51) as f64;
    if at.abs() < EXACT {
        at - (at / n).floor() * n
    } else {
        at.rem_euclid(n)
    }
}

/// Maps a whole coordinate to a texel; `None` outside of a clipped image.
#[inline(always)]
fn wrap(at: f64, size: usize, extension: Extension) -> Option<usize> {
    let n = size as f64;
    if (0.0..n).contains(&at) {
        return Some(at as usize);
    }
    // Map coordinates outside of the image back inside.
    let wrapped = match extension {
        Extension::Clip => return None,
        Extension::Extend => at.clamp(0.0, n - 1.0),
        Extension::Repeat => modulo(at, n),
        Extension::Mirror => {
            // One period is the image followed by its mirror image.
            let m = modulo(at, 2.0 * n);
            if m < n { m } else { 2.0 * n - 1.0 - m }
        }
    };
    Some((wrapped as usize).min(size - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[f32]) -> Image {
        let texels: Vec<_> = values.iter().map(|&v| [v, v, v, 1.0]).collect();
        Image::from_floats(values.len(), 1, &texels, false, "row").unwrap()
    }

    #[test]
    fn texel_centres_are_exact_and_values_between_them_linear() {
        let image = row(&[0.0, 1.0, 4.0, 9.0]);
        let at = |u: f32| image.at(u, 0.5, Interpolation::Linear, Extension::Extend, false)[0];
        for (i, want) in [0.0, 1.0, 4.0, 9.0].into_iter().enumerate() {
            assert_eq!(at((i as f32 + 0.5) / 4.0), want);
        }
        assert_eq!(at(0.5), 2.5);
        assert_eq!(at(-7.0), 0.0);
        assert_eq!(
            image.at(0.49, 0.5, Interpolation::Closest, Extension::Extend, false)[0],
            1.0
        );
    }

    #[test]
    fn extensions_continue_the_image() {
        let image = row(&[1.0, 2.0, 3.0, 4.0]);
        let at = |i: f32, e| image.at((i + 0.5) / 4.0, 0.5, Interpolation::Closest, e, false)[0];
        for (extension, want) in [
            (Extension::Repeat, [4.0, 1.0]),
            (Extension::Extend, [1.0, 4.0]),
            (Extension::Clip, [0.0, 0.0]),
            (Extension::Mirror, [1.0, 4.0]),
        ] {
            assert_eq!([at(-1.0, extension), at(4.0, extension)], want);
        }
        assert_eq!(at(-6.0, Extension::Mirror), 3.0);
    }

    #[test]
    fn encoded_colours_are_decoded_after_interpolation() {
        let texels = [[0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 0.5]];
        let image = Image::from_floats(2, 1, &texels, true, "srgb").unwrap();
        let [r, _, _, a] = image.at(0.5, 0.5, Interpolation::Linear, Extension::Extend, false);
        assert!((r - 0.214_04).abs() < 1e-4 && a == 0.75, "{r} {a}");
        // 0.5 / 0.75, decoded.
        let [r, ..] = image.at(0.5, 0.5, Interpolation::Linear, Extension::Extend, true);
        assert!((r - 0.401_98).abs() < 1e-4, "{r}");
    }

    /// An image one texel high of these numbers as they are stored.
    fn stored(format: Format, channels: usize, bytes: Vec<u8>) -> Image {
        let width = bytes.len() / (channels * format.size());
        let memory = Memory::new(bytes);
        let texels = Texels {
            format,
            channels,
            memory,
        };
        Image::new(width, 1, texels, false, "stored").unwrap()
    }

    #[test]
    fn every_format_has_its_values() {
        let at = |image: &Image, index: f32| {
            let u = (index + 0.5) / image.width as f32;
            image.at(u, 0.5, Interpolation::Linear, Extension::Clip, false)
        };
        let bytes = stored(Format::Bytes, 4, (0..=255).collect());
        for texel in 0..64_u8 {
            let want = [0, 1, 2, 3].map(|k| f32::from(4 * texel + k) * (1.0 / 255.0));
            assert_eq!(at(&bytes, texel.into()), want);
        }
        let shorts = [0_u16, 1, 40_000, 65_535].map(u16::to_ne_bytes).concat();
        let want = [0.0, 1.0, 40_000.0, 65_535.0].map(|x: f32| x * (1.0 / 65535.0));
        assert_eq!(at(&stored(Format::Shorts, 4, shorts.clone()), 0.0), want);
        let grey = stored(Format::Shorts, 1, shorts);
        assert_eq!(at(&grey, 2.0), [want[2], want[2], want[2], 1.0]);
        assert_eq!(at(&grey, 9.0), [0.0, 0.0, 0.0, 1.0], "as in Cycles");
        let halves = [0x3C00_u16, 0xC000, 0, 0x3800]
            .map(u16::to_ne_bytes)
            .concat();
        assert_eq!(
            at(&stored(Format::Halves, 4, halves), 0.0),
            [1.0, -2.0, 0.0, 0.5]
        );
    }

    #[test]
    fn fewer_channels_are_those_of_a_texel_of_four() {
        // Grey with alpha, and opaque colours, each beside the same texels widened.
        let (two, three) = ([[10_u8, 200], [90, 35]], [[10_u8, 20, 30], [200, 90, 255]]);
        let narrow = [two.as_flattened().to_vec(), three.as_flattened().to_vec()];
        let wide = [
            two.map(|[grey, alpha]| [grey, grey, grey, alpha]),
            three.map(|[red, green, blue]| [red, green, blue, 255]),
        ];
        for (k, (narrow, wide)) in narrow.into_iter().zip(wide).enumerate() {
            let shorts = |bytes: &[u8]| -> Vec<u8> {
                let wider = bytes.iter().map(|&b| u16::from(b) * 257);
                wider.flat_map(u16::to_ne_bytes).collect()
            };
            let wide = wide.as_flattened().to_vec();
            let pairs = [
                (Format::Shorts, shorts(&narrow), shorts(&wide)),
                (Format::Bytes, narrow, wide),
            ];
            for (format, narrow, wide) in pairs {
                let (narrow, wide) = (stored(format, k + 2, narrow), stored(format, 4, wide));
                for interpolation in [
                    Interpolation::Closest,
                    Interpolation::Linear,
                    Interpolation::Cubic,
                ] {
                    for extension in [Extension::Clip, Extension::Repeat] {
                        for u in [-0.1, 0.25, 0.4, 0.99, 7.3] {
                            let at =
                                |image: &Image| image.at(u, 0.3, interpolation, extension, k == 0);
                            assert_eq!(at(&narrow), at(&wide), "{format:?} {u} {extension:?}");
                        }
                    }
                }
            }
        }
        let five = Texels {
            format: Format::Bytes,
            channels: 5,
            memory: Memory::new(vec![0; 5]),
        };
        assert!(Image::new(1, 1, five, false, "five").is_err());
    }

    #[test]
    fn cubic_interpolation_is_smooth_and_keeps_the_mean() {
        let image = row(&[0.0, 0.0, 6.0, 0.0, 0.0]);
        let at = |x: f32| {
            let u = (x + 0.5) / 5.0;
            image.at(u, 0.5, Interpolation::Cubic, Extension::Repeat, false)[0]
        };
        for (x, want) in [(0.0, 0.0), (1.0, 1.0), (2.0, 4.0), (2.5, 2.875), (3.0, 1.0)] {
            assert!((at(x) - want).abs() < 1e-5, "{x}: {}", at(x));
        }
        assert!(
            (row(&[3.0; 4]).at(0.3, 0.1, Interpolation::Cubic, Extension::Extend, false)[0] - 3.0)
                .abs()
                < 1e-6
        );
    }

    #[test]
    fn tiles_lie_side_by_side_and_what_is_between_them_is_missing() {
        let image = Image::from_tiles(vec![(1001, row(&[1.0])), (1012, row(&[2.0; 3]))]);
        assert_eq!(image.size(), [3, 1]);
        let at = |u, v| image.at(u, v, Interpolation::Linear, Extension::Repeat, false);
        assert_eq!(at(0.5, 0.5), [1.0; 4]);
        assert_eq!(at(1.5, 1.5), [2.0, 2.0, 2.0, 1.0]);
        for (u, v) in [
            (1.5, 0.5),
            (0.5, 1.5),
            (10.5, 0.5),
            (-1.5, 0.5),
            (f32::NAN, 0.5),
            (1e30, 1e30),
        ] {
            assert_eq!(at(u, v), MISSING, "{u} {v}");
        }
    }

    #[test]
    fn the_quick_functions_are_the_slow_ones() {
        for i in 0..=1_000_000 {
            let c = i as f32 * 2e-6;
            let exact = if c <= 0.04045 {
                f64::from(c) / 12.92
            } else {
                ((f64::from(c) + 0.055) / 1.055).powf(2.4)
            };
            let error = (f64::from(from_srgb(c)) - exact).abs();
            assert!(error <= 2e-6 * exact, "{c}: {error}");
        }
        for n in [1.0, 2.0, 3.0, 640.0, 4_294_967_295.0] {
            for k in [0.0, 1.0, 2.0, 7.0, 333_333.0, 524_287.0, 1e9, 1e15, 1e19] {
                for near in [-1.0, 0.0, 1.0, n - 1.0] {
                    for at in [k * n + near, near - k * n] {
                        assert_eq!(modulo(at, n), at.rem_euclid(n), "{at} {n}");
                    }
                }
            }
        }
    }

    #[test]
    fn missing_images_and_extreme_coordinates_have_a_colour() {
        let none = Image::from_floats(0, 7, &[], false, "none").unwrap();
        let seen = none.at(0.3, 0.3, Interpolation::Linear, Extension::Repeat, false);
        assert_eq!(seen, MISSING);
        let faulty = [[f32::NAN, 1.0, f32::INFINITY, 1.0]];
        let nan = Image::from_floats(1, 1, &faulty, false, "nan").unwrap();
        for interpolation in [
            Interpolation::Closest,
            Interpolation::Linear,
            Interpolation::Cubic,
        ] {
            let at = |u, v| nan.at(u, v, interpolation, Extension::Repeat, false);
            let [r, g, b, a] = at(1e30, -1e30);
            assert_eq!([r, b], [0.0; 2]);
            assert!((g - 1.0).abs() < 1e-6 && (a - 1.0).abs() < 1e-6);
            assert_eq!(at(f32::NAN, 0.0), [0.0; 4]);
        }
        assert!(Image::from_floats(2, 2, &[[0.0; 4]; 3], false, "torn").is_err());
    }
}
