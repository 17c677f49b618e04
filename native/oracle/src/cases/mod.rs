// SPDX-License-Identifier: GPL-3.0-or-later
//! Generated scenes and rays that are numerically difficult, for the contract tests, the benchmarks and the
//! stability table. One file per kind of difficulty.
//!
//! Each case has a small size, for every test run, and a large one. It is determined by its name, the size and a seed.

mod boxes;
mod degenerate;
mod directions;
mod fuzz;
mod grazing;
mod meshes;
mod octants;
mod odd;
mod planes;
mod random;
mod rays;
mod scales;
mod shapes;
mod stiff;

use halfspace_ray::Ray;
use halfspace_scene::Triangles;
use std::sync::Arc;

pub use odd::strew;
pub use random::Random;
pub use rays::{aimed, everywhere, lattice_rays, ray};
pub use shapes::{box_triangles, cloud, grid, placed, soup};

/// Size of the scenes and number of their rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Hundreds of triangles and rays.
    Small,
    /// Tens of thousands of triangles and rays.
    Large,
}

impl Size {
    /// Returns one of two numbers.
    fn pick(self, small: usize, large: usize) -> usize {
        match self {
            Self::Small => small,
            Self::Large => large,
        }
    }

    /// Returns the number of rays of one kind.
    fn rays(self) -> usize {
        self.pick(400, 16_000)
    }
}

/// A named scene and its rays.
pub struct Case {
    /// Stable name of the case.
    pub name: &'static str,
    /// Description of the difficulty.
    pub summary: &'static str,
    /// Identifiers, X01 to X60, of the kinds of extreme input that the case covers. Reports use them to list the kinds
    /// that were tested.
    pub extremes: &'static [&'static str],
    /// Triangles of the scene.
    pub scene: Arc<Triangles>,
    /// Rays chosen to expose errors.
    pub rays: Vec<Ray>,
}

/// Vertices, three per triangle, and specific rays of a case.
type Draft = (Vec<[f32; 3]>, Vec<Ray>);

/// Description of a [`Case`], and the function that makes it.
struct Recipe {
    name: &'static str,
    summary: &'static str,
    extremes: &'static [&'static str],
    make: fn(Size, &mut Random) -> Draft,
}

/// Returns all cases. The rays of each are specific to it, plus rays aimed at its vertices and edges.
pub fn cases(size: Size, seed: u64) -> Vec<Case> {
    let kinds = [
        degenerate::CASES,
        planes::CASES,
        directions::CASES,
        meshes::CASES,
        scales::CASES,
        grazing::CASES,
        boxes::CASES,
        octants::CASES,
        stiff::CASES,
        fuzz::CASES,
    ];
    // Make every case with its own random numbers.
    kinds
        .into_iter()
        .flatten()
        .map(|recipe| recipe.make(size, seed))
        .collect()
}

impl Recipe {
    /// Makes the case. Its random numbers depend on its name and the seed.
    fn make(&self, size: Size, seed: u64) -> Case {
        // Hash the name, starting from the seed (FNV-1a), so that cases are independent of each other.
        let hash = self.name.bytes().fold(seed, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        });
        let random = &mut Random(hash);
        let (corners, mut rays) = (self.make)(size, random);
        // Add rays aimed at the scene, and drop rays that are not finite.
        let scene = soup(corners);
        if !scene.live().is_empty() {
            rays.extend(aimed(&scene, size.rays(), random));
        }
        rays.retain(|ray| ray.o.iter().chain(&ray.d).all(|x| x.is_finite()));
        Case {
            name: self.name,
            summary: self.summary,
            extremes: self.extremes,
            scene,
            rays,
        }
    }
}
