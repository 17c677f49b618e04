// SPDX-License-Identifier: GPL-3.0-or-later
//! Clusters of all normals of a node as published (Hoobergs 2019, section 3.4.2): k-means on oriented unit normals, one
//! weight per triangle, from the normals of K random triangles.

use crate::bsp::normals::oriented;
use halfspace_base::Monitor;
use halfspace_geom::vec3::{Vec3, add_scaled, dot, length, widen};
use rand::Rng;
use rand::seq::index;

/// Largest number of rounds: that of the thesis.
const ROUNDS: usize = 500;

/// Rounds end when no centre moves by more than this squared distance: that of the thesis.
const STILL: f64 = 1e-6;

/// Treatment of an empty cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Empty {
    /// Its centre becomes the normal of a random triangle, as in the thesis's text. Nodes with at most K distinct
    /// normals end with all of these, which are returned at once.
    Replaced,
    /// All centres become those of random triangles, as in the thesis's program. Nodes with fewer distinct normals than
    /// K then end when two draws in a row are equal, or after all rounds, with random normals, some of them equal.
    Restarted,
}

/// Returns the centres of `k` clusters of these unit normals, oriented into one half space; all normals if there are no
/// more than `k`. Where the monitor ends the build, it returns the centres of the last round.
pub fn means(
    normals: &[[f32; 3]],
    k: usize,
    empty: Empty,
    random: &mut impl Rng,
    monitor: &Monitor,
) -> Vec<[f32; 3]> {
    let n = normals.len();
    if n <= k {
        return normals.to_vec();
    }
    if empty == Empty::Replaced
        && let Some(few) = at_most(normals, k)
    {
        return few;
    }
    let members: Vec<Vec3> = normals.iter().map(|&n| widen(n)).collect();
    let mut draw = |k: usize| -> Vec<Vec3> {
        let drawn = index::sample(random, n, k);
        drawn.into_iter().map(|i| members[i]).collect()
    };
    let mut next = draw(k);
    for _ in 0..ROUNDS {
        if monitor.check().is_err() {
            break;
        }
        // Assign each normal to the centre at the smallest angle.
        let centres = next.clone();
        let mut sums = vec![([0.0; 3], 0_usize); k];
        for &normal in &members {
            let (sum, count) = &mut sums[nearest(normal, &centres)];
            *sum = add_scaled(*sum, 1.0, normal);
            *count += 1;
        }
        // Move the centres, and give empty clusters new ones.
        for (i, &(sum, count)) in sums.iter().enumerate() {
            let norm = length(sum);
            match empty {
                Empty::Restarted if count == 0 => {
                    next = draw(k);
                    break;
                }
                Empty::Replaced if count == 0 => next[i] = draw(1)[0],
                // Normals that cancel have no mean: the centre stays.
                _ if norm > 1e-9 => next[i] = sum.map(|x| x / norm),
                _ => {}
            }
        }
        let moved = centres.iter().zip(&next).map(|(&old, &new)| {
            let step = add_scaled(new, -1.0, old);
            dot(step, step)
        });
        if moved.fold(0.0, f64::max) <= STILL {
            break;
        }
    }
    next.into_iter().map(oriented).collect()
}

/// Returns the index of the centre at the smallest angle, the first of equal ones.
fn nearest(normal: Vec3, centres: &[Vec3]) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (i, &centre) in centres.iter().enumerate() {
        let cosine = dot(normal, centre);
        if cosine > best.1 {
            best = (i, cosine);
        }
    }
    best.0
}

/// Returns the distinct normals, or `None` if there are more than `k`.
fn at_most(normals: &[[f32; 3]], k: usize) -> Option<Vec<[f32; 3]>> {
    let mut distinct: Vec<[f32; 3]> = Vec::with_capacity(k);
    for n in normals {
        if !distinct.contains(n) {
            if distinct.len() == k {
                return None;
            }
            distinct.push(*n);
        }
    }
    Some(distinct)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsp::random::generator;

    /// Normals around three directions, `spread` apart within a cluster.
    fn clustered(count: usize, spread: f64) -> Vec<[f32; 3]> {
        let directions = [[1.0, 0.1, 0.2], [0.3, 1.0, 0.1], [0.2, 0.3, 1.0]];
        let around = |i: usize| {
            let [x, y, z] = directions[i % 3];
            let turn = spread * (i / 3) as f64;
            let v = [x + turn, y - turn, z];
            oriented(v.map(|x| x / length(v)))
        };
        (0..count).map(around).collect()
    }

    #[test]
    fn centres_of_separate_clusters_are_their_means() {
        let normals = clustered(300, 1e-4);
        for empty in [Empty::Replaced, Empty::Restarted] {
            let found = (0..20).filter(|&key| {
                let centres = means(&normals, 3, empty, &mut generator(1, key), &Monitor::new());
                assert_eq!(centres.len(), 3);
                // Each cluster has its centre, unless the rounds end at a local optimum.
                let near = |n: &[f32; 3]| centres.iter().any(|c| dot(widen(*c), widen(*n)) > 0.999);
                normals.iter().all(near)
            });
            assert!(found.count() > 3, "{empty:?}");
        }
    }

    #[test]
    fn few_normals_are_all_returned() {
        let random = &mut generator(1, 2);
        let three = clustered(3, 0.0);
        assert_eq!(
            means(&three, 3, Empty::Restarted, random, &Monitor::new()),
            three
        );
        // Of thirty triangles with three normals, the text's rule returns all three, each once.
        let thirty = clustered(30, 0.0);
        assert_eq!(
            means(&thirty, 5, Empty::Replaced, random, &Monitor::new()),
            three
        );
        assert_eq!(
            means(&thirty, 3, Empty::Replaced, random, &Monitor::new()),
            three
        );
    }

    #[test]
    fn the_program_returns_equal_normals_where_few_are_distinct() {
        let thirty = clustered(30, 0.0);
        let repeats = (0..20).filter(|&key| {
            let centres = means(
                &thirty,
                5,
                Empty::Restarted,
                &mut generator(1, key),
                &Monitor::new(),
            );
            assert_eq!(centres.len(), 5);
            let distinct = at_most(&centres, 5).expect("five at most");
            assert!(distinct.iter().all(|n| thirty.contains(n)), "not a normal");
            distinct.len() < 3
        });
        // Five random triangles lack one of the three normals in two of five cases.
        assert!(repeats.count() > 1);
    }

    #[test]
    fn a_cancelled_build_ends_the_rounds() {
        let normals = clustered(300, 1e-4);
        let (going, ended) = (Monitor::new(), Monitor::new());
        ended.cancel();
        for empty in [Empty::Replaced, Empty::Restarted] {
            let found = |monitor| means(&normals, 3, empty, &mut generator(1, 2), monitor);
            // The first centres are normals, their means are not.
            assert!(found(&ended).iter().all(|n| normals.contains(n)));
            assert!(found(&going).iter().any(|n| !normals.contains(n)));
        }
    }
}
