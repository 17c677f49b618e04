// SPDX-License-Identifier: GPL-3.0-or-later
//! Nodes of eight boxes whose children lie in slots named by the corners of the node, so that for each octant of ray
//! directions one permutation visits the nearest corner first (Ylitie, Karras and Laine 2017, Efficient incoherent ray
//! traversal on GPUs through compressed wide BVHs, section 3.2).

use crate::box_tree::{BoxTree, Wide};
use halfspace_geom::vec3::map;
use rayon::prelude::*;

/// Children of a node.
const CHILDREN: usize = 8;

/// Returns the child at stack position `child`, or the stack position of a child: the map is its own inverse. Position
/// 7 is visited first.
#[inline(always)]
pub const fn rank(octant: usize, child: usize) -> usize {
    (CHILDREN - 1) ^ child ^ octant
}

impl BoxTree<8> {
    /// Moves each child to the slot of the node corner it is nearest to. Bit `k` of a slot is set for the upper
    /// corner along axis `k`.
    pub fn by_corners(mut self) -> Self {
        (self.nodes.par_iter_mut()).for_each(|node| *node = by_corners(node));
        self
    }
}

/// Assigns the children of a node to slots greedily: the child that lies farthest towards a free corner takes
/// it, until all children have one.
fn by_corners(node: &Wide<8>) -> Wide<8> {
    // Find the centre of each child and the mean of the centres.
    let (mut open, mut middle) = (0_u32, [0.0; 3]);
    let mut centre = [[0.0; 3]; CHILDREN];
    for (lane, centre) in centre.iter_mut().enumerate() {
        if node.count[lane] == 0 {
            continue;
        }
        open |= 1 << lane;
        for k in 0..3 {
            centre[k] = 0.5 * node.bounds[k][lane] + 0.5 * node.bounds[3 + k][lane];
            middle[k] += centre[k];
        }
    }
    // Measure how far each child lies from the mean towards each corner.
    let count = open.count_ones() as f32;
    let mut far = [[0.0; CHILDREN]; CHILDREN];
    for lane in 0..CHILDREN {
        let from = map([0, 1, 2], |k| centre[lane][k] - middle[k] / count);
        for (corner, far) in far[lane].iter_mut().enumerate() {
            let towards = |k: usize| {
                if corner >> k & 1 == 1 {
                    from[k]
                } else {
                    -from[k]
                }
            };
            *far = towards(0) + towards(1) + towards(2);
        }
    }
    let (mut out, mut free) = (BoxTree::<8>::BLANK, (1_u32 << CHILDREN) - 1);
    // Find the free corner that a child lies farthest towards.
    let farthest = |lane: usize, free: u32| {
        let corners = (0..CHILDREN).filter(|corner| free >> corner & 1 == 1);
        let farther = |a: usize, b: usize| if far[lane][b] > far[lane][a] { b } else { a };
        corners
            .reduce(farther)
            .expect("no more children than corners")
    };
    let mut best = std::array::from_fn::<_, CHILDREN, _>(|lane| farthest(lane, free));
    // Place the child that lies farthest towards its best corner; if that corner was taken meanwhile, choose
    // its next best one first.
    while open != 0 {
        let lanes = (0..CHILDREN).filter(|lane| open >> lane & 1 == 1);
        let farther = |a: usize, b: usize| {
            if far[b][best[b]] > far[a][best[a]] {
                b
            } else {
                a
            }
        };
        let lane = lanes.reduce(farther).expect("some are open");
        let corner = best[lane];
        if free >> corner & 1 == 0 {
            best[lane] = farthest(lane, free);
            continue;
        }
        // Move the child to the slot of its corner.
        (open, free) = (open & !(1 << lane), free & !(1 << corner));
        for (to, from) in out.bounds.iter_mut().zip(&node.bounds) {
            to[corner] = from[lane];
        }
        out.link[corner] = node.link[lane];
        out.count[corner] = node.count[lane];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::box_tree::INNER;

    /// Makes a node whose children are the corners of a cube; `corner(lane)` returns the corner of a child.
    fn node(corner: impl Fn(usize) -> usize) -> Wide<8> {
        let mut node = BoxTree::<8>::BLANK;
        for lane in 0..CHILDREN {
            for k in 0..3 {
                let low = if corner(lane) >> k & 1 == 1 { 2.0 } else { 0.0 };
                (node.bounds[k][lane], node.bounds[3 + k][lane]) = (low, low + 1.0);
            }
            (node.link[lane], node.count[lane]) = (corner(lane) as u32, 1);
        }
        node
    }

    /// A wrong slot would change no answer, only the time that rays take.
    #[test]
    fn children_lie_at_the_corners_that_they_are_nearest_to() {
        for turn in 0..CHILDREN {
            let found = by_corners(&node(|lane| (3 * lane + turn) % CHILDREN));
            assert_eq!(found.link, [0, 1, 2, 3, 4, 5, 6, 7]);
            assert_eq!(found, node(|lane| lane));
        }
    }

    #[test]
    fn no_child_is_lost_if_several_are_nearest_to_one_corner() {
        let mut crowded = BoxTree::<8>::BLANK;
        for lane in 0..5 {
            for k in 0..3 {
                (crowded.bounds[k][lane], crowded.bounds[3 + k][lane]) = (1.0, 2.0);
            }
            (crowded.link[lane], crowded.count[lane]) = (10 + lane as u32, INNER);
        }
        let mut links: Vec<_> = (by_corners(&crowded).link.into_iter())
            .filter(|&link| link != 0)
            .collect();
        links.sort_unstable();
        assert_eq!(links, [10, 11, 12, 13, 14]);
    }
}
