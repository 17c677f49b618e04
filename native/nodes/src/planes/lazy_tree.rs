// SPDX-License-Identifier: GPL-3.0-or-later
//! A tree of split planes that is built on demand. Its upper part is built first. When a ray reaches the root of an
//! unbuilt subtree, the ray's thread builds it, down to unbuilt subtrees of its own, while other threads that reach it
//! wait.
//!
//! All parts together equal the tree that the same builder makes in one go, node for node: [`LazyTree::whole`].

use crate::plane_tree::{ENTRANCE, Node, PlaneTree};
use crate::preorder::{Item, Preorder};
use crate::shape::Shape;
use halfspace_base::error::Result;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::fmt;
use std::sync::{Mutex, OnceLock, PoisonError};

/// The inputs of the build of a subtree.
pub trait Seed: Send {
    /// Builds the subtree.
    fn grow(self: Box<Self>, scene: &Triangles) -> Part;

    /// Returns a copy of the seed.
    fn again(&self) -> Box<dyn Seed>;
}

/// A subtree that is built when a ray first reaches it.
pub struct Unbuilt {
    part: OnceLock<Box<Part>>,
    seed: Mutex<Option<Box<dyn Seed>>>,
    /// Bytes of the seed.
    bytes: usize,
    /// Number of triangle references in the seed.
    references: usize,
}

impl fmt::Debug for Unbuilt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Unbuilt").field(&self.part).finish()
    }
}

impl Unbuilt {
    /// Makes an unbuilt subtree from a seed of this number of bytes and references.
    pub fn new(bytes: usize, references: usize, seed: Box<dyn Seed>) -> Self {
        Self {
            part: OnceLock::new(),
            seed: Mutex::new(Some(seed)),
            bytes,
            references,
        }
    }

    /// Returns the bytes of the seed.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Returns the number of references in the seed.
    pub fn references(&self) -> usize {
        self.references
    }

    /// Builds a copy of the subtree with everything below it, discards it, and returns its bytes; 0 if the subtree is
    /// built or being built.
    pub fn trial(&self, scene: &Triangles) -> usize {
        let seed = self.seed.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(again) = seed.as_ref().map(|seed| seed.again()) else {
            return 0;
        };
        // Release the lock: the trial may take long, and rays may need the subtree.
        drop(seed);
        let part = again.grow(scene);
        part.finish(scene);
        part.progress().bytes
    }

    /// Returns the subtree; the first caller builds it, concurrent callers wait.
    ///
    /// # Panics
    /// If an earlier build of the subtree panicked.
    #[inline(always)]
    pub fn get(&self, scene: &Triangles) -> &Part {
        match self.part.get() {
            Some(part) => part,
            None => self.grown(scene),
        }
    }

    /// Returns the subtree after it is built; not inlined, to keep [`Self::get`] small.
    #[cold]
    #[inline(never)]
    fn grown(&self, scene: &Triangles) -> &Part {
        self.part.get_or_init(|| {
            // Take the seed, which frees its memory after the build.
            let seed = self
                .seed
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            Box::new(seed.expect("the subtree is built once").grow(scene))
        })
    }
}

/// A built part of the tree, with the unbuilt subtrees below it.
#[derive(Debug)]
pub struct Part {
    /// Nodes. Leaves whose count is [`ENTRANCE`] lead to `parts`.
    pub tree: PlaneTree,
    /// Triangles of its leaves.
    pub blocks: Blocks,
    /// Subtrees below this part, in the order of their entrances.
    parts: Vec<Unbuilt>,
    /// Shape of this part, without its subtrees.
    shape: Shape,
    /// Number of its nodes that tried their first directions only.
    first_only: usize,
    /// Depth of the part's root in the whole tree.
    depth: usize,
}

impl Part {
    /// Makes a part from a subtree in preorder whose root lies at this depth.
    ///
    /// # Errors
    /// Those of [`PlaneTree::new`].
    pub fn new(preorder: Preorder, scene: &Triangles, frame: &Frame, depth: usize) -> Result<Self> {
        let mut blocks = Blocks::new();
        Ok(Self {
            tree: PlaneTree::new(&preorder, scene, frame, &mut blocks)?,
            blocks,
            shape: Shape::new(&preorder),
            first_only: preorder.first_only,
            depth,
            parts: preorder.parts,
        })
    }

    /// Returns the subtree number `first`, and builds it if necessary.
    #[inline(always)]
    pub fn enter(&self, first: u32, scene: &Triangles) -> &Self {
        self.parts[first as usize].get(scene)
    }

    /// Returns the bytes of this part, without its subtrees.
    fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.tree.bytes()
            + self.blocks.bytes()
            + self.parts.len() * size_of::<Unbuilt>()
    }

    /// Builds everything below this part.
    fn finish(&self, scene: &Triangles) {
        for below in &self.parts {
            below.get(scene).finish(scene);
        }
    }

    /// Sums the shape and bytes of all built parts, and counts the unbuilt ones.
    fn progress(&self) -> Progress {
        let mut sum = Progress::default();
        let mut open = vec![self];
        // Add each built part, and descend to its built subtrees.
        while let Some(part) = open.pop() {
            sum.shape.join(&part.shape, part.depth);
            sum.first_only += part.first_only;
            sum.bytes += part.bytes();
            for below in &part.parts {
                if let Some(part) = below.part.get() {
                    sum.built += 1;
                    open.push(part);
                } else {
                    sum.unbuilt += 1;
                    sum.bytes += below.bytes;
                }
            }
        }
        sum
    }

    /// Appends the subtree of `node` in preorder, and builds what is not built.
    fn copy(&self, node: u32, scene: &Triangles, out: &mut Preorder) {
        // Get the plane of an inner node; copy a leaf, or the subtree behind an entrance, and return.
        let (plane, children) = match self.tree.node(node) {
            Node::Leaf {
                first,
                count: ENTRANCE,
            } => {
                // Continue with the root of the subtree.
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
        // Append the node with a share of 0: areas of cells are not stored, and the shape is the sum of the parts'.
        out.items.push(Item::Inner { plane, share: 0.0 });
        self.copy(children, scene, out);
        self.copy(children + 1, scene, out);
    }
}

/// Progress of a tree that is built on demand.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Progress {
    /// Shape of the built part.
    pub shape: Shape,
    /// Number of nodes of the built part that tried their first directions only, because one of those was cheap enough.
    pub first_only: usize,
    /// Number of subtrees that rays have built.
    pub built: usize,
    /// Number of unbuilt subtrees below the built part.
    pub unbuilt: usize,
    /// Bytes of the built part and of the seeds of the unbuilt subtrees.
    pub bytes: usize,
}

/// A tree that is built on demand.
#[derive(Debug)]
pub struct LazyTree {
    top: Part,
}

impl PartialEq for LazyTree {
    /// A tree equals only itself, because rays extend the built part.
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl LazyTree {
    /// Makes a tree whose upper part is built.
    pub fn new(top: Part) -> Self {
        Self { top }
    }

    /// Returns the part that contains the root.
    #[inline(always)]
    pub fn top(&self) -> &Part {
        &self.top
    }

    /// Returns the progress of the build.
    pub fn progress(&self) -> Progress {
        self.top.progress()
    }

    /// Returns the whole tree in one piece, with its blocks and shape. Builds all unbuilt subtrees.
    ///
    /// # Errors
    /// Those of [`PlaneTree::new`].
    pub fn whole(&self, scene: &Triangles, frame: &Frame) -> Result<(PlaneTree, Blocks, Shape)> {
        let mut preorder = Preorder::default();
        self.top.copy(self.top.tree.root(), scene, &mut preorder);
        let mut blocks = Blocks::new();
        let tree = PlaneTree::new(&preorder, scene, frame, &mut blocks)?;
        Ok((tree, blocks, self.progress().shape))
    }
}
