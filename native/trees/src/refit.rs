// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies whose nodes can be fitted to moved triangles: the last step of their build, and the fit.

use crate::objects;
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_builders::refit::Topology;
use halfspace_geom::Aabb;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::nested;
use halfspace_nodes::refit::FitTree;
use halfspace_nodes::shape::Shape;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::row::Refit;
use halfspace_structure::spec::Config;
use halfspace_structure::{Built, Plan};
use std::sync::{Arc, OnceLock};

/// Makes the plan of a tree whose scene has these bounds, in the tree's frame.
pub type MakePlan<T> = fn(&Config, &Arc<T>, &Arc<Blocks>, Aabb) -> Plan;

/// The layers of a tree whose nodes can be fitted.
pub struct Layers<T> {
    /// The frame of its coordinates.
    pub frame: Frame,
    /// The nodes.
    pub tree: Arc<T>,
    /// The triangles of the leaves.
    pub leaves: Arc<Blocks>,
    /// Statistics of the nodes.
    pub shape: Shape,
}

/// A built hierarchy that can be fitted to moved triangles. The parameters `robust` and `shadow` are applied here.
pub fn built<T: FitTree>(config: &Config, layers: Layers<T>, plan: MakePlan<T>) -> Built {
    let refit = Refitted {
        template: layers.tree.clone(),
        leaves: Some(layers.leaves.clone()),
        topology: OnceLock::new(),
        plan,
    };
    assemble(config, layers, refit)
}

/// A built hierarchy with what the next fit needs.
fn assemble<T: FitTree>(config: &Config, layers: Layers<T>, refit: Refitted<T>) -> Built {
    let Layers {
        frame,
        tree,
        leaves,
        shape,
    } = layers;
    let plan = (refit.plan)(config, &tree, &leaves, frame.bounds());
    let built = objects::built(config, frame, tree, leaves, plan, shape);
    Built {
        refit: Some(Arc::new(refit)),
        ..built
    }
}

/// The tree as it was built. Later trees are fitted from it, so triangles that could not be hit for a while are found
/// again.
#[derive(Debug)]
struct Refitted<T> {
    template: Arc<T>,
    /// The leaves of the template, from which the topology is read; `None` in a fitted tree, which has the topology.
    leaves: Option<Arc<Blocks>>,
    /// Made for the first fit.
    topology: OnceLock<Arc<Topology>>,
    plan: MakePlan<T>,
}

impl<T: FitTree> Refitted<T> {
    fn topology(&self) -> &Arc<Topology> {
        self.topology.get_or_init(|| {
            let leaves = (self.leaves.as_ref()).expect("kept until the topology is known");
            Arc::new(Topology::new(&*self.template, leaves))
        })
    }
}

impl<T: FitTree> Refit for Refitted<T> {
    fn refit(&self, scene: &Triangles, config: &Config, monitor: &Monitor) -> Result<Built> {
        let topology = self.topology();
        if let Some(id) = missing(topology.ids(), scene) {
            return Err(Error::Refit(format!(
                "triangle {id} had no area or was not finite when the tree was built, and can be hit now: \
                 the structure must be built again"
            )));
        }
        let frame = Frame::new(scene.bounds());
        let framed = FramedScene {
            scene,
            frame: &frame,
        };
        let (tree, leaves) = topology.refit(&*self.template, framed, monitor)?;
        let layers = Layers {
            frame,
            shape: nested::shape(&tree, frame.bounds()),
            tree: Arc::new(tree),
            leaves: Arc::new(leaves),
        };
        let refit = Self {
            template: self.template.clone(),
            leaves: None,
            topology: OnceLock::from(topology.clone()),
            plan: self.plan,
        };
        Ok(assemble(config, layers, refit))
    }

    fn bytes(&self) -> usize {
        let topology = self.topology.get().map_or(0, |topology| topology.bytes());
        // The template of a fitted tree is a tree of its own.
        let template = if self.leaves.is_some() {
            0
        } else {
            size_of_val(self.template.nodes())
        };
        topology + template
    }
}

/// Returns a triangle that can be hit and is not one of `ids`, if there is one.
fn missing(ids: &[u32], scene: &Triangles) -> Option<u32> {
    if ids.len() == scene.len() {
        return None;
    }
    let mut held = vec![false; scene.len()];
    for &id in ids {
        held[id as usize] = true;
    }
    scene.live().iter().copied().find(|&id| !held[id as usize])
}
