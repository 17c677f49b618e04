// SPDX-License-Identifier: GPL-3.0-or-later
//! Beams as González López and Gisbert Cantó trace them (Trazado de haces de rayos en escenas estructuradas
//! espacialmente mediante árboles octales): an origin and a convex polygon of directions, which begins as the whole
//! image.
//!
//! In an empty leaf a beam is clipped against the faces through which it leaves, and each part goes on to the neighbour
//! behind its face, split where smaller neighbours share the face. In a leaf with triangles, scan conversion of the
//! polygon finds its rays; those that hit end, and the beam goes on with the others. Where few rays are left they go on
//! singly. An empty leaf costs the same for any number of rays. Shadow rays of a point light are such an image too, seen
//! from the light. Rays of one direction, those of an orthographic camera or of a sun without size, are a beam whose
//! apex is at infinity ([`form`]): a direction and a polygon of origins in a plane across it.
//!
//! Two descriptions of a beam keep this exact. The polygon is an f64 approximation, a little larger than the beam. The
//! beam itself is the set of rays on one side of each of its lines ([`line::Line`]), which f64 decides exactly for each
//! ray ([`line::Side::holds`]). Both parts of a clipped beam use the same line, so each ray is in exactly one part.

mod beam;
mod form;
mod kernel;
mod leaf;
mod line;
mod polygon;
mod raster;
mod rays;
mod recorder;
mod shadow;
mod source;
#[cfg(test)]
mod tests;
mod traversal;

pub use kernel::{octants, shadow_octants};
pub use traversal::NAMES;
