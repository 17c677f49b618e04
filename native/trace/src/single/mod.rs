// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays one by one: a file for each layout and for each published way through it.

pub mod brute;
pub mod grid;
pub mod objects;
pub mod octants;
pub mod planes;

use crate::batch::{Batch, Walk, Write};
use crate::kernel::{Kernel, SingleRays, store};
use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Closest, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::{Hit, RayCounters};
use std::fmt::Debug;
use std::sync::Arc;

/// A traversal that shares the ownership of its tree, and lends the form of it that the loops run on.
pub trait Method: Debug + Send + Sync + 'static {
    /// The traversal with a borrowed tree.
    type Walk<'a>: Walk
    where
        Self: 'a;

    /// Borrows the tree.
    fn walk(&self) -> Self::Walk<'_>;
}

/// The kernel of a traversal of single rays.
#[derive(Debug)]
pub struct Single<M> {
    /// The traversal.
    pub method: M,
    /// The leaves of its tree.
    pub leaves: Arc<Blocks>,
}

impl<Q: Query, M: Method> Kernel<Q> for Single<M> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let walk = self.method.walk();
        let launch = batch.on(&self.leaves);
        launch.walk::<_, Q>(&walk, &mut store::<Q>(answers), None);
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let walk = self.method.walk();
        let launch = batch.on(&self.leaves);
        launch.walk::<_, Q>(&walk, &mut store::<Q>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

impl<M: Method> SingleRays for Single<M> {
    fn cast(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let (walk, launch) = (self.method.walk(), batch.on(&self.leaves));
        if any {
            launch.walk::<_, Any>(&walk, write, counters);
        } else {
            launch.walk::<_, Closest>(&walk, write, counters);
        }
    }

    fn path(&self, batch: &Batch<'_>) -> (Hit, Path) {
        batch.on(&self.leaves).path(&self.method.walk())
    }

    fn record(
        &self,
        batch: &Batch<'_>,
        any: bool,
        counters: &mut [RayCounters],
        record: &mut Record,
    ) -> Result<()> {
        let (walk, launch) = (self.method.walk(), batch.on(&self.leaves));
        if any {
            launch.record::<_, Any>(&walk, counters, record);
        } else {
            launch.record::<_, Closest>(&walk, counters, record);
        }
        Ok(())
    }

    fn replay(&self, batch: &Batch<'_>, recording: &Recording) -> (Vec<f64>, usize) {
        let (walk, launch) = (self.method.walk(), batch.on(&self.leaves));
        let mut seconds = Vec::new();
        let took = |time: std::time::Duration| seconds.push(time.as_secs_f64());
        let strayed = if recording.any {
            launch.replay::<_, Any>(&walk, &recording.record, took)
        } else {
            launch.replay::<_, Closest>(&walk, &recording.record, took)
        };
        (seconds, strayed)
    }
}

/// Defines a function that makes the kernel of a traversal of single rays. The kernel is compiled where the function is
/// defined, not where it is called.
macro_rules! single_rays {
    (
        $(#[$doc:meta])*
        fn $constructor:ident($tree:ty $(, $field:ident: $type:ty)*) -> $walk:ty {
            |$this:ident| $make:expr
        }
    ) => {
        $(#[$doc])*
        pub fn $constructor(
            tree: &std::sync::Arc<$tree>,
            leaves: &std::sync::Arc<halfspace_leaf::blocks::Blocks>
            $(, $field: $type)*
        ) -> std::sync::Arc<dyn $crate::kernel::SingleRays> {
            #[derive(Debug)]
            struct Owned {
                tree: std::sync::Arc<$tree>,
                $($field: $type,)*
            }
            impl $crate::single::Method for Owned {
                type Walk<'a> = $walk;

                fn walk(&self) -> Self::Walk<'_> {
                    let $this = self;
                    $make
                }
            }
            std::sync::Arc::new($crate::single::Single {
                method: Owned {
                    tree: tree.clone(),
                    $($field,)*
                },
                leaves: leaves.clone(),
            })
        }
    };
}
pub(crate) use single_rays;
