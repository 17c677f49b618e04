// SPDX-License-Identifier: GPL-3.0-or-later
//! End-point overlap (Aila, Karras and Laine 2013, On quality metrics of bounding volume hierarchies): for each node,
//! the area inside its region of triangles that no leaf below it contains, divided by the area of all triangles and
//! multiplied by the cost of the node. A ray that ends on such an area visits the node needlessly.
//!
//! Triangles are clipped to the region in f64. If the tree partitions space, the region is made smaller by [`INWARDS`]
//! on each side, because a triangle may lie in the plane between two regions and the builder's heights are rounded; the
//! overlap of such trees is therefore 0. Other regions are made larger by [`OUTWARDS`], so that boxes without thickness
//! contain the triangles in them. Both are relative to the scene's largest coordinate; the clipped area has an error of
//! at most the triangle's perimeter multiplied by that distance.

use super::Charges;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_geom::clip_area::{Clipper, HalfSpace, triangle_area};
use halfspace_geom::region::Region;
use halfspace_geom::vec3::{Vec3, widen};
use halfspace_nodes::cells::{Cells, NodeId};
use halfspace_structure::Structure;
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use rand::seq::index;

/// Distance by which regions that partition space are smaller, per unit of the largest coordinate: 8 units of roundoff
/// of f32, the error bound of a builder's heights along an oblique normal.
pub const INWARDS: f64 = 1.0 / (1_u64 << 21) as f64;

/// Distance by which other regions are larger, per unit of the largest coordinate: the error bound of vertices of
/// polytopes.
pub const OUTWARDS: f64 = 1.0 / (1_u64 << 40) as f64;

/// Smallest number of triangles in a sample (chosen).
const SMALLEST: usize = 1024;

/// Seed of all samples.
const SEED: u64 = 2013;

/// End-point overlap of a tree.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Overlap {
    /// Expected needless operations of a ray that ends at a random point of the triangles.
    pub charges: Charges,
    /// Standard error of their cost, because the triangles are a sample; 0 if all were used.
    pub error: f64,
    /// Number of triangles used.
    pub sample: usize,
    /// Number of triangles that can be hit.
    pub triangles: usize,
}

impl Overlap {
    /// Returns the overlap of a tree with one leaf, which is 0.
    pub fn none(triangles: usize) -> Self {
        Self {
            sample: triangles,
            triangles,
            ..Self::default()
        }
    }
}

/// A triangle of the sample.
#[derive(Debug)]
struct Triangle {
    corners: [Vec3; 3],
    area: f64,
}

/// Triangles of a scene in the frame of a structure, chosen at random without repetition.
#[derive(Debug)]
pub struct Sample {
    triangles: Vec<Triangle>,
    /// Position in `triangles` of each triangle of the scene; `u32::MAX` if it is not in the sample.
    positions: Vec<u32>,
    /// Number of triangles that can be hit.
    live: usize,
}

impl Sample {
    /// Takes all triangles that can be hit if the tree has at most `max_nodes` nodes; otherwise a fraction of them, in
    /// inverse proportion to the nodes.
    pub fn new(structure: &Structure, max_nodes: usize) -> Self {
        // Take those of the tree alone: others of the scene may have trees of their own.
        let scene = structure.scene_of(0).expect("a scene that is built");
        let shape = structure.progress().shape;
        let live = scene.live();
        let nodes = shape.nodes_axis + shape.nodes_oblique + shape.leaves;
        // Choose the positions in the list of triangles that can be hit.
        let chosen = if nodes <= max_nodes {
            (0..live.len()).collect()
        } else {
            let fraction = max_nodes as f64 / nodes as f64;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "less than the triangles"
            )]
            let wanted = (live.len() as f64 * fraction) as usize;
            let amount = wanted.max(SMALLEST).min(live.len());
            let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
            let mut chosen = index::sample(&mut random, live.len(), amount).into_vec();
            chosen.sort_unstable();
            chosen
        };
        // Convert their vertices to the frame.
        let frame = structure.frame();
        let mut positions = vec![u32::MAX; scene.len()];
        let mut triangles = Vec::with_capacity(chosen.len());
        for (position, &index) in (0..).zip(&chosen) {
            let id = live[index];
            let corners = scene.corners(id).map(|p| widen(frame.point(p)));
            positions[id as usize] = position;
            triangles.push(Triangle {
                corners,
                area: triangle_area(corners),
            });
        }
        Self {
            triangles,
            positions,
            live: live.len(),
        }
    }
}

/// The leaves that hold each triangle of a sample.
#[derive(Debug)]
pub struct Owners {
    /// Pairs of a triangle of the sample and the preorder position of a leaf.
    pairs: Vec<[u32; 2]>,
    /// Index of each triangle's first pair, then the number of pairs; filled by [`Self::finish`].
    firsts: Vec<usize>,
}

impl Owners {
    /// Makes an empty list.
    pub fn new(sample: &Sample) -> Self {
        Self {
            pairs: Vec::with_capacity(sample.triangles.len()),
            firsts: Vec::new(),
        }
    }

    /// Adds a leaf, given by its preorder position and its triangles.
    pub fn add(&mut self, sample: &Sample, ids: &[u32], leaf: u32) {
        let positions = ids.iter().map(|&id| sample.positions[id as usize]);
        let chosen = positions.filter(|&position| position != u32::MAX);
        self.pairs.extend(chosen.map(|position| [position, leaf]));
    }

    /// Sorts the leaves by triangle.
    pub fn finish(mut self) -> Self {
        self.pairs.sort_unstable();
        let triangles = self
            .pairs
            .last()
            .map_or(0, |&[position, _]| position as usize + 1);
        self.firsts = (0..=triangles)
            .map(|triangle| {
                self.pairs
                    .partition_point(|&[position, _]| (position as usize) < triangle)
            })
            .collect();
        self
    }

    /// Returns whether one of the `nodes` consecutive nodes from position `first` on is a leaf that contains the
    /// triangle.
    fn below(&self, triangle: u32, first: u32, nodes: u32) -> bool {
        let at = triangle as usize;
        let (Some(&from), Some(&to)) = (self.firsts.get(at), self.firsts.get(at + 1)) else {
            return false;
        };
        let leaves = &self.pairs[from..to];
        let next = leaves.partition_point(|&[_, leaf]| leaf < first);
        leaves
            .get(next)
            .is_some_and(|&[_, leaf]| leaf < first + nodes)
    }
}

/// A triangle of the sample and the area of its part inside a region.
#[derive(Debug, Clone, Copy)]
struct Piece {
    triangle: u32,
    area: f64,
}

/// A node to visit, whose region contains parts of triangles.
struct Open {
    id: NodeId,
    region: Region,
    /// Preorder position.
    index: u32,
    pieces: Vec<Piece>,
}

/// Measures the overlap of all nodes. `sizes` has the number of nodes of each subtree, in preorder.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn measure(
    tree: &dyn Cells,
    bounds: Aabb,
    sample: &Sample,
    owners: &Owners,
    sizes: &[u32],
    monitor: &Monitor,
) -> Result<Overlap> {
    let magnitude = f64::from(bounds.magnitude());
    let slack = magnitude
        * if tree.partitions() {
            -INWARDS
        } else {
            OUTWARDS
        };
    let mut clip = Clip {
        sample,
        slack,
        walls: Vec::new(),
        clipper: Clipper::default(),
        monitor,
    };
    // Per triangle, the needless operations multiplied by the area where they occur.
    let mut needless = vec![Charges::default(); sample.triangles.len()];
    let (id, region) = tree.root(bounds);
    let everything: Vec<u32> = (0..).take(sample.triangles.len()).collect();
    let pieces = clip.pieces(&region, everything.into_iter());
    let mut open = vec![Open {
        id,
        region,
        index: 0,
        pieces,
    }];
    while let Some(node) = open.pop() {
        monitor.check()?;
        // Charge the node to the triangles inside its region that no leaf below it contains.
        let view = tree.node(node.id, &node.region);
        let (steps, tests) = (tree.steps(&view), view.leaf.map_or(0, |(_, count)| count));
        let size = sizes[node.index as usize];
        for piece in &node.pieces {
            if !owners.below(piece.triangle, node.index, size) {
                needless[piece.triangle as usize].add(steps, tests, piece.area);
            }
        }
        // Clip the triangles to the children; at a leaf, only those that it does not contain.
        let mut index = node.index + 1;
        for (id, region) in view.children {
            let size = sizes[index as usize];
            let inside = node.pieces.iter().map(|piece| piece.triangle);
            let pieces = if size == 1 {
                clip.pieces(&region, inside.filter(|&t| !owners.below(t, index, 1)))
            } else {
                clip.pieces(&region, inside)
            };
            if !pieces.is_empty() {
                open.push(Open {
                    id,
                    region,
                    index,
                    pieces,
                });
            }
            index += size;
        }
    }
    Ok(summed(sample, &needless))
}

/// Clips triangles of a sample to regions.
struct Clip<'a> {
    sample: &'a Sample,
    slack: f64,
    walls: Vec<HalfSpace>,
    clipper: Clipper,
    /// Cancels the measurement: no further triangle has a part.
    monitor: &'a Monitor,
}

impl Clip<'_> {
    /// Returns the parts of triangles inside a region.
    fn pieces(&mut self, region: &Region, triangles: impl Iterator<Item = u32>) -> Vec<Piece> {
        region.half_spaces(&mut self.walls);
        triangles
            .take_while(|_| !self.monitor.is_cancelled())
            .map(|triangle| {
                let corners = self.sample.triangles[triangle as usize].corners;
                let area = self.clipper.area(corners, &self.walls, self.slack);
                Piece { triangle, area }
            })
            .filter(|piece| piece.area > 0.0)
            .collect()
    }
}

/// Returns the overlap, a ratio of two sums over the sample, and its standard error (Cochran 1977, section 2.11).
fn summed(sample: &Sample, needless: &[Charges]) -> Overlap {
    let (count, live) = (sample.triangles.len(), sample.live);
    let surface: f64 = sample.triangles.iter().map(|triangle| triangle.area).sum();
    if surface <= 0.0 {
        return Overlap {
            sample: count,
            triangles: live,
            ..Overlap::default()
        };
    }
    let mean = |get: fn(&Charges) -> f64| needless.iter().map(get).sum::<f64>() / surface;
    let charges = Charges {
        axis: mean(|charges| charges.axis),
        oblique: mean(|charges| charges.oblique),
        tests: mean(|charges| charges.tests),
    };
    // Compute the variance of the residuals, corrected for the fraction of all triangles in the sample.
    let squares: f64 = (needless.iter().zip(&sample.triangles))
        .map(|(one, triangle)| (one.cost() - charges.cost() * triangle.area).powi(2))
        .sum();
    let missing = 1.0 - count as f64 / live as f64;
    let n = count as f64;
    let error = if count > 1 {
        (missing * n / (n - 1.0) * squares).sqrt() / surface
    } else {
        0.0
    };
    Overlap {
        charges,
        error,
        sample: count,
        triangles: live,
    }
}
