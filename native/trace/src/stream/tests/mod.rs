// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams answer as brute force does, through nodes of every kind.

mod answers;
mod counts;
mod trees;
