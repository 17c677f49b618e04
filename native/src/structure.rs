// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure over a scene: rays in, answers out.

use crate::build::grid::Grid;
use crate::build::lazy_tree::{LazyTree, Progress};
use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{PlaneTree, Shape};
use crate::build::ropes::{self, Ropes};
use crate::build::{Monitor, footprint};
use crate::error::{Error, Result};
use crate::leaf_depth::LeafDepths;
use crate::outline::Outline;
use crate::registry::Built;
use crate::scene::Triangles;
use crate::spec::{Config, Value};
use crate::traverse::batch::{Batch, Walk, WithWalk, Write};
use crate::traverse::cases;
use crate::traverse::frame::{Frame, FrameRay};
use crate::traverse::grid_step;
use crate::traverse::objects::Objects;
use crate::traverse::packet::{self, Width};
use crate::traverse::packet_walk::Packets;
use crate::traverse::path::Path;
use crate::traverse::query::{Any, Closest, Query};
use crate::traverse::replay::{Record, Recording};
use crate::traverse::stream::Alone;
use crate::traverse::tile_walk::{ShadowTiles, Tiles};
use crate::traverse::wide_tree::WideTree;
use crate::traverse::{Hit, Ray, RayCounters, Tracer, plane_dir, plane_ta_b, plane_ta_b_1997};
use crate::traverse::{
    Order, octree_beam, octree_glassner, octree_net, octree_param, octree_samet, octree_step,
    plane_arvo, plane_beam, plane_rope, plane_seq, plane_seq_1985, plane_sung, plane_ta_a,
    plane_ta_b_poly, plane_wide,
};
use fearless_simd::Level;
use std::marker::PhantomData;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

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

/// A way of walking a tree of planes. All but `Dir` and `TaBPoly` need axis-aligned planes.
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

/// How batches of rays are walked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Batches {
    /// As the layout walks single rays, or its own tiles.
    Own,
    /// Camera rays in tiles of 8 x 8.
    Eight,
    /// Four such tiles at once.
    Sixteen,
    /// Several rays in flight through wide nodes.
    Wide,
    /// Rays to the nearest hit in packets of so many, whatever their order.
    Packets(u32),
    /// Camera rays in tiles, shadow rays in tiles from their light, other rays to the nearest hit in flight; rays that
    /// are counted as the layout walks single rays.
    Auto,
}

impl Batches {
    fn new(config: &Config) -> Self {
        let chosen = config.values().find(|(name, _)| *name == "traversal");
        match chosen {
            Some((_, Value::Choice("tile8"))) => Self::Eight,
            Some((_, Value::Choice("tile16"))) => Self::Sixteen,
            Some((_, Value::Choice("wide"))) => Self::Wide,
            Some((_, Value::Choice("p4"))) => Self::Packets(4),
            Some((_, Value::Choice("p8"))) => Self::Packets(8),
            Some((_, Value::Choice("p16"))) => Self::Packets(16),
            Some((_, Value::Choice("auto"))) => Self::Auto,
            _ => Self::Own,
        }
    }
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
    /// Links between the leaves of the tree of planes, for walks from leaf to leaf.
    ropes: Option<Ropes>,
    build_seconds: f64,
    /// Gathered when somebody asks.
    leaf_depths: OnceLock<LeafDepths>,
    /// Made when the first instance asks for it.
    outline: OnceLock<Outline>,
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
        let mut built = pool.install(|| (config.structure().build)(&scene, &config, monitor))?;
        let batches = Batches::new(&config);
        let wide = match (&built.layout, batches) {
            (Layout::Plane(tree, _), Batches::Wide | Batches::Auto) => {
                let wide = WideTree::new(tree);
                monitor.take(wide.bytes())?;
                Some(wide)
            }
            _ => None,
        };
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
            ropes,
            build_seconds,
            leaf_depths: OnceLock::new(),
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

    /// Bytes of nodes and leaves, without the scene's own arrays.
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
            + self.ropes.as_ref().map_or(0, Ropes::bytes);
        let whole = self.whole.get().map_or(0, |whole| {
            let Layout::Plane(tree, _) = &whole.layout else {
                return 0;
            };
            tree.bytes() + whole.blocks.bytes()
        });
        nodes + more + whole + self.built.blocks.bytes()
    }

    fn batch<'a>(&'a self, level: Level, rays: &'a [Ray]) -> Batch<'a> {
        self.batch_of(&self.built, level, rays)
    }

    fn batch_of<'a>(&'a self, built: &'a Built, level: Level, rays: &'a [Ray]) -> Batch<'a> {
        Batch {
            scene: &self.scene,
            frame: &built.frame,
            blocks: &built.blocks,
            rays,
            level,
            shadow_cache: self.config.choice("shadow") == "cache",
            placed: None,
        }
    }

    /// What an instance needs to know of the triangles.
    pub fn outline(&self) -> &Outline {
        self.outline.get_or_init(|| Outline::new(&self.scene))
    }

    /// Walks rays that were brought into the space of an instance of this mesh, one by one.
    pub(crate) fn walk_placed<Q: Query>(
        &self,
        level: Level,
        (rays, placed): (&[Ray], &[FrameRay<'_>]),
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let job = Batch {
            shadow_cache: false,
            placed: Some(placed),
            ..self.batch(level, rays)
        };
        self.walk::<Q>(&job, write, counters);
    }

    fn walk<Q: Query>(
        &self,
        job: &Batch<'_>,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        struct Trace<'a, Q>(
            &'a Batch<'a>,
            Write<'a>,
            Option<&'a mut [RayCounters]>,
            PhantomData<Q>,
        );
        impl<Q: Query> WithWalk for Trace<'_, Q> {
            type Output = ();
            fn with<W: Walk>(self, walk: &W) {
                self.0.walk::<_, Q>(walk, self.1, self.2);
            }
        }
        if let Layout::Brute = &self.built.layout {
            return job.brute::<Q>(self.built.shape.references, write, counters);
        }
        self.with_walk(&self.built, Trace::<Q>(job, write, counters, PhantomData));
    }

    /// The same structure on a given instruction set instead of the best one: for tests, which show
    /// that answers do not depend on it.
    pub fn at_level(&self, level: Level) -> AtLevel<'_> {
        AtLevel {
            structure: self,
            level,
        }
    }

    fn trace<Q: Query, T>(
        &self,
        level: Level,
        rays: &[Ray],
        answers: &mut [T],
        counters: Option<&mut [RayCounters]>,
        answer: impl Fn(Hit) -> T + Copy,
    ) {
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        let job = self.batch(level, rays);
        let mut write = |i: usize, hit: Hit| answers[i] = answer(hit);
        if Q::ANY && self.config.choice("shadow") == "beam" {
            return self.shadow_beams(&job, write, counters);
        }
        if Q::ANY && self.shadow_tiles(&job, &mut write, counters.is_some()) {
            return;
        }
        if let (Batches::Packets(rays), false) = (self.batches, Q::ANY) {
            return match rays {
                4 => self.packets::<packet::Four>(&job, write, counters),
                8 => self.packets::<packet::Eight>(&job, write, counters),
                _ => self.packets::<packet::Sixteen>(&job, write, counters),
            };
        }
        // Shadow rays that go in no tile still go much the same way, for which single rays are quicker.
        let streams = self.batches == Batches::Wide || !Q::ANY;
        if let (Some(wide), None, true) = (&self.wide, &counters, streams) {
            return job.stream::<_, Q>(&plane_wide::Walk(wide), write);
        }
        self.walk::<Q>(&job, &mut write, counters);
    }

    /// Walks rays to their nearest hits in packets.
    ///
    /// # Panics
    /// For structures that do not offer it.
    fn packets<L: Width>(
        &self,
        job: &Batch<'_>,
        write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        match &self.built.layout {
            Layout::Plane(tree, _) => {
                job.tiles(&Packets::<_, L>::new(tree), write, counters);
            }
            Layout::Objects(Objects::Boxes8(tree)) => {
                job.tiles(&Packets::<_, L>::new(tree), write, counters);
            }
            _ => unreachable!("only trees of planes and of eight boxes to a node offer packets"),
        }
    }

    /// Hands the way of walking single rays to `then`.
    ///
    /// # Panics
    /// For brute force, which walks nothing.
    fn with_walk<F: WithWalk>(&self, built: &Built, then: F) -> F::Output {
        if let (Batches::Wide, Some(wide)) = (self.batches, &self.wide) {
            return then.with(&Alone(&plane_wide::Walk(wide)));
        }
        match &built.layout {
            Layout::Brute => unreachable!("brute force has no tree to walk"),
            Layout::Lazy(tree) => then.with(&plane_dir::Walk(tree)),
            Layout::Plane(tree, walk) => match walk {
                PlaneWalk::Dir | PlaneWalk::Beams(_) => then.with(&plane_dir::Walk(tree)),
                PlaneWalk::TaB => then.with(&plane_ta_b::Walk(tree)),
                PlaneWalk::TaB1997 => then.with(&plane_ta_b_1997::Walk(tree)),
                PlaneWalk::TaBPoly => then.with(&plane_ta_b_poly::Walk(tree)),
                PlaneWalk::Seq => then.with(&plane_seq::Walk(tree)),
                PlaneWalk::Seq1985 => {
                    then.with(&plane_seq_1985::Walk(tree, self.built.frame.bounds()))
                }
                PlaneWalk::Rope => then.with(&plane_rope::Walk::<false>(tree, self.linked())),
                PlaneWalk::Rope1990 => then.with(&plane_rope::Walk::<true>(tree, self.linked())),
                PlaneWalk::TaA => then.with(&plane_ta_a::Walk::<false>(tree)),
                PlaneWalk::TaA1997 => then.with(&plane_ta_a::Walk::<true>(tree)),
                PlaneWalk::Sung => then.with(&plane_sung::Walk::<false>(tree)),
                PlaneWalk::Sung1992 => then.with(&plane_sung::Walk::<true>(tree)),
                PlaneWalk::Arvo => then.with(&plane_arvo::Walk::<false>(tree)),
                PlaneWalk::Arvo1988 => then.with(&plane_arvo::Walk::<true>(tree)),
            },
            Layout::Objects(tree) => tree.with_walk(self.built.frame.bounds(), then),
            Layout::Grid(grid) => then.with(&grid_step::Walk(grid)),
            Layout::OctreeParam(tree) => then.with(&octree_param::Walk(tree)),
            Layout::OctreeNet(tree) | Layout::OctreeBeam(tree, _) => {
                then.with(&octree_step::Walk(tree, octree_net::Links))
            }
            Layout::OctreeSamet(tree) => then.with(&octree_step::Walk(tree, octree_samet::Ascent)),
            Layout::OctreeGlassner(tree) => {
                then.with(&octree_step::Walk(tree, octree_glassner::Location))
            }
        }
    }

    /// Walks shadow rays in tiles, where that is chosen; says whether it was. Tiles of what is counted are not
    /// walked: nobody reads their speed, and every walk that counts is compiled once more.
    fn shadow_tiles(&self, job: &Batch<'_>, write: Write<'_>, counted: bool) -> bool {
        use Batches::{Auto, Eight, Sixteen};
        if counted || job.shadow_cache {
            return false;
        }
        match (&self.built.layout, self.batches) {
            (Layout::Plane(tree, _), Auto | Eight | Sixteen) => {
                job.quick_tiles(&ShadowTiles::<_, 4>(tree), write);
            }
            (Layout::Lazy(tree), Auto | Eight) => {
                job.quick_tiles(&ShadowTiles::<_, 4>(tree), write);
            }
            (Layout::Objects(Objects::Boxes8(tree)), Eight | Sixteen) => {
                job.quick_tiles(&ShadowTiles::<_, 4>(tree), write);
            }
            _ => return false,
        }
        true
    }

    /// The ropes of a tree that is walked by them.
    fn linked(&self) -> &Ropes {
        self.ropes.as_ref().expect("built with the tree")
    }

    /// The nearest hit of one ray, and what its walk did.
    pub fn path(&self, ray: &Ray) -> (Hit, Path) {
        struct Follow<'a>(&'a Batch<'a>);
        impl WithWalk for Follow<'_> {
            type Output = (Hit, Path);
            fn with<W: Walk>(self, walk: &W) -> (Hit, Path) {
                self.0.path(walk)
            }
        }
        let built = self.built();
        let job = self.batch_of(built, Level::new(), std::slice::from_ref(ray));
        if let Layout::Brute = &self.built.layout {
            let (mut nearest, mut path) = (Hit::MISS, Path::default());
            let counters = std::slice::from_mut(&mut path.counters);
            let count = self.built.shape.references;
            job.brute::<Closest>(count, |_, hit| nearest = hit, Some(counters));
            return (nearest, path);
        }
        self.with_walk(built, Follow(&job))
    }

    /// Walks rays one by one and records what each leaf answers, for [`Self::replay`].
    ///
    /// # Errors
    /// [`Error::Spec`] for brute force, which walks nothing.
    pub fn record(&self, rays: Vec<Ray>, any: bool) -> Result<Recording> {
        struct Recorder<'a, Q>(
            &'a Batch<'a>,
            &'a mut [RayCounters],
            &'a mut Record,
            PhantomData<Q>,
        );
        impl<Q: Query> WithWalk for Recorder<'_, Q> {
            type Output = ();
            fn with<W: Walk>(self, walk: &W) {
                self.0.record::<_, Q>(walk, self.1, self.2);
            }
        }
        if let Layout::Brute = &self.built.layout {
            return Err(Error::Spec("brute walks no tree".to_owned()));
        }
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut record = Record::default();
        let built = self.built();
        let job = self.batch_of(built, Level::new(), &rays);
        if any {
            let recorder = Recorder::<Any>(&job, &mut counters, &mut record, PhantomData);
            self.with_walk(built, recorder);
        } else {
            let recorder = Recorder::<Closest>(&job, &mut counters, &mut record, PhantomData);
            self.with_walk(built, recorder);
        }
        Ok(Recording {
            rays,
            any,
            counters,
            record,
        })
    }

    /// Walks recorded rays of this structure again, on the calling thread, through the same nodes but
    /// without testing triangles; returns the seconds that each chunk of rays took, and how many
    /// rays went astray, which are none.
    pub fn replay(&self, recording: &Recording) -> (Vec<f64>, usize) {
        struct Player<'a, Q>(&'a Batch<'a>, &'a Record, &'a mut Vec<f64>, PhantomData<Q>);
        impl<Q: Query> WithWalk for Player<'_, Q> {
            type Output = usize;
            fn with<W: Walk>(self, walk: &W) -> usize {
                let took = |time: Duration| self.2.push(time.as_secs_f64());
                self.0.replay::<_, Q>(walk, self.1, took)
            }
        }
        let built = self.built();
        let job = self.batch_of(built, Level::new(), &recording.rays);
        let mut seconds = Vec::new();
        let record = &recording.record;
        let strayed = if recording.any {
            let player = Player::<Any>(&job, record, &mut seconds, PhantomData);
            self.with_walk(built, player)
        } else {
            let player = Player::<Closest>(&job, record, &mut seconds, PhantomData);
            self.with_walk(built, player)
        };
        (seconds, strayed)
    }

    /// Walks shadow rays through a tree that divides space as beams.
    ///
    /// # Panics
    /// For other structures, which do not offer it.
    fn shadow_beams(
        &self,
        job: &Batch<'_>,
        write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        match &self.built.layout {
            Layout::OctreeParam(tree) => {
                job.shadow_beams((tree, &octree_param::Walk(tree)), write, counters);
            }
            Layout::OctreeNet(tree) | Layout::OctreeBeam(tree, _) => {
                let walk = octree_step::Walk(tree, octree_net::Links);
                job.shadow_beams((tree, &walk), write, counters);
            }
            Layout::OctreeSamet(tree) => {
                let walk = octree_step::Walk(tree, octree_samet::Ascent);
                job.shadow_beams((tree, &walk), write, counters);
            }
            Layout::OctreeGlassner(tree) => {
                let walk = octree_step::Walk(tree, octree_glassner::Location);
                job.shadow_beams((tree, &walk), write, counters);
            }
            Layout::Plane(tree, _) => {
                job.shadow_beams((tree, &plane_dir::Walk(tree)), write, counters);
            }
            _ => unreachable!("only trees that divide space offer shadow beams"),
        }
    }
}

/// A structure whose rays run on a given instruction set.
pub struct AtLevel<'a> {
    structure: &'a Structure,
    level: Level,
}

impl Tracer for AtLevel<'_> {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.structure.scene)
    }

    fn count(&self) -> usize {
        self.structure.scene.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.structure.scene.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        let (structure, level) = (self.structure, self.level);
        structure.trace::<Closest, _>(level, rays, hits, counters, |hit| hit);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        let job = self.structure.batch(self.level, rays);
        let write = |i: usize, hit: Hit| hits[i] = hit;
        if order != Order::Tiles {
            return self.closest(rays, hits, counters);
        }
        match (&self.structure.built.layout, self.structure.batches) {
            (Layout::OctreeBeam(tree, least), _) => {
                job.tiles(&octree_beam::Walk(tree, *least), write, counters);
            }
            (Layout::Plane(tree, PlaneWalk::Beams(least)), _) => {
                job.tiles(&plane_beam::Walk(tree, *least), write, counters);
            }
            (Layout::Plane(tree, _), Batches::Eight) => {
                job.tiles(&Tiles::<_, 4>(tree), write, counters);
            }
            (Layout::Plane(tree, _), Batches::Auto) if counters.is_none() => {
                job.tiles(&Tiles::<_, 4>(tree), write, counters);
            }
            (Layout::Lazy(tree), Batches::Auto | Batches::Eight) if counters.is_none() => {
                job.tiles(&Tiles::<_, 4>(tree), write, counters);
            }
            (Layout::Plane(tree, _), Batches::Sixteen) => {
                job.tiles(&Tiles::<_, 16>(tree), write, counters);
            }
            (Layout::Objects(Objects::Boxes8(tree)), Batches::Eight) => {
                job.tiles(&Tiles::<_, 4>(tree), write, counters);
            }
            (Layout::Objects(Objects::Boxes8(tree)), Batches::Sixteen) => {
                job.tiles(&Tiles::<_, 16>(tree), write, counters);
            }
            _ => self.closest(rays, hits, counters),
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        let (structure, level) = (self.structure, self.level);
        structure.trace::<Any, _>(level, rays, occluded, counters, |hit| hit.is_hit());
    }
}

impl Tracer for Structure {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.scene)
    }

    fn count(&self) -> usize {
        self.scene.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.scene.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new()).closest(rays, hits, counters);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        self.at_level(Level::new())
            .closest_ordered(rays, hits, counters, order);
    }

    fn leaf_depths(&self, rays: &[Ray], depths: &mut [u32]) {
        let known = self.leaf_depths.get_or_init(|| LeafDepths::new(self));
        for (ray, depth) in rays.iter().zip(depths) {
            *depth = known.of(self, ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new())
            .occluded(rays, occluded, counters);
    }
}
