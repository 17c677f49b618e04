// SPDX-License-Identifier: GPL-3.0-or-later

use super::*;
use halfspace_oracle::cases::Random;

/// Returns random boxes.
fn boxes(count: u32) -> Vec<Object> {
    let mut random = Random(5);
    (0..count)
        .map(|id| {
            let mut bounds = Aabb::EMPTY;
            let (p, size) = (random.point(0.0, 1.0), random.point(0.0, 0.2));
            bounds.grow(p);
            bounds.grow([0, 1, 2].map(|k| p[k] + size[k]));
            Object { bounds, id }
        })
        .collect()
}

/// Returns the least cost of any position at or below a node, by exhaustive search.
fn cheapest(
    tree: &Grown,
    node: usize,
    bounds: Aabb,
    object: &Aabb,
    children: usize,
    inherited: f32,
) -> f32 {
    let grown = surface_of(&bounds.union(object));
    let inherited = inherited + as_f32(tree.counts[node]) * (grown - surface_of(&bounds));
    let mut least = f32::INFINITY;
    if (tree.counts[node] as usize) < children {
        least = inherited + grown;
    }
    for Slot { block, lane } in tree.slots(node) {
        let own = &tree.blocks[block];
        let link = own.link[lane];
        let cost = if link & OBJECT == 0 {
            let bounds = own.bounds(lane);
            cheapest(tree, link as usize, bounds, object, children, inherited)
        } else {
            inherited + 2.0 * surface_of(&own.bounds(lane).union(object))
        };
        least = least.min(cost);
    }
    least
}

#[test]
fn branch_and_bound_finds_the_cheapest_position_and_greed_none_cheaper() {
    for children in [2, 4, WIDEST, usize::MAX] {
        let growth = |search| Growth {
            search,
            children,
            order: Order::Shuffled(0),
        };
        let (all, greedy) = (growth(Search::BranchAndBound), growth(Search::Greedy));
        let objects = boxes(300);
        let mut tree = Grown::new(objects.len());
        let (mut whole, mut scratch) = (Aabb::EMPTY, Scratch::default());
        let mut dearer = 0;
        for (i, object) in objects.iter().enumerate() {
            let bounds = &object.bounds;
            let least = cheapest(&tree, 0, whole, bounds, children, 0.0);
            let found = tree.search(bounds, &whole, &all, &mut scratch).0;
            let near = tree.search(bounds, &whole, &greedy, &mut scratch).0;
            assert_eq!(found, least, "object {i}");
            assert!(near >= least, "object {i}");
            dearer += usize::from(near > least);
            tree.insert(i, bounds, &whole, &all, &mut scratch);
            whole = whole.union(bounds);
        }
        assert!(
            dearer > 0,
            "the greedy search always found the cheapest position: is it greedy?"
        );
    }
}

/// Returns the depth of a tree and its objects.
fn measure(tree: &Grown) -> (usize, Vec<usize>) {
    let (mut deepest, mut objects) = (0, Vec::new());
    let mut open = vec![(Child::Node(0), 0)];
    while let Some((child, depth)) = open.pop() {
        deepest = deepest.max(depth);
        match child {
            Child::Node(node) => {
                open.extend(tree.children(node).map(|(child, _)| (child, depth + 1)));
            }
            Child::Objects(_) => tree.objects(child, &mut objects),
        }
    }
    objects.sort_unstable();
    (deepest, objects)
}

#[test]
fn every_object_is_in_the_tree_once_and_depth_is_bounded() {
    // Nested boxes with one common vertex, each a little larger than the one before.
    let nested = (0..2000_u16).map(|i| {
        let mut bounds = Aabb::EMPTY;
        bounds.grow([0.0; 3]);
        bounds.grow([1.01_f32.powi(i32::from(i)); 3]);
        Object {
            bounds,
            id: u32::from(i),
        }
    });
    let same = vec![boxes(1)[0]; 2000];
    for objects in [nested.collect(), same, boxes(2000)] {
        for search in [Search::Greedy, Search::BranchAndBound] {
            let growth = Growth {
                search,
                children: 2,
                order: Order::Shuffled(3),
            };
            let tree = grow(&objects, &growth, &Monitor::new()).unwrap();
            let (depth, found) = measure(&tree);
            assert!(depth <= MAX_DEPTH, "depth {depth}");
            assert!(found.into_iter().eq(0..objects.len()));
        }
    }
}

#[test]
fn the_order_is_that_of_the_seed() {
    let objects = boxes(200);
    let shape = |order| {
        let growth = Growth {
            search: Search::Greedy,
            children: 4,
            order,
        };
        let tree = grow(&objects, &growth, &Monitor::new()).unwrap();
        let mut out = Vec::new();
        tree.objects(Child::Node(0), &mut out);
        out
    };
    let [one, other] = [1, 2].map(Order::Shuffled);
    assert_eq!(shape(one), shape(one));
    assert_ne!(shape(one), shape(other));
    assert_ne!(shape(one), shape(Order::Given));
}

/// Objects far apart and of one size: each is cheapest as another child of the root, however many it has.
#[test]
fn without_a_limit_nodes_have_any_number_of_children() {
    let objects: Vec<_> = (0..300_u16)
        .map(|i| {
            let mut bounds = Aabb::EMPTY;
            let at = f32::from(i) * 0.001;
            bounds.grow([at, 0.0, 0.0]);
            bounds.grow([at + 1.0, 1.0, 1.0]);
            Object {
                bounds,
                id: u32::from(i),
            }
        })
        .collect();
    let widest = |children| {
        let growth = Growth {
            search: Search::Greedy,
            children,
            order: Order::Given,
        };
        let tree = grow(&objects, &growth, &Monitor::new()).unwrap();
        assert!(measure(&tree).1.into_iter().eq(0..objects.len()));
        (tree.counts.iter().copied().max()).expect("there is a root") as usize
    };
    assert_eq!(widest(4), 4);
    assert!(widest(usize::MAX) > 10 * WIDEST);
}
