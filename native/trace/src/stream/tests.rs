// SPDX-License-Identifier: GPL-3.0-or-later
//! The order in which a stream visits children.

use super::*;
use fearless_simd::Level;

/// The hits do not depend on the order, only the speed does; so it is tested here.
#[test]
fn the_child_at_the_nearest_corner_is_visited_first() {
    let mut node = BoxTree::<CHILDREN>::BLANK;
    for child in 0..CHILDREN {
        for k in 0..3 {
            (node.bounds[k][child], node.bounds[3 + k][child]) = (-1.0, 1.0);
        }
        (node.link[child], node.count[child]) = (small(child), 1);
    }
    let course = || {
        let mut course = Course::nothing();
        (course.line.start, course.line.reach) = (0.0, 1.0);
        course
    };
    let courses = [course(), course()];
    for octant in 0..OCTANTS {
        for rays in 1..3 {
            let mut stream = Stream::new(octant);
            (0..rays).for_each(|place| stream.put(place));
            assert!(stream.begin());
            let root = stream.waiting.pop().expect("it waits");
            dispatch!(Level::new(), simd => stream.node(simd, &node, &courses, root, &mut Vec::new()));
            let links: Vec<_> = stream
                .waiting
                .iter()
                .map(|next| next.link as usize)
                .collect();
            // A ray that descends along an axis comes from its upper end.
            let far_to_near = [7, 6, 5, 4, 3, 2, 1, 0].map(|corner: usize| corner ^ octant);
            assert_eq!(links, far_to_near, "octant {octant}, {rays} rays");
            for next in &stream.waiting {
                let list = &stream.lists[next.first as usize..(next.first + next.rays) as usize];
                assert!(list.iter().map(|&place| place as usize).eq(0..rays));
            }
        }
    }
}
