// SPDX-License-Identifier: GPL-3.0-or-later
//! Helpers of several integration tests.

use halfspace::base::Monitor;
use halfspace::registry;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use std::sync::Arc;

/// Builds a structure on one thread.
pub fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).expect("a valid configuration");
    Structure::build(scene.clone(), config, 1, &Monitor::new()).expect("enough memory")
}
