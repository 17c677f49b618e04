// SPDX-License-Identifier: GPL-3.0-or-later
//! Whole renders against closed forms, against Cycles, and against each other.

mod brightness;
mod left_out;
mod passes;
mod plain;
mod same_picture;
mod setup;
mod shadows;
mod trouble;
