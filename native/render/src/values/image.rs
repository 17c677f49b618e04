// SPDX-License-Identifier: GPL-3.0-or-later
//! Images as textures: linear RGBA in f32, with the lookup rules of Cycles.

use crate::check::{Error, Result};

/// Interpolation between texel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Bilinear.
    Linear,
    /// The nearest texel.
    Closest,
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

/// An image; rows from the bottom up.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    texels: Texels,
    /// Whether colours are sRGB-encoded.
    encoded: bool,
}

/// The values of an image, row by row.
#[derive(Debug, Clone, PartialEq)]
enum Texels {
    Floats(Vec<[f32; 4]>),
    /// Numbers of values, of which an image with a byte per channel has 256: a quarter of the memory, which points look
    /// up in no order.
    Bytes(Vec<[u8; 4]>, Box<[f32; 256]>),
}

impl Default for Texels {
    fn default() -> Self {
        Self::Floats(Vec::new())
    }
}

impl Texels {
    /// Stores bytes if they give back the same values bit for bit, whichever way 0 to 255 became 0 to 1.
    fn new(values: Vec<[f32; 4]>) -> Self {
        let ways: [fn(f32) -> f32; 2] = [|byte| byte * (1.0 / 255.0), |byte| byte / 255.0];
        for way in ways {
            let decoded: [f32; 256] = std::array::from_fn(|byte| way(byte as f32));
            let byte = |value: f32| {
                // The cast clamps what is below or above.
                let byte = (value * 255.0 + 0.5) as u8;
                (decoded[usize::from(byte)].to_bits() == value.to_bits()).then_some(byte)
            };
            let bytes = values.iter().map(|&[r, g, b, a]| {
                let [Some(r), Some(g), Some(b), Some(a)] = [byte(r), byte(g), byte(b), byte(a)]
                else {
                    return None;
                };
                Some([r, g, b, a])
            });
            if let Some(bytes) = bytes.collect::<Option<Vec<_>>>() {
                return Self::Bytes(bytes, Box::new(decoded));
            }
        }
        Self::Floats(values)
    }

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        match self {
            Self::Floats(values) => values.is_empty(),
            Self::Bytes(values, _) => values.is_empty(),
        }
    }

    /// Returns the values of the texel with this index.
    #[inline(always)]
    fn at(&self, index: usize) -> [f32; 4] {
        match self {
            Self::Floats(values) => values[index],
            Self::Bytes(values, decoded) => values[index].map(|byte| decoded[usize::from(byte)]),
        }
    }
}

impl Image {
    /// An image of `width * height` texels, rows from the bottom up; values that are not finite become 0.
    /// `encoded`: colours are sRGB and are decoded after interpolation, as in Cycles. An image without texels is
    /// allowed and shows the pink of Blender's missing images.
    ///
    /// # Errors
    /// [`Error::Shape`] if the number of texels differs from width × height.
    pub fn new(
        width: usize,
        height: usize,
        mut texels: Vec<[f32; 4]>,
        encoded: bool,
        name: &str,
    ) -> Result<Self> {
        // The product of untrusted sizes may overflow.
        if width.checked_mul(height) != Some(texels.len()) {
            return Err(Error::Shape(format!(
                "{name}: expected {width} x {height} texels, got {}",
                texels.len()
            )));
        }
        for value in texels.as_flattened_mut() {
            if !value.is_finite() {
                *value = 0.0;
            }
        }
        Ok(Self {
            width,
            height,
            texels: Texels::new(texels),
            encoded,
        })
    }

    /// Returns width and height.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
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

    /// The value at (u, v) before decoding.
    #[inline(always)]
    fn stored_at(
        &self,
        u: f32,
        v: f32,
        interpolation: Interpolation,
        extension: Extension,
    ) -> [f32; 4] {
        if self.texels.is_empty() {
            return [1.0, 0.0, 1.0, 1.0];
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
        if interpolation == Interpolation::Closest {
            let column = wrap(x.floor(), self.width, extension);
            return self.texel(column, wrap(y.floor(), self.height, extension));
        }
        // Interpolate bilinearly between the four nearest texel centres.
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x.floor(), y.floor());
        let (wx, wy) = ((x - fx) as f32, (y - fy) as f32);
        let columns = [fx, fx + 1.0].map(|x| wrap(x, self.width, extension));
        let rows = [fy, fy + 1.0].map(|y| wrap(y, self.height, extension));
        let [a, b, c, d] =
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| self.texel(columns[x], rows[y]));
        let mut out = [0.0; 4];
        for k in 0..4 {
            // Along x in both rows, then between the rows.
            let low = a[k] + wx * (b[k] - a[k]);
            let high = c[k] + wx * (d[k] - c[k]);
            out[k] = low + wy * (high - low);
        }
        out
    }

    /// The texel of a column and a row, transparent black outside of a clipped image.
    #[inline(always)]
    fn texel(&self, column: Option<usize>, row: Option<usize>) -> [f32; 4] {
        match (column, row) {
            (Some(x), Some(y)) => self.texels.at(y * self.width + x),
            _ => [0.0; 4],
        }
    }
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
        let texels = values.iter().map(|&v| [v, v, v, 1.0]).collect();
        Image::new(values.len(), 1, texels, false, "row").unwrap()
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
        let texels = vec![[0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 0.5]];
        let image = Image::new(2, 1, texels, true, "srgb").unwrap();
        let [r, _, _, a] = image.at(0.5, 0.5, Interpolation::Linear, Extension::Extend, false);
        assert!((r - 0.214_04).abs() < 1e-4 && a == 0.75, "{r} {a}");
        // 0.5 / 0.75, decoded.
        let [r, ..] = image.at(0.5, 0.5, Interpolation::Linear, Extension::Extend, true);
        assert!((r - 0.401_98).abs() < 1e-4, "{r}");
    }

    #[test]
    fn bytes_are_kept_as_bytes_and_give_back_the_same_values() {
        let ways: [fn(f32) -> f32; 2] = [|byte| byte * (1.0 / 255.0), |byte| byte / 255.0];
        for way in ways {
            let texels: Vec<_> = (0..256_u16)
                .map(|k| [k, 255 - k, k / 2, 255].map(|k| way(f32::from(k))))
                .collect();
            for (number, other) in [(0, false), (1, true), (2, true), (3, true)] {
                let mut texels = texels.clone();
                texels[200][0] = [texels[200][0], 0.3, -0.0, 1.5][number];
                let kept = Texels::new(texels.clone());
                assert_eq!(matches!(kept, Texels::Floats(_)), other, "{number}");
                for (i, texel) in texels.iter().enumerate() {
                    assert_eq!(kept.at(i).map(f32::to_bits), texel.map(f32::to_bits));
                }
            }
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
        let none = Image::new(0, 7, Vec::new(), false, "none").unwrap();
        let seen = none.at(0.3, 0.3, Interpolation::Linear, Extension::Repeat, false);
        assert_eq!(seen, [1.0, 0.0, 1.0, 1.0]);
        let nan = Image::new(
            1,
            1,
            vec![[f32::NAN, 1.0, f32::INFINITY, 1.0]],
            false,
            "nan",
        )
        .unwrap();
        let seen = nan.at(1e30, -1e30, Interpolation::Linear, Extension::Repeat, false);
        assert_eq!(seen, [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(
            nan.at(
                f32::NAN,
                0.0,
                Interpolation::Linear,
                Extension::Repeat,
                false
            ),
            [0.0; 4]
        );
        assert!(Image::new(2, 2, vec![[0.0; 4]; 3], false, "torn").is_err());
    }
}
