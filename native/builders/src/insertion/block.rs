// SPDX-License-Identifier: GPL-3.0-or-later
//! The children of a node during insertion.

use halfspace_geom::Aabb;

/// Number of children of a block.
pub const WIDEST: usize = 8;

/// Up to eight children of a node, with their boxes as structure of arrays. Further children of the node are in further
/// blocks.
#[derive(Debug, Clone)]
pub struct Block {
    low: [[f32; WIDEST]; 3],
    high: [[f32; WIDEST]; 3],
    /// The node or the object of each child.
    pub link: [u32; WIDEST],
    /// Number of objects in the subtree of each child.
    pub objects: [u32; WIDEST],
    /// Number of children in this block.
    pub len: usize,
    /// The next block of the same node; 0 for none.
    pub next: u32,
}

impl Block {
    /// Block without children.
    pub const EMPTY: Self = Self {
        low: [[f32::INFINITY; WIDEST]; 3],
        high: [[f32::NEG_INFINITY; WIDEST]; 3],
        link: [0; WIDEST],
        objects: [0; WIDEST],
        len: 0,
        next: 0,
    };

    /// Returns the box of a child.
    pub fn bounds(&self, lane: usize) -> Aabb {
        Aabb {
            min: [0, 1, 2].map(|k| self.low[k][lane]),
            max: [0, 1, 2].map(|k| self.high[k][lane]),
        }
    }

    /// Extends the box of a child by an object.
    pub fn grow(&mut self, lane: usize, object: &Aabb) {
        for k in 0..3 {
            self.low[k][lane] = self.low[k][lane].min(object.min[k]);
            self.high[k][lane] = self.high[k][lane].max(object.max[k]);
        }
        self.objects[lane] += 1;
    }

    /// Appends a child.
    pub fn push(&mut self, link: u32, bounds: &Aabb, objects: u32) {
        let lane = self.len;
        self.len += 1;
        self.grow(lane, bounds);
        self.link[lane] = link;
        self.objects[lane] = objects;
    }

    /// Returns half the surface areas of the children's boxes without and with the object; NaN for missing
    /// children.
    pub fn surfaces(&self, object: &Aabb) -> ([f32; WIDEST], [f32; WIDEST]) {
        let (mut old, mut new) = ([0.0; WIDEST], [0.0; WIDEST]);
        for lane in 0..WIDEST {
            // Area of the child's box.
            let side = |k: usize| self.high[k][lane] - self.low[k][lane];
            old[lane] = surface([side(0), side(1), side(2)]);
            // Area of the box with the object. Written with comparisons, which compile to single instructions.
            let side = |k: usize| {
                let (low, high) = (self.low[k][lane], self.high[k][lane]);
                let low = if object.min[k] < low {
                    object.min[k]
                } else {
                    low
                };
                let high = if object.max[k] > high {
                    object.max[k]
                } else {
                    high
                };
                high - low
            };
            new[lane] = surface([side(0), side(1), side(2)]);
        }
        (old, new)
    }
}

/// Returns half of a box's surface area, from its side lengths.
fn surface([x, y, z]: [f32; 3]) -> f32 {
    x * y + y * z + z * x
}

/// Returns half of a box's surface area; 0 for an empty box.
pub fn surface_of(bounds: &Aabb) -> f32 {
    if bounds.is_empty() {
        return 0.0;
    }
    surface([0, 1, 2].map(|k| bounds.max[k] - bounds.min[k]))
}
