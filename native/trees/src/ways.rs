// SPDX-License-Identifier: GPL-3.0-or-later
//! Tables of traversals: one per kind of nodes. A row has a way of tracing and the function that makes its plan. The
//! parameters `nodes` and `traversal`, their documentation and the contract tests read the rows, so a traversal that is
//! not in a table does not exist.

use halfspace_ray::query::{Any, Closest};
use halfspace_structure::Plan;
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
    /// Makes the kernels. May derive further nodes from the tree.
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

/// The ways through nodes that single rays and streams traverse. `single` is the name of the traversal of single rays.
pub const fn singly_or_in_streams(nodes: &'static str, single: &'static str) -> [Way; 3] {
    [
        way(
            nodes,
            "auto",
            "Automatic",
            Rays::Auto,
            "the quickest for each batch: camera rays one by one, other rays in streams",
        ),
        way(nodes, single, "One by One", Rays::Single, "one by one"),
        way(
            nodes,
            "stream",
            "Streams",
            Rays::Stream,
            "in streams, which visit each node once for all rays that meet it",
        ),
    ]
}

/// The kernels of streams through a tree.
pub struct Streams {
    /// Nearest hits.
    pub closest: Arc<dyn Kernel<Closest>>,
    /// Any hits.
    pub any: Arc<dyn Kernel<Any>>,
}

impl Streams {
    /// Sends all rays to the streams.
    pub fn take_all(self, plan: Plan) -> Plan {
        (plan.with_closest(Rays::Stream, self.closest)).with_any(Rays::Stream, self.any)
    }

    /// The plan of one of the ways of [`singly_or_in_streams`].
    pub fn take_chosen(self, plan: Plan, way: &Way) -> Plan {
        match way.rays {
            Rays::Single => plan,
            _ => self.take_all(plan),
        }
    }
}

/// The ways of the rows whose traversals these are, in this order.
///
/// # Panics
/// At compile time, for a name that the table does not have.
pub const fn offer<F, const N: usize, const M: usize>(
    table: &[Traversal<F>; M],
    names: [&str; N],
) -> [Way; N] {
    let mut ways = [table[0].way; N];
    let mut i = 0;
    while i < N {
        let mut k = 0;
        while !equal(table[k].way.traversal, names[i]) {
            k += 1;
        }
        ways[i] = table[k].way;
        i += 1;
    }
    ways
}

/// The ways of all rows of a table.
pub const fn all<F, const M: usize>(table: &[Traversal<F>; M]) -> [Way; M] {
    let mut ways = [table[0].way; M];
    let mut i = 0;
    while i < M {
        ways[i] = table[i].way;
        i += 1;
    }
    ways
}

/// Both lists, one after the other.
pub const fn join<const A: usize, const B: usize, const N: usize>(
    first: [Way; A],
    second: [Way; B],
) -> [Way; N] {
    assert!(A + B == N);
    let mut ways = [if A > 0 { first[0] } else { second[0] }; N];
    let mut i = 0;
    while i < N {
        ways[i] = if i < A { first[i] } else { second[i - A] };
        i += 1;
    }
    ways
}

/// Each traversal of these ways once, in their order.
///
/// # Panics
/// At compile time, where their number is not `N`.
pub const fn distinct<const N: usize>(ways: &[Way]) -> [Named; N] {
    let mut options = [Named {
        name: "",
        label: "",
        doc: "",
        needs: &[],
    }; N];
    let (mut i, mut count) = (0, 0);
    while i < ways.len() {
        let mut k = 0;
        while k < count && !equal(options[k].name, ways[i].traversal) {
            k += 1;
        }
        if k == count {
            options[count] = Named {
                name: ways[i].traversal,
                label: ways[i].label,
                doc: ways[i].doc,
                needs: &[],
            };
            count += 1;
        }
        i += 1;
    }
    assert!(count == N, "N is the number of traversals");
    options
}

const fn equal(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
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
