// SPDX-License-Identifier: GPL-3.0-or-later
//! Statistics of a tree as the literature reports them: histograms of leaves, levels and children, the terms of the
//! surface area heuristic, the probability that a ray hits one child only, and end-point overlap.
//!
//! Everything is computed on demand from the nodes as convex regions, and depends on the tree alone.

mod census;
mod overlap;

pub use census::{Beta, Charges, Levels};
pub use overlap::Overlap;

use census::Census;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_nodes::cells::try_each_node;
use halfspace_structure::Structure;
use overlap::{Owners, Sample};

/// Statistics of a tree.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Analysis {
    /// Number of inner nodes.
    pub nodes: u64,
    /// Number of leaves at each depth; the root has depth 0.
    pub leaf_depths: Vec<u64>,
    /// Histogram of leaves: pairs of a number of triangles, ascending, and the number of leaves with as many.
    pub leaf_sizes: Vec<[u64; 2]>,
    /// Nodes, planes and directions at each depth.
    pub levels: Levels,
    /// Number of inner nodes with 0, 1, 2 and more children, by that number.
    pub children: Vec<u64>,
    /// Expected operations of a random ray that hits the scene's box and ends at no triangle.
    pub visits: Charges,
    /// Probability that a random ray that visits a split node hits one child only.
    pub beta: Beta,
    /// End-point overlap.
    pub overlap: Overlap,
}

/// Computes the statistics of the tree of a structure, not of its derived layouts. In a tree of more than `max_nodes`
/// nodes, end-point overlap is estimated from a sample of the triangles.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn analysis(structure: &Structure, max_nodes: usize, monitor: &Monitor) -> Result<Analysis> {
    let built = structure.built();
    let bounds = built.frame.bounds();
    let (mut census, mut sizes) = (Census::default(), Vec::new());
    let cells = built.tree.as_ref().and_then(|tree| tree.cells());
    let Some(cells) = cells.filter(|_| !bounds.is_empty()) else {
        // Without a tree, count the scene's box as the only leaf.
        census.leaf(
            built.shape.references,
            0,
            if bounds.area() > 0.0 { 1.0 } else { 0.0 },
        );
        let triangles = structure.scene().live().len();
        return Ok(census.finish(Overlap::none(triangles)));
    };
    // Count the nodes, and collect the leaves that contain each triangle of the sample.
    let sample = Sample::new(structure, max_nodes);
    let mut owners = Owners::new(&sample);
    try_each_node(cells, bounds, |node| {
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
        monitor.check()
    })?;
    // Add up the nodes of all subtrees: parents come before their children.
    for index in (1..sizes.len()).rev() {
        let Subtree { parent, nodes } = sizes[index];
        sizes[parent.expect("only the root has no parent") as usize].nodes += nodes;
    }
    let sizes: Vec<u32> = sizes.iter().map(|subtree| subtree.nodes).collect();
    let overlap = overlap::measure(cells, bounds, &sample, &owners.finish(), &sizes, monitor)?;
    Ok(census.finish(overlap))
}

/// A subtree.
struct Subtree {
    /// Index of the parent of its root, in preorder.
    parent: Option<u32>,
    /// Number of nodes, its root included.
    nodes: u32,
}
