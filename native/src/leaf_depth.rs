// SPDX-License-Identifier: GPL-3.0-or-later
//! How deep in the tree the walks of rays end, for a pass that shows it.

use crate::geom::Aabb;
use crate::regions::{self, Cells, Task, each_leaf};
use crate::structure::Structure;
use crate::traverse::Ray;
use std::collections::HashMap;

/// The depth of each leaf with triangles, by where its blocks begin.
#[derive(Debug, Default)]
pub struct LeafDepths(HashMap<u32, u32>);

impl LeafDepths {
    /// Of all leaves; none without a tree.
    pub fn new(structure: &Structure) -> Self {
        struct Gather(Aabb);
        impl Task for Gather {
            type Result = HashMap<u32, u32>;
            fn run<T: Cells>(self, tree: &T) -> Self::Result {
                let mut depths = HashMap::new();
                if !self.0.is_empty() {
                    each_leaf(tree, self.0, |leaf| {
                        if leaf.count > 0 {
                            depths.insert(leaf.first, leaf.depth as u32);
                        }
                    });
                }
                depths
            }
        }
        let bounds = structure.built().frame.bounds();
        Self(regions::with_walked_cells(structure, Gather(bounds)).unwrap_or_default())
    }

    /// The depth of the last leaf whose triangles the walk of this ray tested; 0 when it tested none.
    pub fn of(&self, structure: &Structure, ray: &Ray) -> u32 {
        let (_, path) = structure.path(ray);
        let last = path.leaves.last().and_then(|(first, _)| self.0.get(first));
        last.copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray_path::ray_path;
    use crate::scene::Triangles;
    use std::sync::Arc;

    #[test]
    fn depths_are_those_of_the_ray_s_path() {
        let mut corners = Vec::new();
        for i in 0..40_u8 {
            let x = f32::from(i);
            corners.push([[x, 0.0, 0.0], [x + 0.9, 0.0, 0.1], [x, 1.0, 0.2]]);
        }
        let vertices: Vec<[f32; 3]> = corners.concat();
        let triangles: Vec<[u32; 3]> = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Arc::new(Triangles::new(vertices, triangles).unwrap());
        let boxes = ["kd:traversal=boxes", "rbsp:traversal=boxes"];
        for spec in ["kd", "bvh-sah", "octree-net", "brute"]
            .into_iter()
            .chain(boxes)
        {
            let structure = Structure::of(&scene, spec);
            let depths = LeafDepths::new(&structure);
            let mut deepest = 0;
            for i in 0..40_u8 {
                let ray = Ray {
                    o: [f32::from(i) + 0.2, 0.2, 5.0],
                    d: [0.0, 0.0, -1.0],
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                let visits = ray_path(&structure, &ray).visits;
                let expected = visits.iter().rfind(|visit| visit.tested);
                let expected = expected.map_or(0, |visit| visit.depth as u32);
                assert_eq!(depths.of(&structure, &ray), expected, "{spec}, ray {i}");
                deepest = deepest.max(expected);
            }
            assert_eq!(deepest > 0, spec != "brute", "{spec}");
        }
    }
}
