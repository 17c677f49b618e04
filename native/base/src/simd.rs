// SPDX-License-Identifier: GPL-3.0-or-later
//! The instruction set that kernels use: the best of this machine, or a smaller one chosen for measurements. Answers do
//! not depend on it; tests run on all of them.

use crate::error::{Error, Result};
use fearless_simd::Level;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One more than the index in [`levels`] of the instruction set in use; 0 for the best.
static CHOSEN: AtomicUsize = AtomicUsize::new(0);

/// Returns each instruction set for which kernels are compiled and that this machine has, with its name, the smallest
/// first.
#[must_use]
pub fn levels() -> Vec<(&'static str, Level)> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let levels = {
        let mut levels = Vec::new();
        levels.extend(best.as_sse4_2().map(|l| ("sse4.2", Level::Sse4_2(l))));
        levels.extend(best.as_avx2().map(|l| ("avx2", Level::Avx2(l))));
        levels.extend(best.as_avx512().map(|l| ("avx512", Level::Avx512(l))));
        levels
    };
    #[cfg(target_arch = "aarch64")]
    let levels = {
        let neon = best.as_neon().is_some();
        vec![(if neon { "neon" } else { "fallback" }, best)]
    };
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let levels = vec![("fallback", best)];
    levels
}

/// The instruction set in use.
#[must_use]
pub fn level() -> Level {
    match CHOSEN.load(Ordering::Relaxed) {
        0 => Level::new(),
        chosen => levels()[chosen - 1].1,
    }
}

/// The name of the instruction set in use.
#[must_use]
pub fn name() -> &'static str {
    let levels = levels();
    match CHOSEN.load(Ordering::Relaxed) {
        0 => levels[levels.len() - 1].0,
        chosen => levels[chosen - 1].0,
    }
}

/// Uses the instruction set of this name from now on, in all threads of the process; "best" uses the best.
///
/// # Errors
/// [`Error::Shape`] if this machine has none of this name.
pub fn choose(wanted: &str) -> Result<()> {
    let levels = levels();
    let chosen = match levels.iter().position(|(name, _)| *name == wanted) {
        Some(index) => index + 1,
        None if wanted == "best" => 0,
        None => {
            let names: Vec<_> = levels.iter().map(|(name, _)| *name).collect();
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
