// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes whose lower parts are built when the first ray needs them.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::space::{Params, PlanePolicy, lazy};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::lazy_tree::{LazyTree, Progress};
use halfspace_nodes::shape::Shape;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::row::Growing;
use halfspace_structure::spec::Config;
use halfspace_structure::way::Rays;
use halfspace_structure::{Built, Plan};
use halfspace_trace::single::planes::dir;
use halfspace_trace::tile;
use std::sync::Arc;

/// Builds the upper part of the tree; the kernels of its plan build the rest where rays arrive.
///
/// # Errors
/// As [`lazy::build`].
pub fn build<P: PlanePolicy + Send + 'static>(
    scene: &Triangles,
    config: &Config,
    policy: P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Built> {
    let frame = Frame::new(scene.bounds());
    let tree = Arc::new(lazy::build(scene, frame, policy, params, monitor)?);
    let leaves = Arc::new(Blocks::new());
    let mut plan = Plan::single("planes", "dir", dir::lazy(&tree, &leaves));
    if config.way().traversal != "dir" {
        let shadow = tile::kernel::shadow_lazy(&tree, &leaves);
        plan = (plan.with_tiles(Rays::Tile, tile::kernel::lazy(&tree, &leaves)))
            .with_any(Rays::Tile, shadow);
    }
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        tree: None,
        leaves,
        derived: Vec::new(),
        plan: plan.with_shadow(config.choice("shadow"), None),
        // `growing` returns the shape of the part that is built so far.
        shape: Shape::default(),
        left_out: Vec::new(),
        growing: Some(Arc::new(Lazy(tree))),
        refit: None,
    })
}

/// A tree that rays build.
#[derive(Debug)]
struct Lazy(Arc<LazyTree>);

impl Growing for Lazy {
    fn progress(&self) -> Progress {
        self.0.progress()
    }

    fn whole(&self, scene: &Triangles, frame: &Frame, left_out: &[String]) -> Built {
        let (tree, blocks, shape) =
            (self.0.whole(scene, frame)).expect("the links of a tree reach all of it");
        let (tree, leaves) = (Arc::new(tree), Arc::new(blocks));
        Built {
            frame: *frame,
            plan: Plan::single("planes", "dir", dir::dir(&tree, &leaves)),
            tree: Some(tree),
            leaves,
            derived: Vec::new(),
            shape,
            left_out: left_out.to_vec(),
            growing: None,
            refit: None,
        }
    }
}
