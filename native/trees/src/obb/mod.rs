// SPDX-License-Identifier: GPL-3.0-or-later
//! Oriented bounding boxes: the hierarchy of `bvh-sah`, whose nodes are then turned to their triangles. The topology
//! does not change, so the two differ by the boxes alone.
//!
//! From the bottom up, each node takes the rotation that is cheapest by the surface area heuristic. With `A` the
//! surface of the node's own axis-aligned box, `A_c` that of a child's box in the rotation, and `C_c` the price of
//! entering that child (of its step, or of its leaf), the node costs `step A + sum A_c C_c`. The step of a turned node
//! is dearer, since the ray has to be rotated.
//!
//! Candidates are the axes, the largest triangle below the node (its plane and its longest edge), and a fixed set
//! that covers all orientations of a box: the quaternions `(4, i, j, k)` with `i`, `j`, `k` from -1 to 1. A box looks
//! the same after 24 rotations, so its orientations are the Rodrigues vectors of components up to `tan(pi / 8)`, about
//! 0.41; the set has the components 0 and 1/4, of either sign. Heights along these rows are merged from child to
//! parent, so each vertex is multiplied with them once.

use crate::bih;
use crate::objects;
use crate::params;
use crate::ways::only_singly;
use halfspace_base::error::Result;
use halfspace_base::monitor::Monitor;
use halfspace_builders::object;
use halfspace_geom::Aabb;
use halfspace_geom::vec3::{Vec3, cross, dot, length, sub, widen};
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::leaves::Leaves;
use halfspace_nodes::box_tree::{self, BoxTree};
use halfspace_nodes::cost::Costs;
use halfspace_nodes::obb_tree::{ObbTree, Rotation, Turn, WIDTH, outwards};
use halfspace_ray::frame::Frame;
use halfspace_scene::triangles::Triangles;
use halfspace_structure::row::{Group, Kind, Need, Only, ParamSpec, StructureSpec, named};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::Way;
use halfspace_structure::{Built, Plan};
use halfspace_trace::single::objects::obb::oriented_boxes;
use rayon::prelude::*;
use std::sync::Arc;

const COSTS: Costs = Costs::BOXES;

/// Number of rotations in the fixed set.
const FIXED: usize = 26;

/// Nodes above this depth, at most 1 + 8 + 64, turn their children in parallel.
const PARALLEL: usize = 3;

const WAYS: [Way; 1] = only_singly("boxes");

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "obb",
    code: 31,
    label: "Oriented boxes",
    family: "objects",
    summary: "The boxes of bvh-sah, those of each node's children turned together to fit their triangles.",
    paper: "Vitsas, Evangelou, Papaioannou and Gkaravelis 2023, Parallel transformation of bounding volume hierarchies \
            into oriented bounding box trees; DOBB-BVH 2025, arXiv 2506.22849, for one rotation per node",
    params: &[
        FRAMES,
        LEAVES,
        params::ROBUST,
        params::step_cost(COSTS),
        OBLIQUE_STEP,
        params::leaf_cost(COSTS),
        params::triangle_cost(COSTS),
        params::LEAF_MAX,
    ],
    ways: &WAYS,
    build,
};

const FRAMES: ParamSpec = ParamSpec {
    name: "frames",
    label: "Rotations",
    doc: "Rotations tried at each node: 1 is the axes alone, 2 adds the largest triangle's own, more add up to 26 \
          fixed ones, first those about one axis. More finds closer boxes and builds longer",
    unit: "rotations",
    kind: Kind::Integer {
        min: 1,
        max: 2 + FIXED as i64,
    },
    default: Value::Integer(2 + FIXED as i64),
    group: Group::Main,
    needs: &[],
};

const LEAVES: ParamSpec = ParamSpec {
    doc: "corners: leaves hold copies of the corners, ready for the test. indices: they name triangles and corners, \
          less than half the memory",
    kind: Kind::Choice(&[
        named("corners", "Corner Copies"),
        named("indices", "Indices"),
    ]),
    default: Value::Choice("corners"),
    ..bih::LEAVES
};

const OBLIQUE_STEP: ParamSpec = ParamSpec {
    name: "oblique_step_cost",
    label: "Turned Step Cost",
    doc: "Cost of a step through a turned node. More leaves more nodes along the axes",
    unit: "",
    kind: Kind::Float { min: 0.0, max: 1e6 },
    default: Value::Float(12.0),
    group: Group::Costs,
    needs: &[Need {
        key: "frames",
        only: Only::Above(1.0),
    }],
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let policy = params::surface_area(config, COSTS);
    // Build the hierarchy of axis-aligned boxes.
    let binary = monitor.during(0.5, || object::build(scene, &frame, &policy, monitor))?;
    let mut leaves = Leaves::new(params::keep(config));
    let boxes = BoxTree::<WIDTH>::new(&binary, &mut leaves)?;
    let leaves = Arc::new(leaves.write(scene, &frame, &binary.ids));
    drop(binary);

    // Choose the rotation of each node, and turn the boxes.
    let frames = config.integer("frames");
    let turning = Turning {
        scene,
        frame: &frame,
        leaves: &leaves,
        boxes: &boxes,
        costs: policy.costs,
        oblique_step: config.float("oblique_step_cost"),
        own: frames > 1,
        fixed: &Rows::new(&fixed()[..frames.saturating_sub(2)]),
        monitor,
    };
    let turns = monitor.during(0.5, || turning.all())?;
    let tree = Arc::new(ObbTree::new(boxes, &turns));

    let shape = tree.shape(frame.bounds());
    let plan = Plan::single("boxes", "ordered", oriented_boxes(&tree, &leaves));
    let mut built = objects::built(config, frame, tree, leaves, plan, shape);
    if frames > 1 && shape.nodes_oblique == 0 && !scene.live().is_empty() {
        let reason = "turned boxes: those along the axes were cheapest at every node";
        built.left_out.push(reason.to_owned());
    }
    Ok(built)
}

/// The fixed set: first the rotations about one axis, then those about diagonals of faces, then of the cube.
fn fixed() -> Vec<Rotation> {
    let steps = || -1..=1_i8;
    let all = steps().flat_map(|i| steps().flat_map(move |j| steps().map(move |k| [i, j, k])));
    let turned = |v: &[i8; 3]| v.iter().filter(|x| **x != 0).count();
    let mut vectors: Vec<_> = all.filter(|v| turned(v) > 0).collect();
    vectors.sort_by_key(turned);
    vectors.into_iter().map(by_quaternion).collect()
}

/// The rotation by the quaternion `(4, x, y, z)`.
fn by_quaternion(v: [i8; 3]) -> Rotation {
    let (w, [x, y, z]) = (4.0, v.map(f64::from));
    let s = 2.0 / (w * w + x * x + y * y + z * z);
    rounded([
        [
            1.0 - s * (y * y + z * z),
            s * (x * y - w * z),
            s * (x * z + w * y),
        ],
        [
            s * (x * y + w * z),
            1.0 - s * (x * x + z * z),
            s * (y * z - w * x),
        ],
        [
            s * (x * z - w * y),
            s * (y * z + w * x),
            1.0 - s * (x * x + y * y),
        ],
    ])
}

/// The rotation to a triangle: its longest edge, the direction across that in its plane, and its normal. `None` for one
/// so small or so narrow that f64 finds no normal.
fn to_triangle([a, b, c]: [Vec3; 3]) -> Option<Rotation> {
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let longest = edges
        .into_iter()
        .reduce(|e, f| if length(f) > length(e) { f } else { e })?;
    let along = unit(longest)?;
    let normal = unit(cross(edges[0], edges[1]))?;
    let across = unit(cross(normal, along))?;
    Some(rounded([along, across, cross(along, across)]))
}

fn unit(v: Vec3) -> Option<Vec3> {
    let size = length(v);
    (size.is_normal()).then(|| v.map(|x| x / size))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "bounds hold for the rows as rounded"
)]
fn rounded(rows: [Vec3; 3]) -> Rotation {
    Rotation::new(rows.map(|row| row.map(|x| x as f32)))
}

/// The rows of some rotations, component by component, for vectors of several heights.
struct Rows {
    rotations: Vec<Rotation>,
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Rows {
    fn new(rotations: &[Rotation]) -> Self {
        let component = |i: usize| {
            let rows = rotations
                .iter()
                .flat_map(|r| [r.row(0), r.row(1), r.row(2)]);
            rows.map(|row| f64::from(row[i])).collect()
        };
        Self {
            rotations: rotations.to_vec(),
            x: component(0),
            y: component(1),
            z: component(2),
        }
    }

    /// The heights of no points.
    fn nothing(&self) -> Heights {
        Heights {
            low: vec![f64::INFINITY; self.x.len()],
            high: vec![f64::NEG_INFINITY; self.x.len()],
        }
    }

    /// Extends intervals of heights to those of a point.
    fn grow(&self, heights: &mut Heights, [x, y, z]: Vec3) {
        let rows = self.x.iter().zip(&self.y).zip(&self.z);
        let ends = heights.low.iter_mut().zip(&mut heights.high);
        for (((a, b), c), (low, high)) in rows.zip(ends) {
            let height = a * x + b * y + c * z;
            *low = if height < *low { height } else { *low };
            *high = if height > *high { height } else { *high };
        }
    }
}

/// Intervals of heights along the rows of some rotations, in f64.
#[derive(Clone)]
struct Heights {
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Heights {
    fn join(&mut self, other: &Self) {
        for (low, x) in self.low.iter_mut().zip(&other.low) {
            *low = low.min(*x);
        }
        for (high, x) in self.high.iter_mut().zip(&other.high) {
            *high = high.max(*x);
        }
    }

    /// The intervals along the three rows of rotation `i`.
    fn of(&self, i: usize) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|k: usize| [self.low[3 * i + k], self.high[3 * i + k]])
    }
}

/// What a subtree hands up to its parent.
struct Below {
    /// Its triangles.
    ids: Vec<u32>,
    /// Their heights along the rows of the fixed set.
    heights: Heights,
    /// Its largest triangle: area and id.
    largest: (f64, u32),
    /// Cost of entering its root: of a step, or of a leaf.
    price: f64,
    /// Its turned nodes.
    turns: Vec<Turn>,
}

/// A rotation for a node, the intervals of its children along the rows, and the cost: price times surface.
struct Choice {
    rotation: Rotation,
    extents: Vec<[[f64; 2]; 3]>,
    cost: f64,
}

/// The choice of rotations for a tree of axis-aligned boxes.
struct Turning<'a> {
    scene: &'a Triangles,
    frame: &'a Frame,
    leaves: &'a Blocks,
    boxes: &'a BoxTree<WIDTH>,
    costs: Costs,
    oblique_step: f32,
    /// Whether the largest triangle's rotation is tried.
    own: bool,
    fixed: &'a Rows,
    monitor: &'a Monitor,
}

impl Turning<'_> {
    /// All turned nodes, in an order that does not depend on the number of threads.
    fn all(&self) -> Result<Vec<Turn>> {
        if !self.own {
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
        let mut largest = (0.0, 0);
        for &id in &ids {
            let [a, b, c] = self.corners(id);
            for p in [a, b, c] {
                self.fixed.grow(&mut heights, p);
            }
            largest = larger(largest, (length(cross(sub(b, a), sub(c, a))), id));
        }
        self.monitor
            .advance(count as f64 / self.scene.live().len() as f64);
        Below {
            ids,
            heights,
            largest,
            price: f64::from(self.costs.leaf(count as f32)),
            turns: Vec::new(),
        }
    }

    fn node(&self, place: u32, depth: usize) -> Result<Below> {
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

        // Hand up what the children have together.
        let mut whole = Below {
            ids: Vec::with_capacity(children.iter().map(|child| child.ids.len()).sum()),
            heights: self.fixed.nothing(),
            largest: (0.0, 0),
            price,
            turns: Vec::new(),
        };
        for child in children {
            whole.ids.extend(child.ids);
            whole.heights.join(&child.heights);
            whole.largest = larger(whole.largest, child.largest);
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
            .fold((0.0, 0), |known, child| larger(known, child.largest));
        let (size, id) = largest;
        let own = (size > 0.0)
            .then(|| to_triangle(self.corners(id)))
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

/// The larger of two triangles, by area; of equal ones that with the smaller id.
fn larger(a: (f64, u32), b: (f64, u32)) -> (f64, u32) {
    if b.0 > a.0 || b.0 == a.0 && b.1 < a.1 {
        b
    } else {
        a
    }
}

/// The surface of a box with these intervals.
fn area(extents: &[[f64; 2]; 3]) -> f64 {
    let [x, y, z] = extents.map(|[low, high]| high - low);
    2.0 * (x * y + y * z + z * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles_are_right(rotation: &Rotation) -> bool {
        let rows = [0, 1, 2].map(|k: usize| widen(rotation.row(k)));
        rotation.is_sound()
            && (0..3).all(|i| {
                let (same, next) = (dot(rows[i], rows[i]), dot(rows[i], rows[(i + 1) % 3]));
                (same - 1.0).abs() < 1e-6 && next.abs() < 1e-6
            })
    }

    #[test]
    fn the_fixed_set_holds_rotations_that_differ() {
        let all = fixed();
        assert_eq!(all.len(), FIXED);
        for (i, rotation) in all.iter().enumerate() {
            assert!(angles_are_right(rotation), "{rotation:?}");
            assert!(*rotation != Rotation::AXES && !all[..i].contains(rotation));
        }
    }

    #[test]
    fn a_triangle_lies_flat_in_its_own_rotation() {
        let corners = [[1.0, 2.0, 3.0], [7.0, 2.5, 5.0], [3.0, 6.0, 4.0]];
        let rotation = to_triangle(corners).unwrap();
        assert!(angles_are_right(&rotation));
        let heights = corners.map(|p| dot(widen(rotation.row(2)), p));
        assert!(heights.iter().all(|h| (h - heights[0]).abs() < 1e-5));
        assert!(to_triangle([corners[0]; 3]).is_none());
    }
}
