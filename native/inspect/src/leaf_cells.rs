// SPDX-License-Identifier: GPL-3.0-or-later
//! The cells of leaves as polyhedra, those with the most triangles first. They show where a tree fails to separate
//! triangles.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_geom::region::{Face, Region};
use halfspace_nodes::cells::{Cells, try_each_leaf};
use halfspace_ray::frame::Frame;
use halfspace_structure::Structure;

/// Cells of leaves, in the scene's space.
#[derive(Debug, Clone, Default)]
pub struct LeafCells {
    /// The faces of all cells.
    pub faces: Faces,
    /// Number of triangles in each leaf.
    pub counts: Vec<u32>,
    /// Depth of each leaf; the root has depth 0.
    pub depths: Vec<u32>,
    /// Number of cells left out because `max_count` was reached.
    pub hidden: usize,
}

/// Faces of a list of cells, one cell after another.
#[derive(Debug, Clone)]
pub struct Faces {
    /// Vertices of all faces.
    pub vertices: Vec<[f32; 3]>,
    /// Index into `vertices` of each face's first vertex, then the length of `vertices`.
    pub offsets: Vec<u32>,
    /// Index of each cell's first face, then the number of faces.
    pub cells: Vec<u32>,
}

impl Default for Faces {
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            offsets: vec![0],
            cells: vec![0],
        }
    }
}

impl Faces {
    /// Appends a cell with these faces, which are given in the frame of the structure and converted to the scene's
    /// space.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the number of drawn faces is limited, and drawing needs no more than f32"
    )]
    pub fn push(&mut self, faces: &[Face], frame: &Frame) {
        for face in faces {
            let corners = face.iter().map(|p| frame.to_scene(p.map(|x| x as f32)));
            self.vertices.extend(corners);
            self.offsets.push(self.vertices.len() as u32);
        }
        self.cells.push(self.offsets.len() as u32 - 1);
    }
}

/// Returns the cells of the leaves with at least `least` triangles, at most `max_count` of them, by descending
/// number of triangles, then in the order of the tree.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn leaf_cells(
    structure: &Structure,
    least: usize,
    max_count: usize,
    monitor: &Monitor,
) -> Result<LeafCells> {
    let built = structure.built();
    let bounds = built.frame.bounds();
    let (chosen, all) = match built.tree.as_ref().and_then(|tree| tree.cells()) {
        Some(_) if bounds.is_empty() => (Vec::new(), 0),
        Some(cells) => fullest(cells, bounds, [least, max_count], monitor)?,
        None => alone(structure, least, max_count),
    };
    let mut out = LeafCells {
        hidden: all - chosen.len(),
        ..LeafCells::default()
    };
    // Append the faces of each chosen cell.
    for cell in chosen {
        out.faces.push(&cell.region.faces(), &built.frame);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^28")]
        out.counts.push(cell.count as u32);
        #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
        out.depths.push(cell.depth as u32);
    }
    Ok(out)
}

/// A leaf whose cell is returned.
struct Chosen {
    count: usize,
    depth: usize,
    region: Region,
}

/// Returns the only cell of a structure without a tree, the scene's box, and the number of matching cells.
fn alone(structure: &Structure, least: usize, max_count: usize) -> (Vec<Chosen>, usize) {
    let built = structure.built();
    let count = built.shape.references;
    if count < least || built.frame.bounds().is_empty() {
        return (Vec::new(), 0);
    }
    let only = Chosen {
        count,
        depth: 0,
        region: Region::of_scene(built.frame.bounds()),
    };
    (std::iter::once(only).take(max_count).collect(), 1)
}

/// Returns the leaves with the most triangles, and the number of all leaves with at least `least`.
fn fullest(
    tree: &dyn Cells,
    bounds: Aabb,
    [least, max_count]: [usize; 2],
    monitor: &Monitor,
) -> Result<(Vec<Chosen>, usize)> {
    // Collect only the numbers of the leaves, because the regions of millions of leaves would need much memory.
    let mut order = Vec::new();
    let mut number = 0_usize;
    try_each_leaf(tree, bounds, |leaf| {
        if leaf.count >= least {
            order.push((leaf.count, number));
        }
        number += 1;
        monitor.check()
    })?;
    let all = order.len();
    order.sort_unstable_by_key(|&(count, number)| (std::cmp::Reverse(count), number));
    order.truncate(max_count);
    let mut wanted: Vec<_> = order.iter().map(|&(_, number)| number).collect();
    wanted.sort_unstable();
    // Copy the regions of the chosen leaves.
    let mut chosen = Vec::with_capacity(wanted.len());
    let mut next = wanted.into_iter().peekable();
    number = 0;
    try_each_leaf(tree, bounds, |leaf| {
        if next.next_if_eq(&number).is_some() {
            chosen.push(Chosen {
                count: leaf.count,
                depth: leaf.depth,
                region: leaf.region.clone(),
            });
        }
        number += 1;
        monitor.check()
    })?;
    chosen.sort_by_key(|cell| std::cmp::Reverse(cell.count));
    Ok((chosen, all))
}
