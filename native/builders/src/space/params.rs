// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of the build loop other than directions: costs, ties, and stopping rules.

use crate::sweep::Ties;
use halfspace_nodes::cost::Costs;

/// Rule by which a node becomes a leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// If no split is cheaper than the leaf.
    Cheapest,
    /// With argument `n`, as in pbrt: the split that would be the `n`-th on its path to cost more than its leaf is
    /// not made, nor one that costs four times as much with fewer than 16 triangles (Pharr, Jakob and Humphreys,
    /// 3rd ed., section 4.4.2).
    Tolerant(u32),
    /// If an even split of the node's triangles would not pay, see [`even_split_pays`]. With argument beta, the share
    /// of visits that go on to one child only; `None` computes it for each plane from the surface areas of its parts.
    /// A plane with all triangles on both sides is never taken.
    Even(Option<f32>),
}

/// Returns whether rays save time where a leaf of `n` triangles is split evenly, with half of them on each side
/// (Hoobergs 2019, equations 3.2 to 3.6). `beta` is the share of visits that go on to one child only, `step` the cost
/// of the new node, `triangle` that of a test.
///
/// With `D` visits of the leaf and `D1` and `D2` of its children, equation 3.6 reads
/// `D1 + D2 <= 2 D (1 - step / (n triangle))`. A visit reaches one child or both, so `D1 + D2 = (2 - beta) D`.
pub fn even_split_pays(n: f32, beta: f32, step: f32, triangle: f32) -> bool {
    step <= 0.5 * beta * n * triangle
}

/// Returns the share of visits to a cell that go on to one child only, for rays that are uniform lines. `shares` are
/// the surface areas of both parts divided by that of the cell; their sum exceeds 1 by twice the section, divided
/// likewise.
pub fn one_child_only(shares: [f32; 2]) -> f32 {
    (2.0 - (shares[0] + shares[1])).clamp(0.0, 1.0)
}

/// Cost of a step through a node with an oblique plane (Ize, Wald and Parker 2008, section 4.2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObliqueStep {
    /// The same cost for every node.
    Fixed(f32),
    /// `alpha` triangle tests per triangle of the node minus one, plus an axis-aligned step. If nothing is then
    /// cheaper than the leaf, `fixed` is tried.
    Linear {
        /// Share of the cost of a triangle test.
        alpha: f32,
        /// Cost of a step in the second attempt.
        fixed: f32,
        /// Whether the second attempt follows Hoobergs's program: where it succeeds, the plane of the first
        /// attempt is used.
        as_code: bool,
    },
}

/// Parameters of the build loop other than directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Costs of the operations of a traversal.
    pub costs: Costs,
    /// Cost of an oblique step.
    pub oblique: ObliqueStep,
    /// Assignment of triangles that touch a plane.
    pub ties: Ties,
    /// Thickness of the slabs that are tried around triangles parallel to the planes, per unit of the scene's
    /// largest coordinate; 0 for none.
    pub slab: f32,
    /// Nodes of at most this number of triangles are leaves.
    pub leaf_size: usize,
    /// Nodes of more triangles are split at any cost, beyond `max_depth` if necessary, as long as a plane splits
    /// them.
    pub leaf_most: usize,
    /// Nodes of at most 16 triangles become leaves where the squared number of triangles, multiplied by the number
    /// of triangles in the scene and by the cell's share of the root's surface area, is at most this: a cell that
    /// few rays visit is not worth a node. 0 for none.
    pub area_stop: f32,
    /// Largest depth of a leaf; at most [`MAX_DEPTH`](halfspace_nodes::plane_tree::MAX_DEPTH).
    pub max_depth: usize,
    /// The stopping rule.
    pub stop: Stop,
    /// Whether pieces are sorted along a curve, which speeds up the counts of single planes.
    pub sorted: bool,
    /// Whether the search ends once a plane separates the node's triangles without cutting any.
    pub early: bool,
    /// Nodes whose first directions have a plane cheaper than this share of their leaf try no further directions.
    pub enough: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piece::Whole;
    use crate::space::{Node, PlanePolicy, build};
    use halfspace_base::Monitor;
    use halfspace_geom::Aabb;
    use halfspace_geom::cell::{ConvexCell, Direction};
    use halfspace_nodes::preorder::{Item, Preorder};
    use halfspace_oracle::cases::soup;
    use halfspace_ray::frame::Frame;
    use proptest::prelude::*;
    use std::collections::HashSet;

    proptest! {
        /// Equations 3.2 and 3.6 in whole numbers, multiplied by their denominators.
        #[test]
        fn a_split_pays_where_the_equations_hold(
            (visits, one_child) in (1_u16..100).prop_flat_map(|visits| (Just(visits), 0..=visits)),
            n in 1_u16..500,
            step in 0_u16..2000,
            triangle in 1_u16..100,
        ) {
            let of_children = 2 * i64::from(visits) - i64::from(one_child);
            let [d, n, step, triangle] = [visits, n, step, triangle].map(i64::from);
            let saved = 2 * triangle * n * d - 2 * step * d - n * of_children * triangle;
            prop_assert_eq!(saved, 2 * d * (n * triangle - step) - of_children * n * triangle);
            let beta = f32::from(one_child) / f32::from(visits);
            let [n, step, triangle] = [n, step, triangle].map(|x| x as f32);
            // Rounding decides where both sides are equal.
            if saved != 0 {
                prop_assert_eq!(even_split_pays(n, beta, step, triangle), saved > 0);
            }
        }
    }

    /// Two axes and a diagonal.
    struct Three;

    impl PlanePolicy for Three {
        type Cell = ConvexCell;
        type Piece = Whole;

        fn root(&self, bounds: Aabb) -> ConvexCell {
            ConvexCell::from_box(bounds, bounds.magnitude())
        }

        fn directions(&self, _: &Node<'_, Whole>, out: &mut Vec<Direction>) {
            let diagonal = Direction::Oblique([0.6, 0.8, 0.0]);
            out.extend([Direction::Axis(2), diagonal, Direction::Axis(0)]);
        }
    }

    /// Checks the subtree that begins with the first of `items`; returns its share and its triangles.
    fn check(
        params: &Params,
        items: &mut std::slice::Iter<'_, Item>,
        ids: &mut std::slice::Iter<'_, u32>,
        inner: &mut [usize; 2],
    ) -> (f32, HashSet<u32>) {
        let Stop::Even(beta) = params.stop else {
            panic!("another rule")
        };
        let triangle = params.costs.triangle;
        match *items.next().expect("a node") {
            Item::Inner { plane, share } => {
                let (below, mut held) = check(params, items, ids, inner);
                let (above, others) = check(params, items, ids, inner);
                held.extend(others);
                let oblique = matches!(plane.direction, Direction::Oblique(_));
                let step = if oblique { 300.0 } else { params.costs.step };
                // The children have the surface of the cell and twice the section.
                let beta = beta.unwrap_or(2.0 - (below + above) / share);
                let most = 0.5 * beta * held.len() as f32 * triangle;
                assert!(step <= most * 1.001, "{plane:?}: {step} above {most}");
                inner[usize::from(oblique)] += 1;
                (share, held)
            }
            Item::Leaf { count, share } => {
                let held: HashSet<_> = ids.by_ref().take(count as usize).copied().collect();
                if let Some(beta) = beta {
                    let least = 0.5 * beta * held.len() as f32 * triangle;
                    assert!(least < 300.0, "a leaf of {count}");
                }
                (share, held)
            }
            Item::Later => panic!("nothing is built later"),
        }
    }

    #[test]
    fn trees_are_split_where_an_even_split_pays_and_nowhere_else() {
        // Small triangles on a lattice, which planes can separate.
        let corners = (0..1000).flat_map(|i| {
            let at = [i % 10, i / 10 % 10, i / 100].map(|x| x as f32);
            [[0.0; 3], [0.1, 0.02, 0.1], [0.05, 0.1, 0.03]]
                .map(|p| [at[0] + p[0], at[1] + p[1], at[2] + p[2]])
        });
        let scene = soup(corners.collect());
        let frame = Frame::new(scene.bounds());
        let tree = |beta: Option<f32>| -> Preorder {
            let params = Params {
                costs: Costs {
                    step: 200.0,
                    ..Costs::THESIS
                },
                oblique: ObliqueStep::Linear {
                    alpha: 0.001,
                    fixed: 300.0,
                    as_code: false,
                },
                ties: Ties::Clean,
                slab: 0.0,
                leaf_size: 1,
                leaf_most: usize::MAX,
                area_stop: 0.0,
                max_depth: 60,
                stop: Stop::Even(beta),
                sorted: false,
                early: false,
                enough: 0.0,
            };
            let built = build(&scene, &frame, &Three, &params, &Monitor::new()).expect("built");
            let mut inner = [0; 2];
            check(
                &params,
                &mut built.items.iter(),
                &mut built.ids.iter(),
                &mut inner,
            );
            assert!(
                inner.iter().all(|&count| count > 3),
                "{inner:?} for {beta:?}"
            );
            built
        };
        // More visits of one child alone give smaller leaves.
        let sizes = [Some(0.2), Some(0.5), Some(1.0)].map(|beta| tree(beta).items.len());
        assert!(sizes.is_sorted() && sizes[0] < sizes[2], "{sizes:?}");
        tree(None);
    }

    #[test]
    fn visits_of_one_child_follow_from_the_section() {
        // A cube halved, one cut in half along its diagonal, and a flat cell cut along itself.
        for (shares, beta) in [
            ([2.0 / 3.0; 2], 2.0 / 3.0),
            ([0.5 + 2.0_f32.sqrt() / 6.0; 2], 1.0 - 2.0_f32.sqrt() / 3.0),
            ([1.0, 1.0], 0.0),
            ([0.0, 1.0], 1.0),
        ] {
            assert!((one_child_only(shares) - beta).abs() < 1e-6, "{shares:?}");
        }
    }
}
