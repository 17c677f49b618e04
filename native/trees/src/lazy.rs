// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes built at once, or, with `lazy=1`, in their lower parts when the first ray needs them.

use crate::params::LAZY;
use crate::planes;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::space::{self, Params, PlanePolicy, lazy};
use halfspace_group::tile;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::lazy_tree::{LazyTree, Progress};
use halfspace_nodes::preorder::Preorder;
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_single::planes::dir;
use halfspace_structure::row::Growing;
use halfspace_structure::spec::{Config, Value};
use halfspace_structure::way::Rays;
use halfspace_structure::{Built, Plan};
use std::fmt::Debug;
use std::sync::Arc;

/// Lists the features that a tree of this shape did not need, each with its reason. The number is that of nodes that
/// tried their first directions only.
pub type LeftOut = Box<dyn Fn(&Shape, usize) -> Vec<String> + Send + Sync>;

/// Returns whether a configuration has `lazy=1`.
pub fn is_lazy(config: &Config) -> bool {
    config.find(LAZY.name) == Some(&Value::Choice("1"))
}

/// A tree as its builder returns it.
pub enum Grown {
    /// All nodes.
    Whole(Preorder),
    /// The upper part, and the number of bytes that all unbuilt subtrees need in common.
    Upper(LazyTree, usize),
}

/// Builds the tree of a policy, or its upper part if the configuration has `lazy=1`, in the current rayon pool.
///
/// # Errors
/// Those of [`space::build`] and [`lazy::build`].
pub fn grow<P: PlanePolicy + Send + 'static>(
    scene: &Triangles,
    config: &Config,
    frame: &Frame,
    policy: P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Grown> {
    if is_lazy(config) {
        let shared = policy.bytes();
        let upper = lazy::build(scene, *frame, policy, params, monitor)?;
        return Ok(Grown::Upper(upper, shared));
    }
    let whole = space::build(scene, frame, &policy, params, monitor)?;
    Ok(Grown::Whole(whole))
}

impl Grown {
    /// Lays out the tree and makes the plan that the configuration chooses.
    ///
    /// # Errors
    /// Those of [`planes::lay_out`].
    pub fn lay_out(
        self,
        scene: &Triangles,
        config: &Config,
        frame: Frame,
        left_out: LeftOut,
        monitor: &Monitor,
    ) -> Result<Built> {
        match self {
            Self::Whole(preorder) => {
                let built = planes::lay_out(scene, config, frame, &preorder, monitor)?;
                let shape = Shape::new(&preorder);
                let mut left_out = left_out(&shape, preorder.first_only);
                let planes = shape.nodes_axis + shape.nodes_oblique;
                if config.way().nodes == "boxes" && planes > 0 {
                    let boxes = built.shape.nodes_axis + built.shape.nodes_oblique;
                    left_out.push(format!(
                        "split planes: rays meet the {boxes} nodes of boxes made from {planes} planes"
                    ));
                }
                Ok(Built { left_out, ..built })
            }
            Self::Upper(tree, shared) => {
                let lazy = Lazy {
                    tree: Arc::new(tree),
                    shared,
                    left_out,
                };
                Ok(growing(lazy, config, frame))
            }
        }
    }
}

/// Makes the plan of a tree whose upper part is built; its kernels build the rest where rays arrive.
fn growing(lazy: Lazy, config: &Config, frame: Frame) -> Built {
    let (tree, leaves) = (lazy.tree.clone(), Arc::new(Blocks::new()));
    let mut plan = Plan::single("planes", "dir", dir::lazy(&tree, &leaves));
    let choice = config.choice("shadow");
    if config.way().traversal != "dir" {
        plan = plan.with_tiles(Rays::Tile, tile::kernel::lazy(&tree, &leaves));
        // Tiles cache leaves of one store only.
        if choice != "cache" {
            let shadow = tile::kernel::shadow_lazy(&tree, &leaves);
            plan = plan.with_any(Rays::Tile, shadow);
        }
    }
    Built {
        frame: frame.with_robust(config.robust()),
        tree: None,
        leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(choice, None),
        // `growing` returns the shape of the part that is built so far, and what it left out.
        shape: Shape::default(),
        left_out: Vec::new(),
        growing: Some(Arc::new(lazy)),
        refit: None,
    }
}

/// A tree that rays build.
struct Lazy {
    tree: Arc<LazyTree>,
    /// Number of bytes that all unbuilt subtrees need in common.
    shared: usize,
    left_out: LeftOut,
}

impl Debug for Lazy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Lazy").field(&self.tree).finish()
    }
}

impl Growing for Lazy {
    fn progress(&self) -> Progress {
        let mut progress = self.tree.progress();
        // The last subtree frees what they have in common.
        if progress.unbuilt > 0 {
            progress.bytes += self.shared;
        }
        progress
    }

    fn left_out(&self) -> Vec<String> {
        let progress = self.progress();
        (self.left_out)(&progress.shape, progress.first_only)
    }

    fn whole(&self, scene: &Triangles, frame: &Frame) -> Built {
        let (tree, blocks, shape) =
            (self.tree.whole(scene, frame)).expect("the links of a tree reach all of it");
        let (tree, leaves) = (Arc::new(tree), Arc::new(blocks));
        Built {
            frame: *frame,
            plan: Plan::single("planes", "dir", dir::dir(&tree, &leaves)),
            tree: Some(tree),
            leaves,
            derived: Vec::new(),
            shape,
            left_out: self.left_out(),
            growing: None,
            refit: None,
        }
    }
}
