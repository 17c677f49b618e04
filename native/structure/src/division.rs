// SPDX-License-Identifier: GPL-3.0-or-later
//! The division of a scene whose triangles differ too much in scale for one frame.
//!
//! Error bounds of a traversal are proportional to the largest coordinate of the tree's frame. One triangle 10^8 times
//! larger than the others, or far away from them, makes these bounds larger than all others together: every ray is
//! tested against all of them, however good the tree. Triangles that lie together in a small part of the scene
//! therefore get a tree of their own, in a frame of their own, and the rest another. A ray goes through one after the
//! other; its answer is the best of both, by distance and number, as of one tree.

use crate::plan::Plan;
use crate::row::{Built, Family, Refit};
use crate::spec::{Config, Value};
use crate::structure::Structure;
use crate::work::{self, Trees};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_ray::ray::HitKey;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_scene::Triangles;
use halfspace_trace::kernel::Kernel;
use std::sync::Arc;

/// Largest number of parts (chosen): a ray goes through each.
const MOST: usize = 4;

/// Scenes of fewer triangles are not divided (chosen): testing them all is as fast.
const FEW: usize = 64;

/// Number of triangles that the search for a cluster looks at (chosen).
const SAMPLE: usize = 1024;

/// Number of places where a cluster is searched for (chosen).
const PLACES: usize = 16;

/// Ratio of the scene's extent to that of a cluster, from which on the cluster gets its own tree. Derived: error bounds
/// are 2^-21 of the frame's extent, so from here on they exceed a five-hundredth of the cluster.
const APART: f32 = 4096.0;

/// [`APART`] of structures whose cells do not follow the triangles: equal cells, octants and halved cells, whose depth is
/// limited. Each halving of the extent costs a level of the depth.
const APART_CELLS: f32 = 64.0;

/// The trees of a scene.
#[derive(Debug)]
pub struct Parts {
    /// The tree with most triangles.
    pub main: Built,
    /// The trees of all other triangles; mostly none.
    pub apart: Vec<Built>,
    /// The triangles of `main`, if rays build it and it is not the only tree.
    pub growing: Option<Arc<Triangles>>,
    /// The part of each triangle of the scene: 0 for `main`, `i + 1` for `apart[i]`; empty if there is only one.
    pub part_of: Vec<u8>,
    /// Deviations from the configuration, with reasons.
    pub remarks: Vec<String>,
}

/// Builds the trees of a scene in the current rayon pool.
///
/// # Errors
/// Those of [`crate::row::StructureSpec::build`].
pub fn build(scene: &Triangles, config: &Config, monitor: &Monitor, trees: Trees) -> Result<Parts> {
    let lists = divided(scene, config);
    let mut remarks = Vec::new();
    if lists.len() < 2 {
        let main = work::build(scene, config, monitor, trees, &mut remarks)?;
        return Ok(Parts {
            main,
            apart: Vec::new(),
            growing: None,
            part_of: Vec::new(),
            remarks,
        });
    }
    remarks.push(remark(&lists));
    // Number the parts, and build the largest first, whose progress is that of the whole.
    let mut part_of = vec![0; scene.len()];
    for (list, part) in lists.iter().zip(0..) {
        for &id in list {
            part_of[id as usize] = part;
        }
    }
    let (mut built, mut growing) = (Vec::with_capacity(lists.len()), None);
    for part in 0..lists.len() {
        let _held = monitor.hold(scene.len() * footprint::TRIANGLE)?;
        let own = only(scene, &part_of, part)?;
        let tree = work::build(&own, config, monitor, trees, &mut remarks)?;
        // Rays build the largest tree alone.
        match (&tree.growing, part) {
            (Some(later), 1..) => built.push(later.whole(&own, &tree.frame)),
            (Some(_), 0) => {
                built.push(tree);
                growing = Some(Arc::new(own));
            }
            (None, _) => built.push(tree),
        }
    }
    let apart = built.split_off(1);
    let main = built.pop().expect("at least two parts");
    Ok(Parts {
        main,
        apart,
        growing,
        part_of,
        remarks,
    })
}

/// Returns the scene in which only the triangles of one part can be hit; all keep their numbers.
///
/// # Errors
/// None, unless the scene's own arrays are refused.
pub fn only(scene: &Triangles, part_of: &[u8], part: usize) -> Result<Triangles> {
    let own = |(&corners, &of): (&[u32; 3], &u8)| {
        if usize::from(of) == part {
            corners
        } else {
            // A triangle without area can never be hit.
            [corners[0]; 3]
        }
    };
    let indices = scene.indices().iter().zip(part_of).map(own).collect();
    Triangles::new(scene.vertices().to_vec(), indices)
}

/// Fits the trees of a scene to its triangles at other places.
///
/// # Errors
/// Those of `fit`, which fits one tree to its own triangles.
///
/// # Panics
/// If a tree cannot be fitted.
pub fn refit<'t>(
    scene: &Triangles,
    trees: impl Iterator<Item = &'t Built>,
    part_of: &[u8],
    fit: impl Fn(&dyn Refit, &Triangles) -> Result<Built>,
) -> Result<Vec<Built>> {
    let fit = |(part, built): (usize, &Built)| {
        let refit = built.refit.as_deref().expect("checked by the caller");
        if part_of.is_empty() {
            fit(refit, scene)
        } else {
            fit(refit, &only(scene, part_of, part)?)
        }
    };
    trees.enumerate().map(fit).collect()
}

/// Returns the parts of a scene, the largest first; only one for most scenes.
fn divided(scene: &Triangles, config: &Config) -> Vec<Vec<u32>> {
    // Brute force has no error bounds of nodes, nor has a traversal as published.
    let published = config.find("robust") == Some(&Value::Choice("none"));
    if config.structure().family == Family::Oracle || published || scene.live().len() < FEW {
        return Vec::new();
    }
    let row = config.structure();
    let regular = matches!(row.id, "grid" | "kd-median") || row.family == Family::Octants;
    let apart = if regular { APART_CELLS } else { APART };
    let (mut done, mut others) = (Vec::new(), Vec::new());
    let mut open = vec![scene.live().to_vec()];
    // Divide the parts, near ones before the rest, until none is a cluster with others far around it. One part takes all
    // that are so few that no tree helps.
    while let Some(ids) = open.pop() {
        let full = done.len() + open.len() + 3 > MOST;
        match cluster(scene, &ids, apart) {
            Some([near, rest]) if rest.len() < FEW => {
                others.extend(rest);
                open.push(near);
            }
            Some([near, rest]) if !full => open.extend([rest, near]),
            _ => done.push(ids),
        }
    }
    if !others.is_empty() {
        others.sort_unstable();
        done.push(others);
    }
    // The sort is stable: parts of equal size keep their order.
    done.sort_by_key(|ids| std::cmp::Reverse(ids.len()));
    done
}

/// Returns the triangles of the fullest place whose extent is at most that of all triangles divided by `apart`, and the
/// rest; `None` unless an eighth of the triangles lies there, with few others around them.
fn cluster(scene: &Triangles, ids: &[u32], apart: f32) -> Option<[Vec<u32>; 2]> {
    if ids.len() < FEW {
        return None;
    }
    let bounds = (ids.iter()).fold(Aabb::EMPTY, |all, &id| {
        all.union(&Aabb::of_triangle(scene.corners(id)))
    });
    let extent = (0..3).fold(0.0_f64, |most, k| most.max(bounds.extent(k)));
    let most = extent / f64::from(apart);
    // Return whether a triangle lies within a distance of a point, along each axis.
    let within = |id: u32, middle: [f32; 3], most: f64| {
        let corners = scene.corners(id);
        let near = |x: f32, k: usize| (f64::from(x) - f64::from(middle[k])).abs() <= most;
        (corners.iter()).all(|p| near(p[0], 0) && near(p[1], 1) && near(p[2], 2))
    };
    // Count the triangles of a sample around some of them.
    let every = |n: usize| ids.iter().step_by(ids.len().div_ceil(n)).copied();
    let count = |middle, most| every(SAMPLE).filter(|&id| within(id, middle, most)).count();
    let counted = every(PLACES).map(|id| {
        let middle = scene.corners(id)[0];
        (count(middle, most), middle)
    });
    // Keep the first of the fullest. It must not be a part of something larger, which one tree serves better.
    let (inside, middle) = counted.fold(
        (0, [0.0; 3]),
        |best, new| {
            if new.0 > best.0 { new } else { best }
        },
    );
    let full = 8 * inside >= every(SAMPLE).count();
    if !full || 4 * count(middle, 4.0 * most) > 5 * inside {
        return None;
    }
    let (near, rest): (Vec<_>, Vec<_>) = ids.iter().partition(|&&id| within(id, middle, most));
    (near.len() >= FEW && !rest.is_empty()).then_some([near, rest])
}

/// Describes a division.
fn remark(lists: &[Vec<u32>]) -> String {
    let counts: Vec<_> = lists.iter().map(|ids| ids.len().to_string()).collect();
    let (last, others) = counts.split_last().expect("at least two parts");
    format!(
        "one tree of the whole scene: its parts differ too much in scale, so {} and {last} triangles have trees of \
         their own, each in its own frame",
        others.join(", ")
    )
}

/// One of the trees of a scene.
#[derive(Debug, Clone, Copy)]
pub struct Part<'a> {
    /// 0 for the main tree, `i + 1` for `apart()[i]`.
    pub number: usize,
    /// The tree.
    pub built: &'a Built,
}

/// A query whose answers from several trees make one.
pub trait Joined: Query {
    /// The answer of a ray that hits nothing.
    const NOTHING: Self::Answer;

    /// Returns whether no tree can have a better answer.
    fn is_final(known: &Self::Answer) -> bool;

    /// Returns the part of a ray in which another tree may have a better answer.
    fn rest(ray: &Ray, known: &Self::Answer) -> Ray;

    /// Replaces an answer by that of another tree if it is better.
    fn join(known: &mut Self::Answer, found: Self::Answer);

    /// Returns the kernel of single rays.
    fn single(plan: &Plan) -> &dyn Kernel<Self>;
}

impl Joined for Closest {
    const NOTHING: Hit = Hit::MISS;

    fn is_final(_: &Hit) -> bool {
        false
    }

    fn rest(ray: &Ray, known: &Hit) -> Ray {
        // Another hit at the same distance may have a smaller number.
        let t_max = if known.is_hit() { known.t } else { ray.t_max };
        Ray { t_max, ..*ray }
    }

    fn join(known: &mut Hit, found: Hit) {
        let key = |hit: &Hit| HitKey::new(hit.t, hit.triangle);
        if key(&found).precedes(key(known)) {
            *known = found;
        }
    }

    fn single(plan: &Plan) -> &dyn Kernel<Self> {
        &*plan.single
    }
}

impl Joined for Any {
    const NOTHING: bool = false;

    fn is_final(known: &bool) -> bool {
        *known
    }

    fn rest(ray: &Ray, _: &bool) -> Ray {
        *ray
    }

    fn join(known: &mut bool, found: bool) {
        *known |= found;
    }

    fn single(plan: &Plan) -> &dyn Kernel<Self> {
        &*plan.single
    }
}

impl Structure {
    /// Answers rays by all trees, one after the other. `trace` answers them by one tree. `counters`: one per ray, or none.
    pub(crate) fn each_part<Q: Joined>(
        &self,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        mut counters: Option<&mut [RayCounters]>,
        trace: impl Fn(Part<'_>, &[Ray], &mut [Q::Answer], Option<&mut [RayCounters]>),
    ) {
        let part = |(number, built)| Part { number, built };
        let main = part((0, &self.built));
        let mut parts = (1..).zip(&self.apart).map(part).chain([main]);
        if self.apart.is_empty() {
            return trace(main, rays, answers, counters);
        }
        let first = parts.next().expect("at least one part");
        trace(first, rays, answers, counters.as_deref_mut());
        let (mut open, mut rest, mut found) = (Vec::new(), Vec::new(), Vec::new());
        for part in parts {
            // Collect the rays that may have a better answer, in their order.
            open.clear();
            open.extend((0..rays.len()).filter(|&i| !Q::is_final(&answers[i])));
            rest.clear();
            rest.extend(open.iter().map(|&i| Q::rest(&rays[i], &answers[i])));
            found.clear();
            found.resize(open.len(), Q::NOTHING);
            let mut counts = counters
                .as_ref()
                .map(|_| vec![RayCounters::default(); open.len()]);
            trace(part, &rest, &mut found, counts.as_deref_mut());
            // Join answers and counters.
            for (&i, &found) in open.iter().zip(&found) {
                Q::join(&mut answers[i], found);
            }
            if let (Some(counters), Some(counts)) = (counters.as_deref_mut(), counts) {
                for (&i, count) in open.iter().zip(&counts) {
                    counters[i].add(count);
                }
            }
        }
    }
}
