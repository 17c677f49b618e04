// SPDX-License-Identifier: GPL-3.0-or-later
//! kd-trees without a cost model, as they were before there was one: cells halved (Kaplan 1985), or
//! their triangles (MacDonald and Booth 1990, who show that the best plane lies between the two).

use crate::kd::default_depth;
use crate::planes::rows::{AXIS_TRAVERSAL, AXIS_WAYS};
use crate::planes::scalar::{AXIS_LEAVES, MAILBOX};
use crate::ways::PLANE_NODES;
use crate::{params, planes};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{BoxCell, Cell, Direction, Plane};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::preorder::{Item, Preorder};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Family, Menu, StructureSpec};
use halfspace_structure::spec::Config;

/// The row of the tree of halved cells.
pub const SPACE: StructureSpec = StructureSpec {
    id: "kd-median",
    code: 3,
    label: "kd-tree (halved cells)",
    family: Family::Space,
    summary: "Each cell is halved, along one axis after the other: a regular tree, without a cost model.",
    paper: "Kaplan 1985, Space-tracing: a constant time ray-tracer; Jansen 1986, Data structures for ray tracing",
    params: &[
        PLANE_NODES,
        AXIS_TRAVERSAL,
        params::ROBUST,
        AXIS_LEAVES,
        MAILBOX,
        params::LEAF_SIZE,
        params::MAX_DEPTH,
    ],
    ways: AXIS_WAYS,
    no_groups: "",
    menu: Menu::Kd,
    literature: &[("Kaplan: regular kd-tree, space median", "")],
    sweep: false,
    claims: &["halved-cells-constant", "medians-*"],
    build: |scene, config, monitor| build(scene, config, monitor, Halves::Space),
};

/// The row of the tree of halved lists.
pub const OBJECTS: StructureSpec = StructureSpec {
    id: "kd-object",
    code: 4,
    label: "kd-tree (halved lists)",
    summary: "Each cell is split at the middle one of its triangles, across its longest side.",
    paper: "MacDonald and Booth 1990, Heuristics for ray tracing using space subdivision, which compares the two",
    literature: &[("MacDonald and Booth: kd-tree, object median", "")],
    claims: &["medians-*"],
    build: |scene, config, monitor| build(scene, config, monitor, Halves::Objects),
    ..SPACE
};

/// Halved quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Halves {
    /// The cell.
    Space,
    /// The triangles of the cell.
    Objects,
}

/// A cell becomes a leaf after this number of consecutive splits that left one side with all its triangles. Derived:
/// one split along each axis where cells are halved.
const IN_VAIN: u32 = 3;

/// Largest number of references per triangle of the scene. A node's budget goes to its children in proportion to their
/// references.
const BUDGET: usize = 64;

/// Arguments that are the same at all nodes.
struct Builder<'a> {
    boxes: &'a [Aabb],
    halves: Halves,
    leaf_size: usize,
    max_depth: usize,
    monitor: &'a Monitor,
}

/// A node that is about to be built.
struct OpenNode {
    ids: Vec<u32>,
    cell: BoxCell,
    share: f32,
    depth: usize,
    /// Number of consecutive splits, up to the parent's, that left one side with all triangles.
    vain: u32,
    budget: usize,
    work: f64,
}

impl Builder<'_> {
    /// Appends a node and all below it to `out`. `gathered` sums the bytes of the leaves.
    fn node(&self, node: OpenNode, out: &mut Preorder, gathered: &mut usize) -> Result<()> {
        // Make a leaf if no plane splits the node.
        self.monitor.check()?;
        let count = node.ids.len();
        let Some((plane, below, above)) = self.split(&node) else {
            self.monitor
                .charge(gathered, footprint::leaf::<Item>(count, 24))?;
            self.monitor.advance(node.work);
            out.leaf(node.ids, node.share);
            return Ok(());
        };
        // Write the inner node, then build its children.
        let references = below.len() + above.len();
        let _held = self.monitor.hold(footprint::unsplit::<u32>(references))?;
        let vain = if below.len().max(above.len()) == count {
            node.vain + 1
        } else {
            0
        };
        out.items.push(Item::Inner {
            plane,
            share: node.share,
        });
        let (cell_below, cell_above) = node.cell.split(plane);
        let whole = node.cell.0.area();
        drop(node.ids);
        for (ids, cell) in [(below, cell_below), (above, cell_above)] {
            let portion = ids.len() as f64 / references.max(1) as f64;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a portion"
            )]
            let child = OpenNode {
                ids,
                share: if whole > 0.0 {
                    node.share * (cell.0.area() / whole) as f32
                } else {
                    node.share
                },
                cell,
                depth: node.depth + 1,
                vain,
                budget: (node.budget as f64 * portion) as usize,
                work: node.work * portion,
            };
            self.node(child, out, gathered)?;
        }
        Ok(())
    }

    /// The plane of a node and the triangles that reach below and above it; `None` for a leaf.
    fn split(&self, node: &OpenNode) -> Option<(Plane, Vec<u32>, Vec<u32>)> {
        if node.ids.len() <= self.leaf_size || node.depth >= self.max_depth || node.vain >= IN_VAIN
        {
            return None;
        }
        // Choose the plane: through the middle of the cell, or through the median triangle.
        let cell = &node.cell.0;
        let (axis, at) = match self.halves {
            Halves::Space => (0..3)
                .map(|turn| (node.depth + turn) % 3)
                .map(|axis| (axis, 0.5 * cell.min[axis] + 0.5 * cell.max[axis]))
                .find(|&(axis, at)| cell.min[axis] < at && at < cell.max[axis])?,
            Halves::Objects => {
                let axis = (0..3).max_by(|&a, &b| cell.extent(a).total_cmp(&cell.extent(b)))?;
                (axis, self.middle(&node.ids, cell, axis)?)
            }
        };
        let bounds = |id: &u32| &self.boxes[*id as usize];
        // Put a triangle that only touches the plane on its own side, and one inside the plane below it.
        let above: Vec<_> = node
            .ids
            .iter()
            .copied()
            .filter(|id| bounds(id).max[axis] > at)
            .collect();
        let below: Vec<_> = node
            .ids
            .iter()
            .copied()
            .filter(|id| bounds(id).min[axis] < at || bounds(id).max[axis] <= at)
            .collect();
        if below.len() + above.len() > node.budget.max(node.ids.len()) {
            return None;
        }
        let plane = Plane {
            direction: Direction::Axis(axis),
            offset: at,
        };
        Some((plane, below, above))
    }

    /// The median along an axis of the middles of the triangles' boxes, cut to the cell; `None` if all lie on its walls.
    fn middle(&self, ids: &[u32], cell: &Aabb, axis: usize) -> Option<f32> {
        let mut middles: Vec<f32> = ids
            .iter()
            .map(|&id| {
                let bounds = &self.boxes[id as usize];
                0.5 * bounds.min[axis].max(cell.min[axis])
                    + 0.5 * bounds.max[axis].min(cell.max[axis])
            })
            .filter(|&at| cell.min[axis] < at && at < cell.max[axis])
            .collect();
        if middles.is_empty() {
            return None;
        }
        let half = middles.len() / 2;
        Some(*middles.select_nth_unstable_by(half, f32::total_cmp).1)
    }
}

fn build(scene: &Triangles, config: &Config, monitor: &Monitor, halves: Halves) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let live = scene.live();
    monitor.take(live.len() * footprint::TRIANGLE)?;
    let mut boxes = vec![Aabb::EMPTY; scene.len()];
    for &id in live {
        boxes[id as usize] = Aabb::of_triangle(scene.corners(id).map(|p| frame.point(p)));
    }
    let builder = Builder {
        boxes: &boxes,
        halves,
        leaf_size: config.integer("leaf_size"),
        max_depth: match config.integer("max_depth") {
            0 => default_depth(live.len()),
            depth => depth,
        }
        .min(MAX_DEPTH),
        monitor,
    };
    let root = OpenNode {
        ids: live.to_vec(),
        cell: BoxCell(frame.bounds()),
        share: f32::from(u8::from(frame.bounds().area() > 0.0)),
        depth: 0,
        vain: 0,
        budget: BUDGET * live.len(),
        work: 1.0,
    };
    let (mut preorder, mut gathered) = (Preorder::default(), 0);
    planes::during_planes(config, monitor, || {
        builder.node(root, &mut preorder, &mut gathered)
    })?;
    monitor.take(gathered)?;
    planes::lay_out(scene, config, frame, &preorder, monitor)
}
