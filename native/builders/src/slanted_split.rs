// SPDX-License-Identifier: GPL-3.0-or-later
//! Finds partitions of triangles between two parallel planes, and planes that cut off empty space. Costs use the
//! surface areas of the parts of a convex region.

use crate::slanted::Policy;
use halfspace_geom::cell::{Cell, ConvexCell};
use halfspace_geom::profile::Profile;
use halfspace_nodes::dop_tree::{NORMALS, height};
use halfspace_nodes::slanted_tree::direction;

/// Number of bins of centres per direction.
const BINS: usize = 16;

/// A triangle during the build.
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    /// Vertices in the structure's frame.
    pub corners: [[f32; 3]; 3],
    /// Triangle.
    pub id: u32,
}

impl Piece {
    /// Returns the lowest and highest height along a direction, rounded; always the same for the same piece.
    #[inline(always)]
    pub fn reach(&self, k: usize) -> (f32, f32) {
        let [a, b, c] = self.corners.map(|p| direction(k).height(p));
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// Returns the middle of the heights along a direction.
    #[inline(always)]
    pub fn centre(&self, k: usize) -> f32 {
        let (low, high) = self.reach(k);
        0.5 * low + 0.5 * high
    }

    /// Returns heights between which the piece certainly lies.
    pub fn bounds(&self, k: usize) -> (f32, f32) {
        let heights = self.corners.map(|p| height(NORMALS[k], p));
        heights
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |all, h| {
                (all.0.min(h.0), all.1.max(h.1))
            })
    }
}

/// Buffers of one thread.
#[derive(Default)]
pub struct Room {
    /// Profile of the cell along a direction.
    pub profile: Profile,
    /// Lowest and highest heights of the pieces along a direction.
    pub reaches: Vec<(f32, f32)>,
}

/// The pieces whose centres fall between two heights.
#[derive(Clone, Copy)]
struct Bin {
    low: f32,
    high: f32,
    /// Largest centre: a partition at it reproduces the bins without computing them again.
    last: f32,
    count: usize,
}

impl Bin {
    /// Bin without pieces.
    const EMPTY: Self = Self {
        low: f32::INFINITY,
        high: f32::NEG_INFINITY,
        last: f32::NEG_INFINITY,
        count: 0,
    };

    /// Returns the bin of the pieces of both.
    fn union(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            last: self.last.max(other.last),
            count: self.count + other.count,
        }
    }
}

/// A partition and its cost.
#[derive(Clone, Copy)]
pub struct Best {
    /// Expected cost.
    pub cost: f32,
    /// Index of the direction.
    pub direction: usize,
    /// Height of the split along the direction.
    pub at: f32,
}

impl Policy {
    /// Returns the direction along which two planes around the pieces leave the least of the cell's surface area,
    /// if that is below the share `empty`.
    pub fn cut(&self, pieces: &[Piece], cell: &ConvexCell, room: &mut Room) -> Option<usize> {
        if self.empty == 0.0 || pieces.is_empty() {
            return None;
        }
        let profile = &mut room.profile;
        let mut least = self.empty;
        let mut best = None;
        for k in 0..self.directions {
            if !cell.extent(direction(k), profile) {
                return None;
            }
            // Compute the ends of the pieces along the direction.
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for piece in pieces {
                let reach = piece.reach(k);
                (low, high) = (low.min(reach.0), high.max(reach.1));
            }
            (low, high) = (low.max(profile.low), high.min(profile.high));
            // Lower bound: the share that is left is at least the square of the height's share, as in
            // `Profile::least_shares`.
            let span = profile.high - profile.low;
            let bound = (high - low) / span;
            if span <= 0.0 || bound * bound >= least || bound > 0.95 {
                continue;
            }
            cell.divide(direction(k), profile);
            // The part below the upper plane and the part above the lower one have the part between in common.
            let share = profile.shares(high).0 + profile.shares(low).1 - 1.0;
            if share < least {
                (least, best) = (share, Some(k));
            }
        }
        best
    }

    /// Returns the cheapest partition; `None` for fewer than two pieces or a cell without surface area.
    pub fn best(&self, pieces: &[Piece], cell: &ConvexCell, room: &mut Room) -> Option<Best> {
        let costs = &self.costs;
        let mut best: Option<Best> = None;
        if pieces.len() < 2 {
            return None;
        }
        for k in 0..self.directions {
            let Some(bins) = bins(pieces, k, &mut room.reaches) else {
                continue;
            };
            let profile = &mut room.profile;
            if !cell.extent(direction(k), profile) {
                return None;
            }
            // Accumulate the bins from above, then sweep from below.
            let step = if k < 3 { costs.step } else { self.oblique_step };
            let mut above = [Bin::EMPTY; BINS];
            above[BINS - 1] = bins[BINS - 1];
            for i in (0..BINS - 1).rev() {
                above[i] = bins[i].union(&above[i + 1]);
            }
            // Divide the surface by an axis at once; for other directions compare lower bounds of the costs first,
            // which need no division.
            let mut divided = k < 3;
            if divided {
                cell.divide(direction(k), profile);
            }
            // Evaluate each boundary between bins.
            let mut below = Bin::EMPTY;
            for i in 1..BINS {
                let filled = bins[i - 1].count > 0;
                below = below.union(&bins[i - 1]);
                if !filled || above[i].count == 0 {
                    continue;
                }
                // Planes lie at the ends of the children, clipped to the region.
                let (end, begin) = (
                    below.high.clamp(profile.low, profile.high),
                    above[i].low.clamp(profile.low, profile.high),
                );
                let leaves = [
                    costs.leaf(below.count as f32),
                    costs.leaf(above[i].count as f32),
                ];
                let cost = |shares: [f32; 2]| step + shares[0] * leaves[0] + shares[1] * leaves[1];
                let limit = best.map_or(f32::INFINITY, |best| best.cost);
                let least = [profile.least_shares(end)[0], profile.least_shares(begin)[1]];
                if cost(least) >= limit {
                    continue;
                }
                // Divide the surface only if the lower bound is promising.
                if !divided {
                    cell.divide(direction(k), profile);
                    divided = true;
                }
                let cost = cost([profile.shares(end).0, profile.shares(begin).1]);
                if cost < limit {
                    best = Some(Best {
                        cost,
                        direction: k,
                        at: below.last,
                    });
                }
            }
        }
        best
    }

    /// Returns a partition along the axis with the largest range of centres, for nodes where no partition has a
    /// cost; `None` if all centres coincide.
    pub fn widest(pieces: &[Piece]) -> Option<Best> {
        // Range of the centres along each axis.
        let spread = |k: usize| {
            let centres = pieces.iter().map(|piece| piece.centre(k));
            let (low, high) = centres.fold((f32::INFINITY, f32::NEG_INFINITY), |all, x| {
                (all.0.min(x), all.1.max(x))
            });
            (low, high - low)
        };
        let spreads: Vec<_> = (0..3).map(spread).collect();
        // Split the widest range in the middle.
        let k = (1..3).fold(0, |a, b| if spreads[b].1 > spreads[a].1 { b } else { a });
        (spreads[k].1 > 0.0).then_some(Best {
            cost: 0.0,
            direction: k,
            at: spreads[k].0 + 0.5 * spreads[k].1,
        })
    }
}

/// Sorts pieces into bins by their centres along a direction; `None` if these coincide.
fn bins(pieces: &[Piece], k: usize, reaches: &mut Vec<(f32, f32)>) -> Option<[Bin; BINS]> {
    reaches.clear();
    reaches.extend(pieces.iter().map(|piece| piece.reach(k)));
    // Scale the range of the centres to the bins.
    let centre = |&(low, high): &(f32, f32)| 0.5 * low + 0.5 * high;
    let (mut first, mut last) = (f32::INFINITY, f32::NEG_INFINITY);
    for reach in &*reaches {
        let at = centre(reach);
        (first, last) = (first.min(at), last.max(at));
    }
    let scale = BINS as f32 / (last - first);
    if !scale.is_finite() {
        return None;
    }
    // Add each piece to its bin.
    let mut bins = [Bin::EMPTY; BINS];
    for reach in &*reaches {
        let at = centre(reach);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, and is clamped"
        )]
        let i = ((at - first) * scale) as usize;
        let bin = &mut bins[i.min(BINS - 1)];
        *bin = bin.union(&Bin {
            low: reach.0,
            high: reach.1,
            last: at,
            count: 1,
        });
    }
    Some(bins)
}
