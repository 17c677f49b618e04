// SPDX-License-Identifier: GPL-3.0-or-later
//! Sorts pieces along a space-filling curve, so that neighbours in the list are close in space.

use crate::piece::Piece;
use halfspace_geom::Aabb;

/// Sorts pieces along the Z-order curve (Morton 1966) through the scene's box `bounds`, by the centres of their boxes,
/// with ten bits per axis.
pub fn sort<P: Piece>(pieces: &mut [P], bounds: &Aabb) {
    // Compute the Morton code of a piece.
    let code = |piece: &P| {
        let own = piece.bounds();
        (0..3).fold(0_u32, |code, k| {
            let extent = bounds.extent(k).max(f64::MIN_POSITIVE);
            let centre = 0.5 * (f64::from(own.min[k]) + f64::from(own.max[k]));
            let at = (centre - f64::from(bounds.min[k])) / extent;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "ten bits"
            )]
            let cell = (at * 1024.0).clamp(0.0, 1023.0) as u32;
            // Interleave ten bits of each coordinate.
            code | (0..10).fold(0, |bits, i| bits | (cell >> i & 1) << (3 * i + k as u32))
        })
    };
    pieces.sort_by_cached_key(code);
}
