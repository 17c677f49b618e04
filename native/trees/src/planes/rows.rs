// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversals of split planes, binary and wide.

use super::Planes;
use crate::boxes;
use crate::list::List;
use crate::params;
use crate::ways::{
    Traversal, all, distinct, in_packets, in_streams, in_tiles, named, offer, traversal, way,
};
use halfspace_base::error::Result;
use halfspace_beam as beam;
use halfspace_group::tile;
use halfspace_nodes::ropes;
use halfspace_papers::{arvo, seq, seq_1985, sung, ta_a, ta_b, ta_b_1997, ta_b_poly};
use halfspace_stream as stream;
use halfspace_structure::Plan;
use halfspace_structure::coherence::Limits;
use halfspace_structure::footprint::Footprint;
use halfspace_structure::row::{Named, ParamSpec};
use halfspace_structure::way::{Rays, Way};

/// Makes the plan for a tree of split planes. May derive further nodes from it.
pub type MakePlan = fn(&mut Planes<'_>) -> Result<Plan>;

/// All traversals of nodes of one split plane.
pub const BINARY: [Traversal<MakePlan>; 19] = [
    Traversal {
        way: way(
            "planes",
            "auto",
            "Automatic",
            Rays::Auto,
            "the quickest for each batch: few rays one by one, camera rays in tiles or packets by the size of triangles, \
             shadow rays in tiles, packets or streams by a sample, others in streams",
        ),
        plan: |planes| {
            let [tiles, packets] = planes.quickest_together()?;
            let streams = stream::kernel::planes(&planes.tree, &planes.leaves);
            let any = stream::kernel::shadow_planes(&planes.tree, &planes.leaves);
            Ok((planes.quickest()?)
                .with_tiles_by_footprint(tiles.closest, packets.closest, Footprint::PLANES)
                .with_closest(Rays::Stream, streams)
                .with_any_by_coherence(tiles.any, packets.any, any, Limits::PLANES)
                .with_few_singly())
        },
    },
    Traversal {
        way: way(
            "planes",
            "dir",
            "By Distances",
            Rays::Single,
            "one by one, by plane distances in the order of the direction",
        ),
        plan: |planes| Ok(planes.by_distances()),
    },
    Traversal {
        way: way(
            "planes",
            "tile",
            "Tiles of 64",
            Rays::Tile,
            "camera rays in tiles of 64, and shadow rays of one light in tiles of 64 from the light; tiles whose rays \
             diverge are split into packets; other rays as dir",
        ),
        plan: |planes| {
            let tiles = tile::kernel::planes(&planes.tree, &planes.leaves);
            Ok(planes.in_tiles(tiles))
        },
    },
    Traversal {
        way: way(
            "planes",
            "tile16",
            "Tiles of 256",
            Rays::Tile,
            "as tile, but camera rays in tiles of 256",
        ),
        plan: |planes| {
            let tiles = tile::kernel::large_planes(&planes.tree, &planes.leaves);
            Ok(planes.in_tiles(tiles))
        },
    },
    Traversal {
        way: way(
            "planes",
            "packet",
            "Packets of 16",
            Rays::Packet,
            "packets of 16 rays, one to a lane, shadow rays too",
        ),
        plan: |planes| Ok(planes.packets(16)),
    },
    Traversal {
        way: way(
            "planes",
            "packet8",
            "Packets of 8",
            Rays::Packet,
            "nearest hits in packets of 8, shadow rays as dir",
        ),
        plan: |planes| Ok(planes.packets(8)),
    },
    Traversal {
        way: way(
            "planes",
            "packet4",
            "Packets of 4",
            Rays::Packet,
            "nearest hits in packets of 4, shadow rays as dir",
        ),
        plan: |planes| Ok(planes.packets(4)),
    },
    Traversal {
        way: in_streams("planes"),
        plan: |planes| Ok(planes.in_streams()),
    },
    Traversal {
        way: way(
            "planes",
            "ta-b",
            "TA-B",
            Rays::Single,
            "one by one, by entry and exit points (Havran et al. 1997); measured, it saves 15 to 32 % of the traversal of \
             Sung and Arvo, not the published 30 to 50, and a picture is not twice as fast",
        ),
        plan: |planes| {
            let (bounded, published) = (ta_b::ta_b, ta_b_1997::ta_b_published);
            let mut plan = planes.along_axes("ta-b", bounded, published)?;
            plan.cases = &halfspace_ray::cases::NAMES;
            Ok(plan)
        },
    },
    Traversal {
        way: way(
            "planes",
            "ta-b-poly",
            "TA-B, Oblique",
            Rays::Single,
            "one by one, by the heights of entry and exit points over planes of any direction",
        ),
        plan: |planes| {
            let kernel = ta_b_poly::ta_b_poly(&planes.tree, &planes.leaves);
            Ok(Plan::single("planes", "ta-b-poly", kernel))
        },
    },
    Traversal {
        way: way(
            "planes",
            "ta-a",
            "TA-A",
            Rays::Single,
            "one by one, by the side of the origin and distances (Havran et al. 1997)",
        ),
        plan: |planes| planes.along_axes("ta-a", ta_a::ta_a, ta_a::ta_a_published),
    },
    Traversal {
        way: way(
            "planes",
            "sung",
            "Sung",
            Rays::Single,
            "one by one, by the side of the origin and distances (Sung and Shirley 1992)",
        ),
        plan: |planes| planes.along_axes("sung", sung::sung, sung::sung_published),
    },
    Traversal {
        way: way(
            "planes",
            "arvo",
            "Arvo",
            Rays::Single,
            "one by one, by the side of the origin and distances (Arvo 1988)",
        ),
        plan: |planes| planes.along_axes("arvo", arvo::arvo, arvo::arvo_published),
    },
    Traversal {
        way: way(
            "planes",
            "seq",
            "Sequential",
            Rays::Single,
            "one by one, each leaf located from the root, without a stack (Kaplan 1985)",
        ),
        plan: |planes| {
            let bounds = planes.frame.bounds();
            planes.along_axes("seq", seq::seq, |tree, leaves| {
                seq_1985::seq_published(tree, leaves, bounds)
            })
        },
    },
    Traversal {
        way: way(
            "planes",
            "rope",
            "Ropes",
            Rays::Single,
            "one by one, from leaf to leaf by links to what lies across each face (MacDonald and Booth 1990), which take \
             about twice the memory of the nodes and more",
        ),
        plan: |planes| planes.roped("rope", ropes::LinkKind::Ropes),
    },
    Traversal {
        way: way(
            "planes",
            "ropetree",
            "Rope Trees",
            Rays::Single,
            "the same by a small tree for each face (Havran et al. 1998)",
        ),
        plan: |planes| planes.roped("ropetree", ropes::LinkKind::RopeTrees),
    },
    Traversal {
        way: way(
            "planes",
            "projected",
            "Projected",
            Rays::Single,
            "one by one, each ray projected onto the tree's directions once (Kammaje and Mora 2007; Budge et al. 2008), \
             through nodes that name a direction, which take the memory of the nodes once more",
        ),
        plan: |planes| planes.projected(),
    },
    Traversal {
        way: way(
            "planes",
            "tile-projected",
            "Projected Tiles",
            Rays::Tile,
            "as tile, but through nodes that name a direction, onto which a tile is projected once",
        ),
        plan: |planes| {
            let [tiles, _] = planes.projected_together()?;
            Ok(
                (planes.by_distances().with_tiles(Rays::Tile, tiles.closest))
                    .with_any(Rays::Tile, tiles.any),
            )
        },
    },
    Traversal {
        way: way(
            "planes",
            "packet-projected",
            "Projected Packet",
            Rays::Packet,
            "as packet, but through nodes that name a direction, onto which a packet is projected once",
        ),
        plan: |planes| {
            let [_, packets] = planes.projected_together()?;
            Ok(packets.take_all(planes.by_distances(), Rays::Packet))
        },
    },
];

/// All traversals of nodes of seven split planes, which are three levels of the binary tree.
pub const WIDE: [Traversal<MakePlan>; 5] = [
    Traversal {
        way: way(
            "wide",
            "auto",
            "Automatic",
            Rays::Auto,
            "the quickest for each batch: few rays one by one, camera rays in tiles, others in streams",
        ),
        plan: |planes| planes.wide_together(Rays::Auto),
    },
    Traversal {
        way: way(
            "wide",
            "flight",
            "In Flight",
            Rays::Flight,
            "several rays in turn, many rays in random order sorted by origin",
        ),
        plan: |planes| planes.wide_in_flight(),
    },
    Traversal {
        way: in_tiles("wide"),
        plan: |planes| planes.wide_together(Rays::Tile),
    },
    Traversal {
        way: in_packets("wide"),
        plan: |planes| planes.wide_together(Rays::Packet),
    },
    Traversal {
        way: in_streams("wide"),
        plan: |planes| planes.wide_together(Rays::Stream),
    },
];

/// Camera rays as beams, for a structure that offers them (Heckbert and Hanrahan 1984).
pub const BEAMS: [Traversal<MakePlan>; 1] = [Traversal {
    way: way(
        "planes",
        "beam",
        "Beams",
        Rays::Beam,
        "camera rays in tiles of 64 that each plane cuts as one beam, other rays as dir",
    ),
    plan: |planes| {
        let least = params::least(planes.config, &params::BEAM_LEAST);
        let beams = beam::kernel::planes(&planes.tree, &planes.leaves, least);
        let mut plan = planes.by_distances().with_tiles(Rays::Beam, beams);
        plan.cases = &beam::planes::NAMES;
        Ok(plan)
    },
}];

/// Adds the ways through wide nodes and boxes.
const fn with_others(ways: List<Way>) -> List<Way> {
    ways.and(all(&WIDE).slice())
        .and(all(&boxes::TRAVERSALS).slice())
}

const AXIS: List<Way> = with_others(offer(
    &BINARY,
    &[
        "auto", "dir", "tile", "tile16", "packet", "packet8", "packet4", "stream", "ta-b", "ta-a",
        "sung", "arvo", "seq", "rope", "ropetree",
    ],
));

/// Ways through axis-aligned trees.
pub const AXIS_WAYS: &[Way] = AXIS.slice();

const AXIS_OPTIONS: List<Named> = distinct(AXIS_WAYS);

/// Traversals of axis-aligned trees.
pub const AXIS_TRAVERSAL: ParamSpec = traversal(AXIS_OPTIONS.slice());

const ANY: List<Way> = with_others(offer(
    &BINARY,
    &[
        "auto",
        "dir",
        "tile",
        "tile16",
        "packet",
        "packet8",
        "packet4",
        "stream",
        "ta-b-poly",
    ],
));

/// Ways through trees with oblique planes.
pub const ANY_WAYS: &[Way] = ANY.slice();

const ANY_OPTIONS: List<Named> = distinct(ANY_WAYS);

/// Traversals of trees with oblique planes.
pub const ANY_TRAVERSAL: ParamSpec = traversal(ANY_OPTIONS.slice());

const FIXED: List<Way> = with_others(offer(
    &BINARY,
    &[
        "auto",
        "projected",
        "tile-projected",
        "packet-projected",
        "dir",
        "tile",
        "tile16",
        "packet",
        "packet8",
        "packet4",
        "stream",
        "ta-b-poly",
    ],
));

/// The way of rays that are projected onto the tree's directions.
pub const PROJECTED: Way = named(&BINARY, "projected");

/// Ways through trees whose planes have few directions.
pub const FIXED_WAYS: &[Way] = FIXED.slice();

const FIXED_OPTIONS: List<Named> = distinct(FIXED_WAYS);

/// Traversals of trees whose planes have few directions.
pub const FIXED_TRAVERSAL: ParamSpec = traversal(FIXED_OPTIONS.slice());

const BEAM: List<Way> =
    all(&BEAMS).and(offer(&BINARY, &["dir", "tile", "packet", "stream"]).slice());

/// Ways through the tree of beams.
pub const BEAM_WAYS: &[Way] = BEAM.slice();

const BEAM_OPTIONS: List<Named> = distinct(BEAM_WAYS);

/// Traversals of the tree of beams.
pub const BEAM_TRAVERSAL: ParamSpec = traversal(BEAM_OPTIONS.slice());
