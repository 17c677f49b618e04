// SPDX-License-Identifier: GPL-3.0-or-later
//! A tree of split planes that is built as far as rays go. Its upper part stands; where a ray reaches the root
//! of a subtree that does not, the ray's thread builds that, down to subtrees of its own that wait in turn.
//! Other threads that come there meanwhile wait for it.
//!
//! All of it together is the tree that the same builder makes at once, node for node: [`LazyTree::whole`].

use super::cell::{Direction, Plane};
use super::plane_tree::{ENTRANCE, Node, PlaneTree};
use super::preorder::{Item, Preorder};
use super::shape::Shape;
use crate::error::Result;
use crate::scene::Triangles;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;
use std::fmt;
use std::sync::{Mutex, OnceLock, PoisonError};

/// What a subtree grows from.
pub trait Seed: Send {
    /// Builds it.
    fn grow(self: Box<Self>, scene: &Triangles) -> Part;

    /// The same once more.
    fn again(&self) -> Box<dyn Seed>;
}

/// A subtree that is built when it is first asked for.
pub struct Unbuilt {
    part: OnceLock<Box<Part>>,
    seed: Mutex<Option<Box<dyn Seed>>>,
    /// Of the seed.
    bytes: usize,
    /// Triangles, each as often as it is in the seed.
    references: usize,
}

impl fmt::Debug for Unbuilt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Unbuilt").field(&self.part).finish()
    }
}

impl Unbuilt {
    /// A subtree that grows from this seed of so many bytes, which holds so many references.
    pub fn new(bytes: usize, references: usize, seed: Box<dyn Seed>) -> Self {
        Self {
            part: OnceLock::new(),
            seed: Mutex::new(Some(seed)),
            bytes,
            references,
        }
    }

    /// What its seed takes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// How many references its seed holds.
    pub fn references(&self) -> usize {
        self.references
    }

    /// What the subtree takes once rays have been everywhere in it; 0 when somebody builds it. Builds it on trial, with
    /// all below it, and throws that away.
    pub fn trial(&self, scene: &Triangles) -> usize {
        let seed = self.seed.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(again) = seed.as_ref().map(|seed| seed.again()) else {
            return 0;
        };
        drop(seed);
        let part = again.grow(scene);
        part.finish(scene);
        part.progress().bytes
    }

    /// The subtree; the first who asks builds it.
    ///
    /// # Panics
    /// When building it panicked before.
    #[inline(always)]
    pub fn get(&self, scene: &Triangles) -> &Part {
        match self.part.get() {
            Some(part) => part,
            None => self.grown(scene),
        }
    }

    #[cold]
    #[inline(never)]
    fn grown(&self, scene: &Triangles) -> &Part {
        self.part.get_or_init(|| {
            let seed = self
                .seed
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            Box::new(seed.expect("a seed grows once").grow(scene))
        })
    }
}

/// A subtree that is built, but for those below it that are not.
#[derive(Debug)]
pub struct Part {
    /// Its nodes. Those leaves whose count is [`ENTRANCE`] lead to its parts.
    pub tree: PlaneTree,
    /// Its leaves.
    pub blocks: Blocks,
    parts: Vec<Unbuilt>,
    /// Without that of its parts.
    shape: Shape,
    /// Of its root, in the whole tree.
    depth: usize,
}

impl Part {
    /// Lays out a subtree whose root has this depth.
    ///
    /// # Errors
    /// As [`PlaneTree::new`].
    pub fn new(preorder: Preorder, scene: &Triangles, frame: &Frame, depth: usize) -> Result<Self> {
        let mut blocks = Blocks::new();
        Ok(Self {
            tree: PlaneTree::new(&preorder, scene, frame, &mut blocks)?,
            blocks,
            shape: Shape::new(&preorder),
            depth,
            parts: preorder.parts,
        })
    }

    /// The part that a leaf of the tree leads to.
    #[inline(always)]
    pub fn enter(&self, first: u32, scene: &Triangles) -> &Self {
        self.parts[first as usize].get(scene)
    }

    fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.tree.bytes()
            + self.blocks.bytes()
            + self.parts.len() * size_of::<Unbuilt>()
    }

    /// Builds all below it that is not built.
    fn finish(&self, scene: &Triangles) {
        for below in &self.parts {
            below.get(scene).finish(scene);
        }
    }

    /// How far it is built.
    fn progress(&self) -> Progress {
        let mut sum = Progress::default();
        let mut open = vec![self];
        while let Some(part) = open.pop() {
            sum.shape.join(&part.shape, part.depth);
            sum.bytes += part.bytes();
            for below in &part.parts {
                if let Some(part) = below.part.get() {
                    sum.built += 1;
                    open.push(part);
                } else {
                    sum.waiting += 1;
                    sum.bytes += below.bytes;
                }
            }
        }
        sum
    }

    /// Appends the nodes from `node` on, and builds what is not built.
    fn copy(&self, node: u32, scene: &Triangles, out: &mut Preorder) {
        let (plane, children) = match self.tree.node(node) {
            Node::Leaf {
                first,
                count: ENTRANCE,
            } => {
                let part = self.enter(first, scene);
                return part.copy(part.tree.root(), scene, out);
            }
            Node::Leaf { first, count } => {
                return out.leaf(self.blocks.ids(first, count), 0.0);
            }
            Node::Axis {
                axis,
                split,
                children,
                ..
            } => {
                let direction = Direction::Axis(axis);
                (
                    Plane {
                        direction,
                        offset: split,
                    },
                    children,
                )
            }
            Node::Oblique {
                normal,
                offset,
                children,
                ..
            } => {
                let direction = Direction::Oblique(normal);
                (Plane { direction, offset }, children)
            }
        };
        out.items.push(Item::Inner { plane, share: 0.0 });
        self.copy(children, scene, out);
        self.copy(children + 1, scene, out);
    }
}

/// How far a tree is built.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Progress {
    /// The shape of what is built.
    pub shape: Shape,
    /// Subtrees that rays have had built.
    pub built: usize,
    /// Subtrees that wait at the ends of what is built.
    pub waiting: usize,
    /// Bytes of both.
    pub bytes: usize,
}

/// A tree that is built as far as rays go.
#[derive(Debug)]
pub struct LazyTree {
    top: Part,
}

impl PartialEq for LazyTree {
    /// What is built changes from ray to ray, so a tree is the same only as itself.
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl LazyTree {
    /// A tree of which this part is built.
    pub fn new(top: Part) -> Self {
        Self { top }
    }

    /// The part that holds the root.
    #[inline(always)]
    pub fn top(&self) -> &Part {
        &self.top
    }

    /// How far it is built.
    pub fn progress(&self) -> Progress {
        self.top.progress()
    }

    /// The whole tree in one piece. Builds all that is not built.
    ///
    /// # Errors
    /// As [`PlaneTree::new`].
    pub fn whole(&self, scene: &Triangles, frame: &Frame) -> Result<(PlaneTree, Blocks, Shape)> {
        let mut preorder = Preorder::default();
        self.top.copy(self.top.tree.root(), scene, &mut preorder);
        let mut blocks = Blocks::new();
        let tree = PlaneTree::new(&preorder, scene, frame, &mut blocks)?;
        Ok((tree, blocks, self.progress().shape))
    }
}
