// SPDX-License-Identifier: GPL-3.0-or-later
//! Clustered normals: k-means on the sphere (Hoobergs 2019, section 3.2), and on lines through the centre.
//!
//! The thesis clusters all triangles of a node in up to 500 rounds, which takes most of its builds; here a sample is
//! clustered in few rounds, with the same prices and rules too.

use super::normals::{Normals, oriented};
use super::random::generator;
use super::{Source, add_distinct};
use crate::build::piece::Piece;
use crate::build::space::Node;
use crate::geom::vec3::{Vec3, add_scaled, dot, length, widen};
use rand::Rng;
use rand::seq::index;
use std::sync::Arc;

/// Normals that are clustered at most. The centres of a sample are those of all, near enough, and a
/// node near the root would otherwise take longer than the rest of the tree.
const SAMPLE: usize = 128;

/// Rounds at most. Few nodes need more than five.
const ROUNDS: usize = 16;

/// Rounds stop when no centre moves by more than this, squared.
const STILL: f64 = 1e-6;

/// How many times empty clusters may begin anew before fewer clusters do.
const RESTARTS: usize = 4;

/// What is clustered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Geometry {
    /// Points on the sphere, each triangle counting once, as in the thesis: normals on both sides of the
    /// half space's border are far apart.
    Sphere,
    /// Lines through the centre, which have no sides and no border; equal normals are one, triangles
    /// count by their area.
    Lines,
}

/// Centres of the clusters of the node's normals.
pub struct Clusters {
    /// All normals.
    pub normals: Arc<Normals>,
    /// What random choices depend on.
    pub seed: u64,
    /// What is clustered.
    pub geometry: Geometry,
}

/// A normal and how much it counts.
type Member = (Vec3, f64);

impl Source for Clusters {
    fn directions<P: Piece>(&self, node: &Node<'_, P>, k: usize, out: &mut Vec<[f32; 3]>) {
        let wanted = k.saturating_sub(out.len());
        if wanted == 0 {
            return;
        }
        let mut random = generator(self.seed, node.key);
        let members = self.sample(node, out, &mut random);
        if members.len() <= wanted {
            for (n, _) in members {
                add_distinct(out, oriented(n));
            }
            return;
        }
        for centre in means(&members, wanted, self.geometry, &mut random) {
            add_distinct(out, oriented(centre));
        }
    }
}

impl Clusters {
    /// Distinct normals of at most [`SAMPLE`] triangles that are not among `known`.
    fn sample<P: Piece>(
        &self,
        node: &Node<'_, P>,
        known: &[[f32; 3]],
        random: &mut impl Rng,
    ) -> Vec<Member> {
        let n = node.pieces.len();
        let mut drawn: Vec<_> = if n <= SAMPLE {
            (0..n).collect()
        } else {
            index::sample(random, n, SAMPLE).into_vec()
        };
        drawn.sort_unstable();
        let mut members: Vec<([f32; 3], f64)> = Vec::with_capacity(drawn.len());
        for i in drawn {
            let id = node.pieces[i].id();
            let Some(normal) = self.normals.get(id) else {
                continue;
            };
            if known.contains(&normal) {
                continue;
            }
            let weight = match self.geometry {
                Geometry::Sphere => 1.0,
                Geometry::Lines => f64::from(self.normals.area(id)),
            };
            match members.iter_mut().find(|(m, _)| *m == normal) {
                Some((_, sum)) => *sum += weight,
                None => members.push((normal, weight)),
            }
        }
        members.into_iter().map(|(n, w)| (widen(n), w)).collect()
    }
}

/// The centres of `k` clusters of more than `k` members.
fn means(members: &[Member], k: usize, geometry: Geometry, random: &mut impl Rng) -> Vec<Vec3> {
    let closeness = |a: Vec3, b: Vec3| match geometry {
        Geometry::Sphere => dot(a, b),
        Geometry::Lines => dot(a, b).abs(),
    };
    let start = |random: &mut _| -> Vec<Vec3> {
        index::sample(random, members.len(), k)
            .into_iter()
            .map(|i| members[i].0)
            .collect()
    };
    let mut centres = start(random);
    let mut restarts = 0;
    for _ in 0..ROUNDS {
        let mut sums = vec![[0.0; 3]; centres.len()];
        let mut filled = vec![false; centres.len()];
        for &(n, weight) in members {
            let mut nearest = (0, f64::NEG_INFINITY);
            for (i, &centre) in centres.iter().enumerate() {
                let near = closeness(n, centre);
                if near > nearest.1 {
                    nearest = (i, near);
                }
            }
            let centre = centres[nearest.0];
            // A line has no direction of its own: it takes that of its centre.
            let side = match geometry {
                Geometry::Sphere => 1.0,
                Geometry::Lines => dot(n, centre).signum(),
            };
            sums[nearest.0] = add_scaled(sums[nearest.0], side * weight, n);
            filled[nearest.0] = true;
        }
        if filled.iter().any(|f| !f) {
            restarts += 1;
            if restarts <= RESTARTS {
                centres = start(random);
                continue;
            }
            let mut keep = filled.iter();
            centres.retain(|_| *keep.next().expect("one per centre"));
            continue;
        }
        let mut moved = 0.0_f64;
        for (centre, sum) in centres.iter_mut().zip(sums) {
            let norm = length(sum);
            // Members that cancel have no mean; the old centre stays.
            if norm > 1e-9 {
                let new = sum.map(|x| x / norm);
                let step = add_scaled(new, -1.0, *centre);
                moved = moved.max(dot(step, step));
                *centre = new;
            }
        }
        if moved <= STILL {
            break;
        }
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(v: Vec3) -> Member {
        (v.map(|x| x / length(v)), 1.0)
    }

    #[test]
    fn normals_around_the_border_of_the_half_space_are_one_line() {
        // Turned into one half space, these come from both sides of the border.
        let members: Vec<_> = [1e-3, 2e-3, 3e-3]
            .into_iter()
            .flat_map(|e| [unit([e, 1.0, 0.0]), unit([e, -1.0, 0.0])])
            .chain([unit([0.0, 0.0, 1.0]), unit([0.01, 0.0, 1.0])])
            .collect();
        let centres = means(&members, 2, Geometry::Lines, &mut generator(1, 2));
        assert_eq!(centres.len(), 2);
        for axis in [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            assert!(
                centres.iter().any(|c| dot(*c, axis).abs() > 0.999),
                "{centres:?}"
            );
        }
    }

    #[test]
    fn clusters_without_members_end() {
        let members: Vec<_> = [[1.0, 0.0, 0.0]; 9]
            .into_iter()
            .chain([[0.0, 1.0, 0.0]])
            .map(unit)
            .collect();
        for geometry in [Geometry::Sphere, Geometry::Lines] {
            let centres = means(&members, 6, geometry, &mut generator(1, 2));
            assert!((1..=6).contains(&centres.len()));
        }
    }
}
