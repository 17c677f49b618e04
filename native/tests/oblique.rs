// SPDX-License-Identifier: GPL-3.0-or-later
//! Properties of trees with oblique planes beyond the contract of all structures.

use halfspace::base::Monitor;
use halfspace::inspect::validate::validate;
use halfspace::nodes::planes::views::Numbered;
use halfspace::nodes::projected_tree::Projected;
use halfspace::oracle::cases::{Case, Random, Size, aimed, cases, grid, soup};
use halfspace::ray::{Hit, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use std::sync::Arc;

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build_kept(scene.clone(), config, 2, &Monitor::new()).unwrap()
}

/// Small triangles of all orientations, close together but rarely crossing.
fn scattered(count: usize) -> Arc<Triangles> {
    let mut random = Random(5);
    let triangles = (0..count).flat_map(|_| {
        let centre = random.point(-1.0, 1.0);
        [[0.0_f32; 3]; 3].map(|_| {
            let step = random.point(-0.02, 0.02);
            std::array::from_fn(|k| centre[k] + step[k])
        })
    });
    soup(triangles.collect())
}

fn same_tree(scene: &Arc<Triangles>, a: &str, b: &str) {
    let (one, other) = (build(scene, a), build(scene, b));
    assert!(one.built().same_nodes(other.built()), "{a} and {b}: nodes");
    assert!(
        one.built().leaves == other.built().leaves,
        "{a} and {b}: leaves"
    );
}

#[test]
fn three_directions_make_the_kd_tree() {
    let scene = scattered(3000);
    // A tree with large leaves.
    let cut_short = |id: &str| format!("{id}max_depth=4");
    for id in [
        "bsp-wn-plus-kd",
        "bsp-cn-plus-kd",
        "bsp-random-plus-kd",
        "rbsp-kd",
    ] {
        same_tree(&scene, &format!("{id}:k=3"), "kd:traversal=dir");
        let (own, kd) = (format!("{id}:k=3,"), "kd:traversal=dir,");
        same_tree(&scene, &cut_short(&own), &cut_short(kd));
        let thesis = format!("{id}:k=3,costs=thesis,ties=pbrt,clip=0");
        same_tree(&scene, &thesis, "kd-sah:traversal=dir");
    }
}

#[test]
fn walls_parallel_to_axes_leave_out_oblique_planes() {
    let walls = soup(grid(3, 0.0));
    let turned = scattered(3000);
    for tree in TREES.iter().filter(|t| t.id.ends_with("-kd")) {
        let structure = build(&walls, tree.id);
        assert_eq!(structure.shape().nodes_oblique, 0, "{}", tree.id);
        assert!(
            structure
                .left_out()
                .iter()
                .any(|s| s.contains("oblique planes")),
            "{}: {:?}",
            tree.id,
            structure.left_out()
        );
        let structure = build(&turned, tree.id);
        assert!(structure.shape().nodes_oblique > 0, "{}", tree.id);
        assert!(
            !structure
                .left_out()
                .iter()
                .any(|s| s.contains("oblique planes")),
            "{}: {:?}",
            tree.id,
            structure.left_out()
        );
    }
}

/// Directions left untried in small nodes and next to good axis-aligned planes are reported, and can be tried.
#[test]
fn directions_left_untried_are_reported() {
    let scene = scattered(3000);
    for id in ["bsp-wn-plus-kd", "bsp-cn-plus", "bsp-hybrid-plus-kd"] {
        let reported = |spec: &str| {
            let left_out = build(&scene, spec).left_out();
            let of = |part: &str| left_out.iter().any(|s| s.contains(part));
            [of("besides the axes"), of("small nodes")]
        };
        // In a scene this small the default leaves nothing untried.
        let enough = format!("{id}:enough=0.9");
        assert_eq!(reported(&enough), [true; 2], "{id}");
        assert_eq!(reported(&format!("{id}:enough=0")), [false, true], "{id}");
        // A share of K for any K, and never the axes alone.
        for (k, small) in [(6, 4), (10, 7), (5, 4)] {
            let left_out = build(&scene, &format!("{id}:k={k}")).left_out().join(" ");
            let reported = format!("small nodes: {small} instead of {k} ");
            assert!(left_out.contains(&reported), "{id}: {left_out}");
        }
        assert_eq!(reported(&format!("{id}:k=4")), [false; 2], "{id}");
        assert_eq!(
            reported(&format!("{enough},k_small=1")),
            [true, false],
            "{id}"
        );
        let thesis = format!("{id}:costs=thesis");
        assert_eq!(reported(&thesis), [false; 2], "{id}");
        for idle in ["enough=0", "k_small=1"] {
            let refused = registry::parse(&format!("{thesis},{idle}")).unwrap_err();
            assert!(
                refused.to_string().contains("has no effect"),
                "{id}: {refused}"
            );
        }
        let all = build(&scene, &format!("{id}:enough=0,k_small=1"));
        assert!(
            !build(&scene, &enough).built().same_nodes(all.built()),
            "{id}"
        );
    }
}

#[test]
fn seeds_choose_the_tree() {
    let scene = scattered(3000);
    for tree in TREES.iter().filter(|t| {
        ["k", "seed"]
            .iter()
            .all(|name| t.params.iter().any(|p| p.name == *name))
    }) {
        let mut spec = format!("{}:k=5", tree.id);
        if tree.params.iter().any(|p| p.name == "set") {
            spec += ",set=random";
        }
        for all in ["k_small=1", "enough=0"] {
            let (name, _) = all.split_once('=').expect("a key");
            if tree.params.iter().any(|p| p.name == name) {
                spec = format!("{spec},{all}");
            }
        }
        let spec = |seed: u32| format!("{spec},seed={seed}");
        same_tree(&scene, &spec(3), &spec(3));
        let (one, other) = (build(&scene, &spec(3)), build(&scene, &spec(4)));
        assert!(!one.built().same_nodes(other.built()), "{}", tree.id);
    }
}

/// Leaves hold at most 64 triangles wherever planes separate triangles, for every limit of the depth.
#[test]
fn large_leaves_hold_triangles_that_no_plane_splits() {
    let cases = cases(Size::Small, 7);
    let case = |name: &str| -> &Arc<Triangles> {
        let case: Option<&Case> = cases.iter().find(|c| c.name == name);
        &case.expect("a case of this name").scene
    };
    let scattered = scattered(3000);
    for id in ["bsp-wn-plus-kd", "bsp-cn", "rbsp", "bsp-ize-kd"] {
        for (scene, limit) in [(&scattered, 3), (case("fan"), 10)] {
            let shape = build(scene, &format!("{id}:max_depth={limit}")).shape();
            assert!(shape.leaf_max <= 64, "{id}: {}", shape.leaf_max);
            assert_eq!(shape.leaves_large, 0, "{id}");
        }
        let shape = build(case("identical"), id).shape();
        assert_eq!((shape.leaf_max, shape.leaves_large), (100, 1), "{id}");
    }
}

/// Projected nodes have codes for 30 directions. Beyond, they store planes whole: here those of the rarest of 26
/// directions and of the axes, which are not among them.
#[test]
fn planes_along_more_directions_than_codes_are_stored_whole() {
    let scene = scattered(3000);
    let rays = aimed(&scene, 40, &mut Random(3));
    let closest = |structure: &Structure| {
        let mut hits = vec![Hit::MISS; rays.len()];
        structure.closest(&rays, &mut hits, None);
        hits
    };
    let expected = closest(&build(&scene, "brute"));
    for (spec, more) in [
        ("rbsp:k=26,axes_depth=3", true),
        ("rbsp:k=26", false),
        ("rbsp:k=13,axes_depth=3", false),
    ] {
        let structure = build(&scene, &format!("{spec},traversal=projected"));
        let built = structure.built();
        let [derived] = &built.derived[..] else {
            panic!("{spec}: one derived layout")
        };
        let numbered: &Numbered = derived.tree.downcast_ref().expect("numbered nodes");
        let mut whole = 0;
        numbered.tree.visit(|index, _, _| {
            whole += usize::from(matches!(
                numbered.nodes.node(index),
                Projected::Whole { .. }
            ));
        });
        assert_eq!(whole > 0, more, "{spec}: {whole} planes stored whole");
        assert_eq!(validate(&structure), Vec::<String>::new(), "{spec}");
        assert_eq!(closest(&structure), expected, "{spec}");
    }
}

#[test]
fn invalid_values_name_the_key_and_its_range() {
    for (spec, part) in [
        (
            "bsp-wn-plus-kd:k=2",
            "k=2 is not a whole number from 3 to 32",
        ),
        ("bsp-wn:k=0", "k=0 is not a whole number from 1 to 32"),
        (
            "bsp-cn-plus:k=33",
            "k=33 is not a whole number from 3 to 32",
        ),
        ("rbsp:k=27", "k=27 is not a whole number from 3 to 26"),
        ("bsp-wn-plus-kd:alpha=-1", "alpha=-1 is not a number from 0"),
        ("bsp-wn-plus-kd:alpha=nan", "alpha=nan is not a number"),
        ("bsp-wn:seed=-1", "seed=-1 is not a whole number from 0"),
        ("rbsp:set=star", "set=star is not one of cube, spiral"),
    ] {
        let message = registry::parse(spec).unwrap_err().to_string();
        assert!(message.contains(part), "{spec}: {message}");
    }
}
