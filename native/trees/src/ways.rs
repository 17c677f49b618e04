// SPDX-License-Identifier: GPL-3.0-or-later
//! Tables of traversals: one per kind of nodes. A row has a way to send rays and the function that makes its plan. The
//! parameters `nodes` and `traversal`, their documentation and the contract tests read the rows, so a traversal that is
//! not in a table does not exist.

use crate::list::{List, equal};
use halfspace_ray::query::{Any, Closest};
use halfspace_structure::Plan;
use halfspace_structure::coherence::Limits;
use halfspace_structure::footprint::Footprint;
use halfspace_structure::row::{Group, Kind, Named, ParamSpec};
use halfspace_structure::spec::Value;
use halfspace_structure::way::{NODES, NODES_OF_PLANES, Rays, TRAVERSAL, Way};
use halfspace_trace::kernel::Kernel;
use std::sync::Arc;

/// A row: a way to send rays through nodes. `F` is the function that makes its plan.
#[derive(Debug)]
pub struct Traversal<F> {
    /// The nodes and the traversal.
    pub way: Way,
    /// Makes the plan. May derive further nodes from the tree.
    pub plan: F,
}

/// A way through `nodes`.
pub const fn way(
    nodes: &'static str,
    traversal: &'static str,
    label: &'static str,
    rays: Rays,
    doc: &'static str,
) -> Way {
    Way {
        nodes,
        traversal,
        label,
        rays,
        doc,
    }
}

/// The way of a structure whose rays can only be traced one by one, in one traversal.
pub const fn only_singly(nodes: &'static str) -> [Way; 1] {
    [way(nodes, "", "One by One", Rays::Single, "one by one")]
}

/// The ways through nodes that have one traversal of single rays, named `single`, and kernels for tiles, packets and
/// streams.
pub const fn every_way(nodes: &'static str, single: &'static str) -> [Way; 5] {
    [
        way(
            nodes,
            "auto",
            "Automatic",
            Rays::Auto,
            "the quickest for each batch: few rays one by one, camera rays in tiles or packets by the size of triangles, \
             shadow rays in tiles, packets or streams by a sample, others in streams",
        ),
        way(nodes, single, "One by One", Rays::Single, "one by one"),
        in_tiles(nodes),
        in_packets(nodes),
        in_streams(nodes),
    ]
}

/// Tiles of 64 through `nodes`.
pub const fn in_tiles(nodes: &'static str) -> Way {
    way(
        nodes,
        "tile",
        "Tiles of 64",
        Rays::Tile,
        "camera rays in tiles of 64, shadow rays of one light in tiles of 64 from the light; tiles whose rays diverge \
         are split into packets",
    )
}

/// Packets of 16 through `nodes`.
pub const fn in_packets(nodes: &'static str) -> Way {
    way(
        nodes,
        "packet",
        "Packets of 16",
        Rays::Packet,
        "packets of 16 rays, one to a lane, shadow rays too",
    )
}

/// Streams through `nodes`.
pub const fn in_streams(nodes: &'static str) -> Way {
    way(
        nodes,
        "stream",
        "Streams",
        Rays::Stream,
        "in streams, which visit each node once for all rays that meet it",
    )
}

/// The kernels of one way of sending rays.
pub struct Pair {
    /// Nearest hits.
    pub closest: Arc<dyn Kernel<Closest>>,
    /// Any hits.
    pub any: Arc<dyn Kernel<Any>>,
}

impl Pair {
    /// Sends all rays to these kernels.
    pub fn take_all(self, plan: Plan, rays: Rays) -> Plan {
        (plan.with_closest(rays, self.closest)).with_any(rays, self.any)
    }
}

/// The kernels of rays that go through a tree together.
pub struct Together {
    /// Tiles of 64.
    pub tiles: Pair,
    /// Packets of 16.
    pub packets: Pair,
    /// Streams.
    pub streams: Pair,
}

/// Makes the kernels of [`Together`] by the names that they have in packets, tiles and streams.
macro_rules! together {
    ($tree:expr, $leaves:expr, $closest:ident, $shadow:ident) => {{
        use halfspace_group::{packet, tile};
        use halfspace_stream as stream;
        $crate::ways::Together {
            tiles: $crate::ways::Pair {
                closest: tile::kernel::$closest($tree, $leaves),
                any: tile::kernel::$shadow($tree, $leaves),
            },
            packets: $crate::ways::Pair {
                closest: packet::kernel::$closest($tree, $leaves),
                any: packet::kernel::$shadow($tree, $leaves),
            },
            streams: $crate::ways::Pair {
                closest: stream::kernel::$closest($tree, $leaves),
                any: stream::kernel::$shadow($tree, $leaves),
            },
        }
    }};
}
pub(crate) use together;

impl Together {
    /// Adds to the plan of single rays the kernels for one of the ways of [`every_way`].
    pub fn plan(self, single: Plan, rays: Rays) -> Plan {
        let Self {
            tiles,
            packets,
            streams,
        } = self;
        match rays {
            Rays::Tile => (single.with_tiles(rays, tiles.closest)).with_any(rays, tiles.any),
            Rays::Packet => packets.take_all(single, rays),
            Rays::Stream => streams.take_all(single, rays),
            Rays::Auto => (single.with_closest(Rays::Stream, streams.closest))
                .with_tiles_by_footprint(tiles.closest, packets.closest, Footprint::OTHERS)
                .with_any_by_coherence(tiles.any, packets.any, streams.any, Limits::OTHERS)
                .with_few_singly(),
            Rays::Single | Rays::Flight | Rays::Beam => single,
        }
    }
}

/// The way of the row with this traversal.
///
/// # Panics
/// At compile time, for a name that the table does not have.
pub const fn named<F>(table: &[Traversal<F>], name: &str) -> Way {
    let mut i = 0;
    while i < table.len() {
        if equal(table[i].way.traversal, name) {
            return table[i].way;
        }
        i += 1;
    }
    panic!("the table has no traversal of this name")
}

/// The ways of the rows with the traversals `names`, in their order.
///
/// # Panics
/// At compile time, for a name that the table does not have.
pub const fn offer<F>(table: &[Traversal<F>], names: &[&str]) -> List<Way> {
    let mut ways = List::of(&[named(table, names[0])]);
    let mut i = 1;
    while i < names.len() {
        ways = ways.and(&[named(table, names[i])]);
        i += 1;
    }
    ways
}

/// The ways of all rows of a table.
pub const fn all<F>(table: &[Traversal<F>]) -> List<Way> {
    let mut ways = List::of(&[table[0].way]);
    let mut i = 1;
    while i < table.len() {
        ways = ways.and(&[table[i].way]);
        i += 1;
    }
    ways
}

/// Each traversal of these ways once, in their order.
pub const fn distinct(ways: &[Way]) -> List<Named> {
    let mut options = List::of(&[option(&ways[0])]);
    let mut i = 1;
    while i < ways.len() {
        let mut k = 0;
        let known = options.slice();
        while k < known.len() && !equal(known[k].name, ways[i].traversal) {
            k += 1;
        }
        if k == known.len() {
            options = options.and(&[option(&ways[i])]);
        }
        i += 1;
    }
    options
}

/// The option of the parameter `traversal` that chooses a way.
const fn option(way: &Way) -> Named {
    Named {
        name: way.traversal,
        label: way.label,
        doc: way.doc,
        needs: &[],
    }
}

/// The parameter `traversal` of a structure that offers these, the default first.
pub const fn traversal(options: &'static [Named]) -> ParamSpec {
    ParamSpec {
        name: TRAVERSAL,
        label: "Rays",
        doc: "How rays traverse the nodes",
        unit: "",
        kind: Kind::Choice(options),
        default: Value::Choice(options[0].name),
        group: Group::Main,
        needs: &[],
    }
}

/// The parameter `nodes` of trees of split planes.
pub const PLANE_NODES: ParamSpec = ParamSpec {
    name: NODES,
    label: "Nodes",
    doc: "What rays are tested against",
    unit: "",
    kind: Kind::Choice(&NODES_OF_PLANES),
    default: Value::Choice(NODES_OF_PLANES[0].name),
    group: Group::Main,
    needs: &[],
};

/// The row of a chosen way.
///
/// # Panics
/// For a way that is not in the table, which reading a configuration excludes.
pub fn chosen<'a, F>(table: &'a [Traversal<F>], way: &Way) -> &'a Traversal<F> {
    let row = table.iter().find(|row| row.way == *way);
    row.unwrap_or_else(|| panic!("no row through {} is named {}", way.nodes, way.traversal))
}
