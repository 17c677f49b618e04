// SPDX-License-Identifier: GPL-3.0-or-later
//! T.Haces: the octree whose camera rays go as beams.

use super::octree::{self, LEAF_SIZE, MAX_DEPTH_PARAM, REFERENCES, Walked};
use crate::build::Monitor;
use crate::error::Result;
use crate::registry::{Built, StructureSpec};
use crate::registry::{Kind, ParamSpec};
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::structure::Layout;

/// The threshold of the paper, which gives no number.
const BEAM_LEAST: ParamSpec = ParamSpec {
    name: "beam_least",
    label: "Smallest Beam",
    doc: "Rays go on singly when fewer than this are left together. More ends beams earlier; 65 is never \
          a beam, 1 always",
    unit: "rays",
    kind: Kind::Integer { min: 1, max: 65 },
    default: Value::Integer(4),
};

/// The registry's row.
pub const SPEC: StructureSpec = StructureSpec {
    id: "octree-beam",
    code: 65,
    label: "Octree with beams",
    family: "octants",
    summary: "The octree with links, on which 64 camera rays of a tile go as one beam until they part.",
    paper: "González López and Gisbert Canto, Trazado de haces de rayos en escenas estructuradas espacialmente mediante árboles octales",
    params: &[LEAF_SIZE, REFERENCES, MAX_DEPTH_PARAM, BEAM_LEAST],
    build,
};

fn build(scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
    let least = u32::try_from(config.integer("beam_least")).expect("in range");
    octree::build(scene, config, monitor, Walked::ByLinks, |tree| {
        Layout::OctreeBeam(tree, least)
    })
}
