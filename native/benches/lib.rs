// SPDX-License-Identifier: GPL-3.0-or-later
//! Holds no code: the package exists for its benches.
