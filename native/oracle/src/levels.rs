// SPDX-License-Identifier: GPL-3.0-or-later
//! The instruction sets for which traversals are compiled and that this machine has. Answers do not depend on them;
//! tests run on all of them.

use fearless_simd::Level;

/// Returns each instruction set with its name, the smallest first.
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
    #[cfg(not(target_arch = "x86_64"))]
    let levels = vec![("best", best)];
    levels
}
