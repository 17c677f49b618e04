// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees with oblique planes: parts common to all families.
//!
//! A family is a [`Source`] of directions; a [`Variant`] selects the treatment of the axes.

pub mod beam_hh;
pub mod clusters;
mod draws;
pub mod fixed;
mod grow;
pub mod hybrid;
pub mod ize;
pub mod means;
pub mod normals;
pub mod params;
mod policy;
pub mod random;
pub mod settings;

use halfspace_base::Monitor;
use halfspace_builders::piece::Piece;

pub use grow::{build, build_with};
pub use policy::anything;
pub use settings::Settings;

/// The paper of the sweeps.
pub const HOOBERGS: &str =
    "Hoobergs 2019, Bomen voor binaire ruimtepartitie (master thesis, KU Leuven)";

/// Defines the three rows of a family of sweeps: plain, with the axes, and with the axes as cheap nodes. `named` is
/// the name of the plain row in the literature; `grow` builds a variant; `claims` are those about the last row.
macro_rules! sweep_rows {
    (
        $id:literal, $codes:expr, $label:literal, named $name:literal, along $along:literal, k $k:literal, $grow:path,
        claims $claims:expr
    ) => {
        $crate::bsp::sweep_rows!(
            $id, $codes, $label, named $name, along $along, k $k, $grow, claims $claims,
            params: params::usual, params::plus, params::kd
        );
    };
    (
        $id:literal, $codes:expr, $label:literal, named $name:literal, along $along:literal, k $k:literal, $grow:path,
        claims $claims:expr,
        params: $usual:path, $plus:path, $kd:path
    ) => {
        /// The registry's row: plain.
        pub const PLAIN: StructureSpec = StructureSpec {
            id: $id,
            code: $codes[0],
            label: concat!("BSP, ", $label),
            family: halfspace_structure::row::Family::Space,
            summary: concat!("Planes along ", $along, "."),
            paper: $crate::bsp::HOOBERGS,
            params: const { &$usual(params::k(1, $k)) }.slice(),
            ways: $crate::planes::rows::ANY_WAYS,
            no_groups: "",
            menu: halfspace_structure::row::Menu::Bsp,
            literature: &[($name, concat!("k=", $k))],
            sweep: true,
            claims: &["without-axes", "long-builds"],
            build: |scene, config, monitor| $grow(scene, config, monitor, Variant::Plain),
        };

        /// The registry's row: with the axes.
        pub const PLUS: StructureSpec = StructureSpec {
            id: concat!($id, "-plus"),
            code: $codes[1],
            label: concat!("BSP, ", $label, " +"),
            summary: concat!("Planes along the axes and ", $along, "."),
            params: const { &$plus(params::k(3, $k)) }.slice(),
            literature: &[(concat!($name, "+"), concat!("k=", $k))],
            claims: &["three-directions-are-kd", "long-builds"],
            build: |scene, config, monitor| $grow(scene, config, monitor, Variant::Plus),
            ..PLAIN
        };

        /// The registry's row: with the axes as cheap nodes.
        pub const PLUS_KD: StructureSpec = StructureSpec {
            id: concat!($id, "-plus-kd"),
            code: $codes[2],
            label: concat!("BSP, ", $label, " + Kd"),
            summary: concat!("Planes along the axes, at cheap nodes, and ", $along, "."),
            params: const { &$kd(params::k(3, $k)) }.slice(),
            literature: &[(concat!($name, "+^Kd"), concat!("k=", $k))],
            claims: $claims,
            build: |scene, config, monitor| $grow(scene, config, monitor, Variant::PlusKd),
            ..PLAIN
        };
    };
}
pub(crate) use sweep_rows;

/// Treatment of the axes. K counts all directions of a node, including the axes among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// The axes are not treated specially.
    Plain,
    /// The first three directions are the axes.
    Plus,
    /// Like `Plus`, and nodes split along an axis are traversed and priced like those of a kd-tree.
    PlusKd,
}

/// The triangles of a node, one per piece.
pub trait Ids {
    /// Number of pieces.
    fn count(&self) -> usize;

    /// The triangle of a piece.
    fn get(&self, piece: usize) -> u32;
}

impl<P: Piece> Ids for &[P] {
    fn count(&self) -> usize {
        self.len()
    }

    fn get(&self, piece: usize) -> u32 {
        self[piece].id()
    }
}

/// A node without the type of its pieces. It keeps [`Source`] free of type parameters, so the build loop is compiled
/// once for all sources.
pub struct Triangulated<'a> {
    /// Key of the random choices at this node.
    pub key: u64,
    /// Its triangles.
    pub ids: &'a dyn Ids,
    /// The monitor of the build: a source that takes long returns when it is cancelled.
    pub monitor: &'a Monitor,
}

/// A source of directions for nodes.
pub trait Source: Send + Sync {
    /// Adds directions until `out` holds `k`, or until there are no more worth trying. Directions in `out` are not added
    /// again.
    fn directions(&self, node: &Triangulated<'_>, k: usize, out: &mut Vec<[f32; 3]>);

    /// Returns the bytes that the source holds.
    fn bytes(&self) -> usize {
        0
    }

    /// Adds further directions for a node that would otherwise become a leaf.
    fn more(&self, _: &Triangulated<'_>, _: &mut Vec<[f32; 3]>) {}
}

/// Largest absolute cosine of two directions that count as distinct.
const SAME: f32 = 0.999_99;

/// Appends a direction unless it or its opposite is in `out`. Returns whether it was appended.
pub fn add_distinct(out: &mut Vec<[f32; 3]>, n: [f32; 3]) -> bool {
    let known = out
        .iter()
        .any(|m| (m[0] * n[0] + m[1] * n[1] + m[2] * n[2]).abs() > SAME);
    if !known {
        out.push(n);
    }
    !known
}

/// Unit vectors of the axes.
pub const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
