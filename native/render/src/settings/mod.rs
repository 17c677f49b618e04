// SPDX-License-Identifier: GPL-3.0-or-later
//! Settings of a render: size, samples, bounces, passes.

use crate::camera::filter::FilterKind;
use crate::check::{Error, Result};
use crate::math::vector::Vec3;

mod light_pass;
mod matte_pass;
mod mist;
mod pass;

pub use crate::settings::light_pass::{LightPass, LobeKind};
pub use crate::settings::matte_pass::{MatteKind, MattePass};
pub use crate::settings::mist::{Falloff, Mist};
pub use crate::settings::pass::Pass;

/// The rendering algorithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrator {
    /// Path tracing: all light.
    Path,
    /// Direct light, perfect mirrors and clear glass (Whitted 1980), without light that is scattered by another
    /// surface.
    Whitted,
    /// Ambient occlusion of the first surface: the cosine-weighted fraction of the hemisphere without an occluder
    /// within a distance.
    Ambient,
}

/// Settings of a render.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Width of the full frame, pixels.
    pub width: u32,
    /// Height of the full frame, pixels.
    pub height: u32,
    /// x0, y0, x1, y1 in pixels from the lower left, half open; `None` = the full frame.
    pub border: Option<[u32; 4]>,
    /// Samples per pixel: the cost is proportional, the noise falls with the square root or faster.
    pub samples: u32,
    /// Rendering algorithm.
    pub integrator: Integrator,
    /// Range of ambient occlusion, scene units; may be infinite.
    pub ambient_distance: f32,
    /// Whether rays that flat polygons mirror or refract go as beams from the polygon's virtual eye, see
    /// [`crate::path::beams`]; refraction is then approximate. For [`Integrator::Whitted`] only.
    pub secondary_beams: bool,
    /// Largest number of times a path scatters after its first surface; 0 = direct light only. As in Cycles.
    pub max_bounces: u32,
    /// Largest number of diffuse bounces within that. As in Cycles.
    pub diffuse_bounces: u32,
    /// The same for glossy reflections.
    pub glossy_bounces: u32,
    /// The same for refractions.
    pub transmission_bounces: u32,
    /// Largest number of times a path scatters in volumes after the first time; 0 = single scattering. As in Cycles.
    pub volume_bounces: u32,
    /// Largest number of transparent surfaces that a path passes, with its shadow rays; the next one only
    /// emits. As in Cycles.
    pub transparent_bounces: u32,
    /// Upper limit of what one sample adds after its first bounce, as the mean of its channels; 0 = no limit,
    /// unbiased. Lower values remove fireflies and lose light. As in Cycles.
    pub clamp_indirect: f32,
    /// The same limit for what a sample adds up to and with its first bounce: light that the camera sees directly or in
    /// one reflection; 0 = no limit.
    pub clamp_direct: f32,
    /// Blurs glossy and refractive lobes that a path meets after an improbable bounce, see [`Self::min_width`]; 0 =
    /// off, unbiased. Larger values remove more noise and more caustics. As in Cycles.
    pub filter_glossy: f32,
    /// Whether lobes that reflect are kept where the last bounce was diffuse. Without them paths find no caustics of
    /// mirrors. As in Cycles.
    pub caustics_reflective: bool,
    /// The same for lobes that refract: caustics of glass.
    pub caustics_refractive: bool,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Whether the background has alpha 0 and is black for camera rays.
    pub film_transparent: bool,
    /// Roughness up to which a transparent film sees through glass; below 0 = not at all. As in Cycles.
    pub transparent_glass: f32,
    /// Passes to fill.
    pub passes: Vec<Pass>,
    /// Error below which a block of pixels gets no more samples, see [`crate::film::adaptive`]; 0 = adaptive sampling
    /// off.
    pub noise_threshold: f32,
    /// Samples that every pixel gets first; 0 = derived from the threshold.
    pub min_samples: u32,
    /// Seconds after which no more samples begin, once every pixel has one; 0 = no limit. The only setting that
    /// makes the image depend on the machine.
    pub time_limit: f32,
    /// The mist pass.
    pub mist: Mist,
    /// Samples per pixel between two updates; `None` = 1, 3, 4, then 8.
    pub step_samples: Option<u32>,
    /// Pixel filter.
    pub filter: FilterKind,
    /// Width of the filter in pixels, in Blender's definition.
    pub filter_width: f32,
    /// Factor on the colours of the combined pass, not on its alpha.
    pub exposure: f32,
    /// Largest number of rays of each kind to record; 0 = none is recorded. The image does not depend on it.
    pub record_rays: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            width: 1,
            height: 1,
            border: None,
            samples: 1,
            integrator: Integrator::Path,
            ambient_distance: f32::INFINITY,
            max_bounces: 4,
            diffuse_bounces: MAX_BOUNCES,
            glossy_bounces: MAX_BOUNCES,
            transmission_bounces: MAX_BOUNCES,
            volume_bounces: 0,
            transparent_bounces: 8,
            clamp_indirect: 0.0,
            clamp_direct: 0.0,
            filter_glossy: 0.0,
            caustics_reflective: true,
            caustics_refractive: true,
            secondary_beams: false,
            seed: 0,
            film_transparent: false,
            transparent_glass: -1.0,
            passes: vec![Pass::Combined],
            noise_threshold: 0.0,
            min_samples: 0,
            time_limit: 0.0,
            mist: Mist::default(),
            step_samples: None,
            filter: FilterKind::BlackmanHarris,
            filter_width: 1.5,
            exposure: 1.0,
            record_rays: 0,
        }
    }
}

impl Settings {
    /// Applies `clamp_indirect` or `clamp_direct` to a contribution. `indirect`: whether the light was reflected more
    /// than once.
    #[inline]
    pub fn clamped(&self, value: Vec3, indirect: bool) -> Vec3 {
        // Scaling all channels alike keeps the hue.
        let mean = (value.x.abs() + value.y.abs() + value.z.abs()) / 3.0;
        let limit = if indirect {
            self.clamp_indirect
        } else {
            self.clamp_direct
        };
        if limit > 0.0 && mean > limit {
            return value * (limit / mean);
        }
        value
    }

    /// Returns the least width (roughness²) of the lobes of a path whose least probable bounce had the density
    /// `pdf`: the square root of 1 - pdf / `filter_glossy`, halved, as in Cycles.
    #[inline]
    pub fn min_width(&self, pdf: f32) -> f32 {
        if self.filter_glossy > 0.0 && pdf < self.filter_glossy {
            return 0.5 * (1.0 - pdf / self.filter_glossy).sqrt();
        }
        0.0
    }
}

/// Largest number of samples between two updates of a tile, whose buffer grows in proportion.
pub const MAX_STEP_SAMPLES: u32 = 64;

/// Largest limit of any kind of bounces, as in Cycles.
pub const MAX_BOUNCES: u32 = 1024;

/// Number of samples between two estimates of the noise.
pub const CHECK_SAMPLES: u32 = 16;

/// Largest number of rays of a kind to record: 40 bytes each, of at most some hundred kinds.
const MAX_RECORDED: u32 = 1 << 16;

/// Largest number of pixels of a film, to catch mistyped sizes.
const MAX_PIXELS: u64 = 1 << 30;

impl Settings {
    /// Checks all settings.
    ///
    /// # Errors
    /// [`Error::Spec`] with the key at fault.
    pub fn check(&self) -> Result<()> {
        self.check_counts()?;
        self.check_quantities()?;
        if self.secondary_beams && self.integrator != Integrator::Whitted {
            return Err(Error::Spec(
                "settings['secondary_beams'] needs settings['integrator'] = 'whitted'".into(),
            ));
        }
        self.check_border()
    }

    /// Checks sizes and numbers of samples and bounces.
    fn check_counts(&self) -> Result<()> {
        let spec = |text: String| Err(Error::Spec(text));
        for (key, value) in [("width", self.width), ("height", self.height)] {
            if value == 0 || value > 1 << 20 {
                return spec(format!(
                    "settings['{key}'] must lie in 1..1048576, got {value}"
                ));
            }
        }
        if self.samples == 0 || self.samples > 1 << 24 {
            let got = self.samples;
            return spec(format!(
                "settings['samples'] must lie in 1..16777216, got {got}"
            ));
        }
        for (key, got) in [
            ("max_bounces", self.max_bounces),
            ("diffuse_bounces", self.diffuse_bounces),
            ("glossy_bounces", self.glossy_bounces),
            ("transmission_bounces", self.transmission_bounces),
            ("volume_bounces", self.volume_bounces),
            ("transparent_bounces", self.transparent_bounces),
        ] {
            if got > MAX_BOUNCES {
                return spec(format!(
                    "settings['{key}'] must lie in 0..{MAX_BOUNCES}, got {got}"
                ));
            }
        }
        if self.record_rays > MAX_RECORDED {
            let got = self.record_rays;
            return spec(format!(
                "settings['record_rays'] must lie in 0..{MAX_RECORDED}, got {got}"
            ));
        }
        if let Some(step) = self.step_samples
            && !(1..=MAX_STEP_SAMPLES).contains(&step)
        {
            return spec(format!(
                "settings['step_samples'] must be from 1 to {MAX_STEP_SAMPLES}, got {step}"
            ));
        }
        Ok(())
    }

    /// Checks limits, thresholds and distances.
    fn check_quantities(&self) -> Result<()> {
        let spec = |text: String| Err(Error::Spec(text));
        // Every comparison with NaN is false, so NaN needs a test of its own.
        for (key, got) in [
            ("clamp_direct", self.clamp_direct),
            ("clamp_indirect", self.clamp_indirect),
            ("filter_glossy", self.filter_glossy),
            ("exposure", self.exposure),
        ] {
            if got.is_nan() || got < 0.0 {
                return spec(format!("settings['{key}'] must be at least 0, got {got}"));
            }
        }
        if self.ambient_distance.is_nan() || self.ambient_distance <= 0.0 {
            let got = self.ambient_distance;
            return spec(format!(
                "settings['ambient_distance'] must be above 0, got {got}"
            ));
        }
        for (key, value) in [
            ("noise_threshold", self.noise_threshold),
            ("time_limit", self.time_limit),
        ] {
            if value.is_nan() || value < 0.0 {
                return spec(format!("settings['{key}'] must be at least 0, got {value}"));
            }
        }
        if self.transparent_glass.is_nan() {
            return spec("settings['transparent_glass'] must be a number".into());
        }
        if self.mist.start.is_nan() || self.mist.depth.is_nan() {
            return spec("settings['mist'] must be numbers".into());
        }
        Ok(())
    }

    /// Checks that the border is not empty and lies within the frame.
    fn check_border(&self) -> Result<()> {
        let spec = |text: String| Err(Error::Spec(text));
        let [x0, y0, x1, y1] = self.region();
        if x0 >= x1 || y0 >= y1 || x1 > self.width || y1 > self.height {
            return spec(format!(
                "settings['border'] ({x0}, {y0}, {x1}, {y1}) is empty or outside {} x {} pixels",
                self.width, self.height
            ));
        }
        if u64::from(x1 - x0) * u64::from(y1 - y0) > MAX_PIXELS {
            return spec(format!("settings: more than {MAX_PIXELS} pixels"));
        }
        Ok(())
    }

    /// Returns the pixels to render: x0, y0, x1, y1 of the border or the full frame.
    pub fn region(&self) -> [u32; 4] {
        self.border.unwrap_or([0, 0, self.width, self.height])
    }

    /// Returns the number of samples of the next step, after the first `done`.
    pub fn step_after(&self, done: u32) -> u32 {
        // The first steps are short, so that an image appears soon; longer ones give the structure more rays at once.
        let step = self.step_samples.unwrap_or(match done {
            0 => 1,
            1..4 => 3,
            4..8 => 4,
            _ => 8,
        });
        // Adaptive sampling decides at multiples of `CHECK_SAMPLES`, so that no step crosses one.
        let check = if self.noise_threshold > 0.0 {
            CHECK_SAMPLES - done % CHECK_SAMPLES
        } else {
            step
        };
        step.min(check).min(self.samples - done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clamping_keeps_the_hue_and_leaves_direct_light_unchanged() {
        let settings = Settings {
            clamp_indirect: 2.0,
            ..Settings::default()
        };
        let bright = Vec3::from([30.0, 20.0, 10.0]);
        assert_eq!(settings.clamped(bright, false), bright);
        assert_eq!(settings.clamped(bright, true), Vec3::from([3.0, 2.0, 1.0]));
        let dim = Vec3::from([3.0, 1.0, 1.0]);
        assert_eq!(settings.clamped(dim, true), dim);
        assert_eq!(Settings::default().clamped(bright, true), bright);
    }

    #[test]
    fn direct_light_has_a_limit_of_its_own() {
        let settings = Settings {
            clamp_direct: 2.0,
            ..Settings::default()
        };
        let bright = Vec3::from([30.0, 20.0, 10.0]);
        assert_eq!(settings.clamped(bright, true), bright);
        assert_eq!(settings.clamped(bright, false), Vec3::from([3.0, 2.0, 1.0]));
        assert_eq!(Settings::default().clamped(bright, false), bright);
    }

    #[test]
    fn only_improbable_bounces_widen_lobes() {
        let settings = Settings {
            filter_glossy: 2.0,
            ..Settings::default()
        };
        assert_eq!(settings.min_width(f32::INFINITY), 0.0);
        assert_eq!(settings.min_width(2.0), 0.0);
        assert_eq!(settings.min_width(0.0), 0.5);
        assert!((settings.min_width(1.5) - 0.25).abs() < 1e-6);
        assert_eq!(Settings::default().min_width(0.0), 0.0);
    }

    #[test]
    fn steps_add_up_to_the_samples() {
        for step_samples in [None, Some(1), Some(5), Some(100)] {
            let settings = Settings {
                samples: 37,
                step_samples,
                ..Default::default()
            };
            let mut done = 0;
            while done < settings.samples {
                done += settings.step_after(done);
            }
            assert_eq!(done, 37);
        }
    }

    #[test]
    fn invalid_settings_are_named() {
        let base = Settings {
            width: 8,
            height: 8,
            ..Default::default()
        };
        let cases = [
            (
                "width",
                Settings {
                    width: 0,
                    ..base.clone()
                },
            ),
            (
                "samples",
                Settings {
                    samples: 0,
                    ..base.clone()
                },
            ),
            (
                "max_bounces",
                Settings {
                    max_bounces: 5000,
                    ..base.clone()
                },
            ),
            (
                "step_samples",
                Settings {
                    step_samples: Some(0),
                    ..base.clone()
                },
            ),
            (
                "filter_glossy",
                Settings {
                    filter_glossy: -1.0,
                    ..base.clone()
                },
            ),
            (
                "exposure",
                Settings {
                    exposure: f32::NAN,
                    ..base.clone()
                },
            ),
            (
                "border",
                Settings {
                    border: Some([0, 0, 9, 8]),
                    ..base.clone()
                },
            ),
            (
                "border",
                Settings {
                    border: Some([3, 0, 3, 8]),
                    ..base.clone()
                },
            ),
        ];
        for (name, settings) in cases {
            assert!(settings.check().unwrap_err().to_string().contains(name));
        }
    }
}
