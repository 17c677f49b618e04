// SPDX-License-Identifier: GPL-3.0-or-later
//! Which splits are worth the references that they add.
//!
//! What lies all over each other in one plane or along one line, or meets in one point, is cut by every plane. The
//! surface area heuristic does not mind: each cut spares a ray a test or two of thousands, so the references grow with
//! the square of the triangles. Where triangles of a large node have multiplied on the way to it, its splits must gain
//! the more the more they cut.

use super::{BUDGET, Builder, Choice, Pending, PlanePolicy, Stop};

/// Nodes of more triangles are large. Smaller ones come to hundreds of copies in ordinary scenes too, around the hubs of
/// wheels, and do no harm.
const LARGE: usize = 64;

/// Copies of each triangle up to which a split need not be worth more. Large nodes of rooms, courts and scans come to 13
/// at most; those at the poles of a teapot, where its triangles meet in one point, to hundreds.
const COPIES: f32 = 16.0;

/// With so many copies more, a split must gain as large a share of its leaf's price as it adds to the references.
const PATIENCE: f32 = 32.0;

impl<P: PlanePolicy> Builder<'_, P> {
    /// Whether a split that the cost model wants, of a node of `n` triangles that cost `leaf` as a leaf, is worth the
    /// references that it adds.
    pub fn is_worth(&self, choice: &Choice, leaf: f32, node: &Pending<P::Cell>, n: usize) -> bool {
        // f32 holds these counts exactly, except in nodes so large that their budget always suffices.
        let total = choice.best.counts[0] + choice.best.counts[1];
        let budget = node.budget as f32;
        if total > budget {
            return false;
        }
        // So many references would there be for each triangle, were all of the tree like the way here.
        let copies = n as f32 * BUDGET as f32 / budget;
        // Published builders go on where nothing is gained.
        if n <= LARGE || copies <= COPIES || self.params.stop != Stop::Cheapest {
            return true;
        }
        let more = total / n as f32 - 1.0;
        more <= 0.0 || PATIENCE * (1.0 - choice.best.cost / leaf) >= (copies - COPIES) * more
    }
}

#[cfg(test)]
mod tests {
    use crate::oracle::cases::{Random, soup};
    use crate::structure::Structure;

    /// References per triangle.
    fn copies(corners: &[[f32; 3]], spec: &str) -> f64 {
        let triangles = corners.len() / 3;
        let shape = Structure::of(&soup(corners.to_vec()), spec).shape();
        shape.references as f64 / triangles as f64
    }

    #[test]
    fn slivers_along_one_line_do_not_multiply_without_end() {
        let mut random = Random(5);
        let corners: Vec<_> = (0..3 * 1500)
            .map(|_| random.unit())
            .map(|t| [t, 0.7 * t, 0.3 * t])
            .collect();
        for spec in ["rbsp", "rbsp-kd", "bsp-wn-plus-kd"] {
            let copies = copies(&corners, spec);
            assert!(copies < 140.0, "{spec}: {copies}");
        }
    }

    #[test]
    fn spokes_of_a_wheel_do_not_multiply_without_end() {
        let n = 6000;
        let rim = |i: usize| {
            let angle = std::f32::consts::TAU * (i % n) as f32 / n as f32;
            [angle.cos(), angle.sin(), 0.0]
        };
        let corners: Vec<_> = (0..n)
            .flat_map(|i| [[0.0; 3], rim(i), rim(i + 1)])
            .collect();
        for spec in ["kd", "bsp-wn-plus-kd"] {
            let copies = copies(&corners, spec);
            assert!(copies < 100.0, "{spec}: {copies}");
        }
    }

    #[test]
    fn coplanar_triangles_over_each_other_do_not_multiply_without_end() {
        let mut random = Random(7);
        let corners: Vec<_> = (0..3 * 1000)
            .map(|_| [random.unit(), random.unit(), 0.0])
            .collect();
        let copies = copies(&corners, "kd");
        assert!(copies < 100.0, "{copies}");
    }

    /// Around the centre of nested tetrahedra their triangles are copied more often than anywhere in other scenes, and
    /// still planes part them.
    #[test]
    fn what_planes_part_is_parted_however_often_it_was_copied() {
        let corner = [
            [1.0, 1.0, 1.0],
            [1.0, -1.0, -1.0],
            [-1.0, 1.0, -1.0],
            [-1.0, -1.0, 1.0],
        ];
        let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
        let n = 500;
        let corners: Vec<_> = (0..n)
            .map(|i| 0.01 + 0.99 * i as f32 / (n - 1) as f32)
            .flat_map(|size| {
                faces.map(|face| face.map(|i: usize| corner[i].map(|x: f32| size * x)))
            })
            .flatten()
            .collect();
        for spec in ["rbsp", "bsp-wn-plus", "bsp-cn-plus"] {
            let shape = Structure::of(&soup(corners.clone()), spec).shape();
            assert_eq!(shape.leaves_large, 0, "{spec}: {}", shape.leaf_max);
        }
    }
}
