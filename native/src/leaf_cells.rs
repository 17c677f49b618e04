// SPDX-License-Identifier: GPL-3.0-or-later
//! The cells of leaves as polygons, the fullest first: where a tree leaves many triangles together.

use crate::geom::Aabb;
use crate::regions::{self, Cells, Region, Task, each_leaf};
use crate::structure::Structure;
use crate::traverse::frame::Frame;

/// Cells in the scene's frame.
#[derive(Debug, Clone, Default)]
pub struct LeafCells {
    /// The faces of all cells.
    pub faces: Faces,
    /// Triangles in each leaf.
    pub counts: Vec<u32>,
    /// Depth of each leaf; the root has depth 0.
    pub depths: Vec<u32>,
    /// How many cells were left out because there were enough.
    pub hidden: usize,
}

/// The faces of some cells, one cell after another.
#[derive(Debug, Clone)]
pub struct Faces {
    /// Corners of all faces.
    pub vertices: Vec<[f32; 3]>,
    /// Where each face begins in `vertices`, and one more entry for the end.
    pub offsets: Vec<u32>,
    /// Where each cell begins among the faces, and one more entry for the end.
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
    /// Appends a cell of these faces.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "what is drawn is bounded, and f32"
    )]
    pub fn push(&mut self, faces: &[regions::Face], frame: &Frame) {
        for face in faces {
            let corners = face.iter().map(|p| frame.to_scene(p.map(|x| x as f32)));
            self.vertices.extend(corners);
            self.offsets.push(self.vertices.len() as u32);
        }
        self.cells.push(self.offsets.len() as u32 - 1);
    }
}

/// The cells of all leaves with at least `least` triangles, at most `max_count` of them, those with the
/// most triangles first, and among equals in the order of the tree.
pub fn leaf_cells(structure: &Structure, least: usize, max_count: usize) -> LeafCells {
    let built = structure.built();
    let task = Fullest {
        bounds: built.frame.bounds(),
        least,
        max_count,
    };
    let (chosen, all) = match regions::with_cells(structure, task) {
        Some(found) => found,
        None => alone(structure, least, max_count),
    };
    let mut out = LeafCells {
        hidden: all - chosen.len(),
        ..LeafCells::default()
    };
    for (count, depth, region) in chosen {
        out.faces.push(&region.faces(), &built.frame);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^28")]
        out.counts.push(count as u32);
        #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
        out.depths.push(depth as u32);
    }
    out
}

type Chosen = (usize, usize, Region);

/// Without a tree the scene's box is the only cell.
fn alone(structure: &Structure, least: usize, max_count: usize) -> (Vec<Chosen>, usize) {
    let built = structure.built();
    let count = built.shape.references;
    if count < least || built.frame.bounds().is_empty() {
        return (Vec::new(), 0);
    }
    let only = (count, 0, Region::of_scene(built.frame.bounds()));
    (std::iter::once(only).take(max_count).collect(), 1)
}

struct Fullest {
    bounds: Aabb,
    least: usize,
    max_count: usize,
}

impl Task for Fullest {
    /// Count, depth and region of the chosen leaves, and how many there are in all.
    type Result = (Vec<Chosen>, usize);

    fn run<T: Cells>(self, tree: &T) -> Self::Result {
        if self.bounds.is_empty() {
            return (Vec::new(), 0);
        }
        // First the numbers alone, because regions of millions of leaves would take much memory.
        let mut order = Vec::new();
        let mut number = 0_usize;
        each_leaf(tree, self.bounds, |leaf| {
            if leaf.count >= self.least {
                order.push((leaf.count, number));
            }
            number += 1;
        });
        let all = order.len();
        order.sort_unstable_by_key(|&(count, number)| (std::cmp::Reverse(count), number));
        order.truncate(self.max_count);
        let mut wanted: Vec<_> = order.iter().map(|&(_, number)| number).collect();
        wanted.sort_unstable();
        let mut chosen = Vec::with_capacity(wanted.len());
        let mut next = wanted.into_iter().peekable();
        number = 0;
        each_leaf(tree, self.bounds, |leaf| {
            if next.next_if_eq(&number).is_some() {
                chosen.push((leaf.count, leaf.depth, leaf.region.clone()));
            }
            number += 1;
        });
        chosen.sort_by_key(|&(count, ..)| std::cmp::Reverse(count));
        (chosen, all)
    }
}
