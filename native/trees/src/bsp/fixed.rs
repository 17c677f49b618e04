// SPDX-License-Identifier: GPL-3.0-or-later
//! Sets of directions that are the same at every node.

use crate::bsp::random::{direction, generator};
use crate::bsp::{AXES, Settings, Source, Triangulated, Variant, add_distinct, build, params};
use crate::list::List;
use crate::planes::rows::{FIXED_TRAVERSAL, FIXED_WAYS};
use crate::planes::scalar::FIXED_LEAVES;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{
    Family, Group, Kind, Menu, Need, Only, ParamSpec, StructureSpec, named,
};
use halfspace_structure::spec::{Config, Value};

/// The same directions at every node.
pub struct Fixed(pub Vec<[f32; 3]>);

impl Source for Fixed {
    fn directions(&self, _: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>) {
        let known = out.len();
        out.extend(self.0.iter().take(k).skip(known));
    }
}

/// Number of directions with coordinates -1, 0 and 1.
pub const CUBE: usize = 13;

/// Returns the thirteen directions with coordinates -1, 0 and 1: axes, then diagonals of the cube, then of its
/// faces (Klosowski et al. 1998). Diagonals are halved, so that none is longer than 1 and products stay exact.
pub fn cube() -> Vec<[f32; 3]> {
    let half = 0.5;
    let mut set = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Four diagonals of the cube, then six of its faces.
    for (y, z) in [(half, half), (half, -half), (-half, half), (-half, -half)] {
        set.push([half, y, z]);
    }
    for sign in [half, -half] {
        set.extend([[half, sign, 0.0], [half, 0.0, sign], [0.0, half, sign]]);
    }
    set
}

/// Returns `count` directions on a spiral over the half sphere, each with an equal share of its area (the idea of
/// Kammaje and Mora 2007; here with the golden angle).
pub fn spiral(count: usize) -> Vec<[f32; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            // Equal steps in z have equal areas on the sphere.
            let z = 1.0 - (2 * i + 1) as f64 / (2 * count) as f64;
            let radius = (1.0 - z * z).sqrt();
            let angle = golden * i as f64;
            #[expect(clippy::cast_possible_truncation, reason = "planes have f32 normals")]
            let n = [radius * angle.cos(), radius * angle.sin(), z].map(|x| x as f32);
            n
        })
        .collect()
}

const PAPER: &str =
    "Kammaje and Mora 2007, A study of restricted BSP trees for ray tracing; Budge et al. 2008";

/// The registry's row: all nodes alike.
pub const PLAIN: StructureSpec = StructureSpec {
    id: "rbsp",
    code: 22,
    label: "RBSP",
    family: Family::Space,
    summary: "Planes along K directions that are the same at every node.",
    paper: PAPER,
    params: PLAIN_PARAMS.slice(),
    ways: FIXED_WAYS,
    no_groups: "",
    menu: Menu::Bsp,
    literature: &[("RBSP", "k=13")],
    sweep: false,
    claims: &["rbsp-*", "fixed-directions"],
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plain),
};

/// The registry's row: with the axes as cheap nodes.
pub const KD: StructureSpec = StructureSpec {
    id: "rbsp-kd",
    code: 23,
    label: "RBSP + Kd",
    family: Family::Space,
    summary: "Planes along K directions that are the same at every node; the axes among them make cheap nodes.",
    paper: "Kammaje and Mora 2007; Budge et al. 2008; Hoobergs 2019",
    params: KD_PARAMS.slice(),
    ways: FIXED_WAYS,
    no_groups: "",
    menu: Menu::Bsp,
    literature: &[("RBSP^Kd", "k=13")],
    sweep: false,
    claims: &["other-trees-time", "rbsp-*", "fixed-directions"],
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

const SET: ParamSpec = ParamSpec {
    name: "set",
    label: "Directions",
    doc: "cube: the axes, the cube's diagonals and its faces' (Klosowski et al. 1998), up to 13, and a spiral \
          beyond. spiral: always even over the sphere (Kammaje and Mora 2007). random: drawn once for the whole tree, \
          after the axes where these make cheap nodes (Hoobergs 2019)",
    unit: "",
    kind: Kind::Choice(&[
        named("cube", "Cube"),
        named("spiral", "Spiral"),
        named("random", "Random"),
    ]),
    default: Value::Choice("cube"),
    group: Group::Builder,
    needs: &[],
};

const K: ParamSpec = ParamSpec {
    kind: Kind::Integer { min: 3, max: 26 },
    ..params::k(3, 13)
};

/// Where the directions are random.
const RANDOM: &[Need] = &[Need {
    key: "set",
    only: Only::Options(&["random"]),
}];

/// The same where axes make cheap nodes: further directions are tried.
const RANDOM_MORE: &[Need] = &[RANDOM[0], params::MORE_THAN_AXES[0]];

/// The parameters of [`params::usual`] with the set of directions in place of the seed, and the seed of random sets last.
const PLAIN_PARAMS: List<ParamSpec> = with_set(params::usual(K))
    .with_needs("axes_depth", params::MORE_THAN_AXES)
    .and(&[params::SEED.needing(RANDOM)]);

/// The parameters of [`params::kd`], likewise.
const KD_PARAMS: List<ParamSpec> = with_set(params::kd(K))
    .with_needs("set", params::MORE_THAN_AXES)
    .and(&[params::SEED.needing(RANDOM_MORE)]);

/// Replaces the seed by the set of directions, and by default tries K at small nodes too.
const fn with_set(params: List<ParamSpec>) -> List<ParamSpec> {
    params
        .replace("traversal", FIXED_TRAVERSAL)
        .replace("seed", SET)
        .with_default("k_small", Value::Float(1.0))
        .replace("leaves", FIXED_LEAVES)
}

/// Returns `k` random directions, after the axes in the variant where these make cheap nodes.
fn random(k: usize, seed: u64, variant: Variant) -> Vec<[f32; 3]> {
    let mut random = generator(seed, 0);
    let mut set = if variant == Variant::PlusKd {
        AXES.to_vec()
    } else {
        Vec::new()
    };
    while set.len() < k {
        add_distinct(&mut set, direction(&mut random));
    }
    set
}

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let (k, kind) = (config.integer("k"), config.choice("set"));
    let set = if kind == "random" {
        random(k, Settings::of(config).seed, variant)
    } else if kind == "cube" && k <= CUBE {
        cube()
    } else if variant == Variant::PlusKd {
        let mut set = cube();
        set.truncate(3);
        set.extend(spiral(k - 3));
        set
    } else {
        spiral(k)
    };
    build(scene, config, monitor, variant, |_, _| Fixed(set))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsp::add_distinct;

    #[test]
    fn sets_hold_distinct_directions_no_longer_than_one() {
        let drawn = random(26, 1, Variant::PlusKd);
        assert_eq!(drawn[..3], AXES);
        for set in [cube(), spiral(26), spiral(3), drawn] {
            let mut distinct = Vec::new();
            for &n in &set {
                let square: f32 = n.iter().map(|x| x * x).sum();
                assert!((0.49..1.000_001).contains(&square), "{n:?}");
                let unit = n.map(|x| x / square.sqrt());
                assert!(add_distinct(&mut distinct, unit), "{n:?} twice");
            }
        }
        assert_eq!(cube().len(), CUBE);
    }
}
