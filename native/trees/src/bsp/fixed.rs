// SPDX-License-Identifier: GPL-3.0-or-later
//! Sets of directions that are the same at every node.

use crate::bsp::random::{direction, generator};
use crate::bsp::{AXES, Source, Triangulated, Variant, add_distinct, build, params};
use crate::planes::rows::{FIXED_TRAVERSAL, FIXED_WAYS};
use crate::planes::scalar::FIXED_LEAVES;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Group, Kind, Need, Only, ParamSpec, StructureSpec, named};
use halfspace_structure::spec::{Config, Value};

/// The same directions at every node.
pub struct Fixed(pub Vec<[f32; 3]>);

impl Source for Fixed {
    fn directions(&self, _: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>) {
        let known = out.len();
        out.extend(self.0.iter().take(k).skip(known));
    }
}

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
    family: "space",
    summary: "Planes along K directions that are the same at every node.",
    paper: PAPER,
    params: &PLAIN_PARAMS,
    ways: FIXED_WAYS,
    no_groups: "",
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plain),
};

/// The registry's row: with the axes as cheap nodes.
pub const KD: StructureSpec = StructureSpec {
    id: "rbsp-kd",
    code: 23,
    label: "RBSP + Kd",
    family: "space",
    summary: "Planes along K directions that are the same at every node; the axes among them make cheap nodes.",
    paper: "Kammaje and Mora 2007; Budge et al. 2008; Hoobergs 2019",
    params: &KD_PARAMS,
    ways: FIXED_WAYS,
    no_groups: "",
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

const PLAIN_PARAMS: [ParamSpec; params::USUAL + 1] = with_seed(plain_params(), RANDOM);
const KD_PARAMS: [ParamSpec; params::KD + 1] = with_seed(kd_params(), RANDOM_MORE);

/// Appends the seed of random directions, with its conditions.
const fn with_seed<const A: usize, const N: usize>(
    first: [ParamSpec; A],
    needs: &'static [Need],
) -> [ParamSpec; N] {
    assert!(A + 1 == N);
    let mut all = [params::SEED.needing(needs); N];
    let mut i = 0;
    while i < A {
        all[i] = first[i];
        i += 1;
    }
    all
}

/// K at small nodes, which is K by default.
const K_SMALL: ParamSpec = ParamSpec {
    default: Value::Float(1.0),
    ..params::K_SMALL
};

/// The parameters of [`params::usual`] with the set of directions in place of the seed.
const fn plain_params() -> [ParamSpec; params::USUAL] {
    let mut all = params::usual(K);
    let [seed, axes_depth, leaves] = params::PLACES_USUAL;
    all[seed - 1] = FIXED_TRAVERSAL;
    all[seed] = SET;
    all[seed + 1] = K_SMALL.needing(all[seed + 1].needs);
    all[axes_depth] = all[axes_depth].needing(params::MORE_THAN_AXES);
    all[leaves] = FIXED_LEAVES;
    all
}

/// The parameters of [`params::kd`] with the set of directions in place of the seed.
const fn kd_params() -> [ParamSpec; params::KD] {
    let mut all = params::kd(K);
    let [_, traversal, seed] = params::PLACES_KD;
    all[traversal] = FIXED_TRAVERSAL;
    all[seed] = SET.needing(params::MORE_THAN_AXES);
    all[params::PLACE_LEAVES_KD] = FIXED_LEAVES;
    all[seed + 1] = K_SMALL.needing(all[seed + 1].needs);
    all
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
        random(k, config.integer("seed") as u64, variant)
    } else if kind == "cube" && k <= cube().len() {
        cube()
    } else if variant == Variant::PlusKd {
        let mut set = cube();
        set.truncate(3);
        set.extend(spiral(k - 3));
        set
    } else {
        spiral(k)
    };
    build(scene, config, monitor, variant, |_| Fixed(set))
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
        assert_eq!(cube().len(), 13);
    }
}
