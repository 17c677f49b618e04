// SPDX-License-Identifier: GPL-3.0-or-later
//! The two choices of tracing: the nodes against which rays are tested, and the traversal.

use crate::row::Named;

/// How the rays of a batch are grouped for the traversal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rays {
    /// One ray after another.
    Single,
    /// Several single rays whose steps alternate.
    Flight,
    /// Packets of 4, 8 or 16 rays, one per lane.
    Packet,
    /// Tiles of camera rays, and of shadow rays reversed to start at the light.
    Tile,
    /// Beams: nodes clip or split the convex region of a bundle of rays.
    Beam,
    /// Streams: each node is visited once for all rays that hit it.
    Stream,
    /// The fastest of these for each batch.
    Auto,
}

impl Rays {
    /// Returns the name in registries and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Flight => "flight",
            Self::Packet => "packet",
            Self::Tile => "tile",
            Self::Beam => "beam",
            Self::Stream => "stream",
            Self::Auto => "auto",
        }
    }
}

/// One valid pair of nodes and traversal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Way {
    /// Nodes that rays are tested against: planes, wide, boxes, intervals, octants, cells, or none.
    pub nodes: &'static str,
    /// Value of the parameter `traversal`; empty for a structure with only one.
    pub traversal: &'static str,
    /// Name of the traversal in user interfaces.
    pub label: &'static str,
    /// How rays are grouped.
    pub rays: Rays,
    /// One clause for the documentation.
    pub doc: &'static str,
}

/// Name of the parameter that chooses the nodes.
pub const NODES: &str = "nodes";

/// Name of the parameter that chooses the traversal.
pub const TRAVERSAL: &str = "traversal";

/// The kinds of nodes that a tree of split planes offers, its own first.
pub const NODES_OF_PLANES: [Named; 3] = [
    Named {
        name: "planes",
        label: "Split Planes",
        doc: "the planes of the tree, one to a node",
        needs: &[],
    },
    Named {
        name: "wide",
        label: "Wide Planes",
        doc: "the planes of the tree, seven of three levels to a node",
        needs: &[],
    },
    Named {
        name: "boxes",
        label: "Plane Boxes",
        doc: "boxes around the triangles that the planes separate, eight to a node, with leaves of their own; the planes \
              and their leaves are freed after the build",
        needs: &[],
    },
];
