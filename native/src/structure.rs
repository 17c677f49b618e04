// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure over a scene: rays in, answers out.

mod recording;
mod tracer;
mod tracing;

pub use self::tracer::AtLevel;
use self::tracing::Batches;
use crate::build::grid::Grid;
use crate::build::lazy_tree::{LazyTree, Progress};
use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::PlaneTree;
use crate::build::ropes::Ropes;
use crate::build::shape::Shape;
use crate::build::{Monitor, footprint, ropes};
use crate::error::{Error, Result};
use crate::leaf_depth::LeafDepths;
use crate::outline::Outline;
use crate::registry::Built;
use crate::scene::Triangles;
use crate::spec::Config;
use crate::traverse::frame::Frame;
use crate::traverse::objects::Objects;
use crate::traverse::plane_boxes::PlaneBoxes;
use crate::traverse::tile::Lately;
use crate::traverse::wide_tree::WideTree;
use crate::traverse::{cases, plane_beam};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// A tree, laid out for one way of walking: matched once per batch of rays, never per ray.
#[derive(Debug, PartialEq)]
pub enum Layout {
    /// No tree.
    Brute,
    /// Planes.
    Plane(PlaneTree, PlaneWalk),
    /// Planes, built as far as rays go; walked by distances in the order of the direction.
    Lazy(LazyTree),
    /// Objects, by boxes or intervals around them.
    Objects(Objects),
    /// Equal cells.
    Grid(Grid),
    /// Octants, from the top.
    OctreeParam(Octree),
    /// Octants, from leaf to leaf by links.
    OctreeNet(Octree),
    /// The same, and tiles of rays as beams, down to this many rays.
    OctreeBeam(Octree, u32),
    /// Octants, from leaf to leaf by the common ancestor.
    OctreeSamet(Octree),
    /// Octants, from leaf to leaf by the root.
    OctreeGlassner(Octree),
}

/// A way of walking a tree of planes. All but `Dir`, `TaBPoly` and `Beams` need axis-aligned planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaneWalk {
    /// By distances in the order of the direction.
    Dir,
    /// By entry and exit points.
    TaB,
    /// The same as published.
    TaB1997,
    /// By entry and exit points, whatever the planes.
    TaBPoly,
    /// Leaf after leaf, each from the root.
    Seq,
    /// The same as published.
    Seq1985,
    /// From leaf to leaf by ropes.
    Rope,
    /// The same as published.
    Rope1990,
    /// By the side of the origin and distances, case by case.
    TaA,
    /// The same as published.
    TaA1997,
    /// By the side of the origin and distances, as Sung and Shirley.
    Sung,
    /// The same as published.
    Sung1992,
    /// By the side of the origin and distances, as Arvo.
    Arvo,
    /// The same as published.
    Arvo1988,
    /// By distances in the order of the direction, and tiles of rays as beams, down to this many rays.
    Beams(u32),
}

/// A built structure.
#[derive(Debug)]
pub struct Structure {
    scene: Arc<Triangles>,
    config: Config,
    batches: Batches,
    built: Built,
    /// All of a tree that is built as far as rays go, in one piece, once somebody asks.
    whole: OnceLock<Built>,
    /// The tree of planes once more, for walks through wide nodes.
    wide: Option<WideTree>,
    /// The tree of planes once more, as boxes around what its planes part.
    boxes: Option<PlaneBoxes>,
    /// Links between the leaves of the tree of planes, for walks from leaf to leaf.
    ropes: Option<Ropes>,
    build_seconds: f64,
    /// Gathered when somebody asks.
    leaf_depths: OnceLock<LeafDepths>,
    /// Made when the first instance asks for it.
    outline: OnceLock<Outline>,
    /// How tiles of camera rays and of shadow rays went lately.
    lately: [Lately; 2],
}

#[cfg(test)]
impl Structure {
    /// Of a configuration that is right, on one thread.
    pub(crate) fn of(scene: &Arc<Triangles>, spec: &str) -> Self {
        let config = Config::parse(spec).expect("a right configuration");
        Self::build(scene.clone(), config, 1, &Monitor::new()).expect("a tree")
    }
}

/// What progress takes for the share of boxes in the time of a build. Where planes are dear it is less.
const BOXES: f64 = 0.35;

/// What a tree of planes is laid out as a second time: nodes of seven planes, or boxes, whatever its planes.
fn second_layout(
    scene: &Triangles,
    built: &Built,
    batches: Batches,
    monitor: &Monitor,
) -> Result<(Option<WideTree>, Option<PlaneBoxes>)> {
    let Layout::Plane(tree, _) = &built.layout else {
        return Ok((None, None));
    };
    match batches {
        Batches::Boxes | Batches::Auto => {
            let boxes = PlaneBoxes::new(tree, (scene, &built.frame), monitor)?;
            Ok((None, Some(boxes)))
        }
        Batches::Wide => {
            let nodes = WideTree::new(tree);
            monitor.take(nodes.bytes())?;
            Ok((Some(nodes), None))
        }
        _ => Ok((None, None)),
    }
}

impl Structure {
    /// Builds `config` over `scene` on `threads` threads, 0 for one per core.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when the monitor says so; [`Error::Memory`] when the build would need more than the
    /// monitor allows, or when no threads can start.
    pub fn build(
        scene: Arc<Triangles>,
        config: Config,
        threads: usize,
        monitor: &Monitor,
    ) -> Result<Self> {
        let _held = monitor.hold(scene.live().len() * footprint::TRIANGLE)?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::Memory(format!("threads: {e}")))?;
        let start = Instant::now();
        let batches = Batches::new(&config);
        let boxed = matches!(batches, Batches::Auto | Batches::Boxes)
            && config.structure().traversals().contains(&"boxes");
        let planes = if boxed { 1.0 - BOXES } else { 1.0 };
        let mut built = monitor.during(planes, || {
            pool.install(|| (config.structure().build)(&scene, &config, monitor))
        })?;
        let (wide, boxes) = monitor.during(1.0 - planes, || {
            let made = pool.install(|| second_layout(&scene, &built, batches, monitor))?;
            if made.1.is_none() {
                // Trees that rays build have none.
                monitor.advance(1.0);
            }
            Ok::<_, Error>(made)
        })?;
        let ropes = match &built.layout {
            Layout::Plane(tree, PlaneWalk::Rope | PlaneWalk::Rope1990) => {
                let kind = match config.choice("traversal") {
                    "ropetree" => ropes::Kind::RopeTrees,
                    _ => ropes::Kind::Ropes,
                };
                let ropes = Ropes::new(tree, built.frame.bounds(), kind, monitor)?;
                built.shape.links = ropes.count();
                Some(ropes)
            }
            _ => None,
        };
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            scene,
            batches,
            config,
            built,
            whole: OnceLock::new(),
            wide,
            boxes,
            ropes,
            build_seconds,
            leaf_depths: OnceLock::new(),
            lately: Default::default(),
            outline: OnceLock::new(),
        })
    }

    /// The triangles.
    pub fn scene(&self) -> &Arc<Triangles> {
        &self.scene
    }

    /// Structure and parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Seconds that the build took, by the clock.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// The tree's shape, as far as it is built.
    pub fn shape(&self) -> Shape {
        self.progress().shape
    }

    /// How far the tree is built: wholly, unless rays have it built.
    pub fn progress(&self) -> Progress {
        match &self.built.layout {
            Layout::Lazy(tree) => tree.progress(),
            _ => Progress {
                shape: self.built.shape,
                ..Progress::default()
            },
        }
    }

    /// The frame its coordinates are in.
    pub fn frame(&self) -> &Frame {
        &self.built.frame
    }

    /// What the scene did not need, each with its reason.
    pub fn left_out(&self) -> &[String] {
        &self.built.left_out
    }

    /// All of the tree, for validation and drawing. Where rays have it built, this builds what is left and lays
    /// it out once more in one piece.
    ///
    /// # Panics
    /// When the whole has more nodes or leaf data than its links can name, which is an error of other builds.
    pub fn built(&self) -> &Built {
        let Layout::Lazy(tree) = &self.built.layout else {
            return &self.built;
        };
        self.whole.get_or_init(|| {
            let (tree, blocks, shape) = tree
                .whole(&self.scene, &self.built.frame)
                .expect("the links of a tree reach all of it");
            Built {
                frame: self.built.frame,
                blocks,
                layout: Layout::Plane(tree, PlaneWalk::Dir),
                shape,
                left_out: self.built.left_out.clone(),
            }
        })
    }

    /// The boxes that are made from a tree of planes, where the walk needs them.
    pub fn boxes(&self) -> Option<&PlaneBoxes> {
        self.boxes.as_ref()
    }

    /// The links between leaves, where the walk needs them.
    pub fn ropes(&self) -> Option<&Ropes> {
        self.ropes.as_ref()
    }

    /// What counted walks tell apart, by the places in [`RayCounters::cases`].
    pub fn cases(&self) -> &'static [&'static str] {
        match self.built.layout {
            Layout::Plane(_, PlaneWalk::TaB | PlaneWalk::TaB1997) => &cases::NAMES,
            Layout::Plane(_, PlaneWalk::Beams(_)) => &plane_beam::NAMES,
            _ => &[],
        }
    }

    /// Bytes of nodes and leaves of all layouts, without the scene's own arrays.
    pub fn bytes(&self) -> usize {
        let nodes = match &self.built.layout {
            Layout::Brute => 0,
            Layout::Plane(tree, _) => tree.bytes(),
            Layout::Lazy(tree) => tree.progress().bytes,
            Layout::Objects(tree) => tree.nested().bytes(),
            Layout::Grid(grid) => grid.bytes(),
            Layout::OctreeParam(tree)
            | Layout::OctreeNet(tree)
            | Layout::OctreeBeam(tree, _)
            | Layout::OctreeSamet(tree)
            | Layout::OctreeGlassner(tree) => tree.bytes(),
        };
        let more = self.wide.as_ref().map_or(0, WideTree::bytes)
            + self.boxes.as_ref().map_or(0, PlaneBoxes::bytes)
            + self.ropes.as_ref().map_or(0, Ropes::bytes);
        let whole = self.whole.get().map_or(0, |whole| {
            let Layout::Plane(tree, _) = &whole.layout else {
                return 0;
            };
            tree.bytes() + whole.blocks.bytes()
        });
        nodes + more + whole + self.built.blocks.bytes()
    }

    /// What an instance needs to know of the triangles.
    pub fn outline(&self) -> &Outline {
        self.outline.get_or_init(|| Outline::new(&self.scene))
    }
}
