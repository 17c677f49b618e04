// SPDX-License-Identifier: GPL-3.0-or-later
//! Counters count the tree's own nodes, in every structure as it comes: another tree has other counts, and no nodes are
//! counted that the tree does not have.

mod common;

use common::build;
use halfspace::oracle::cases::{Random, aimed, cloud, ray, soup};
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::registry::TREES;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::way::Rays;
use std::sync::Arc;

/// The kinds of batches that a structure sends to different kernels.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Any,
    Closest,
    Tiles,
}

const KINDS: [Kind; 3] = [Kind::Any, Kind::Closest, Kind::Tiles];

/// The sum of the counters of all rays of a batch.
fn spent(structure: &Structure, rays: &[Ray], kind: Kind) -> RayCounters {
    let mut counters = vec![RayCounters::default(); rays.len()];
    let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    match kind {
        Kind::Any => structure.occluded(rays, &mut blocked, Some(&mut counters)),
        Kind::Closest => structure.closest(rays, &mut hits, Some(&mut counters)),
        Kind::Tiles => {
            structure.closest_ordered(rays, &mut hits, Some(&mut counters), Order::Tiles);
        }
    }
    let mut sum = RayCounters::default();
    for own in &counters {
        sum.add(own);
    }
    sum
}

/// Triangles of many directions, so that oblique planes pay.
fn scene() -> Arc<Triangles> {
    soup(cloud(700, 0.15, &mut Random(17)))
}

#[test]
fn steps_are_those_of_the_nodes_that_the_tree_is_made_of() {
    let scene = scene();
    let rays = aimed(&scene, 1000, &mut Random(18));
    for tree in TREES {
        let structure = build(&scene, tree.id);
        let own = tree.ways[0].nodes;
        for route in structure.routes() {
            assert_eq!(route.nodes, own, "{}: {}", tree.id, route.batch);
            assert!(route.counted, "{}: {}", tree.id, route.batch);
        }
        let shape = structure.shape();
        for kind in KINDS {
            let sum = spent(&structure, &rays, kind);
            let named = format!("{}, {kind:?}: {sum:?}", tree.id);
            let oblique = shape.nodes_oblique > 0;
            match own {
                "planes" => {
                    assert!(sum.steps_boxes == 0 && sum.steps() > 100, "{named}");
                    assert_eq!(sum.steps_oblique > 0, oblique, "{named}");
                    assert_eq!(sum.steps_axis > 0, shape.nodes_axis > 0, "{named}");
                }
                "none" => assert_eq!(sum.steps(), 0, "{named}"),
                _ => assert!(sum.steps() > 100, "{named}"),
            }
        }
    }
}

/// A changed parameter of the directions makes another tree, and the batches of every kind then count other steps.
#[test]
fn other_directions_are_counted_as_other_steps() {
    let scene = scene();
    let rays = aimed(&scene, 1000, &mut Random(19));
    let (mut compared, mut axial) = (0, 0);
    for tree in TREES {
        let usual = build(&scene, tree.id);
        let has = |name: &str| tree.all_params().any(|param| param.name == name);
        let changes = [("k", "k=3"), ("k", "k=8"), ("alpha", "alpha=1000")];
        for (_, changed) in changes.iter().filter(|(name, _)| has(name)) {
            // The parameter may have no effect next to the others, or have this value already.
            let parsed = halfspace::registry::parse(&format!("{}:{changed}", tree.id));
            let Some(spec) = parsed.ok().map(|config| config.canonical()) else {
                continue;
            };
            if spec == tree.id {
                continue;
            }
            let other = build(&scene, &spec);
            if usual.built().same_nodes(other.built()) {
                // Where few oblique planes are taken, their costs may change none.
                let few = 10 * usual.shape().nodes_oblique < usual.shape().nodes_axis;
                assert!(few && changed.starts_with("alpha"), "{spec}");
                continue;
            }
            let without = other.shape().nodes_oblique == 0;
            for kind in KINDS {
                let (before, after) = (spent(&usual, &rays, kind), spent(&other, &rays, kind));
                let steps = |own: &RayCounters| [own.steps_axis, own.steps_oblique, own.leaves];
                assert_ne!(steps(&before), steps(&after), "{spec}, {kind:?}");
                assert_eq!(after.steps_oblique == 0, without, "{spec}, {kind:?}");
            }
            compared += 1;
            axial += usize::from(without && usual.shape().nodes_oblique > 0);
        }
    }
    assert!(compared > 20, "{compared} changes");
    assert!(axial > 5, "{axial} trees lose their oblique planes");
}

/// A stream of one octant visits no node twice: rays at points all over the scene count at most as many nodes as the tree
/// has, and most of them.
#[test]
fn a_stream_counts_each_node_of_the_tree_once() {
    let scene = scene();
    let mut random = Random(20);
    let rays: Vec<_> = (0..8000)
        .map(|_| Ray {
            t_max: 1e-3,
            ..ray(random.point(-1.0, 1.0), [0.3, 0.5, 0.8])
        })
        .collect();
    for tree in TREES.iter().filter(|tree| tree.no_groups.is_empty()) {
        let traversal = match build(&scene, tree.id).routes()[1].rays {
            Rays::Stream => String::new(),
            _ => ":traversal=stream".to_owned(),
        };
        let structure = build(&scene, &format!("{}{traversal}", tree.id));
        let (sum, shape) = (spent(&structure, &rays, Kind::Closest), structure.shape());
        let named = format!("{}: {sum:?} of {shape:?}", tree.id);
        let full = shape.leaves - shape.leaves_empty;
        assert!(sum.leaves as usize <= full, "{named}");
        assert!(4 * sum.leaves as usize > full, "{named}");
        if tree.ways[0].nodes == "planes" {
            for (counted, all) in [
                (sum.steps_axis, shape.nodes_axis),
                (sum.steps_oblique, shape.nodes_oblique),
            ] {
                assert!(counted as usize <= all, "{named}");
                assert!(4 * counted as usize >= all, "{named}");
            }
        }
    }
}
