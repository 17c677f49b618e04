// SPDX-License-Identifier: GPL-3.0-or-later
//! The configurations that the contract of structures is tested on.

use halfspace::registry::{self, TREES};
use halfspace::structure::row::Family;
use halfspace::structure::way::Way;

/// Returns whether a way is compared in full on another tree with the same nodes.
fn elsewhere(tree: &str, way: &Way) -> bool {
    let on: &[&str] = match (way.nodes, way.traversal) {
        ("planes" | "boxes", "packet" | "packet4" | "packet8") => &["kd", "rbsp-kd", "bvh-sah"],
        ("boxes", "flight" | "stream" | "ordered") => &["kd", "bsp-wn", "bvh-sah"],
        ("boxes", "auto") => &["kd", "kd-median", "rbsp-kd", "bsp-wn", "bsp-ize", "bvh-sah"],
        ("wide", "flight" | "packet") | ("planes" | "wide", "stream") => &["kd", "bsp-wn"],
        // As `auto`, which is compared on all trees.
        ("intervals" | "octants" | "cells", "stream") => &[],
        (_, "ta-b-poly") => &["rbsp-kd", "bsp-wn"],
        (_, "seq" | "rope" | "ropetree") => &["kd", "kd-median"],
        (_, "ta-a" | "sung" | "arvo") => &["kd", "kd-sah"],
        _ => return false,
    };
    !on.contains(&tree)
}

/// Returns the configuration with one more value.
pub fn with(spec: &str, pair: &str) -> String {
    format!("{spec}{}{pair}", if spec.contains(':') { ',' } else { ':' })
}

/// Forms of trees that other values than the defaults select.
const FORMS: [&str; 27] = [
    "bvh-sah:quality=fast",
    "bvh-sah:quality=high",
    "bvh-sah:splits=1",
    "bvh-sah:splits=4,traversal=ordered",
    "bvh-sah:splits=0.3,traversal=flight",
    "bih:split=middle",
    "bih:split=median,traversal=packet",
    "bih-n:split=sah",
    "bih5:cut=split",
    "bih-bvh:split=median,leaves=corners",
    "bbox-gs:fanout=any,leaf_size=1",
    "bbox-gs-bnb:fanout=any,order=given",
    "rbsp:k=26,axes_depth=3,traversal=projected",
    "rbsp-kd:set=random,seed=1,traversal=projected",
    "rbsp-kd:k=13,leaves=scalar,traversal=projected",
    "kd:leaves=scalar,mailbox=hashed",
    "kd-median:traversal=ta-b,leaves=scalar,mailbox=hashed",
    "bvh-sah:width=2,leaves=scalar",
    "bvh-sah:splits=1,leaves=scalar",
    "bih-n:n=2,leaves=scalar",
    "bbox-gs:slabs=7,leaves=scalar",
    "octree-beam:traversal=net,leaves=scalar",
    "kd:stop=beta",
    "kd-sah:stop=beta,beta=0.5",
    "rbsp:costs=thesis,stop=beta",
    "bsp-wn-plus-kd:stop=beta,traversal=tile",
    "bsp-ize-kd:costs=thesis,stop=beta,beta=1",
];

/// Returns every structure with each of its ways.
pub fn specs() -> Vec<String> {
    let mut specs: Vec<_> = FORMS.map(str::to_owned).into();
    for tree in TREES {
        if tree.params.iter().any(|p| p.name == "lazy") {
            specs.push(format!("{}:lazy=1", tree.id));
        }
        // Tiles differ only for tiles of rays, which `tiles.rs` tests.
        let ways = (tree.ways.iter().zip(tree.spelled_ways()))
            .filter(|(way, _)| !way.traversal.starts_with("tile") && !elsewhere(tree.id, way));
        let ways: Vec<_> = ways.map(|(_, spec)| spec).collect();
        // Leaves tested one triangle at a time, on one tree of each kind of nodes.
        let elsewhere = tree.family == Family::Space
            && !["kd", "kd-median", "kd-sah", "rbsp-kd", "bsp-wn", "grid"].contains(&tree.id);
        let scalar = ways.iter().map(|spec| with(spec, "leaves=scalar"));
        specs.extend(scalar.filter(|spec| !elsewhere && registry::parse(spec).is_ok()));
        specs.extend(ways);
    }
    specs
}
