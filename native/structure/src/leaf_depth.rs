// SPDX-License-Identifier: GPL-3.0-or-later
//! The depth of the last leaf that each ray tests, for a render pass.

use crate::structure::Structure;
use halfspace_nodes::cells::each_leaf;
use halfspace_ray::Ray;
use std::collections::HashMap;

/// Depth of each leaf that holds triangles, keyed by the index of its first block.
#[derive(Debug, Default)]
pub struct LeafDepths(HashMap<u32, u32>);

impl LeafDepths {
    /// Finds the depths of all leaves that single rays test; none without a tree.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "bounded by the depth limit"
    )]
    pub fn new(structure: &Structure) -> Self {
        let built = structure.built();
        let bounds = built.frame.bounds();
        let mut depths = HashMap::new();
        if let Some(cells) = built.tree.as_ref().and_then(|tree| tree.cells())
            && !bounds.is_empty()
        {
            each_leaf(cells, bounds, |leaf| {
                if leaf.count > 0 {
                    depths.insert(leaf.first, leaf.depth as u32);
                }
            });
        }
        Self(depths)
    }

    /// Traces a ray and returns the depth of the last leaf whose triangles were tested; 0 if none was.
    pub fn of(&self, structure: &Structure, ray: &Ray) -> u32 {
        let (_, path) = structure.path(ray, false, None);
        let last = path.leaves.last().and_then(|leaf| self.0.get(&leaf.first));
        last.copied().unwrap_or(0)
    }
}
