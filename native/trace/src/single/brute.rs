// SPDX-License-Identifier: GPL-3.0-or-later
//! No tree: every ray against every triangle.

use crate::batch::{Batch, Write};
use crate::kernel::{Kernel, SingleRays, store};
use halfspace_base::error::{Error, Result};
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::{Hit, RayCounters};
use std::sync::Arc;

/// Tests all triangles of the scene.
#[derive(Debug)]
struct Brute {
    /// One leaf of all triangles.
    leaves: Arc<Blocks>,
    /// Number of triangles.
    count: usize,
}

/// The kernel of brute force over a leaf of `count` triangles.
pub fn brute(leaves: &Arc<Blocks>, count: usize) -> Arc<dyn SingleRays> {
    Arc::new(Brute {
        leaves: leaves.clone(),
        count,
    })
}

impl<Q: Query> Kernel<Q> for Brute {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let launch = batch.on(&self.leaves);
        launch.brute::<Q>(self.count, &mut store::<Q>(answers), None);
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let launch = batch.on(&self.leaves);
        launch.brute::<Q>(self.count, &mut store::<Q>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

impl SingleRays for Brute {
    fn cast(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let launch = batch.on(&self.leaves);
        if any {
            launch.brute::<Any>(self.count, write, counters);
        } else {
            launch.brute::<Closest>(self.count, write, counters);
        }
    }

    fn path(&self, batch: &Batch<'_>) -> (Hit, Path) {
        let (mut nearest, mut path) = (Hit::MISS, Path::default());
        let counters = std::slice::from_mut(&mut path.counters);
        self.cast(batch, false, &mut |_, hit| nearest = hit, Some(counters));
        (nearest, path)
    }

    fn record(&self, _: &Batch<'_>, _: bool, _: &mut [RayCounters], _: &mut Record) -> Result<()> {
        Err(Error::Spec("brute walks no tree".to_owned()))
    }

    fn replay(&self, _: &Batch<'_>, _: &Recording) -> (Vec<f64>, usize) {
        unreachable!("brute force records nothing")
    }
}
