// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through trees of split planes.

pub mod dir;
