// SPDX-License-Identifier: GPL-3.0-or-later
//! What each of many configurations is tested with; in turn where a machine is emulated.

use crate::hard::share;

/// All of these; where a machine is emulated, one in turn.
pub fn in_turn<T>(all: &[T], turn: usize) -> &[T] {
    if share() == 1 {
        return all;
    }
    let chosen = turn % all.len();
    &all[chosen..=chosen]
}
