// SPDX-License-Identifier: GPL-3.0-or-later
//! The parameters of a tree with oblique planes, read once.

use super::fixed::CUBE;
use super::{Variant, params};
use crate::kd::default_depth;
use crate::kd_sah::thesis_depth;
use halfspace_builders::space::{ObliqueStep, Params, Stop};
use halfspace_builders::sweep::Ties;
use halfspace_nodes::cost::Costs;
use halfspace_ray::frame::U;
use halfspace_structure::spec::{Config, Value};

/// Values of the parameters. One that the structure's row lacks has the value under which it changes nothing.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Number of directions of a node; 0 in rows without K.
    pub k: usize,
    /// Share of K that is tried at small nodes.
    pub k_small: f32,
    /// Number of triangles of a node whose planes are tried; 0 in rows without it.
    pub tried: usize,
    /// Seed of the random choices.
    pub seed: u64,
    /// Nodes above this depth try only the axes.
    pub axes_depth: usize,
    /// Whether triangles are cut to their cells.
    pub clip: bool,
    /// Whether costs and stopping rules are those of the thesis.
    thesis: bool,
    costs: Costs,
    /// Cost of a step through an oblique node.
    oblique: f32,
    /// Share of a triangle's cost that such a step costs for each triangle of the node.
    alpha: f32,
    /// Whether the fallback rule is that of the thesis's program.
    as_code: bool,
    ties: Ties,
    slab: bool,
    early: bool,
    enough: f32,
    area_stop: f32,
    stop: Stop,
    /// Depth limit; 0 chooses by the number of triangles.
    max_depth: usize,
    /// Whether a fixed set has more directions than the axes, which come first and may suffice. The thesis tries all.
    axes_first: bool,
}

impl Settings {
    /// Reads a configuration.
    ///
    /// # Panics
    /// When the structure's row lacks a parameter that all these trees have.
    pub fn of(config: &Config) -> Self {
        let has = |name| config.find(name).is_some();
        let integer = |name| if has(name) { config.integer(name) } else { 0 };
        let float = |name, none| if has(name) { config.float(name) } else { none };
        // The thesis has costs of its own, and tries K directions at every node.
        let thesis = config.pick("costs", [("fitted", false), ("thesis", true)]);
        let fitted = |name, otherwise| {
            if thesis {
                otherwise
            } else {
                float(name, otherwise)
            }
        };
        Self {
            k: integer("k"),
            k_small: fitted("k_small", 1.0),
            tried: integer("tried"),
            seed: integer("seed") as u64,
            axes_depth: integer("axes_depth"),
            clip: config.on("clip"),
            thesis,
            costs: if thesis {
                Costs::THESIS
            } else {
                crate::params::costs(config)
            },
            oblique: fitted("oblique_cost", Costs::THESIS_OBLIQUE),
            alpha: float("alpha", 0.0),
            as_code: has("alpha") && config.pick("rule", [("text", false), ("code", true)]),
            ties: config.pick(
                "ties",
                [("clean", Ties::Clean), ("pbrt", Ties::StartsFirst)],
            ),
            slab: config.on("slab"),
            early: has("early") && config.on("early"),
            enough: fitted("enough", 0.0),
            area_stop: fitted("area_stop", 0.0),
            stop: crate::params::stop(
                config,
                if thesis {
                    Stop::Tolerant(3)
                } else {
                    Stop::Cheapest
                },
            ),
            max_depth: integer("max_depth"),
            axes_first: !thesis
                && config.find("set") == Some(&Value::Choice("cube"))
                && (4..=CUBE).contains(&integer("k")),
        }
    }

    /// Returns whether the axes are among the directions of every node.
    pub fn has_axes(&self, variant: Variant) -> bool {
        variant != Variant::Plain || self.axes_first
    }

    /// Returns K at small nodes: a share of K, but at least one direction in addition to the axes.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most 32"
    )]
    pub fn at_small_nodes(&self, variant: Variant, k: usize) -> usize {
        let axes = if variant == Variant::Plain { 0 } else { 3 };
        let share = (k as f32 * self.k_small).ceil() as usize;
        share.max(axes + 1).min(k)
    }

    /// Returns the costs and rules of the build loop for a scene of this number of triangles.
    pub fn params(&self, triangles: usize, variant: Variant) -> Params {
        Params {
            costs: self.costs,
            // Only the variant with cheap axis nodes has the linear cost.
            oblique: match variant {
                Variant::PlusKd => ObliqueStep::Linear {
                    alpha: self.alpha,
                    fixed: self.oblique,
                    as_code: self.as_code,
                },
                Variant::Plain | Variant::Plus => ObliqueStep::Fixed(self.oblique),
            },
            ties: self.ties,
            slab: if self.slab { 20.0 * U } else { 0.0 },
            leaf_size: usize::from(self.thesis),
            leaf_most: params::LEAF_MOST,
            area_stop: self.area_stop,
            max_depth: match self.max_depth {
                0 if self.thesis => thesis_depth(triangles),
                0 => default_depth(triangles),
                depth => depth,
            },
            stop: self.stop,
            sorted: false,
            early: self.early,
            enough: self.enough,
        }
    }
}
