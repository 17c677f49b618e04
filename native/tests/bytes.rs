// SPDX-License-Identifier: GPL-3.0-or-later
//! The fuzzing targets without a fuzzer: every target on many random byte strings, the same in each run.
//! `HALFSPACE_FUZZ_SECONDS` sets a time per target instead of a number of strings.

mod harness;

use halfspace::oracle::cases::Random;
use std::time::{Duration, Instant};

/// Number of byte strings per target by default.
const COUNT: u32 = 1500;

/// Random bytes, bytes of few values, or text similar to a configuration.
fn make(random: &mut Random) -> Vec<u8> {
    let words = [
        "kd",
        "kd-sah",
        "brute",
        "octree-net",
        ":",
        "=",
        ",",
        "max_depth",
        "traversal",
        "-1",
        "61",
        "1e99",
        "nan",
        "dir",
    ];
    let length = [8, 64, 400, 2000][random.below(4)];
    match random.below(4) {
        0 => (0..random.below(8))
            .flat_map(|_| random.pick(&words).bytes())
            .collect(),
        1 => (0..length)
            .map(|_| random.pick(&[0, 1, 8, 16, 64, 128, 255]))
            .collect(),
        _ => (0..length)
            .map(|_| u8::try_from(random.below(256)).expect("a byte"))
            .collect(),
    }
}

#[test]
fn every_target_accepts_any_bytes() {
    let seconds = std::env::var("HALFSPACE_FUZZ_SECONDS").ok();
    let longer = seconds
        .map(|text| Duration::from_secs(text.parse().expect("HALFSPACE_FUZZ_SECONDS: a number")));
    for (name, target) in harness::TARGETS {
        let (start, mut number) = (Instant::now(), 0_u32);
        while longer.map_or(number < COUNT, |time| start.elapsed() < time) {
            let bytes = make(&mut Random(
                u64::from(number) << 8 | u64::from(name.as_bytes()[0]),
            ));
            if std::panic::catch_unwind(|| target(&bytes)).is_err() {
                panic!("{name}: input {number} of {} bytes: {bytes:?}", bytes.len());
            }
            number += 1;
        }
        println!("{name}: {number} inputs");
    }
}
