// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through trees of split planes as papers describe them, one file per algorithm; and the kernels of all trees
//! that test one triangle at a time ([`halfspace_leaf::scalar`]).

pub mod alone;
pub mod bounded;
pub mod mailbox;
pub mod origin;
pub mod projected;
pub mod published;
pub mod rope;
pub mod seq;
pub mod seq_1985;
pub mod ta_b;
pub mod ta_b_1997;
pub mod ta_b_poly;

pub use origin as arvo;
pub use origin as sung;
pub use origin as ta_a;
