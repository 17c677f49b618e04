// SPDX-License-Identifier: GPL-3.0-or-later
//! Generated scenes and rays that are hard to get right: for the contract tests, the benchmarks,
//! the stability table and whoever wants to see a structure fail. One file per kind of difficulty.
//!
//! Each case exists small, for every test run, and large. A case is a function of its name, the
//! size and a seed.

mod boxes;
mod degenerate;
mod directions;
mod fuzz;
mod grazing;
mod meshes;
mod octants;
#[cfg(test)]
mod odd;
mod planes;
mod random;
mod rays;
mod scales;
mod shapes;
mod stiff;

use crate::scene::Triangles;
use crate::traverse::Ray;
use std::sync::Arc;

#[cfg(test)]
pub use odd::strew;
pub use random::Random;
#[cfg(test)]
pub use rays::everywhere;
pub use rays::{aimed, lattice_rays, ray};
#[cfg(test)]
pub use shapes::cloud;
pub use shapes::{box_triangles, grid, placed, soup};

/// How large the scenes are and how many rays they get.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Hundreds of triangles and rays.
    Small,
    /// Tens of thousands.
    Large,
}

impl Size {
    /// One of two numbers.
    fn pick(self, small: usize, large: usize) -> usize {
        match self {
            Self::Small => small,
            Self::Large => large,
        }
    }

    /// How many rays of one kind.
    fn rays(self) -> usize {
        self.pick(400, 16_000)
    }
}

/// A named scene and its rays.
pub struct Case {
    /// Stable name.
    pub name: &'static str,
    /// What is hard about it.
    pub summary: &'static str,
    /// Which kinds of extreme input it stands for, X01 to X60, each a number for what its summary says: reports count
    /// by them which kinds were tried.
    pub extremes: &'static [&'static str],
    /// Its triangles.
    pub scene: Arc<Triangles>,
    /// Rays that look for trouble.
    pub rays: Vec<Ray>,
}

/// How a case is made: corners, three a triangle, and rays of its own.
type Draft = (Vec<[f32; 3]>, Vec<Ray>);

/// A case that has not been made yet.
struct Recipe {
    name: &'static str,
    summary: &'static str,
    extremes: &'static [&'static str],
    make: fn(Size, &mut Random) -> Draft,
}

/// All cases. The rays of each are its own, and as many again aimed at its corners and edges.
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
    kinds
        .into_iter()
        .flatten()
        .map(|recipe| recipe.make(size, seed))
        .collect()
}

impl Recipe {
    fn make(&self, size: Size, seed: u64) -> Case {
        let name = self.name.bytes().fold(seed, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        });
        let random = &mut Random(name);
        let (corners, mut rays) = (self.make)(size, random);
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
