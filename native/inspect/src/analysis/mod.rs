// SPDX-License-Identifier: GPL-3.0-or-later
//! Statistics of a tree as the literature reports them: histograms of leaves, levels and children, the terms of the
//! surface area heuristic, the share of nodes of which a ray meets one child only, and end-point overlap.
//!
//! Everything is computed on demand from the nodes as convex regions, and depends on the tree alone.

mod census;
mod overlap;

pub use census::{Beta, Charges, Levels};
pub use overlap::Overlap;

use census::Census;
use halfspace_nodes::cells::each_node;
use halfspace_structure::Structure;
use overlap::{Owners, Sample};

/// Statistics of a tree.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Analysis {
    /// Inner nodes.
    pub nodes: u64,
    /// Number of leaves at each depth; the root has depth 0.
    pub leaf_depths: Vec<u64>,
    /// Numbers of triangles that leaves hold, ascending, and the number of leaves that hold as many.
    pub leaf_sizes: Vec<[u64; 2]>,
    /// Nodes, planes and directions at each depth.
    pub levels: Levels,
    /// Number of inner nodes with 0, 1, 2, ... children.
    pub children: Vec<u64>,
    /// What a random ray that meets the scene's box visits on average, if nothing stops it.
    pub visits: Charges,
    /// Share of visits of split nodes in which a random ray meets one child only.
    pub beta: Beta,
    /// End-point overlap.
    pub overlap: Overlap,
}

/// Analyses the tree of a structure, the one that its statistics describe. End-point overlap of a tree of more than
/// `max_nodes` nodes is estimated from a sample of the triangles.
pub fn analysis(structure: &Structure, max_nodes: usize) -> Analysis {
    let built = structure.built();
    let bounds = built.frame.bounds();
    let (mut census, mut sizes) = (Census::default(), Vec::new());
    let cells = built.tree.as_ref().and_then(|tree| tree.cells());
    let Some(cells) = cells.filter(|_| !bounds.is_empty()) else {
        // Without a tree, the scene's box is the only leaf.
        census.leaf(
            built.shape.references,
            0,
            if bounds.area() > 0.0 { 1.0 } else { 0.0 },
        );
        let triangles = structure.scene().live().len();
        return census.finish(Overlap::none(triangles));
    };
    // Count the nodes, and note in which leaves the triangles of the sample lie.
    let sample = Sample::new(structure, max_nodes);
    let mut owners = Owners::new(&sample);
    each_node(cells, bounds, |node| {
        let share = census::share(node.region, &bounds);
        match node.view.leaf {
            Some((first, count)) => {
                census.leaf(count, node.depth, share);
                owners.add(&sample, &built.leaves.ids(first, count), node.index);
            }
            None => census.inner(&node, cells.partitions()),
        }
        census.steps(cells.steps(node.view), share);
        sizes.push(Subtree {
            parent: node.parent,
            nodes: 1,
        });
    });
    // Add up the nodes of all subtrees: parents come before their children.
    for index in (1..sizes.len()).rev() {
        let Subtree { parent, nodes } = sizes[index];
        sizes[parent.expect("only the root has no parent") as usize].nodes += nodes;
    }
    let sizes: Vec<u32> = sizes.iter().map(|subtree| subtree.nodes).collect();
    let overlap = overlap::measure(cells, bounds, &sample, &owners.finish(), &sizes);
    census.finish(overlap)
}

/// Number of nodes of a subtree, its root included.
struct Subtree {
    parent: Option<u32>,
    nodes: u32,
}
