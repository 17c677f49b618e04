// SPDX-License-Identifier: GPL-3.0-or-later
//! [`Tree`] and [`Cells`] for interval hierarchies of oblique planes.

use super::slant_tree::{SlantKind, SlantTree};
use super::slanted_tree::direction;
use crate::cells::{Cells, NodeId, NodeView, OBLIQUE, SLAB};
use crate::check;
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::Plane;
use halfspace_geom::region::Region;

impl Tree for SlantTree {
    fn bytes(&self) -> usize {
        SlantTree::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        let nodes = (0..u32::try_from(self.node_count()).expect("links are 32 bits wide"))
            .map(|index| self.kind(index));
        for kind in nodes {
            if let SlantKind::Leaf { first, count } = kind {
                see(first, count);
            }
        }
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::slanted::slanted(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A node is named by its index.
impl Cells for SlantTree {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        ([0; 4], Region::of_scene(bounds))
    }

    fn node(&self, [index, ..]: NodeId, region: &Region) -> NodeView {
        let (k, has_one_child, planes, link) = match self.kind(index) {
            SlantKind::Leaf { first, count } => return NodeView::leaf(first, count),
            SlantKind::Inner {
                direction,
                alone,
                planes,
                link,
            } => (direction, alone, planes, link),
        };
        let planes = planes.map(|offset| Plane {
            direction: direction(k),
            offset,
        });
        // Cut the region of each child: an only child lies between the planes, others below the first and above the
        // second.
        let children = if has_one_child {
            let [_, above] = region.split(planes[0]);
            let [inside, _] = above.split(planes[1]);
            vec![([link, 0, 0, 0], inside)]
        } else {
            let ([below, _], [_, above]) = (region.split(planes[0]), region.split(planes[1]));
            vec![([link, 0, 0, 0], below), ([link + 1, 0, 0, 0], above)]
        };
        let kind = if k < 3 { SLAB } else { OBLIQUE };
        NodeView {
            planes: planes.map(|plane| (plane, kind)).to_vec(),
            children,
            ..NodeView::default()
        }
    }
}
