// SPDX-License-Identifier: GPL-3.0-or-later
//! Directions from clustered normals: k-means on the sphere (Hoobergs 2019, section 3.2), and on lines through the
//! centre.
//!
//! The thesis clusters all triangles of a node in up to 500 rounds, which takes most of its build time: `draw=thesis`
//! ([`crate::bsp::means`]). By default a sample is clustered in few rounds.

use crate::bsp::means::{self, Empty};
use crate::bsp::normals::{Normals, oriented};
use crate::bsp::random::generator;
use crate::bsp::{Source, Triangulated, Variant, add_distinct, build, draws, params, sweep_rows};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::vec3::{Vec3, add_scaled, dot, length, widen};
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::StructureSpec;
use halfspace_structure::spec::Config;
use rand::Rng;
use rand::seq::index;
use std::sync::Arc;

/// Largest number of normals that are clustered. The centres of a sample are close to those of all normals, and a
/// node near the root would otherwise take longer than the rest of the tree.
const SAMPLE: usize = 128;

/// Largest number of rounds. Measured: few nodes need more than five.
const ROUNDS: usize = 16;

/// Rounds end when no centre moves by more than this squared distance. Derived: a turn by 0.001 is below that of
/// [`add_distinct`], which takes directions up to 0.0045 apart for one.
const STILL: f64 = 1e-6;

/// Number of restarts after an empty cluster; after these, empty clusters are removed instead.
const RESTARTS: usize = 4;

/// Space in which normals are clustered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Geometry {
    /// Points on the sphere with weight one per triangle, as in the thesis: similar normals on both sides of the
    /// half space's border are far apart.
    Sphere,
    /// Lines through the centre, which have no orientation and hence no border. Equal normals are merged, and
    /// triangles are weighted by their area.
    Lines,
}

/// Directions at the centres of the clusters of a node's normals.
pub struct Clusters {
    /// Normals of all triangles.
    pub normals: Arc<Normals>,
    /// Seed of the random choices.
    pub seed: u64,
    /// Space in which normals are clustered.
    pub geometry: Geometry,
    /// Clusters all normals as published, with this rule for empty clusters.
    pub published: Option<Empty>,
}

/// A normal and its weight.
type Member = (Vec3, f64);

impl Source for Clusters {
    fn bytes(&self) -> usize {
        self.normals.bytes()
    }

    fn directions(&self, node: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>) {
        let wanted = k.saturating_sub(out.len());
        if wanted == 0 {
            return;
        }
        let mut random = generator(self.seed, node.key);
        if let Some(empty) = self.published {
            let all = (0..node.ids.count()).filter_map(|i| self.normals.get(node.ids.get(i)));
            let all: Vec<_> = all.collect();
            for centre in means::means(&all, wanted, empty, &mut random, node.monitor) {
                if !out.contains(&centre) {
                    out.push(centre);
                }
            }
            return;
        }
        // Few distinct normals need no clusters.
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
    /// Returns the distinct normals, with their weights, of at most [`SAMPLE`] of the node's triangles, without
    /// those in `known`.
    fn sample(
        &self,
        node: &Triangulated<'_>,
        known: &[[f32; 3]],
        random: &mut impl Rng,
    ) -> Vec<Member> {
        let n = node.ids.count();
        let mut drawn: Vec<_> = if n <= SAMPLE {
            (0..n).collect()
        } else {
            index::sample(random, n, SAMPLE).into_vec()
        };
        // Visit the sample in the order of the pieces.
        drawn.sort_unstable();
        // Merge equal normals and add their weights.
        let mut members: Vec<([f32; 3], f64)> = Vec::with_capacity(drawn.len());
        for i in drawn {
            let id = node.ids.get(i);
            let Some(normal) = self.normals.get(id) else {
                continue;
            };
            if known.contains(&normal) {
                continue;
            }
            // Weight as the geometry requires.
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

/// Returns the centres of `k` clusters of more than `k` members by k-means; fewer if clusters stay empty.
fn means(members: &[Member], k: usize, geometry: Geometry, random: &mut impl Rng) -> Vec<Vec3> {
    // Cosine of the angle between two members, without orientation for lines.
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
        // Assign each member to the nearest centre, and sum the members of each cluster.
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
            // A line has no orientation: it takes that of its centre.
            let side = match geometry {
                Geometry::Sphere => 1.0,
                Geometry::Lines => dot(n, centre).signum(),
            };
            sums[nearest.0] = add_scaled(sums[nearest.0], side * weight, n);
            filled[nearest.0] = true;
        }
        // Start again if a cluster is empty, or remove it after too many restarts.
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
        // Move the centres to the normalized sums.
        let mut moved = 0.0_f64;
        for (centre, sum) in centres.iter_mut().zip(sums) {
            let norm = length(sum);
            // Members that cancel have no mean; the old centre is kept.
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

sweep_rows!(
    "bsp-cn", [16, 17, 18], "clusters", named "BSP_cn", along "the centres of clusters of the normals of each node", k 6, grow,
    claims &["sweep-trees-*", "three-directions-are-kd", "long-builds"],
    params: draws::clusters_usual, draws::clusters_plus, draws::clusters_kd
);

/// The registry's row: normals as lines, without a border of the half space; equal normals merged, triangles weighted
/// by area.
pub const AXIAL: StructureSpec = StructureSpec {
    id: "bsp-cn-axial-plus-kd",
    code: 19,
    label: "BSP, axial clusters + Kd",
    summary: "Planes along the axes and the centres of clusters of normals, taken as lines and weighted by area.",
    paper: "Our own, after Hoobergs 2019",
    params: const { &params::kd(params::k(3, 6)) }.slice(),
    literature: &[("BSP_cn+^Kd, axial", "")],
    claims: &["three-directions-are-kd", "long-builds"],
    build: |scene, config, monitor| grow_axial(scene, config, monitor, Variant::PlusKd),
    ..PLUS_KD
};

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    build(scene, config, monitor, variant, |settings, normals| {
        Clusters {
            normals,
            seed: settings.seed,
            geometry: Geometry::Sphere,
            published: (config.pick("draw", [("distinct", false), ("thesis", true)])).then(|| {
                config.pick(
                    "empty_clusters",
                    [("text", Empty::Replaced), ("code", Empty::Restarted)],
                )
            }),
        }
    })
}

fn grow_axial(
    scene: &Triangles,
    config: &Config,
    monitor: &Monitor,
    variant: Variant,
) -> Result<Built> {
    build(scene, config, monitor, variant, |settings, normals| {
        Clusters {
            normals,
            seed: settings.seed,
            geometry: Geometry::Lines,
            published: None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(v: Vec3) -> Member {
        (v.map(|x| x / length(v)), 1.0)
    }

    #[test]
    fn normals_around_the_border_of_the_half_space_are_one_line() {
        // Oriented into one half space, these come from both sides of the border.
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
