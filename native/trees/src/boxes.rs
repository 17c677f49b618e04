// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversals of nodes of eight boxes: those of a box hierarchy, and those made from split planes.

use crate::leaf_tests;
use crate::ways::{Pair, Traversal, chosen, in_packets, in_streams, in_tiles, way};
use halfspace_group::{packet, tile};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_papers::alone;
use halfspace_ray::query::{Any, Closest};
use halfspace_single::objects::boxes::boxes8;
use halfspace_stream as stream;
use halfspace_stream::flight;
use halfspace_stream::order::Rule;
use halfspace_structure::Plan;
use halfspace_structure::coherence::Limits;
use halfspace_structure::footprint::Footprint;
use halfspace_structure::spec::Config;
use halfspace_structure::way::Rays;
use halfspace_trace::kernel::Kernel;
use std::sync::Arc;

/// A tree of eight boxes per node, for which a plan is made.
pub struct Boxes {
    /// The nodes. Rays in flight and streams need [`BoxTree::by_corners`]; the other traversals take any order.
    pub tree: Arc<BoxTree<8>>,
    /// The triangles of its leaves.
    pub leaves: Arc<Blocks>,
    /// The order in which any-hit streams visit the children of a node.
    pub any_order: Rule,
}

/// Makes the plan for a tree of eight boxes per node.
pub type MakePlan = fn(&Boxes) -> Plan;

/// All traversals of nodes of eight boxes.
pub const TRAVERSALS: [Traversal<MakePlan>; 9] = [
    Traversal {
        way: way(
            "boxes",
            "auto",
            "Automatic",
            Rays::Auto,
            "the quickest for each batch: few rays one by one, camera rays in tiles or packets by the size of triangles, \
             shadow rays in tiles, packets or streams by a sample, others in streams",
        ),
        plan: |boxes| {
            let tiles = tile::kernel::boxes(&boxes.tree, &boxes.leaves);
            let shadow_tiles = tile::kernel::shadow_boxes(&boxes.tree, &boxes.leaves);
            let shadow = packet::kernel::shadow_boxes(&boxes.tree, &boxes.leaves);
            let streams = stream::kernel::boxes(&boxes.tree, &boxes.leaves);
            let any = boxes.any_stream();
            let packets = packet::kernel::boxes(&boxes.tree, &boxes.leaves, 16);
            (boxes.singly().with_closest(Rays::Stream, streams))
                .with_tiles_by_footprint(tiles, packets, Footprint::BOXES)
                .with_any_by_coherence(shadow_tiles, shadow, any, Limits::BOXES)
                .with_few_singly()
        },
    },
    Traversal {
        way: way(
            "boxes",
            "ordered",
            "Nearest First",
            Rays::Single,
            "one by one, the nearest box first",
        ),
        plan: |boxes| boxes.singly(),
    },
    Traversal {
        way: way(
            "boxes",
            "flight",
            "In Flight",
            Rays::Flight,
            "several rays in turn, boxes in the order of the direction's octant, many rays in random order sorted by origin",
        ),
        plan: |boxes| {
            let closest = flight::kernel::wide_boxes(&boxes.tree, &boxes.leaves);
            let shadow = flight::kernel::shadow_wide_boxes(&boxes.tree, &boxes.leaves);
            (boxes.singly().with_closest(Rays::Flight, closest)).with_any(Rays::Flight, shadow)
        },
    },
    Traversal {
        way: in_streams("boxes"),
        plan: |boxes| {
            let streams = Pair {
                closest: stream::kernel::boxes(&boxes.tree, &boxes.leaves),
                any: boxes.any_stream(),
            };
            streams.take_all(boxes.singly(), Rays::Stream)
        },
    },
    Traversal {
        way: in_tiles("boxes"),
        plan: |boxes| {
            let tiles = tile::kernel::boxes(&boxes.tree, &boxes.leaves);
            boxes.in_tiles(tiles)
        },
    },
    Traversal {
        way: way(
            "boxes",
            "tile16",
            "Tiles of 256",
            Rays::Tile,
            "as tile, but camera rays in tiles of 256",
        ),
        plan: |boxes| {
            let tiles = tile::kernel::large_boxes(&boxes.tree, &boxes.leaves);
            boxes.in_tiles(tiles)
        },
    },
    Traversal {
        way: in_packets("boxes"),
        plan: |boxes| {
            let shadow = packet::kernel::shadow_boxes(&boxes.tree, &boxes.leaves);
            boxes.packets(16).with_any(Rays::Packet, shadow)
        },
    },
    Traversal {
        way: way(
            "boxes",
            "packet8",
            "Packets of 8",
            Rays::Packet,
            "nearest hits in packets of 8",
        ),
        plan: |boxes| boxes.packets(8),
    },
    Traversal {
        way: way(
            "boxes",
            "packet4",
            "Packets of 4",
            Rays::Packet,
            "nearest hits in packets of 4",
        ),
        plan: |boxes| boxes.packets(4),
    },
];

impl Boxes {
    /// The plan of the chosen way.
    pub fn plan(&self, config: &Config) -> Plan {
        if leaf_tests::alone(config) {
            let kernel = alone::boxes8(&self.tree, &self.leaves, config.robust());
            return Plan::single("boxes", "ordered", kernel);
        }
        (chosen(&TRAVERSALS, config.way()).plan)(self)
    }

    /// Single rays, the nearest box first.
    fn singly(&self) -> Plan {
        Plan::single("boxes", "ordered", boxes8(&self.tree, &self.leaves))
    }

    /// Any hits in streams.
    fn any_stream(&self) -> Arc<dyn Kernel<Any>> {
        stream::kernel::shadow_boxes(&self.tree, &self.leaves, self.any_order)
    }

    /// Camera rays in `tiles`, shadow rays in tiles of 64.
    fn in_tiles(&self, tiles: Arc<dyn Kernel<Closest>>) -> Plan {
        let shadow = tile::kernel::shadow_boxes(&self.tree, &self.leaves);
        (self.singly().with_tiles(Rays::Tile, tiles)).with_any(Rays::Tile, shadow)
    }

    /// Nearest hits in packets of this number of rays.
    fn packets(&self, rays: usize) -> Plan {
        let packets = packet::kernel::boxes(&self.tree, &self.leaves, rays);
        self.singly().with_closest(Rays::Packet, packets)
    }
}
