// SPDX-License-Identifier: GPL-3.0-or-later
//! Surfaces that lie on each other, and the order in which a ray passes them.
//!
//! A tracer returns one of the triangles that a ray meets at one f32 distance, that with the smallest number. Where rays
//! pass surfaces, all of them count, in this order: by exact distance; at the same place as if a vanishing gap lay between
//! the bodies, so first the surfaces that the ray leaves through their backs, then those that it enters; of several that
//! it enters by their numbers, and of several that it leaves in the reverse order, so that a ray the other way passes
//! them in reverse.

use std::cmp::Ordering;
use std::collections::HashMap;

use crate::scene::RenderScene;
use crate::scene::facet::Facet;
use halfspace_geom::vec3::{cross, dot, length, map, sub, widen};
use halfspace_geom::verdict::verdict_within;
use halfspace_ray::{Hit, Ray, Tracer};

/// Largest gap between surfaces that rays may meet at the same f32 distance, relative to the largest coordinate of the
/// scene: rays are up to four times as long, and their distances round by half a unit.
const GAP: f64 = 4.0 * f32::EPSILON as f64;

/// Largest sine of the angle between surfaces that lie on each other (chosen); others meet in a line.
const STEEP: f64 = 0.01;

/// Depth of an overlap in the plane, relative to the triangles, below which neighbours only touch.
const DEPTH: f64 = 1e-7;

/// Largest number of pairs (chosen): 128 MiB.
const MOST_PAIRS: usize = 1 << 24;

/// Number of triangles in a leaf of the tree of boxes (chosen).
const LEAF: usize = 4;

/// Number of triangles from which parts of the tree are handled by several threads (chosen).
const TASK: usize = 4096;

/// The triangles that lie on one, sorted along an axis.
struct Partners {
    axis: usize,
    /// Largest extent along the axis.
    reach: f32,
    /// Smallest coordinate along the axis, and number, of each.
    each: Box<[(f32, u32)]>,
}

/// For each triangle the triangles that lie on it.
pub struct Touching {
    of: HashMap<u32, Partners>,
    gap: f32,
}

/// A triangle in the search for pairs.
#[derive(Clone, Copy)]
struct Item {
    id: u32,
    passable: bool,
    low: [f32; 3],
    high: [f32; 3],
}

/// A node of the tree of boxes.
struct Node<'a> {
    low: [f32; 3],
    high: [f32; 3],
    /// Whether a ray passes any of the triangles.
    passable: bool,
    items: &'a [Item],
    children: Option<Box<[Node<'a>; 2]>>,
}

/// Where a line crosses a triangle.
#[derive(Clone, Copy)]
struct Crossing {
    t: f64,
    bound: f64,
    leaves: bool,
    hit: Hit,
}

impl Touching {
    /// Finds the pairs of triangles that lie on each other, of which rays pass at least one; `None` without any.
    /// `passable`: whether rays pass a triangle. Takes O(n log n) for n triangles without pairs.
    pub fn find(
        tracer: &dyn Tracer,
        ids: impl Iterator<Item = u32>,
        passable: impl Fn(u32) -> bool,
    ) -> Option<Self> {
        let mut items: Vec<Item> = ids
            .map(|id| {
                let corners = tracer.corners(id);
                let each = |f: fn(f32, f32) -> f32| {
                    [0, 1, 2].map(|k| f(f(corners[0][k], corners[1][k]), corners[2][k]))
                };
                Item {
                    id,
                    passable: passable(id),
                    low: each(f32::min),
                    high: each(f32::max),
                }
            })
            .collect();
        if !items.iter().any(|item| item.passable) {
            return None;
        }
        let far = |most: f32, x: &f32| most.max(x.abs());
        let size = items
            .iter()
            .flat_map(|item| item.low.iter().chain(&item.high))
            .fold(0.0, far);
        let gap = (GAP * f64::from(size)) as f32;
        let root = Node::new(&mut items);
        let search = Search { tracer, gap };
        let mut pairs = Vec::new();
        search.within(&root, &mut pairs);
        let mut of: HashMap<u32, Vec<u32>> = HashMap::new();
        for [a, b] in pairs {
            of.entry(a).or_default().push(b);
            of.entry(b).or_default().push(a);
        }
        (!of.is_empty()).then(|| Self {
            of: of
                .into_iter()
                .map(|(id, partners)| (id, Partners::new(tracer, &partners)))
                .collect(),
            gap,
        })
    }
}

impl Partners {
    fn new(tracer: &dyn Tracer, ids: &[u32]) -> Self {
        let corners: Vec<_> = ids.iter().map(|&id| tracer.corners(id)).collect();
        let span = |k: usize, of: &[[[f32; 3]; 3]]| {
            let all = of.as_flattened().iter().map(|v| v[k]);
            let [low, high] = all.fold([f32::MAX, f32::MIN], |[a, b], x| [a.min(x), b.max(x)]);
            (low, high - low)
        };
        let wider = |&a: &usize, &b: &usize| span(a, &corners).1.total_cmp(&span(b, &corners).1);
        let axis = (0..3).max_by(wider).expect("three axes");
        let own = |one: &[[f32; 3]; 3]| span(axis, std::slice::from_ref(one));
        let reach = corners.iter().map(|one| own(one).1).fold(0.0, f32::max);
        let mut each: Vec<_> = ids
            .iter()
            .zip(&corners)
            .map(|(&id, one)| (own(one).0, id))
            .collect();
        each.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self {
            axis,
            reach,
            each: each.into(),
        }
    }

    /// Returns those that a point may lie on, up to `gap`.
    fn at(&self, point: [f64; 3], gap: f32) -> impl Iterator<Item = u32> + '_ {
        let x = point[self.axis] as f32;
        let slack = 2.0 * gap;
        let begin = self
            .each
            .partition_point(|one| one.0 < x - self.reach - slack);
        let found = self.each[begin..]
            .iter()
            .take_while(move |one| one.0 <= x + slack);
        found.map(|one| one.1)
    }
}

impl<'a> Node<'a> {
    fn new(items: &'a mut [Item]) -> Self {
        let mut low = [f32::MAX; 3];
        let mut high = [f32::MIN; 3];
        for item in &*items {
            for k in 0..3 {
                low[k] = low[k].min(item.low[k]);
                high[k] = high[k].max(item.high[k]);
            }
        }
        let passable = items.iter().any(|item| item.passable);
        if items.len() <= LEAF {
            return Self {
                low,
                high,
                passable,
                items,
                children: None,
            };
        }
        let wider = |&a: &usize, &b: &usize| (high[a] - low[a]).total_cmp(&(high[b] - low[b]));
        let axis = (0..3).max_by(wider).expect("three axes");
        let middle = items.len() / 2;
        let centre = |item: &Item| 0.5 * item.low[axis] + 0.5 * item.high[axis];
        items.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)));
        let many = items.len() > TASK;
        let (left, right) = items.split_at_mut(middle);
        let (left, right) = if many {
            rayon::join(|| Self::new(left), || Self::new(right))
        } else {
            (Self::new(left), Self::new(right))
        };
        Self {
            low,
            high,
            passable,
            items: &[],
            children: Some(Box::new([left, right])),
        }
    }
}

/// The search for pairs.
struct Search<'a> {
    tracer: &'a dyn Tracer,
    gap: f32,
}

impl Search<'_> {
    /// Whether two boxes are closer than the gap.
    fn near(&self, a: [[f32; 3]; 2], b: [[f32; 3]; 2]) -> bool {
        (0..3).all(|k| a[0][k] - self.gap <= b[1][k] && b[0][k] - self.gap <= a[1][k])
    }

    /// Adds the pairs within a node.
    fn within(&self, node: &Node<'_>, pairs: &mut Vec<[u32; 2]>) {
        if !node.passable {
            return;
        }
        let Some([left, right]) = node.children.as_deref() else {
            for (i, a) in node.items.iter().enumerate() {
                node.items[i + 1..]
                    .iter()
                    .for_each(|b| self.pair(a, b, pairs));
            }
            return;
        };
        self.within(left, pairs);
        self.within(right, pairs);
        self.between(left, right, pairs);
    }

    /// Adds the pairs of a triangle of each node.
    fn between(&self, a: &Node<'_>, b: &Node<'_>, pairs: &mut Vec<[u32; 2]>) {
        if !(a.passable || b.passable) || !self.near([a.low, a.high], [b.low, b.high]) {
            return;
        }
        match (a.children.as_deref(), b.children.as_deref()) {
            (Some([left, right]), _) => {
                self.between(left, b, pairs);
                self.between(right, b, pairs);
            }
            (None, Some([left, right])) => {
                self.between(a, left, pairs);
                self.between(a, right, pairs);
            }
            (None, None) => {
                for one in a.items {
                    b.items
                        .iter()
                        .for_each(|other| self.pair(one, other, pairs));
                }
            }
        }
    }

    /// Adds a pair if the triangles lie on each other.
    fn pair(&self, a: &Item, b: &Item, pairs: &mut Vec<[u32; 2]>) {
        if (a.passable || b.passable)
            && self.near([a.low, a.high], [b.low, b.high])
            && pairs.len() < MOST_PAIRS
            && self.lie_on_each_other(self.tracer.corners(a.id), self.tracer.corners(b.id))
        {
            pairs.push([a.id, b.id]);
        }
    }

    /// Whether two triangles are about parallel, not further apart than the gap, and overlap seen along their normal.
    fn lie_on_each_other(&self, a: [[f32; 3]; 3], b: [[f32; 3]; 3]) -> bool {
        let [a, b] = [a, b].map(|corners| map(corners, widen));
        let normal = |v: [[f64; 3]; 3]| cross(sub(v[1], v[0]), sub(v[2], v[0]));
        let (na, nb) = (normal(a), normal(b));
        let (la, lb) = (length(na), length(nb));
        if length(cross(na, nb)) > STEEP * la * lb {
            return false;
        }
        let gap = f64::from(self.gap);
        let heights = b.map(|v| dot(na, sub(v, a[0])) / la);
        let [low, high] = [f64::min, f64::max].map(|f| f(f(heights[0], heights[1]), heights[2]));
        if low > gap || high < -gap {
            return false;
        }
        // Project along the largest component of the normal, and look for a line that separates both.
        let size = na.map(f64::abs);
        let (i, j) = if size[0] >= size[1] && size[0] >= size[2] {
            (1, 2)
        } else if size[1] >= size[2] {
            (2, 0)
        } else {
            (0, 1)
        };
        let flat = |v: [[f64; 3]; 3]| v.map(|v| [v[i], v[j]]);
        let (fa, fb) = (flat(a), flat(b));
        [fa, fb].iter().all(|edges| {
            (0..3).all(|k| {
                let (p, q) = (edges[k], edges[(k + 1) % 3]);
                let along = [p[1] - q[1], q[0] - p[0]];
                let span = |v: [[f64; 2]; 3]| {
                    let x = v.map(|v| along[0] * (v[0] - p[0]) + along[1] * (v[1] - p[1]));
                    [x[0].min(x[1]).min(x[2]), x[0].max(x[1]).max(x[2])]
                };
                let ([a0, a1], [b0, b1]) = (span(fa), span(fb));
                let depth = a1.min(b1) - a0.max(b0);
                depth > DEPTH * (a1 - a0).min(b1 - b0)
            })
        })
    }
}

impl Crossing {
    /// The crossing of a ray's line with a triangle, if there is one.
    fn of(tracer: &dyn Tracer, ray: &Ray, triangle: u32) -> Option<Self> {
        let corners = tracer.corners(triangle);
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        let found = verdict_within(ray.o, ray.d, corners, all)?;
        let hit = Hit {
            t: found.t,
            triangle,
            u: found.u,
            v: found.v,
        };
        Some(Self::at(corners, ray, hit))
    }

    /// The crossing with a plane.
    fn at(corners: [[f32; 3]; 3], ray: &Ray, hit: Hit) -> Self {
        let facet = Facet::new(corners, [0.0; 3], None);
        let [t, bound] = facet.crossing(ray.o, ray.d);
        let leaves = dot(facet.normal, widen(ray.d)) > 0.0;
        Self {
            t,
            bound,
            leaves,
            hit,
        }
    }

    /// Whether the ray passes this triangle before the other.
    fn precedes(&self, other: &Self) -> bool {
        let (own, others) = (self.hit.triangle, other.hit.triangle);
        if (self.t - other.t).abs() > self.bound + other.bound {
            return self.t < other.t;
        }
        let order = match (self.leaves, other.leaves) {
            (true, true) => others.cmp(&own),
            (false, false) => own.cmp(&others),
            (true, false) => Ordering::Less,
            (false, true) => Ordering::Greater,
        };
        order == Ordering::Less
    }
}

impl RenderScene {
    /// Returns the surface that a ray meets first, of all that it meets at the distance of the nearest hit. `left`: the
    /// triangle that the ray has left, or [`Hit::NONE`]: those on it that follow are still ahead.
    #[inline(always)]
    pub fn first(&self, ray: &Ray, hit: Hit, left: u32) -> Hit {
        match &self.touching {
            None => hit,
            Some(touching) => touching.first(&*self.tracer, ray, hit, left),
        }
    }

    /// Whether surfaces lie on each other, so that [`Self::first`] may differ from the nearest hit.
    pub fn touches(&self) -> bool {
        self.touching.is_some()
    }
}

impl Touching {
    fn first(&self, tracer: &dyn Tracer, ray: &Ray, hit: Hit, left: u32) -> Hit {
        if left != Hit::NONE
            && let Some(ahead) = self.ahead(tracer, ray, left)
        {
            return ahead;
        }
        let Some(partners) = self.of.get(&hit.triangle) else {
            return hit;
        };
        // Compare all that the ray meets at this distance.
        let corners = tracer.corners(hit.triangle);
        let mut best = Crossing::at(corners, ray, hit);
        let point = [0, 1, 2].map(|k| f64::from(ray.o[k]) + best.t * f64::from(ray.d[k]));
        for id in partners.at(point, self.gap) {
            if let Some(other) = Crossing::of(tracer, ray, id)
                && other.hit.t == hit.t
                && other.precedes(&best)
            {
                best = other;
            }
        }
        best.hit
    }

    /// Returns the first triangle on the one that the ray has left that is still ahead, though the ray's interval begins
    /// behind it.
    fn ahead(&self, tracer: &dyn Tracer, ray: &Ray, left: u32) -> Option<Hit> {
        let partners = self.of.get(&left)?;
        let corners = tracer.corners(left);
        let here = Crossing::at(
            corners,
            ray,
            Hit {
                triangle: left,
                ..Hit::MISS
            },
        );
        let point = [0, 1, 2].map(|k| f64::from(ray.o[k]) + here.t * f64::from(ray.d[k]));
        let mut best: Option<Crossing> = None;
        for id in partners.at(point, self.gap) {
            if let Some(other) = Crossing::of(tracer, ray, id)
                && other.hit.t < ray.t_min
                && here.precedes(&other)
                && best.is_none_or(|best| other.precedes(&best))
            {
                best = Some(other);
            }
        }
        // Distances count from the beginning of the interval.
        best.map(|found| Hit {
            t: ray.t_min,
            ..found.hit
        })
    }
}
