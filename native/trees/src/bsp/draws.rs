// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of the trees whose directions are normals or clusters of normals: which normals are drawn.

use crate::bsp::params::{MORE_THAN_AXES, RULE, kd, plus, usual};
use crate::list::List;
use halfspace_structure::row::{Group, Kind, Need, Only, ParamSpec, named};
use halfspace_structure::spec::Value;

/// Parameter empty_clusters.
const EMPTY_CLUSTERS: ParamSpec = ParamSpec {
    name: "empty_clusters",
    label: "Empty Clusters",
    doc: "What draw=thesis does where a cluster is empty. text: its centre becomes a random normal. code: all centres \
          do, as in the thesis's program, so that nodes of few distinct normals get equal ones",
    group: Group::Builder,
    ..RULE
};

/// Parameter draw of trees whose directions are normals.
const DRAW: ParamSpec = ParamSpec {
    name: "draw",
    label: "Draws",
    doc: "Whose normals become directions. distinct: triangles are drawn until K normals differ. thesis: those of K \
          triangles, equal or not (Hoobergs 2019)",
    unit: "",
    kind: Kind::Choice(&[
        named("distinct", "Distinct"),
        named("thesis", "As in the Thesis"),
    ]),
    default: Value::Choice("distinct"),
    group: Group::Builder,
    needs: &[],
};

/// [`DRAW`] of trees whose directions are clusters.
const DRAW_CLUSTERS: ParamSpec = ParamSpec {
    doc: "Which normals are clustered. distinct: those of up to 128 triangles, equal ones merged, in up to 16 rounds. \
          thesis: those of all triangles, in up to 500 rounds (Hoobergs 2019)",
    ..DRAW
};

/// Where normals are drawn as published.
const PUBLISHED: &[Need] = &[Need {
    key: "draw",
    only: Only::Options(&["thesis"]),
}];

/// Both conditions: normals are drawn as published, and directions other than the axes are tried.
const PUBLISHED_MORE: &[Need] = &[MORE_THAN_AXES[0], PUBLISHED[0]];

/// [`usual`] for directions from normals.
pub const fn normals_usual(k: ParamSpec) -> List<ParamSpec> {
    usual(k).and(&[DRAW])
}

/// [`plus`] for directions from normals.
pub const fn normals_plus(k: ParamSpec) -> List<ParamSpec> {
    plus(k).and(&[DRAW.needing(MORE_THAN_AXES)])
}

/// [`kd`] for directions from normals.
pub const fn normals_kd(k: ParamSpec) -> List<ParamSpec> {
    kd(k).and(&[DRAW.needing(MORE_THAN_AXES)])
}

/// [`usual`] for directions from clusters.
pub const fn clusters_usual(k: ParamSpec) -> List<ParamSpec> {
    usual(k).and(&[DRAW_CLUSTERS, EMPTY_CLUSTERS.needing(PUBLISHED)])
}

/// [`plus`] for directions from clusters.
pub const fn clusters_plus(k: ParamSpec) -> List<ParamSpec> {
    let draw = DRAW_CLUSTERS.needing(MORE_THAN_AXES);
    plus(k).and(&[draw, EMPTY_CLUSTERS.needing(PUBLISHED_MORE)])
}

/// [`kd`] for directions from clusters.
pub const fn clusters_kd(k: ParamSpec) -> List<ParamSpec> {
    let draw = DRAW_CLUSTERS.needing(MORE_THAN_AXES);
    kd(k).and(&[draw, EMPTY_CLUSTERS.needing(PUBLISHED_MORE)])
}
