// SPDX-License-Identifier: GPL-3.0-or-later
//! Kernels that trace rays one by one: a file for each layout, and for each published traversal of it.

pub mod brute;
pub mod grid;
pub mod objects;
pub mod octants;
pub mod planes;

use crate::batch::{Batch, SingleTraversal, Write};
use crate::kernel::{Kernel, SingleRays, store};
use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Closest, Count, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::{Hit, RayCounters};
use std::fmt::Debug;
use std::sync::Arc;

/// A traversal that shares the ownership of its tree.
pub trait OwnedTraversal: Debug + Send + Sync + 'static {
    /// The traversal of the borrowed tree, which the loops run on.
    type Borrowed<'a>: SingleTraversal
    where
        Self: 'a;

    /// Borrows the tree.
    fn borrowed(&self) -> Self::Borrowed<'_>;
}

/// The kernel of a traversal of single rays.
#[derive(Debug)]
pub struct Single<T> {
    /// The traversal.
    pub traversal: T,
    /// The leaves of its tree.
    pub leaves: Arc<Blocks>,
}

impl<Q: Query, T: OwnedTraversal> Kernel<Q> for Single<T> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let traversal = self.traversal.borrowed();
        let launch = batch.on(&self.leaves);
        launch.trace::<_, Q>(&traversal, &mut store::<Q>(answers), None);
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let traversal = self.traversal.borrowed();
        let launch = batch.on(&self.leaves);
        launch.trace::<_, Q>(&traversal, &mut store::<Q>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

impl<T: OwnedTraversal> SingleRays for Single<T> {
    fn cast(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        if any {
            launch.trace::<_, Any>(&traversal, write, counters);
        } else {
            launch.trace::<_, Closest>(&traversal, write, counters);
        }
    }

    fn observe<'c>(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        count: &mut dyn FnMut(usize) -> Count<'c>,
    ) {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        if any {
            launch.counted::<_, Any>(&traversal, write, count);
        } else {
            launch.counted::<_, Closest>(&traversal, write, count);
        }
    }

    fn path(&self, batch: &Batch<'_>) -> (Hit, Path) {
        batch.on(&self.leaves).path(&self.traversal.borrowed())
    }

    fn record(
        &self,
        batch: &Batch<'_>,
        any: bool,
        counters: &mut [RayCounters],
        record: &mut Record,
    ) -> Result<()> {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        if any {
            launch.record::<_, Any>(&traversal, counters, record);
        } else {
            launch.record::<_, Closest>(&traversal, counters, record);
        }
        Ok(())
    }

    fn replay(&self, batch: &Batch<'_>, recording: &Recording) -> (Vec<f64>, usize) {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        let mut seconds = Vec::new();
        let took = |time: std::time::Duration| seconds.push(time.as_secs_f64());
        let strayed = if recording.any {
            launch.replay::<_, Any>(&traversal, &recording.record, took)
        } else {
            launch.replay::<_, Closest>(&traversal, &recording.record, took)
        };
        (seconds, strayed)
    }
}

/// Defines a function that makes the kernel of a traversal of single rays. The kernel is compiled where the function is
/// defined, not where it is called.
macro_rules! single_rays {
    (
        $(#[$doc:meta])*
        fn $constructor:ident($tree:ty $(, $field:ident: $type:ty)*) -> $traversal:ty {
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
            impl $crate::single::OwnedTraversal for Owned {
                type Borrowed<'a> = $traversal;

                fn borrowed(&self) -> Self::Borrowed<'_> {
                    let $this = self;
                    $make
                }
            }
            std::sync::Arc::new($crate::single::Single {
                traversal: Owned {
                    tree: tree.clone(),
                    $($field,)*
                },
                leaves: leaves.clone(),
            })
        }
    };
}
pub(crate) use single_rays;
