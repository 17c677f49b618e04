// SPDX-License-Identifier: GPL-3.0-or-later
//! kd- and BSP trees whose lower parts are built when the first ray needs them.

use crate::build::Monitor;
use crate::build::shape::Shape;
use crate::build::space::{Params, PlanePolicy, lazy};
use crate::error::Result;
use crate::registry::Built;
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Layout;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;
use crate::trees::kd::plane_tree;

/// Why the whole tree is built at once in spite of `lazy=1`, if it is.
fn obstacle(config: &Config) -> Option<String> {
    for (key, walks) in [
        ("traversal", ["auto", "dir", "tile8"].as_slice()),
        ("shadow", &["none", "cache"]),
    ] {
        let chosen = config.choice(key);
        if !walks.contains(&chosen) {
            return Some(format!("lazy: {key}={chosen} walks a tree in one piece"));
        }
    }
    None
}

/// Builds what no ray needs to ask for, or the whole tree where the walk wants that.
///
/// # Errors
/// As [`lazy::build`] and [`plane_tree`].
pub fn build<P: PlanePolicy + Send + 'static>(
    scene: &Triangles,
    config: &Config,
    policy: P,
    params: &Params,
    monitor: &Monitor,
) -> Result<Built> {
    if let Some(reason) = obstacle(config) {
        let mut built = plane_tree(scene, config, &policy, params, monitor)?;
        built.left_out.push(reason);
        return Ok(built);
    }
    let frame = Frame::new(scene.bounds());
    let tree = lazy::build(scene, frame, policy, params, monitor)?;
    Ok(Built {
        frame: frame.with_robust(config.robust()),
        blocks: Blocks::new(),
        layout: Layout::Lazy(tree),
        // That of what is built, whenever it is asked for.
        shape: Shape::default(),
        left_out: Vec::new(),
    })
}
