// SPDX-License-Identifier: GPL-3.0-or-later
//! Scattering by hair: light that meets a fibre leaves it in a cone about it.
//!
//! Directions are in a frame whose x axis runs along the hair and whose z axis points to the viewer, perpendicular to
//! the hair. Lobes return BSDF × |cosine|, as all lobes do.

pub mod fiber;
pub mod strand;
