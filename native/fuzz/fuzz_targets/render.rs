// SPDX-License-Identifier: GPL-3.0-or-later
#![no_main]
#![allow(dead_code, reason = "each target uses its part of the harness")]

#[path = "../../tests/harness/mod.rs"]
mod harness;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| harness::render(bytes));
