// SPDX-License-Identifier: GPL-3.0-or-later
//! A whole tree as flat arrays, for programs that do not depend on its layout.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::region::Region;
use halfspace_geom::vec3::{Vec3, dot, widen};
use halfspace_nodes::cells::{BOX, NodeCell, SLAB, try_each_node};
use halfspace_ray::frame::Frame;
use halfspace_structure::Structure;

/// Kind of a leaf; inner nodes have the kind of their first plane, see [`halfspace_nodes::cells`].
pub const LEAF: u8 = 7;

/// The nodes of a tree in preorder, in the scene's space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Export {
    /// Kind of each node: 0, 1, 2 a plane perpendicular to that axis; 3 oblique planes; 4 slabs; 5 octants; 6 boxes of
    /// its children; [`LEAF`].
    pub kinds: Vec<u8>,
    /// Index of each node's parent; -1 for the root.
    pub parents: Vec<i32>,
    /// Depth of each node; the root has depth 0.
    pub depths: Vec<u32>,
    /// Indices of the children.
    pub children: Lists<u32>,
    /// Planes that the node stores: normal, and height along it.
    pub planes: Lists<[f64; 4]>,
    /// Kind of each plane.
    pub plane_kinds: Vec<u8>,
    /// The box of each node's region: lower and upper corner.
    pub bounds: Vec<[f64; 6]>,
    /// The faces of regions other than boxes: outward normal, and height along it.
    pub walls: Lists<[f64; 4]>,
    /// Triangles of leaves.
    pub triangles: Lists<u32>,
}

/// One list per node, one after another.
#[derive(Debug, Clone, PartialEq)]
pub struct Lists<T> {
    /// Index in `entries` of each node's first entry, then the number of entries.
    pub offsets: Vec<u32>,
    /// The entries of all nodes.
    pub entries: Vec<T>,
}

impl<T> Default for Lists<T> {
    fn default() -> Self {
        Self {
            offsets: vec![0],
            entries: Vec::new(),
        }
    }
}

impl<T> Lists<T> {
    /// Appends the list of the next node.
    fn push(&mut self, entries: impl IntoIterator<Item = T>) {
        self.entries.extend(entries);
        let end = u32::try_from(self.entries.len()).expect("bounded by the nodes' links");
        self.offsets.push(end);
    }
}

/// The map from frame to scene coordinates in f64.
struct ToScene {
    /// Point of the scene at the frame's origin.
    origin: Vec3,
    /// Factor from scene to frame coordinates.
    scale: f64,
}

impl ToScene {
    /// Makes the map of a frame.
    fn new(frame: &Frame) -> Self {
        Self {
            origin: widen(frame.map().origin()),
            scale: f64::from(frame.scale()),
        }
    }

    /// Converts a point.
    fn point(&self, p: Vec3) -> Vec3 {
        std::array::from_fn(|k| p[k] / self.scale + self.origin[k])
    }

    /// Converts the offset of a plane with this normal.
    fn offset(&self, normal: Vec3, offset: f64) -> f64 {
        offset / self.scale + dot(normal, self.origin)
    }
}

/// Exports the tree of a structure, not its derived layouts. Without a tree, the scene's box is the only node, a leaf.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn export(structure: &Structure, monitor: &Monitor) -> Result<Export> {
    let built = structure.built();
    let (frame, bounds) = (&built.frame, built.frame.bounds());
    let to_scene = ToScene::new(frame);
    let mut out = Export::default();
    let ids = |first, count| built.leaves.ids(first, count);
    let cells = built.tree.as_ref().and_then(|tree| tree.cells());
    match cells.filter(|_| !bounds.is_empty()) {
        Some(cells) => try_each_node(cells, bounds, |node| {
            let triangles = node.view.leaf.map(|(first, count)| ids(first, count));
            out.node(&node, triangles.unwrap_or_default(), &to_scene);
            monitor.check()
        })?,
        None => {
            out.head(LEAF, None, 0);
            out.planes.push([]);
            out.region(&Region::of_scene(bounds), &to_scene);
            out.triangles.push(ids(0, built.shape.references));
        }
    }
    out.link();
    monitor.check()?;
    Ok(out)
}

impl Export {
    /// Appends kind, parent and depth of a node.
    fn head(&mut self, kind: u8, parent: Option<u32>, depth: usize) {
        self.kinds.push(kind);
        let parent =
            parent.map(|parent| i32::try_from(parent).expect("links have fewer than 31 bits"));
        self.parents.push(parent.unwrap_or(-1));
        self.depths
            .push(u32::try_from(depth).expect("bounded by the depth limits"));
    }

    /// Appends a node, and the triangles if it is a leaf.
    fn node(&mut self, node: &NodeCell<'_>, triangles: Vec<u32>, to_scene: &ToScene) {
        let view = node.view;
        let kind = match view.planes.first() {
            _ if view.leaf.is_some() => LEAF,
            Some(&(_, kind)) => kind,
            None if view.boxes => BOX,
            None => SLAB,
        };
        self.head(kind, node.parent, node.depth);
        self.planes.push(view.planes.iter().map(|(plane, _)| {
            let normal = plane.direction.vector().map(f64::from);
            let [x, y, z] = normal;
            [x, y, z, to_scene.offset(normal, f64::from(plane.offset))]
        }));
        self.plane_kinds
            .extend(view.planes.iter().map(|&(_, kind)| kind));
        self.region(node.region, to_scene);
        self.triangles.push(triangles);
    }

    /// Appends the region of a node.
    fn region(&mut self, region: &Region, to_scene: &ToScene) {
        let [low, high] = region.extent().map(|corner| to_scene.point(corner));
        self.bounds
            .push([low[0], low[1], low[2], high[0], high[1], high[2]]);
        let mut walls = Vec::new();
        if region.bounds().is_none() {
            region.half_spaces(&mut walls);
        }
        self.walls.push(walls.into_iter().map(|wall| {
            let [x, y, z] = wall.normal;
            [x, y, z, to_scene.offset(wall.normal, wall.offset)]
        }));
    }

    /// Fills in the children from the parents, in preorder.
    fn link(&mut self) {
        let mut children = vec![Vec::new(); self.kinds.len()];
        for (node, &parent) in (0..).zip(&self.parents) {
            if let Ok(parent) = usize::try_from(parent) {
                children[parent].push(node);
            }
        }
        for list in children {
            self.children.push(list);
        }
    }
}
