// SPDX-License-Identifier: GPL-3.0-or-later
//! What a tree will take once rays have had all of it built, so that one without room is refused at once: the rays
//! themselves cannot be, half way.
//!
//! One in [`TRIAL`] of the subtrees that wait, and at least [`LEAST`], are built on trial and thrown away; they wait
//! in the order of the tree, so those lie all over the scene. What they take for each of their references is expected
//! of all others. Where there is room for [`AMPLE`] bytes for each reference nothing is tried.

use crate::build::lazy_tree::Unbuilt;
use crate::build::{Monitor, footprint};
use crate::error::{Error, Result};
use crate::memory::megabytes;
use crate::scene::Triangles;
use rayon::prelude::*;

/// One in so many subtrees is built on trial, about the same share of the whole build.
const TRIAL: usize = 32;

/// So many are tried at least, if there are as many.
const LEAST: usize = 4;

/// Bytes for each reference. Kd-trees of scenes take 140 to 220 for each triangle, and those of thin triangles that
/// lie all over each other 500.
const AMPLE: u64 = 4096;

/// Passes when these subtrees will have room, beside what the monitor has counted until now.
///
/// # Errors
/// [`Error::Memory`] when they will not; [`Error::Cancelled`].
pub(super) fn check_room(parts: &[Unbuilt], scene: &Triangles, monitor: &Monitor) -> Result<()> {
    let of = |parts: &[&Unbuilt]| -> (usize, usize) {
        parts.iter().fold((0, 0), |(bytes, references), part| {
            (bytes + part.bytes(), references + part.references())
        })
    };
    let (seeds, references) = of(&parts.iter().collect::<Vec<_>>());
    let room = monitor.room();
    if references as u64 <= room / AMPLE {
        return Ok(());
    }
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
    // Each seed goes where its subtree comes, and what was counted for the triangles goes with the build.
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
