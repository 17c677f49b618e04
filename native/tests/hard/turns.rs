// SPDX-License-Identifier: GPL-3.0-or-later
//! All of many variants, or one of them in turn where a machine is emulated.

use crate::hard::share;

/// All of these; where a machine is emulated, one in turn.
pub fn in_turn<T>(all: &[T], turn: usize) -> &[T] {
    if share() == 1 {
        return all;
    }
    let chosen = turn % all.len();
    &all[chosen..=chosen]
}
