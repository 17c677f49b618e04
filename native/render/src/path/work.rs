// SPDX-License-Identifier: GPL-3.0-or-later
//! Counts of the work of a render.

/// Counts of rays, traversal work and shading. Zeros also prove which features were left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Camera rays.
    pub rays_primary: u64,
    /// Shadow rays; those continued behind a transparent surface count again.
    pub rays_shadow: u64,
    /// Rays after a bounce or through a transparent surface.
    pub rays_secondary: u64,
    /// Rays that programs of surfaces traced: ambient occlusion, bevels and the node Raycast.
    pub rays_programs: u64,
    /// Inner nodes visited by camera rays, when counted.
    pub steps: u64,
    /// Triangles tested by camera rays, when counted.
    pub tests: u64,
    /// Surface points with a glass lobe.
    pub shaded_glass: u64,
    /// Surface points of paths whose material's program ran.
    pub shaded_textures: u64,
    /// Surface points with a lobe that reflects off facets.
    pub shaded_glossy: u64,
    /// Surface points of paths whose normals were interpolated.
    pub normals_fetched: u64,
    /// Rays that were tested against the lights.
    pub lights_tested: u64,
    /// Beams of secondary rays that were traced in groups.
    pub beams: u64,
    /// Secondary rays in these beams.
    pub rays_beams: u64,
    /// Largest angle between a ray from a virtual eye, in a group or not, and the direction that its material scatters
    /// to, radians.
    pub beam_deviation: f32,
}

impl Work {
    /// Adds the counts of another worker.
    pub fn add(&mut self, other: &Self) {
        self.rays_primary += other.rays_primary;
        self.rays_shadow += other.rays_shadow;
        self.rays_secondary += other.rays_secondary;
        self.rays_programs += other.rays_programs;
        self.steps += other.steps;
        self.tests += other.tests;
        self.shaded_glass += other.shaded_glass;
        self.shaded_textures += other.shaded_textures;
        self.shaded_glossy += other.shaded_glossy;
        self.normals_fetched += other.normals_fetched;
        self.lights_tested += other.lights_tested;
        self.beams += other.beams;
        self.rays_beams += other.rays_beams;
        self.beam_deviation = self.beam_deviation.max(other.beam_deviation);
    }

    /// Returns the number of all rays.
    pub fn rays(&self) -> u64 {
        self.rays_primary + self.rays_shadow + self.rays_secondary + self.rays_programs
    }
}
