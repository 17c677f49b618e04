// SPDX-License-Identifier: GPL-3.0-or-later
//! All methods of a sweep find the same plane.

use super::*;
use fearless_simd::Level;
use proptest::prelude::*;

fn scratch(ends: &[(f32, f32)]) -> Scratch {
    Scratch {
        min: ends.iter().map(|e| e.0).collect(),
        max: ends.iter().map(|e| e.1).collect(),
        ..Scratch::default()
    }
}

fn unit() -> Profile {
    let mut profile = Profile::default();
    (profile.low, profile.high, profile.walls) = (0.0, 8.0, true);
    profile.linear(0.2, 0.075);
    profile
}

fn pricing(costs: &Costs) -> Pricing<'_> {
    Pricing {
        costs,
        steps: [costs.step, f32::INFINITY],
        limits: [f32::INFINITY; 2],
        by_count: false,
    }
}

proptest! {
    #[test]
    fn searches_find_the_plane_that_sorting_finds(
        ends in prop::collection::vec((0u16..700, 0u16..90), COUNT_LIMIT + 1..2 * STRETCH_LIMIT),
        clean in any::<bool>(),
        thesis in any::<bool>(),
        slabs in any::<bool>(),
    ) {
        let at = |x: u16| f32::from(x.min(640)) / 80.0;
        let mut scratch = scratch(
            &ends.into_iter().map(|(a, n)| (at(a), at(a + n))).collect::<Vec<_>>(),
        );
        if slabs {
            scratch.add_slabs(0.05);
        }
        let ties = if clean { Ties::Clean } else { Ties::StartsFirst };
        let costs = if thesis { Costs::THESIS } else { Costs::BLOCKS };
        let profile = unit();
        let pricing = Pricing { steps: [costs.step, 3.0 * costs.step], ..pricing(&costs) };
        let found = sweep(&mut scratch, &profile, &pricing, ties, Candidates::All);
        let merged = dispatch!(Level::new(), simd => {
            let mut batch = Batch::new(simd, &profile, &pricing, ties);
            sorted(&mut batch, &mut scratch);
            batch.finish()
        });
        prop_assert_eq!(found, merged);
        // Repeat with limits exactly at the costs found.
        let limits = found.map(|best| best.map_or(f32::INFINITY, |b| b.cost));
        let pricing = Pricing { limits, ..pricing };
        prop_assert_eq!(sweep(&mut scratch, &profile, &pricing, ties, Candidates::All), found);
    }
}

proptest! {
    /// A block's triangles are only ever separated from empty space.
    #[test]
    fn the_hull_has_the_planes_that_pay_for_a_block(
        ends in prop::collection::vec((0u8..70, 0u8..30), 1..9),
    ) {
        let at = |x: u8| f32::from(x.min(80)) / 10.0;
        let mut scratch = scratch(
            &ends.into_iter().map(|(a, n)| (at(a), at(a + n))).collect::<Vec<_>>(),
        );
        let costs = Costs::BLOCKS;
        let leaf = costs.leaf(scratch.min.len() as f32);
        let profile = unit();
        let pricing = Pricing { limits: [leaf; 2], ..pricing(&costs) };
        let mut found = |candidates| {
            sweep(&mut scratch, &profile, &pricing, Ties::Clean, candidates)[0]
                .filter(|best| best.cost < leaf)
        };
        prop_assert_eq!(found(Candidates::All), found(Candidates::Hull));
    }
}

proptest! {
    #[test]
    fn counting_and_sorting_find_the_same_plane(
        ends in prop::collection::vec((0u8..9, 0u8..4), 1..COUNT_LIMIT + 1),
        clean in any::<bool>(),
        thesis in any::<bool>(),
    ) {
        let ends: Vec<_> = ends
            .into_iter()
            .map(|(a, n)| (f32::from(a.min(8)), f32::from((a + n).min(8))))
            .collect();
        let ties = if clean { Ties::Clean } else { Ties::StartsFirst };
        let costs = if thesis { Costs::THESIS } else { Costs::BLOCKS };
        let profile = unit();
        let pricing = pricing(&costs);
        let counted = sweep(&mut scratch(&ends), &profile, &pricing, ties, Candidates::All);
        let merged = dispatch!(Level::new(), simd => {
            let mut batch = Batch::new(simd, &profile, &pricing, ties);
            sorted(&mut batch, &mut scratch(&ends));
            batch.finish()
        });
        prop_assert_eq!(counted, merged);
        // The counts behind the cost equal those of the assignment to sides.
        if let Some(best) = counted[0] {
            let sides = ends.iter().map(|e| best.touching.sides(best.at, e.0, e.1));
            let (left, right) = sides.fold((0.0, 0.0), |(l, r), (a, b)| {
                (l + f32::from(u8::from(a)), r + f32::from(u8::from(b)))
            });
            prop_assert_eq!(best.cost, costs.split(profile.shares(best.at).into(), [left, right]));
            prop_assert!(ends.iter().all(|e| {
                let (below, above) = best.touching.sides(best.at, e.0, e.1);
                below || above
            }), "a triangle was lost");
        }
    }
}

#[test]
fn walls_split_planar_triangles_only() {
    let flat_floor = [(0.0, 0.0), (0.0, 8.0), (0.0, 8.0)];
    let profile = unit();
    let pricing = pricing(&Costs::THESIS);
    let sweep = |ends: &[(f32, f32)]| {
        sweep(
            &mut scratch(ends),
            &profile,
            &pricing,
            Ties::Clean,
            Candidates::All,
        )[0]
    };
    let best = sweep(&flat_floor).unwrap();
    assert_eq!((best.at, best.touching), (0.0, Touching::PlanarBelow));
    let nothing_flat = [(0.0, 8.0), (0.0, 8.0)];
    assert_eq!(sweep(&nothing_flat), None);
}
