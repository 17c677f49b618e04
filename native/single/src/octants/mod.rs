// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through octrees, one file per way from a cell to the next.

pub mod glassner;
pub mod net;
pub mod param;
pub mod samet;
pub mod step;
