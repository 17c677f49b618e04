// SPDX-License-Identifier: GPL-3.0-or-later
//! The cases of `halfspace::oracle`, with fewer rays where a machine is emulated.
//! Tests without rays take fewer structures.

use halfspace::oracle::cases::{self, Case, Size};
use std::sync::LazyLock;

/// Tests of hard scenes trace one ray of this many: the value of `HALFSPACE_TEST_SHARE`, 1 where it is not set.
pub fn share() -> usize {
    static SHARE: LazyLock<usize> = LazyLock::new(|| {
        let text = std::env::var("HALFSPACE_TEST_SHARE").unwrap_or_else(|_| "1".to_owned());
        let share = text.parse().ok().filter(|&share| share > 0);
        share.expect("HALFSPACE_TEST_SHARE: a whole number above 0")
    });
    *SHARE
}

/// All small cases of a seed, each with its share of the rays.
pub fn cases(seed: u64) -> Vec<Case> {
    let share = share();
    let mut cases = cases::cases(Size::Small, seed);
    for case in &mut cases {
        case.rays = case.rays.iter().copied().step_by(share).collect();
    }
    cases
}
