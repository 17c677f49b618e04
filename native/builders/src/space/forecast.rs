// SPDX-License-Identifier: GPL-3.0-or-later
//! Predicts the memory of a tree once rays have caused all of it to be built, so that a tree too large is refused
//! at once: rays cannot fail while they are traced.
//!
//! One in [`TRIAL`] of the unbuilt subtrees, and at least [`LEAST`], are built on trial and discarded. They are
//! evenly spaced in the order of the tree, and therefore cover the scene. Their bytes per reference are
//! extrapolated to all others. If there is room for [`AMPLE`] bytes per reference, no trial is made.

use halfspace_base::error::{Error, Result};
use halfspace_base::memory::megabytes;
use halfspace_base::{Monitor, footprint};
use halfspace_nodes::lazy_tree::Unbuilt;
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// One in this number of subtrees is built on trial, which costs about the same share of the whole build.
const TRIAL: usize = 32;

/// Smallest number of trials, if there are that many subtrees.
const LEAST: usize = 4;

/// Bytes per reference that suffice for any tree. Measured: kd-trees of scenes take 140 to 220 per triangle, those
/// of thin triangles that all overlap 500.
const AMPLE: u64 = 4096;

/// Checks that these subtrees will fit into the memory that the monitor has left.
///
/// # Errors
/// [`Error::Memory`] when they do not fit; [`Error::Cancelled`].
pub fn check_room(parts: &[Unbuilt], scene: &Triangles, monitor: &Monitor) -> Result<()> {
    let of = |parts: &[&Unbuilt]| -> (usize, usize) {
        parts.iter().fold((0, 0), |(bytes, references), part| {
            (bytes + part.bytes(), references + part.references())
        })
    };
    // Skip the trials if there is ample memory.
    let (seeds, references) = of(&parts.iter().collect::<Vec<_>>());
    let room = monitor.room();
    if references as u64 <= room / AMPLE {
        return Ok(());
    }
    // Build evenly spaced subtrees on trial, and extrapolate their bytes.
    let stride = (parts.len() / LEAST).clamp(1, TRIAL);
    let tried: Vec<_> = parts.iter().skip(stride / 2).step_by(stride).collect();
    let took = tried
        .par_iter()
        .map(|part| monitor.check().map(|()| part.trial(scene)))
        .sum::<Result<usize>>()?;
    let each = took as f64 / of(&tried).1.max(1) as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an estimate of bytes"
    )]
    let whole = (each * references as f64) as u64;
    // Each subtree replaces its seed, and the bytes counted for the triangles are released with the build.
    let freed = (seeds + scene.live().len() * footprint::TRIANGLE) as u64;
    if whole <= room.saturating_add(freed) {
        return Ok(());
    }
    Err(Error::Memory(format!(
        "memory_limit: once rays have had all of the tree built, that will take about {}, of {} that are left; \
         a smaller depth limit, larger leaves or another structure need less",
        megabytes(whole),
        megabytes(room.saturating_add(freed)),
    )))
}
