// SPDX-License-Identifier: GPL-3.0-or-later
//! Work on all cores whose items start threads of their own.

use std::num::NonZero;
use std::sync::Mutex;
use std::thread;

/// Calls `work` with each of the items, on one thread per core.
///
/// A worker of rayon that waits for another pool, as each build has one, begins another item meanwhile, on the same
/// stack: hundreds of items overflow it.
pub fn on_all_cores<T: Send>(items: Vec<T>, work: impl Fn(T) + Sync) {
    let count = thread::available_parallelism().map_or(1, NonZero::get);
    let items = Mutex::new(items.into_iter());
    let take = || items.lock().ok().and_then(|mut items| items.next());
    thread::scope(|scope| {
        for _ in 0..count {
            scope.spawn(|| {
                while let Some(item) = take() {
                    work(item);
                }
            });
        }
    });
}
