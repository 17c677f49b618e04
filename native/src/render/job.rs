// SPDX-License-Identifier: GPL-3.0-or-later
//! A render in progress: its threads, its progress, its end.
//!
//! Every tile is rendered step by step by whichever thread comes next; a tile's steps follow each
//! other, and a step's samples do not depend on who computes them. So the image is the same for
//! any number of threads.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::camera::{Camera, CameraParams};
use super::check::{Error, Result};
use super::film::Film;
use super::filter::Filter;
use super::integrator::{Context, Wavefront};
use super::scene::RenderScene;
use super::settings::{Pass, Settings};
use super::work::Work;
use crate::memory::check_room;

/// Numbers of a render so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Statistics {
    /// Wall clock since the start, up to the end.
    pub seconds: f64,
    /// What was done.
    pub work: Work,
}

struct Shared {
    scene: Arc<RenderScene>,
    camera: Camera,
    filter: Filter,
    settings: Settings,
    film: Film,
    /// Samples done per tile; held while a step of the tile is rendered.
    turns: Vec<Mutex<u32>>,
    /// Visits of tiles handed out so far, and how many there are.
    next: AtomicUsize,
    visits: usize,
    /// Pixel samples finished and wanted.
    done: AtomicU64,
    wanted: u64,
    stop: AtomicBool,
    /// The time limit came first.
    expired: AtomicBool,
    running: AtomicUsize,
    started: Instant,
    state: Mutex<State>,
    ended: Condvar,
}

#[derive(Default)]
struct State {
    finished: bool,
    cancelled: bool,
    error: Option<String>,
    work: Work,
    seconds: f64,
}

/// A running or finished render. Dropping it cancels it and waits for its threads.
pub struct Job {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Job {
    /// Starts rendering on threads of its own and returns at once. `threads`: 0 = all cores.
    ///
    /// # Errors
    /// When a setting or the camera is invalid, or no thread can be started.
    pub fn start(
        scene: Arc<RenderScene>,
        camera: &CameraParams,
        settings: Settings,
        threads: usize,
    ) -> Result<Self> {
        settings.check()?;
        check_room("settings: the film", Film::bytes(&settings))?;
        let camera = Camera::new(camera, settings.width, settings.height)?;
        let filter = Filter::new(settings.filter, settings.filter_width)?;
        let film = Film::new(&settings);
        let mut steps = 0;
        let mut done = 0;
        while done < settings.samples {
            done += settings.step_after(done);
            steps += 1;
        }
        let tiles = film.tiles();
        let pixels: u64 = (0..tiles).map(|t| film.area(t).pixels() as u64).sum();
        let threads = match threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            n => n.min(1024),
        };
        let threads = threads.min(tiles).max(1);
        let shared = Arc::new(Shared {
            turns: (0..tiles).map(|_| Mutex::new(0)).collect(),
            next: AtomicUsize::new(0),
            visits: tiles * steps,
            done: AtomicU64::new(0),
            wanted: pixels * u64::from(settings.samples),
            stop: AtomicBool::new(false),
            expired: AtomicBool::new(false),
            running: AtomicUsize::new(threads),
            started: Instant::now(),
            state: Mutex::new(State::default()),
            ended: Condvar::new(),
            scene,
            camera,
            filter,
            settings,
            film,
        });
        let mut job = Self {
            shared: Arc::clone(&shared),
            threads: Vec::with_capacity(threads),
        };
        for index in 0..threads {
            let shared = Arc::clone(&shared);
            let builder = std::thread::Builder::new().name(format!("halfspace-render-{index}"));
            match builder.spawn(move || shared.run()) {
                Ok(handle) => job.threads.push(handle),
                Err(error) if index == 0 => {
                    return Err(Error::Spec(format!(
                        "threads: none could be started: {error}"
                    )));
                }
                // Fewer threads render the same image; the missing ones count as ended.
                Err(_) => job.shared.leave(),
            }
        }
        Ok(job)
    }

    /// Waits until the render has ended or the time is over. Returns whether it has ended.
    pub fn wait(&self, time: Duration) -> bool {
        let state = self.shared.state();
        let (state, _) = self
            .shared
            .ended
            .wait_timeout_while(state, time, |s| !s.finished)
            .unwrap_or_else(PoisonError::into_inner);
        state.finished
    }

    /// Asks the render to stop; it does within 0.1 s. The film keeps what was finished.
    pub fn cancel(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// Share of the samples that are done, 0..1.
    pub fn progress(&self) -> f64 {
        self.shared.done.load(Ordering::Relaxed) as f64 / self.shared.wanted as f64
    }

    /// Whether it has ended: done, failed or cancelled.
    pub fn is_finished(&self) -> bool {
        self.shared.state().finished
    }

    /// Whether it ended before all samples were done because it was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.shared.state().cancelled
    }

    /// What went wrong, if anything.
    pub fn error(&self) -> Option<String> {
        self.shared.state().error.clone()
    }

    /// Samples per pixel that every pixel has.
    pub fn samples_done(&self) -> u32 {
        self.shared.film.samples_done()
    }

    /// The passes that are filled.
    pub fn passes(&self) -> &[Pass] {
        self.shared.film.passes()
    }

    /// Whether traversal steps and tests are counted.
    pub fn counts(&self) -> bool {
        self.shared.film.counts()
    }

    /// The mean so far; see [`Film::copy_into`].
    ///
    /// # Errors
    /// As there.
    pub fn copy_into(&self, pass: Pass, out: &mut [f32]) -> Result<()> {
        self.shared.film.copy_into(pass, out)
    }

    /// Numbers so far.
    pub fn statistics(&self) -> Statistics {
        let state = self.shared.state();
        let seconds = if state.finished {
            state.seconds
        } else {
            self.shared.started.elapsed().as_secs_f64()
        };
        Statistics {
            seconds,
            work: state.work,
        }
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        self.cancel();
        for thread in self.threads.drain(..) {
            // A worker's panic is already caught and told; nothing is left to report.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The life of one thread.
    fn run(&self) {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.work())) {
            self.stop.store(true, Ordering::Relaxed);
            self.state()
                .error
                .get_or_insert(Error::of_panic(&*panic).to_string());
        }
        self.leave();
    }

    /// Notes that one thread is gone; the last one ends the render.
    fn leave(&self) {
        if self.running.fetch_sub(1, Ordering::AcqRel) == 1 {
            let mut state = self.state();
            let complete = self.done.load(Ordering::Relaxed) == self.wanted
                || self.expired.load(Ordering::Relaxed) && !self.stop.load(Ordering::Relaxed);
            state.cancelled = !complete && state.error.is_none();
            state.seconds = self.started.elapsed().as_secs_f64();
            state.finished = true;
            self.ended.notify_all();
        }
    }

    fn work(&self) {
        let mut wavefront = Wavefront::new(self.scene.features());
        let context = Context {
            scene: &self.scene,
            camera: &self.camera,
            filter: &self.filter,
            settings: &self.settings,
            film: &self.film,
            stop: &self.stop,
        };
        let mut active = Vec::new();
        let limit = f64::from(self.settings.time_limit);
        let tiles = self.film.tiles();
        loop {
            let visit = self.next.fetch_add(1, Ordering::Relaxed);
            if visit >= self.visits || self.stop.load(Ordering::Relaxed) {
                return;
            }
            if visit >= tiles && limit > 0.0 && self.started.elapsed().as_secs_f64() > limit {
                self.expired.store(true, Ordering::Relaxed);
                return;
            }
            let tile = visit % tiles;
            let area = self.film.area(tile);
            // Whoever comes first does the tile's next step, so the steps stay in order.
            let mut done = self.turns[tile]
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let count = self.settings.step_after(*done);
            if self.film.active(tile, &mut active) {
                let Ok(samples) = wavefront.render(&context, area, &active, *done, count) else {
                    return;
                };
                self.film.add(tile, samples, count, &self.settings);
            } else {
                self.film.skip(tile, count);
            }
            *done += count;
            let finished = area.pixels() as u64 * u64::from(count);
            self.done.fetch_add(finished, Ordering::Relaxed);
            self.state().work.add(&wavefront.work);
            wavefront.work = Work::default();
        }
    }
}
