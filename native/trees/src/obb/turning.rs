// SPDX-License-Identifier: GPL-3.0-or-later
//! Choice of the rotation of each node, from the leaves up.

use super::rotations::{Heights, Rows, to_triangle};
use halfspace_base::error::Result;
use halfspace_base::monitor::Monitor;
use halfspace_geom::Aabb;
use halfspace_geom::vec3::{Vec3, cross, dot, length, sub, widen};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::{self, BoxTree};
use halfspace_nodes::cost::Costs;
use halfspace_nodes::obb_tree::{Rotation, Turn, WIDTH, outwards};
use halfspace_ray::frame::Frame;
use halfspace_scene::triangles::Triangles;
use rayon::prelude::*;

/// Nodes above this depth, at most 1 + 8 + 64, turn their children in parallel.
const PARALLEL: usize = 3;

/// The largest of some triangles, and the length of its normal, which is twice its area.
#[derive(Clone, Copy)]
struct Largest {
    size: f64,
    id: u32,
}

impl Largest {
    /// No triangle.
    const NONE: Self = Self { size: 0.0, id: 0 };

    /// The larger of two triangles; of equal ones that with the smaller id.
    fn or(self, other: Self) -> Self {
        if other.size > self.size || other.size == self.size && other.id < self.id {
            other
        } else {
            self
        }
    }
}

/// Quantities of a subtree that its parent needs.
struct Below {
    /// Its triangles.
    ids: Vec<u32>,
    /// Their heights along the rows of the fixed set.
    heights: Heights,
    largest: Largest,
    /// Cost of entering its root: of a step, or of a leaf.
    price: f64,
    /// Its turned nodes.
    turns: Vec<Turn>,
}

/// A rotation for a node, the intervals of its children along the rows, and the cost of the node.
struct Choice {
    rotation: Rotation,
    extents: Vec<[[f64; 2]; 3]>,
    cost: f64,
}

/// The choice of rotations for a tree of axis-aligned boxes.
pub struct Turning<'a> {
    /// The triangles.
    pub scene: &'a Triangles,
    /// The frame of the tree.
    pub frame: &'a Frame,
    /// Its leaves.
    pub leaves: &'a Blocks,
    /// Its nodes.
    pub boxes: &'a BoxTree<WIDTH>,
    /// Costs of a step along the axes and of leaves.
    pub costs: Costs,
    /// Cost of a step through a turned node.
    pub oblique_step: f32,
    /// Whether the rotation of each node's largest triangle is tried.
    pub own: bool,
    /// The fixed set of rotations.
    pub fixed: &'a Rows,
    /// Receives progress; limits memory.
    pub monitor: &'a Monitor,
}

impl Turning<'_> {
    /// All turned nodes, in an order that does not depend on the number of threads.
    ///
    /// # Errors
    /// Those of [`Monitor::check`] and [`Monitor::take`].
    pub fn all(&self) -> Result<Vec<Turn>> {
        if !self.own && self.fixed.rotations.is_empty() {
            self.monitor.advance(1.0);
            return Ok(Vec::new());
        }
        let below = self.node(0, 0)?;
        self.monitor.take(size_of_val(&*below.turns))?;
        Ok(below.turns)
    }

    fn corners(&self, id: u32) -> [Vec3; 3] {
        self.scene.corners(id).map(|p| widen(self.frame.point(p)))
    }

    fn leaf(&self, link: u32, count: usize) -> Below {
        let ids = self.leaves.ids(link, count);
        let mut heights = self.fixed.nothing();
        let mut largest = Largest::NONE;
        for &id in &ids {
            let [a, b, c] = self.corners(id);
            for p in [a, b, c] {
                self.fixed.grow(&mut heights, p);
            }
            let size = length(cross(sub(b, a), sub(c, a)));
            largest = largest.or(Largest { size, id });
        }
        self.monitor
            .advance(count as f64 / self.scene.live().len() as f64);
        Below {
            ids: if self.own { ids } else { Vec::new() },
            heights,
            largest,
            price: f64::from(self.costs.leaf(count as f32)),
            turns: Vec::new(),
        }
    }

    /// Chooses the rotations of a node and of all nodes below it.
    fn node(&self, place: u32, depth: usize) -> Result<Below> {
        // Visit the children, in parallel near the root.
        self.monitor.check()?;
        let node = &self.boxes.nodes[place as usize];
        let lanes: Vec<_> = (0..WIDTH).filter(|&lane| node.count[lane] != 0).collect();
        let child = |&lane: &usize| match (node.link[lane], node.count[lane]) {
            (link, box_tree::INNER) => self.node(link, depth + 1),
            (link, count) => Ok(self.leaf(link, count as usize)),
        };
        let children: Vec<Below> = if depth < PARALLEL {
            lanes.par_iter().map(child).collect::<Result<_>>()?
        } else {
            lanes.iter().map(child).collect::<Result<_>>()?
        };
        let bounds: Vec<_> = lanes.iter().map(|&lane| self.box_of(place, lane)).collect();
        let (choice, price) = self.choose(&bounds, &children);

        // Join the quantities of the children for the parent.
        let mut whole = Below {
            ids: Vec::with_capacity(children.iter().map(|child| child.ids.len()).sum()),
            heights: self.fixed.nothing(),
            largest: Largest::NONE,
            price,
            turns: Vec::new(),
        };
        for child in children {
            whole.ids.extend(child.ids);
            whole.heights.join(&child.heights);
            whole.largest = whole.largest.or(child.largest);
            whole.turns.extend(child.turns);
        }
        if let Some(choice) = choice {
            whole.turns.push(self.turn(place, &lanes, &choice));
        }
        Ok(whole)
    }

    fn box_of(&self, place: u32, lane: usize) -> Aabb {
        let bounds = &self.boxes.nodes[place as usize].bounds;
        Aabb {
            min: [0, 1, 2].map(|k: usize| bounds[k][lane]),
            max: [3, 4, 5].map(|k: usize| bounds[k][lane]),
        }
    }

    /// The rotation that makes a node cheaper than the axes do, if there is one, and the price of a step through it.
    fn choose(&self, bounds: &[Aabb], children: &[Below]) -> (Option<Choice>, f64) {
        // Compute the cost with the axes; `turned` computes that with a rotation.
        let whole = bounds
            .iter()
            .fold(Aabb::EMPTY, |all, b| all.union(b))
            .area();
        let [step, oblique] = [self.costs.step, self.oblique_step].map(f64::from);
        let below = bounds
            .iter()
            .zip(children)
            .map(|(b, child)| b.area() * child.price);
        let aligned = step * whole + below.sum::<f64>();
        let turned = |rotation: Rotation, extents: Vec<[[f64; 2]; 3]>| {
            let below = extents
                .iter()
                .zip(children)
                .map(|(e, child)| area(e) * child.price);
            let cost = oblique * whole + below.sum::<f64>();
            Choice {
                rotation,
                extents,
                cost,
            }
        };
        // Try the rotation of the largest triangle, which takes a pass over all vertices, then the fixed set.
        let largest = children
            .iter()
            .fold(Largest::NONE, |known, child| known.or(child.largest));
        let own = (self.own && largest.size > 0.0)
            .then(|| to_triangle(self.corners(largest.id)))
            .flatten();
        let own = own.map(|rotation| {
            let extents = children
                .iter()
                .map(|child| self.extents(&rotation, &child.ids));
            turned(rotation, extents.collect())
        });
        let fixed = self
            .fixed
            .rotations
            .iter()
            .enumerate()
            .map(|(i, rotation)| {
                let extents = children.iter().map(|child| child.heights.of(i));
                turned(*rotation, extents.collect())
            });
        let best =
            (own.into_iter().chain(fixed)).reduce(|a, b| if b.cost < a.cost { b } else { a });
        match best {
            Some(choice) if choice.cost < aligned => (Some(choice), oblique),
            _ => (None, step),
        }
    }

    /// The intervals of heights of some triangles along three rows.
    fn extents(&self, rotation: &Rotation, ids: &[u32]) -> [[f64; 2]; 3] {
        let rows = [0, 1, 2].map(|k: usize| widen(rotation.row(k)));
        let mut extents = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for &id in ids {
            for p in self.corners(id) {
                for (row, [low, high]) in rows.iter().zip(&mut extents) {
                    let height = dot(*row, p);
                    *low = low.min(height);
                    *high = high.max(height);
                }
            }
        }
        extents
    }

    /// The bounds of a turned node's children, rounded outwards.
    fn turn(&self, place: u32, lanes: &[usize], choice: &Choice) -> Turn {
        let mut bounds = BoxTree::<WIDTH>::BLANK.bounds;
        let magnitude = self.frame.bounds().magnitude();
        for (&lane, extents) in lanes.iter().zip(&choice.extents) {
            for (k, [low, high]) in extents.iter().enumerate() {
                [bounds[k][lane], bounds[3 + k][lane]] = outwards(*low, *high, magnitude);
            }
        }
        Turn {
            node: place,
            rotation: choice.rotation,
            bounds,
        }
    }
}

/// The surface of a box with these intervals.
fn area(extents: &[[f64; 2]; 3]) -> f64 {
    let [x, y, z] = extents.map(|[low, high]| high - low);
    2.0 * (x * y + y * z + z * x)
}
