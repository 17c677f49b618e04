// SPDX-License-Identifier: GPL-3.0-or-later
//! Polytopes stay closed, and areas computed without cutting equal those of the parts.

use super::*;
use crate::cell::{Direction, Plane};
use proptest::prelude::*;

fn unit_box() -> Polytope {
    Polytope::from_box(
        &Aabb {
            min: [-1.0, 0.0, 2.0],
            max: [1.0, 3.0, 3.0],
        },
        3.0,
    )
}

fn sound(cell: &Polytope) {
    assert_eq!(cell.euler(), 2);
    assert!(cell.gap() <= cell.area_noise(), "{}", cell.gap());
}

#[test]
fn a_box_is_a_polytope() {
    sound(&unit_box());
    assert_eq!(unit_box().area(), 22.0);
}

fn direction() -> impl Strategy<Value = [f32; 3]> {
    prop_oneof![
        [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0],
        [-1_i8..2, -1_i8..2, -1_i8..2].prop_map(|v| v.map(f32::from)),
        // A direction close to an axis.
        [0_u8..3, 0_u8..3].prop_map(|[k, small]| std::array::from_fn(|i| if i == k as usize {
            1.0
        } else if i == small as usize {
            1e-5
        } else {
            0.0
        })),
    ]
    .prop_filter("a direction", |v| v.iter().any(|x| x.abs() > 0.1))
    .prop_map(|v| {
        let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
        v.map(|x| x / length)
    })
}

proptest! {
    /// Areas computed without cutting equal the areas of the parts; parts are closed; the area of a cut counts
    /// twice.
    #[test]
    fn profiles_are_the_areas_of_the_parts(
        cuts in prop::collection::vec((direction(), 0.05_f32..0.95, any::<bool>()), 1..14)
    ) {
        let mut cell = unit_box();
        let mut profile = Profile::default();
        for (n, at, lower) in cuts {
            if !cell.extent(n, &mut profile) || profile.high - profile.low < 1e-3 {
                break;
            }
            cell.divide(n, &mut profile);
            let offset = profile.low + at * (profile.high - profile.low);
            let plane = Plane { direction: Direction::Oblique(n), offset };
            let (below, above) = cell.split(plane).expect("a cut inside");
            sound(&below);
            sound(&above);
            let cap = below.facets().last().unwrap().area;
            let sum = below.area() + above.area() - 2.0 * cap;
            prop_assert!((sum / cell.area() - 1.0).abs() < 1e-9, "{} {}", sum, cell.area());
            let (left, right) = profile.shares(offset);
            prop_assert!((f64::from(left) - below.area() / cell.area()).abs() < 1e-4);
            prop_assert!((f64::from(right) - above.area() / cell.area()).abs() < 1e-4);
            let [least_below, least_above] = profile.least_shares(offset);
            prop_assert!(least_below <= left && least_above <= right);
            cell = if lower { below } else { above };
        }
    }
}

/// Makes two hundred cuts by planes a hundredth of a degree apart.
#[test]
fn nearly_parallel_cuts_keep_a_cell_closed() {
    let mut cell = unit_box();
    for i in 0..200 {
        let angle = 1.745e-4 * f64::from(i);
        #[expect(clippy::cast_possible_truncation, reason = "a direction")]
        let n = [angle.cos() as f32, angle.sin() as f32, 0.0];
        let plane = Plane {
            direction: Direction::Oblique(n),
            offset: 0.9,
        };
        let before = cell.area();
        if let Some((below, above)) = cell.split(plane) {
            sound(&below);
            sound(&above);
            assert!(below.area() <= before * (1.0 + 1e-12));
            cell = below;
        }
    }
}
