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
    texels: Vec<[f32; 4]>,
    /// Whether colours are sRGB-encoded.
    encoded: bool,
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
            texels,
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
            return self.texel(x.floor(), y.floor(), extension);
        }
        // Interpolate bilinearly between the four nearest texel centres.
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x.floor(), y.floor());
        let (wx, wy) = ((x - fx) as f32, (y - fy) as f32);
        let [a, b, c, d] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(dx, dy)| self.texel(fx + dx, fy + dy, extension));
        let mut out = [0.0; 4];
        for k in 0..4 {
            // Along x in both rows, then between the rows.
            let low = a[k] + wx * (b[k] - a[k]);
            let high = c[k] + wx * (d[k] - c[k]);
            out[k] = low + wy * (high - low);
        }
        out
    }

    /// The texel at whole coordinates, transparent black outside of a clipped image.
    #[inline(always)]
    fn texel(&self, x: f64, y: f64, extension: Extension) -> [f32; 4] {
        match (
            wrap(x, self.width, extension),
            wrap(y, self.height, extension),
        ) {
            (Some(x), Some(y)) => self.texels[y * self.width + x],
            _ => [0.0; 4],
        }
    }
}

/// The sRGB transfer function, encoded to linear.
fn from_srgb(c: f32) -> f32 {
    if c <= 0.04045 {
        c.max(0.0) * (1.0 / 12.92)
    } else {
        ((c + 0.055) * (1.0 / 1.055)).powf(2.4)
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
        Extension::Repeat => at.rem_euclid(n),
        Extension::Mirror => {
            // One period is the image followed by its mirror image.
            let m = at.rem_euclid(2.0 * n);
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
