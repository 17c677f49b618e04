// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow catchers: surfaces that are in the photograph behind the picture already, and show only what the other objects
//! take from their light.
//!
//! A camera ray that meets a catcher splits into two paths with equal random numbers: one in the whole scene, one in a
//! scene of catchers alone. Their sums divided by each other are the shadow. As in Cycles, the shadow is in the alpha
//! of the combined pass, or dims the background of a film that is not transparent; with a pass of its own it is in that
//! pass alone. Unlike in Cycles, pixels at the edges of objects weight the shadow by the area of the catcher in them.

use crate::film::PixelSample;
use crate::math::vector::Vec3;

/// The scene in which a path finds light, and so the sum that the light belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Catch {
    /// The whole scene; the camera ray has met no shadow catcher.
    #[default]
    None,
    /// The whole scene, after the camera ray met a catcher.
    Whole,
    /// Shadow catchers alone, after the camera ray met one.
    OnlyCatchers,
}

/// Number of sums per pixel.
pub const SUMS: usize = 10;

/// The light of one sample whose camera ray meets a shadow catcher.
#[derive(Debug, Clone, Copy, Default)]
pub struct Caught {
    /// Light of the catcher in the whole scene.
    whole: [f32; 3],
    /// Light of the catcher in a scene of catchers alone.
    alone: [f32; 3],
    /// Light of the background that the catcher hides.
    background: [f32; 3],
    /// Whether the ray meets a catcher.
    met: bool,
}

impl Caught {
    /// Marks that the ray meets a catcher, which hides this light of the background.
    pub fn meet(&mut self, background: Vec3) {
        (self.met, self.background) = (true, background.array());
    }

    /// Adds light that a path finds after it met the catcher.
    #[inline(always)]
    pub fn add(&mut self, catch: Catch, light: Vec3) {
        let sum = match catch {
            Catch::None => return,
            Catch::Whole => &mut self.whole,
            Catch::OnlyCatchers => &mut self.alone,
        };
        for (sum, value) in sum.iter_mut().zip(light.array()) {
            *sum += value;
        }
    }

    /// Returns what the film sums up. `sample`: of the same ray.
    pub fn values(&self, sample: &PixelSample) -> [f32; SUMS] {
        let opacity = if self.met { sample.alpha } else { 0.0 };
        let [a, b, c] = self.whole;
        let [d, e, f] = self.alone;
        let [g, h, i] = self.background;
        [a, b, c, d, e, f, g, h, i, opacity]
    }
}

/// The means of a pixel: of the combined light and alpha, and of [`Caught::values`].
pub struct Means {
    /// Light and alpha, shadow catchers included.
    pub combined: [f64; 4],
    /// Sums over the shadow catchers.
    pub caught: [f64; SUMS],
}

impl Means {
    /// Returns the light of the catchers among all objects divided by that among catchers alone; 1 where that is 0.
    fn shadow(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let alone = self.caught[3 + k];
            if alone == 0.0 {
                1.0
            } else {
                self.caught[k] / alone
            }
        })
    }

    /// Returns the area of catchers in the pixel, and that of other opaque surfaces.
    fn areas(&self) -> [f64; 2] {
        let catcher = self.caught[9];
        [catcher, self.combined[3] - catcher]
    }

    /// Returns the pass of the shadow: a factor on what lies behind the other objects.
    pub fn pass(&self) -> [f64; 3] {
        let [catcher, others] = self.areas();
        if catcher <= 0.0 {
            return [1.0; 3];
        }
        let share = (catcher / (1.0 - others)).clamp(0.0, 1.0);
        self.shadow().map(|shadow| 1.0 + share * (shadow - 1.0))
    }

    /// Returns the combined pass. `apart`: whether the shadow has a pass of its own; `transparent`: whether the film
    /// is transparent.
    pub fn picture(&self, apart: bool, transparent: bool) -> [f64; 4] {
        let [catcher, others] = self.areas();
        let mut color = [0, 1, 2].map(|k| self.combined[k] - self.caught[k]);
        if apart {
            return [color[0], color[1], color[2], others];
        }
        let light = (self.shadow().iter().sum::<f64>() / 3.0).clamp(0.0, 1.0);
        if transparent {
            return [
                color[0],
                color[1],
                color[2],
                others + catcher * (1.0 - light),
            ];
        }
        for (k, value) in color.iter_mut().enumerate() {
            *value += light * self.caught[6 + k];
        }
        [color[0], color[1], color[2], self.combined[3]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pixel: a quarter object of light 8, half a catcher of light 2 that loses three quarters, the rest empty.
    fn means(transparent: bool) -> Means {
        let background = if transparent { 0.0 } else { 4.0 };
        let light = 0.25 * 8.0 + 0.5 * 0.5 + 0.25 * background;
        Means {
            combined: [light, light, light, if transparent { 0.75 } else { 1.0 }],
            caught: [
                0.25,
                0.25,
                0.25,
                1.0,
                1.0,
                1.0,
                0.5 * background,
                0.5 * background,
                0.5 * background,
                0.5,
            ],
        }
    }

    #[test]
    fn alpha_holds_the_shadow_of_a_transparent_film() {
        let [r, _, _, alpha] = means(true).picture(false, true);
        assert_eq!((r, alpha), (2.0, 0.25 + 0.5 * 0.75));
    }

    #[test]
    fn the_shadow_dims_the_background_of_other_films() {
        let [r, _, _, alpha] = means(false).picture(false, false);
        assert_eq!((r, alpha), (2.0 + 0.25 * 4.0 + 0.5 * 0.25 * 4.0, 1.0));
    }

    #[test]
    fn a_pass_of_its_own_holds_the_shadow_instead() {
        let pixel = means(true);
        let [r, _, _, alpha] = pixel.picture(true, true);
        assert_eq!((r, alpha), (2.0, 0.25));
        // Two thirds of what the object leaves open are the catcher.
        let dimmed = 1.0 - 2.0 / 3.0 * 0.75;
        assert!((pixel.pass()[0] - dimmed).abs() < 1e-12);
        // Over a white photograph both ways agree.
        let apart = r + (1.0 - alpha) * pixel.pass()[0];
        let [r, _, _, alpha] = pixel.picture(false, true);
        assert!((apart - (r + (1.0 - alpha))).abs() < 1e-12);
    }

    #[test]
    fn catchers_without_light_have_no_shadow() {
        let mut pixel = means(true);
        pixel.caught[..6].fill(0.0);
        assert_eq!(pixel.pass(), [1.0; 3]);
    }
}
