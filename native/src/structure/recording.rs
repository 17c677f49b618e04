// SPDX-License-Identifier: GPL-3.0-or-later
//! Walks of single rays that are told, or recorded and walked again.

use super::{Layout, Structure};
use crate::error::{Error, Result};
use crate::traverse::batch::{Batch, Walk, WithWalk};
use crate::traverse::path::Path;
use crate::traverse::query::{Any, Closest, Query};
use crate::traverse::replay::{Record, Recording};
use crate::traverse::{Hit, Ray, RayCounters};
use fearless_simd::Level;
use std::marker::PhantomData;
use std::time::Duration;

impl Structure {
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
        let job = self.batch_walked(built, Level::new(), std::slice::from_ref(ray));
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
        let job = self.batch_walked(built, Level::new(), &rays);
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
        let job = self.batch_walked(built, Level::new(), &recording.rays);
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
}
