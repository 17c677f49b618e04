// SPDX-License-Identifier: GPL-3.0-or-later
//! The instruction set that kernels use: the best of this machine, or a smaller one chosen for measurements. Answers do
//! not depend on it; tests run on all of them.

use crate::error::{Error, Result};
use fearless_simd::Level;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One more than the index in [`NAMES`] of the instruction set in use; 0 for the best.
static CHOSEN: AtomicUsize = AtomicUsize::new(0);

/// The instruction sets for which kernels are compiled, the smallest first.
#[cfg(target_arch = "x86_64")]
const NAMES: [&str; 3] = ["sse4.2", "avx2", "avx512"];
#[cfg(target_arch = "aarch64")]
const NAMES: [&str; 2] = ["fallback", "neon"];
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
const NAMES: [&str; 1] = ["fallback"];

/// Returns the instruction set at an index of [`NAMES`] if kernels can use it on this machine.
fn at(index: usize) -> Option<Level> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let level = match index {
        0 => best.as_sse4_2().map(Level::Sse4_2),
        1 => best.as_avx2().map(Level::Avx2),
        _ => best.as_avx512().map(Level::Avx512),
    };
    #[cfg(target_arch = "aarch64")]
    let level = (best.as_neon().is_some() == (index == 1)).then_some(best);
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let level = (index == 0).then_some(best);
    level
}

/// Returns each instruction set for which kernels are compiled and that this machine has, with its name, the smallest
/// first.
#[must_use]
pub fn levels() -> Vec<(&'static str, Level)> {
    let named = NAMES.into_iter().enumerate();
    named
        .filter_map(|(index, name)| Some((name, at(index)?)))
        .collect()
}

/// The instruction set in use. Builders call it at every node.
#[must_use]
pub fn level() -> Level {
    let chosen = CHOSEN.load(Ordering::Relaxed).checked_sub(1);
    chosen.and_then(at).unwrap_or_else(Level::new)
}

/// The name of the instruction set in use.
#[must_use]
pub fn name() -> &'static str {
    match CHOSEN.load(Ordering::Relaxed) {
        0 => levels().last().expect("there is one").0,
        chosen => NAMES[chosen - 1],
    }
}

/// Uses the instruction set of this name from now on, in all threads of the process; "best" uses the best.
///
/// # Errors
/// [`Error::Shape`] if this machine has none of this name.
pub fn choose(wanted: &str) -> Result<()> {
    let index = NAMES.iter().position(|name| *name == wanted);
    let chosen = match index.filter(|&index| at(index).is_some()) {
        Some(index) => index + 1,
        None if wanted == "best" => 0,
        None => {
            let names: Vec<_> = levels().into_iter().map(|(name, _)| name).collect();
            return Err(Error::Shape(format!(
                "level: expected best, {}, got {wanted:?}",
                names.join(", ")
            )));
        }
    };
    CHOSEN.store(chosen, Ordering::Relaxed);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chosen_level_is_used_and_an_unknown_one_changes_nothing() {
        let best = name();
        for (wanted, _) in levels() {
            choose(wanted).unwrap();
            assert_eq!(name(), wanted);
            let error = choose("mmx").unwrap_err().to_string();
            assert!(error.contains(wanted) && error.contains("mmx"), "{error}");
            assert_eq!(name(), wanted);
        }
        choose("best").unwrap();
        assert_eq!(name(), best);
    }
}
