// SPDX-License-Identifier: GPL-3.0-or-later
//! The leaves of plane trees tested one triangle at a time, by single rays through binary nodes.

use super::Planes;
use super::rows::{BINARY, MakePlan};
use crate::leaf_tests::{BLOCKS, LEAVES, NO_BEAMS, SCALAR, leaves};
use crate::ways::{Traversal, named};
use halfspace_base::error::Result;
use halfspace_nodes::ropes;
use halfspace_papers::{bounded, mailbox, published};
use halfspace_structure::Plan;
use halfspace_structure::row::{Group, Kind, Named, Need, Only, ParamSpec, named as option};
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::{NODES, TRAVERSAL, Way};

const PLANES: Need = Need {
    key: NODES,
    only: Only::Options(&["planes"]),
};

const AXIS_NEEDS: &[Need] = &[
    PLANES,
    Need {
        key: TRAVERSAL,
        only: Only::Options(&[
            "auto", "dir", "ta-b", "ta-a", "sung", "arvo", "seq", "rope", "ropetree",
        ]),
    },
    NO_BEAMS,
];

const ANY_NEEDS: &[Need] = &[
    PLANES,
    Need {
        key: TRAVERSAL,
        only: Only::Options(&["auto", "dir", "ta-b-poly"]),
    },
    NO_BEAMS,
];

/// The parameter of axis-aligned trees.
pub const AXIS_LEAVES: ParamSpec = leaves(&[
    BLOCKS,
    Named {
        needs: AXIS_NEEDS,
        ..SCALAR
    },
]);

/// The option of mailboxes.
const HASHED: &str = "hashed";

/// The parameter that gives rays mailboxes.
pub const MAILBOX: ParamSpec = ParamSpec {
    name: "mailbox",
    label: "Mailboxes",
    doc: "How rays avoid a second test of a triangle that lies in several leaves. none: they test it again. hashed: each \
          ray keeps the numbers of up to 64 triangles that it has tested; answers are the same",
    unit: "",
    kind: Kind::Choice(&[option("none", "None"), option(HASHED, "Hashed")]),
    default: Value::Choice("none"),
    group: Group::Numerics,
    needs: &[
        Need {
            key: LEAVES,
            only: Only::Options(&[SCALAR.name]),
        },
        Need {
            key: TRAVERSAL,
            only: Only::Options(&["auto", "dir", "ta-b"]),
        },
    ],
};

/// Whether rays have mailboxes.
fn mailboxed(config: &Config) -> bool {
    config.find(MAILBOX.name) == Some(&Value::Choice(HASHED))
}

/// The parameter of trees with oblique planes.
pub const ANY_LEAVES: ParamSpec = leaves(&[
    BLOCKS,
    Named {
        needs: ANY_NEEDS,
        ..SCALAR
    },
]);

const FIXED_NEEDS: &[Need] = &[
    PLANES,
    Need {
        key: TRAVERSAL,
        only: Only::Options(&["auto", "dir", "projected", "ta-b-poly"]),
    },
    NO_BEAMS,
];

/// The parameter of trees whose planes have few directions.
pub const FIXED_LEAVES: ParamSpec = leaves(&[
    BLOCKS,
    Named {
        needs: FIXED_NEEDS,
        ..SCALAR
    },
]);

/// The way of [`BINARY`] with this name.
const fn binary(name: &str) -> Way {
    named(&BINARY, name)
}

/// All traversals that test one triangle at a time.
pub const ONE_BY_ONE: [Traversal<MakePlan>; 11] = [
    Traversal {
        way: binary("auto"),
        plan: |planes| {
            if planes.has_few_directions() {
                projected(planes)
            } else {
                Ok(by_distances(planes))
            }
        },
    },
    Traversal {
        way: binary("dir"),
        plan: |planes| Ok(by_distances(planes)),
    },
    Traversal {
        way: binary("ta-b"),
        plan: |planes| {
            if mailboxed(planes.config) {
                let mut plan = planes.along_axes("ta-b", mailbox::ta_b, mailbox::published_ta_b)?;
                plan.cases = &mailbox::TA_B_NAMES;
                return Ok(plan);
            }
            let mut plan = planes.along_axes("ta-b", bounded::ta_b, published::ta_b)?;
            plan.cases = &halfspace_ray::cases::NAMES;
            Ok(plan)
        },
    },
    Traversal {
        way: binary("ta-b-poly"),
        plan: |planes| Ok(planes.as_chosen("ta-b-poly", bounded::ta_b_poly, published::ta_b_poly)),
    },
    Traversal {
        way: binary("ta-a"),
        plan: |planes| planes.along_axes("ta-a", bounded::ta_a, published::ta_a),
    },
    Traversal {
        way: binary("sung"),
        plan: |planes| planes.along_axes("sung", bounded::sung, published::sung),
    },
    Traversal {
        way: binary("arvo"),
        plan: |planes| planes.along_axes("arvo", bounded::arvo, published::arvo),
    },
    Traversal {
        way: binary("seq"),
        plan: |planes| {
            let bounds = planes.frame.bounds();
            planes.along_axes("seq", bounded::seq, |tree, leaves| {
                published::seq(tree, leaves, bounds)
            })
        },
    },
    Traversal {
        way: binary("rope"),
        plan: |planes| roped(planes, "rope", ropes::LinkKind::Ropes),
    },
    Traversal {
        way: binary("ropetree"),
        plan: |planes| roped(planes, "ropetree", ropes::LinkKind::RopeTrees),
    },
    Traversal {
        way: binary("projected"),
        plan: projected,
    },
];

/// Single rays by plane distances.
fn by_distances(planes: &Planes<'_>) -> Plan {
    if mailboxed(planes.config) {
        let mut plan = planes.as_chosen("dir", mailbox::dir, mailbox::published_dir);
        plan.cases = &mailbox::NAMES;
        return plan;
    }
    planes.as_chosen("dir", bounded::dir, published::dir)
}

/// Single rays that are projected onto the tree's directions.
fn projected(planes: &mut Planes<'_>) -> Result<Plan> {
    let nodes = planes.numbered()?;
    let make = if planes.robust {
        bounded::projected
    } else {
        published::projected
    };
    let kernel = make(&nodes, &planes.leaves);
    Ok(Plan::single("planes", "projected", kernel))
}

/// Single rays from leaf to leaf by links of this kind.
fn roped(planes: &mut Planes<'_>, name: &'static str, kind: ropes::LinkKind) -> Result<Plan> {
    let links = planes.links(kind)?;
    let make = if planes.robust {
        bounded::rope
    } else {
        published::rope
    };
    let kernel = make(&planes.axis_tree()?, &planes.leaves, links);
    Ok(Plan::single("planes", name, kernel))
}
