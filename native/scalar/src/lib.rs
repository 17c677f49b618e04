// SPDX-License-Identifier: GPL-3.0-or-later
//! Kernels of single rays that test one triangle at a time: the traversals of [`halfspace_trace::single`] with the leaf
//! tests of [`halfspace_leaf::scalar`].

pub mod bounded;
pub mod published;
