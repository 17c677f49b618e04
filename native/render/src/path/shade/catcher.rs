// SPDX-License-Identifier: GPL-3.0-or-later
//! The split of a camera ray's path at a shadow catcher, see [`crate::film::catcher`].

use crate::film::catcher::Catch;
use crate::film::{Batch, Shares};
use crate::math::vector::Vec3;
use crate::medium::stack::Stack;
use crate::path::beams::source::Source;
use crate::path::state::Path;
use crate::path::walk::RandomWalk;
use crate::path::wavefront::{Context, Wavefront};
use crate::values::program::Value;
use halfspace_ray::{Hit, Ray};

/// A path that goes on among shadow catchers alone, and what the wavefront keeps of it.
pub(super) struct Split {
    path: Path,
    ray: Ray,
    source: Option<Source>,
    media: Option<Stack>,
    shares: Option<Shares>,
    walk: Option<Option<RandomWalk>>,
}

/// Values that the wavefront keeps for a path, where it does.
type Beside<'a> = (
    Option<&'a Source>,
    Option<&'a Stack>,
    Option<&'a Shares>,
    Option<&'a Option<RandomWalk>>,
);

impl Split {
    /// The path with its ray.
    pub(super) fn new(path: Path, ray: Ray, (source, media, shares, walk): Beside<'_>) -> Self {
        Self {
            path,
            ray,
            source: source.copied(),
            media: media.copied(),
            shares: shares.copied(),
            walk: walk.copied(),
        }
    }

    /// Appends the path to a wavefront.
    pub(super) fn append(self, wave: &mut Wavefront) {
        wave.rays.push(self.ray);
        wave.paths.push(self.path);
        wave.sources.extend(self.source);
        wave.media.extend(self.media);
        wave.shares.extend(self.shares);
        wave.walks.extend(self.walk);
    }
}

/// Splits a path whose camera ray hits a shadow catcher. Returns the path that goes on among catchers alone.
#[inline]
pub(super) fn split(
    context: &Context<'_>,
    ray: &Ray,
    hit: &Hit,
    path: &mut Path,
    batch: &mut Batch,
    registers: &mut Vec<Value>,
) -> Option<Path> {
    let scene = context.scene;
    if !scene.features().catchers || !path.camera || path.catch != Catch::None || !hit.is_hit() {
        return None;
    }
    let material = &scene.materials[scene.attributes.at(hit.triangle).material()];
    if !material.catcher || !material.visible.to(path.kind) {
        return None;
    }
    // Without a film that catches shadows, catchers are surfaces like others.
    let caught = batch.caught.get_mut(path.slot as usize)?;
    // The film shows the background behind the catcher, unless it is transparent.
    let mut background = Vec3::ZERO;
    if !context.settings.film_transparent && scene.world.visible.to(path.kind) {
        let (d, history) = (Vec3::from(ray.d), path.history(0.0));
        let (images, varying) = (&scene.images, &scene.varying);
        let (world, kind) = (&scene.world, path.kind);
        let light = world.radiance(images, varying, d, kind, history, registers);
        background = context.settings.clamped(path.throughput * light, false);
    }
    caught.meet(background);
    Some(path.split())
}
