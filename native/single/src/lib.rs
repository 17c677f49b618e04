// SPDX-License-Identifier: GPL-3.0-or-later
//! Kernels that trace rays one by one: a file for each layout, and for each published traversal of it.

pub mod grid;
pub mod objects;
pub mod octants;
pub mod planes;
pub mod steps;

use halfspace_base::error::Result;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, AsPublished, Closest, Count, OneByOne, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::selection::HitFilter;
use halfspace_ray::{Hit, RayCounters};
use halfspace_trace::batch::{Batch, Launch, SingleTraversal, Write};
use halfspace_trace::kernel::{Kernel, SingleRays, filtered, store};
use std::fmt::Debug;
use std::marker::PhantomData;
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

/// How a kernel tests the triangles of leaves; see [`halfspace_ray::query::LeafTest`].
pub trait Leaves: Debug + Send + Sync + 'static {
    /// The query of its traversals.
    type Of<Q: Query>: Query<Answer = Q::Answer>;

    /// As [`Launch::sifted`], where that is compiled.
    fn sift<T: SingleTraversal>(_: &Launch<'_>, _: &T, _: Write<'_>, _: HitFilter<'_>) -> bool {
        false
    }
}

/// Eight triangles at a time.
#[derive(Debug)]
pub struct Eight;

impl Leaves for Eight {
    type Of<Q: Query> = Q;

    fn sift<T: SingleTraversal>(
        launch: &Launch<'_>,
        traversal: &T,
        write: Write<'_>,
        filter: HitFilter<'_>,
    ) -> bool {
        launch.sifted::<_, Closest>(traversal, write, filter)
    }
}

/// One triangle at a time.
#[derive(Debug)]
pub struct Scalar;

impl Leaves for Scalar {
    type Of<Q: Query> = OneByOne<Q>;
}

/// One triangle at a time as published.
#[derive(Debug)]
pub struct Published;

impl Leaves for Published {
    type Of<Q: Query> = AsPublished<Q>;
}

/// The kernel of a traversal of single rays, which tests leaves in the way `L`.
#[derive(Debug)]
pub struct Single<T, L = Eight> {
    traversal: T,
    /// The leaves of its tree.
    leaves: Arc<Blocks>,
    tests: PhantomData<L>,
}

impl<T, L> Single<T, L> {
    /// Makes the kernel of a traversal; `leaves` are those of its tree.
    pub fn new(traversal: T, leaves: Arc<Blocks>) -> Self {
        Self {
            traversal,
            leaves,
            tests: PhantomData,
        }
    }
}

impl<Q: Query, T: OwnedTraversal, L: Leaves> Kernel<Q> for Single<T, L> {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let traversal = self.traversal.borrowed();
        let launch = batch.on(&self.leaves);
        launch.trace::<_, L::Of<Q>>(&traversal, &mut store::<Q>(answers), None);
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let traversal = self.traversal.borrowed();
        let launch = batch.on(&self.leaves);
        launch.trace::<_, L::Of<Q>>(&traversal, &mut store::<Q>(answers), Some(counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

impl<T: OwnedTraversal, L: Leaves> SingleRays for Single<T, L> {
    fn cast(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        if any {
            launch.trace::<_, L::Of<Any>>(&traversal, write, counters);
        } else {
            launch.trace::<_, L::Of<Closest>>(&traversal, write, counters);
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
            launch.counted::<_, L::Of<Any>>(&traversal, write, count);
        } else {
            launch.counted::<_, L::Of<Closest>>(&traversal, write, count);
        }
    }

    fn sift(&self, batch: &Batch<'_>, write: Write<'_>, filter: HitFilter<'_>) {
        let launch = batch.on(&self.leaves);
        if !L::sift(&launch, &self.traversal.borrowed(), write, filter) {
            filtered(self, batch, write, filter);
        }
    }

    fn path(&self, batch: &Batch<'_>, any: bool) -> (Hit, Path) {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        if any {
            launch.path::<_, L::Of<Any>>(&traversal)
        } else {
            launch.path::<_, L::Of<Closest>>(&traversal)
        }
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
            launch.record::<_, L::Of<Any>>(&traversal, counters, record);
        } else {
            launch.record::<_, L::Of<Closest>>(&traversal, counters, record);
        }
        Ok(())
    }

    fn replay(&self, batch: &Batch<'_>, recording: &Recording) -> (Vec<f64>, usize) {
        let (traversal, launch) = (self.traversal.borrowed(), batch.on(&self.leaves));
        let mut seconds = Vec::new();
        let took = |time: std::time::Duration| seconds.push(time.as_secs_f64());
        let strayed = if recording.any {
            launch.replay::<_, L::Of<Any>>(&traversal, &recording.record, took)
        } else {
            launch.replay::<_, L::Of<Closest>>(&traversal, &recording.record, took)
        };
        (seconds, strayed)
    }
}

/// Defines a function that makes the kernel of a traversal of single rays, which tests leaves in the way after `with`, by
/// default eight triangles at a time. The kernel is compiled where the function is defined, not where it is called.
#[macro_export]
macro_rules! single_rays {
    (
        $(#[$doc:meta])*
        fn $constructor:ident($($of:tt)*) -> $traversal:ty {
            |$this:ident| $make:expr
        }
    ) => {
        $crate::single_rays! {
            $(#[$doc])*
            fn $constructor($($of)*) -> $traversal, with $crate::Eight {
                |$this| $make
            }
        }
    };
    (
        $(#[$doc:meta])*
        fn $constructor:ident($tree:ty $(, $field:ident: $type:ty)*) -> $traversal:ty, with $leaves:ty {
            |$this:ident| $make:expr
        }
    ) => {
        $(#[$doc])*
        pub fn $constructor(
            tree: &std::sync::Arc<$tree>,
            leaves: &std::sync::Arc<halfspace_leaf::blocks::Blocks>
            $(, $field: $type)*
        ) -> std::sync::Arc<dyn halfspace_trace::kernel::SingleRays> {
            #[derive(Debug)]
            struct Owned {
                tree: std::sync::Arc<$tree>,
                $($field: $type,)*
            }
            impl $crate::OwnedTraversal for Owned {
                type Borrowed<'a> = $traversal;

                fn borrowed(&self) -> Self::Borrowed<'_> {
                    let $this = self;
                    $make
                }
            }
            let owned = Owned {
                tree: tree.clone(),
                $($field,)*
            };
            let kernel = $crate::Single::<_, $leaves>::new(owned, leaves.clone());
            std::sync::Arc::new(kernel)
        }
    };
}
