// SPDX-License-Identifier: GPL-3.0-or-later
//! Groups of rays that traverse a tree together: packets, and tiles of rays with a common origin, whose remainders go on in
//! packets.

pub mod packet;
pub mod tile;
pub mod visits;
