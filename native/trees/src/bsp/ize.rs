// SPDX-License-Identifier: GPL-3.0-or-later
//! The general BSP tree of Ize, Wald and Parker 2008: sweeps along the axes, and for each triangle of a node its own
//! plane and, perpendicular to it, one plane through each edge.

use crate::bsp::normals::{Normals, oriented};
use crate::bsp::{AXES, Settings, Variant, anything, build_with, params};
use crate::lazy::Grown;
use crate::list::List;
use crate::planes::rows::ANY_WAYS;
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_builders::piece::{Clipped, Piece, Whole};
use halfspace_builders::space::{self, Node, Params, PlanePolicy};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{ConvexCell, Direction, Plane};
use halfspace_geom::vec3::{cross, dot, length, sub, widen};
use halfspace_nodes::preorder::Preorder;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_structure::Built;
use halfspace_structure::row::{Family, Group, Kind, Menu, ParamSpec, StructureSpec};
use halfspace_structure::spec::{Config, Value};
use std::marker::PhantomData;

const PAPER: &str = "Ize, Wald and Parker 2008, Ray tracing with the BSP tree";

/// The registry's row: all nodes alike.
pub const PLAIN: StructureSpec = StructureSpec {
    id: "bsp-ize",
    code: 24,
    label: "BSP, Ize",
    family: Family::Space,
    summary: "Planes along the axes, in the triangles and through their edges.",
    paper: PAPER,
    params: PLAIN_PARAMS.slice(),
    ways: ANY_WAYS,
    no_groups: "",
    menu: Menu::Bsp,
    literature: &[("BSP_IZE", "")],
    sweep: false,
    claims: &["long-builds"],
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::Plus),
};

/// The registry's row: with the axes as cheap nodes.
pub const KD: StructureSpec = StructureSpec {
    id: "bsp-ize-kd",
    code: 25,
    label: "BSP, Ize + Kd",
    family: Family::Space,
    summary: "Planes along the axes, at cheap nodes, in the triangles and through their edges.",
    paper: PAPER,
    params: KD_PARAMS.slice(),
    ways: ANY_WAYS,
    no_groups: "",
    menu: Menu::Bsp,
    literature: &[("BSP_IZE^Kd", "")],
    sweep: false,
    claims: &["other-trees-time", "long-builds"],
    build: |scene, config, monitor| grow(scene, config, monitor, Variant::PlusKd),
};

/// An edge gets no plane if the triangle's height over it is at most this share of the edge's length.
const SLIVER: f64 = 1.0 / (1 << 20) as f64;

const TRIED: ParamSpec = ParamSpec {
    name: "tried",
    label: "Triangles Tried",
    doc: "Triangles of a node whose planes are tried, evenly spread over it. The paper tries all: measured, \
          the tree is the same within a hundredth, and takes eight to fourteen times as long to build",
    unit: "triangles",
    kind: Kind::Integer {
        min: 1,
        max: 1_000_000_000,
    },
    default: Value::Integer(128),
    group: Group::Main,
    needs: &[],
};

const PLAIN_PARAMS: List<ParamSpec> = params::single(TRIED);
const KD_PARAMS: List<ParamSpec> = params::single_kd(TRIED);

struct Policy<'a, P> {
    scene: &'a Triangles,
    frame: &'a Frame,
    normals: &'a Normals,
    variant: Variant,
    /// Number of triangles of a node whose planes are tried; 0 to try the axes only.
    tried: usize,
    pieces: PhantomData<P>,
}

impl<P: Piece> PlanePolicy for Policy<'_, P> {
    type Cell = ConvexCell;
    type Piece = P;

    fn root(&self, bounds: Aabb) -> ConvexCell {
        ConvexCell::from_box(bounds, bounds.magnitude())
    }

    fn directions(&self, _: &Node<'_, P>, out: &mut Vec<Direction>) {
        match self.variant {
            Variant::PlusKd => out.extend((0..3).map(Direction::Axis)),
            _ => out.extend(AXES.map(Direction::Oblique)),
        }
    }

    fn last_resort(&self, node: &Node<'_, P>, out: &mut Vec<Direction>) {
        out.extend(anything(node).into_iter().map(Direction::Oblique));
    }

    fn planes(&self, node: &Node<'_, P>, out: &mut Vec<Plane>) {
        if self.tried > 0 {
            let step = node.pieces.len().div_ceil(self.tried).max(1);
            for piece in node.pieces.iter().step_by(step) {
                self.planes_of(piece.id(), out);
            }
        }
    }
}

impl<P: Piece> Policy<'_, P> {
    /// Adds the planes of one triangle. Rounding puts the corners that define a plane slightly above or below it, so
    /// each plane is moved until the whole triangle lies on one side.
    fn planes_of(&self, id: u32, out: &mut Vec<Plane>) {
        let Some(normal) = self.normals.get(id) else {
            return;
        };
        let corners = self.scene.corners(id).map(|p| self.frame.point(p));
        // Put one plane with normal `n` above the triangle for each `true`, below it for each `false`.
        let mut add = |n: [f32; 3], sides: &[bool]| {
            // The sweeps try planes across the axes.
            if AXES.contains(&n) {
                return;
            }
            let direction = Direction::Oblique(n);
            let heights = corners.map(|p| direction.height(p));
            for &above in sides {
                let offset = heights
                    .into_iter()
                    .reduce(|a, b| if above { a.max(b) } else { a.min(b) });
                let offset = offset.expect("three corners");
                out.push(Plane { direction, offset });
            }
        };
        add(normal, &[false, true]);
        // Add the planes perpendicular to the triangle through its edges.
        let points = corners.map(widen);
        let exact = cross(sub(points[1], points[0]), sub(points[2], points[0]));
        let unit = exact.map(|x| x / length(exact));
        for i in 0..3 {
            let edge = sub(points[(i + 1) % 3], points[i]);
            let inward = cross(unit, edge);
            let norm = length(inward);
            let height = dot(inward, sub(points[(i + 2) % 3], points[i]));
            if height <= SLIVER * norm * norm {
                continue;
            }
            let n = inward.map(|x| x / norm);
            let turned = oriented(n);
            // The inward normal has the triangle above its edge; a reversed normal has it below.
            let above = dot(widen(turned), n) < 0.0;
            add(turned, &[above]);
        }
    }
}

fn grow(scene: &Triangles, config: &Config, monitor: &Monitor, variant: Variant) -> Result<Built> {
    let settings = &Settings::of(config);
    let params = Params {
        sorted: true,
        ..settings.params(scene.live().len(), variant)
    };
    build_with(
        scene,
        config,
        monitor,
        settings,
        &params,
        variant,
        |frame, normals, oblique| {
            let tried = if oblique { settings.tried } else { 0 };
            let framed = FramedScene { scene, frame };
            let preorder = if settings.clip {
                tree::<Clipped>(framed, &params, variant, tried, &normals, monitor)?
            } else {
                tree::<Whole>(framed, &params, variant, tried, &normals, monitor)?
            };
            Ok((Grown::Whole(preorder), None))
        },
    )
}

fn tree<P: Piece>(
    framed: FramedScene<'_>,
    params: &Params,
    variant: Variant,
    tried: usize,
    normals: &Normals,
    monitor: &Monitor,
) -> Result<Preorder> {
    let FramedScene { scene, frame } = framed;
    let policy = Policy::<P> {
        scene,
        frame,
        normals,
        variant,
        tried,
        pieces: PhantomData,
    };
    space::build(scene, frame, &policy, params, monitor)
}
