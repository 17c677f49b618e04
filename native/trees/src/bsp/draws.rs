// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of the trees whose directions are normals or clusters of normals: which normals are drawn.

use crate::bsp::params::{LINEAR_MORE, MORE_THAN_AXES, RULE, kd, plus, usual};
use crate::list::List;
use halfspace_structure::row::{Group, Kind, Need, Only, ParamSpec, named};
use halfspace_structure::spec::Value;

/// Parameter rule of trees whose directions are clusters.
const CLUSTER_RULE: ParamSpec = ParamSpec {
    label: "Empty Clusters",
    doc: "What draw=thesis does where a cluster is empty. text: its centre becomes a random normal. code: all centres \
          do, as in the thesis's program, so that nodes of few distinct normals get equal ones",
    ..RULE
};

/// [`RULE`] of trees whose directions are clusters.
const RULE_OF_CLUSTERS: ParamSpec = ParamSpec {
    doc: "Where no plane pays at the linear cost of oblique planes but one does at the fixed cost: text \
          takes that one, code takes the first attempt's, as the thesis's program does. Where draw=thesis meets an \
          empty cluster: text replaces its centre, code all centres",
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
    usual(k).and(&[DRAW_CLUSTERS, CLUSTER_RULE.needing(PUBLISHED)])
}

/// [`plus`] for directions from clusters.
pub const fn clusters_plus(k: ParamSpec) -> List<ParamSpec> {
    let draw = DRAW_CLUSTERS.needing(MORE_THAN_AXES);
    plus(k).and(&[draw, CLUSTER_RULE.needing(PUBLISHED_MORE)])
}

/// [`kd`] for directions from clusters.
pub const fn clusters_kd(k: ParamSpec) -> List<ParamSpec> {
    kd(k)
        .replace("rule", RULE_OF_CLUSTERS.needing(LINEAR_MORE))
        .and(&[DRAW_CLUSTERS.needing(MORE_THAN_AXES)])
}
