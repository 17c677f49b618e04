// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies over runs of neighbouring triangles: the sides of a piece of a hair have nearly the same box, so that
//! partitions between them gain nothing. A build over runs takes a fraction of the time.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::binned::SurfaceArea;
use halfspace_builders::object::{self, Object};
use halfspace_geom::Aabb;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::object_tree::{Item, ItemKind, ObjectTree};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

/// Number of triangles of a leaf that are tested at once, the most of a part of a run.
const BLOCK: usize = 8;

/// Number of triangles of a run (chosen): more than the sides of a tube have.
const LONGEST: usize = 64;

/// Area of the box of a run relative to the largest one of its triangles (chosen). Derived: the box of two pieces of a
/// straight hair has twice the area of one, that of the sides of a piece along an axis at most 1.5 times that of a side.
const LARGER: f64 = 1.5;

/// Number of triangles to a part of a run, on average, from which the build takes runs (chosen): meshes have two, the
/// halves of quadrangles.
const LEAST: usize = 4;

/// Triangles in the order of the scene, divided into parts of runs.
struct Runs {
    /// The box of each part.
    objects: Vec<Object>,
    /// The first triangle of each part among the live ones, and their number.
    firsts: Vec<u32>,
}

/// Builds a tree over the live triangles of `scene`, as [`object::build`], or over their runs where these are long.
///
/// # Errors
/// Those of [`object::build`].
pub fn build(
    scene: &Triangles,
    frame: &Frame,
    policy: &SurfaceArea,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    let objects = object::gather(scene, frame);
    let most = policy.leaf_max.min(BLOCK);
    let Some(mut runs) = Runs::find(&objects, most) else {
        return object::build_over(objects, frame.bounds(), policy, monitor);
    };
    drop(objects);
    // A part of a run fills a block of tests, whole or not.
    let costs = Costs {
        triangle: policy.costs.triangle * policy.costs.block,
        block: 1.0,
        ..policy.costs
    };
    let policy = SurfaceArea {
        costs,
        leaf_max: policy.leaf_max / most,
    };
    let objects = std::mem::take(&mut runs.objects);
    let tree = object::build_over(objects, frame.bounds(), &policy, monitor)?;
    Ok(runs.expand(&tree, scene.live()))
}

impl Runs {
    /// Divides objects into runs, and these into equal parts of at most `most`; `None` if they are short.
    fn find(all: &[Object], most: usize) -> Option<Self> {
        let mut runs = Self {
            objects: Vec::new(),
            firsts: vec![0],
        };
        let mut first = 0;
        while first < all.len() {
            // Extend the run while its box is hardly larger than that of a triangle.
            let mut bounds = all[first].bounds;
            let mut largest = bounds.area();
            let mut end = first + 1;
            while end < all.len() && end - first < LONGEST {
                let next = &all[end].bounds;
                bounds = bounds.union(next);
                largest = largest.max(next.area());
                if bounds.area() > LARGER * largest {
                    break;
                }
                end += 1;
            }
            let parts = (end - first).div_ceil(most);
            for part in all[first..end].chunks((end - first).div_ceil(parts)) {
                runs.add(part);
            }
            first = end;
            // Give up as soon as the parts are too many.
            if runs.objects.len() * LEAST > all.len() {
                return None;
            }
        }
        (!all.is_empty()).then_some(runs)
    }

    /// Appends a part.
    fn add(&mut self, part: &[Object]) {
        let union = |all: Aabb, one: &Object| all.union(&one.bounds);
        let last = self.firsts[self.objects.len()];
        self.objects.push(Object {
            bounds: part.iter().fold(Aabb::EMPTY, union),
            id: u32::try_from(self.objects.len()).expect("fewer than triangles"),
        });
        let count = u32::try_from(part.len()).expect("a short run");
        self.firsts.push(last + count);
    }

    /// Returns the tree of the triangles of a tree of the parts.
    fn expand(&self, tree: &ObjectTree, live: &[u32]) -> ObjectTree {
        let mut ids = Vec::with_capacity(live.len());
        let mut parts = tree.ids.iter().map(|&part| part as usize);
        let mut item = |index: usize| {
            let item = tree.items[index];
            let ItemKind::Leaf { count } = tree.kind(index) else {
                return item;
            };
            let before = ids.len();
            for part in parts.by_ref().take(count) {
                let [first, end] = [self.firsts[part], self.firsts[part + 1]];
                ids.extend_from_slice(&live[first as usize..end as usize]);
            }
            Item::leaf(item.bounds, ids.len() - before)
        };
        let items = (0..tree.items.len()).map(&mut item).collect();
        ObjectTree { items, ids }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIECES: usize = 200;

    /// Bent tubes of this number of sides, a ring after another, each of 10 pieces.
    fn tubes(sides: u32) -> Triangles {
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for ring in 0..PIECES as u32 / 10 * 11 {
            let [tube, step] = [ring / 11, ring % 11].map(|x| f64::from(x) as f32);
            for side in 0..sides {
                let (y, x) = (std::f32::consts::TAU * side as f32 / sides as f32).sin_cos();
                let bent = 0.02 * step * step;
                vertices.push([
                    0.02 * x + bent,
                    0.02 * y + 0.3 * step,
                    tube + bent + 0.4 * step,
                ]);
            }
            for side in (0..sides).filter(|_| ring % 11 < 10) {
                let [a, b] = [side, (side + 1) % sides].map(|side| ring * sides + side);
                indices.extend([[a, b, b + sides], [a, b + sides, a + sides]]);
            }
        }
        Triangles::new(vertices, indices).unwrap()
    }

    #[test]
    fn runs_are_the_sides_of_a_piece_and_the_tree_has_every_triangle() {
        for (sides, parts) in [(3, 1), (5, 2), (7, 2)] {
            let scene = tubes(sides);
            let frame = Frame::new(scene.bounds());
            let objects = object::gather(&scene, &frame);
            let runs = Runs::find(&objects, BLOCK).unwrap();
            let expected = 2 * sides / parts;
            assert_eq!(runs.objects.len(), PIECES * parts as usize);
            assert!(
                runs.firsts
                    .windows(2)
                    .all(|two| two[1] - two[0] == expected)
            );
            for leaf_max in [2, 5, 24] {
                let policy = SurfaceArea {
                    costs: Costs::BOXES,
                    leaf_max,
                };
                let tree = build(&scene, &frame, &policy, &Monitor::new()).unwrap();
                let firsts = tree.firsts();
                for (index, item) in tree.items.iter().enumerate() {
                    let ItemKind::Leaf { count } = tree.kind(index) else {
                        continue;
                    };
                    assert!((1..=leaf_max).contains(&count));
                    let first = firsts[index] as usize;
                    let around = (tree.ids[first..first + count].iter())
                        .map(|&id| objects[id as usize].bounds)
                        .fold(Aabb::EMPTY, |all, one| all.union(&one));
                    assert_eq!(item.bounds, around);
                }
                let mut ids = tree.ids.clone();
                ids.sort_unstable();
                assert_eq!(ids, scene.live());
            }
        }
    }

    #[test]
    fn triangles_that_are_no_runs_are_built_one_by_one() {
        let mut vertices = Vec::new();
        for i in 0..20_u8 {
            let x = f32::from(i);
            vertices.extend([[x, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 1.0, 1.0]]);
        }
        let indices = (0..20).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let objects = object::gather(&scene, &Frame::new(scene.bounds()));
        assert!(Runs::find(&objects, BLOCK).is_none());
        assert!(Runs::find(&[], BLOCK).is_none());
    }
}
