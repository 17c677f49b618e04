// SPDX-License-Identifier: GPL-3.0-or-later
//! Beams of secondary rays (Heckbert and Hanrahan 1984, Beam tracing polygonal objects): the rays that a flat polygon
//! mirrors or refracts come from one virtual eye, as camera rays come from theirs, so that structures trace them in
//! tiles or beams.
//!
//! A mirror's virtual eye is exact up to rounding. That of a refracting plane is an approximation, the one of the paper:
//! the tangents of the angles have the ratio of the sines. [`Work::beam_deviation`] holds the largest angle between a
//! beam's ray and Snell's. Rays of a parallel beam (an orthographic camera) stay parallel, both ways exactly.
//!
//! [`Work::beam_deviation`]: crate::path::work::Work::beam_deviation

pub mod groups;
pub mod polygons;
pub mod source;
