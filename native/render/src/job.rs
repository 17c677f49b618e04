// SPDX-License-Identifier: GPL-3.0-or-later
//! A render in progress: its threads, its progress and its end.
//!
//! Each tile is rendered in steps of a few samples. Any thread may render the next step; the steps of one tile
//! follow each other, and the samples do not depend on the thread. So the image is the same for any number of
//! threads.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::camera::filter::Filter;
use crate::camera::{Camera, CameraParams};
use crate::check::{Error, Result};
use crate::film::{Film, Unsampled};
use crate::path::beams::polygons::Polygons;
use crate::path::points::Points;
use crate::path::record::{Recorded, Recorder};
use crate::path::wavefront::{Context, Wavefront};
use crate::path::work::Work;
use crate::scene::RenderScene;
use crate::settings::{Pass, Settings};
use halfspace_base::memory::check_room;

/// Statistics of a render so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Statistics {
    /// Wall-clock time since the start, until the end if it has ended; seconds.
    pub seconds: f64,
    /// Counts of rays and traversal work.
    pub work: Work,
}

/// The state that all threads of a render share.
struct Shared {
    scenes: Vec<Arc<RenderScene>>,
    camera: Camera,
    filter: Filter,
    settings: Settings,
    film: Film,
    /// The polygons that mirror and refract beams, scene by scene, if secondary rays go as beams; otherwise none.
    polygons: Vec<Polygons>,
    /// The points of surfaces that the pixels show, in place of what the camera sees.
    points: Option<Points>,
    /// Records rays, if the settings request it.
    recorder: Option<Recorder>,
    /// Samples done per tile; locked while a step of the tile is rendered.
    tile_samples: Vec<Mutex<u32>>,
    /// Number of steps handed out so far, over all tiles.
    next: AtomicUsize,
    /// Number of steps of all tiles together.
    steps: usize,
    /// Number of pixel samples finished.
    done: AtomicU64,
    /// Number of pixel samples of the whole render.
    wanted: u64,
    /// Set to cancel the render.
    stop: AtomicBool,
    /// Whether the time limit ended the render.
    expired: AtomicBool,
    /// Number of threads that still run.
    running: AtomicUsize,
    started: Instant,
    state: Mutex<State>,
    ended: Condvar,
}

/// The part of the shared state that changes together.
#[derive(Default)]
struct State {
    finished: bool,
    cancelled: bool,
    error: Option<String>,
    work: Work,
    seconds: f64,
}

/// Largest number of scenes of a render.
const MAX_SCENES: usize = 1 << 10;

/// One scene at one or several times.
pub struct Moments(pub Vec<Arc<RenderScene>>);

impl From<Arc<RenderScene>> for Moments {
    /// A scene without motion.
    fn from(scene: Arc<RenderScene>) -> Self {
        Self(vec![scene])
    }
}

/// A running or finished render. Dropping it cancels it and waits for its threads.
pub struct Job {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Job {
    /// Starts rendering on new threads and returns at once. `scenes`: one, or the same one at several times while the
    /// shutter is open, which the samples take in turn. `threads`: number of threads, 0 = one per core.
    ///
    /// # Errors
    /// If there is no scene or too many, a setting or the camera is invalid, the film exceeds the memory, or no thread
    /// can be started.
    pub fn start(
        scenes: impl Into<Moments>,
        camera: &CameraParams,
        settings: Settings,
        threads: usize,
    ) -> Result<Self> {
        Self::start_at(scenes, camera, settings, threads, None)
    }

    /// Like [`Self::start`]. `points`: what the pixels show in place of what the camera sees.
    ///
    /// # Errors
    /// As for [`Self::start`], and of [`Points::prepared`].
    pub fn start_at(
        scenes: impl Into<Moments>,
        camera: &CameraParams,
        settings: Settings,
        threads: usize,
        points: Option<Points>,
    ) -> Result<Self> {
        // Check everything before the first thread starts.
        settings.check()?;
        let Moments(scenes) = scenes.into();
        if scenes.is_empty() || scenes.len() > MAX_SCENES {
            return Err(Error::Spec(format!(
                "scenes: expected 1 to {MAX_SCENES}, got {}",
                scenes.len()
            )));
        }
        let pixels = settings.width as usize * settings.height as usize;
        let points = points.map(|points| points.prepared(pixels, &scenes[0]));
        let points = points.transpose()?;
        // Points show shadow catchers as they are.
        let catches = points.is_none() && scenes.iter().any(|scene| scene.features().catchers);
        check_room("settings: the film", Film::bytes(&settings, catches))?;
        let camera = Camera::new(camera, settings.width, settings.height)?;
        let filter = Filter::new(settings.filter, settings.filter_width)?;
        let film = Film::new(&settings, catches);
        // Count the steps that each tile needs.
        let mut steps = 0;
        let mut done = 0;
        while done < settings.samples {
            done += settings.step_after(done);
            steps += 1;
        }
        // Count tiles and pixels, for the order of work and the progress.
        let tiles = film.tiles();
        let pixels: u64 = (0..tiles).map(|t| film.area(t).pixels() as u64).sum();
        // More threads than tiles would find nothing to do.
        let threads = match threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            n => n.min(1024),
        };
        let threads = threads.min(tiles).max(1);
        let with_beams = scenes.iter().filter(|_| settings.secondary_beams);
        let polygons = with_beams.map(|scene| Polygons::of(scene)).collect();
        let recorder =
            (settings.record_rays > 0).then(|| Recorder::new(settings.record_rays as usize));
        let shared = Arc::new(Shared {
            tile_samples: (0..tiles).map(|_| Mutex::new(0)).collect(),
            next: AtomicUsize::new(0),
            steps: tiles * steps,
            done: AtomicU64::new(0),
            wanted: pixels * u64::from(settings.samples),
            stop: AtomicBool::new(false),
            expired: AtomicBool::new(false),
            running: AtomicUsize::new(threads),
            started: Instant::now(),
            state: Mutex::new(State::default()),
            ended: Condvar::new(),
            scenes,
            camera,
            filter,
            settings,
            film,
            polygons,
            points,
            recorder,
        });
        let mut job = Self {
            shared: Arc::clone(&shared),
            threads: Vec::with_capacity(threads),
        };
        // Start the threads.
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
                // Fewer threads render the same image; count the missing ones as ended.
                Err(_) => job.shared.thread_ended(),
            }
        }
        Ok(job)
    }

    /// Waits until the render has ended, at most for `time`. Returns whether it has ended.
    pub fn wait(&self, time: Duration) -> bool {
        let state = self.shared.state();
        let (state, _) = self
            .shared
            .ended
            .wait_timeout_while(state, time, |s| !s.finished)
            .unwrap_or_else(PoisonError::into_inner);
        state.finished
    }

    /// Requests the render to stop, which takes at most 0.1 s. The film keeps what was finished.
    pub fn cancel(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// Returns the fraction of the samples that are done, 0..1.
    pub fn progress(&self) -> f64 {
        self.shared.done.load(Ordering::Relaxed) as f64 / self.shared.wanted as f64
    }

    /// Whether the render has ended: completed, failed or cancelled.
    pub fn is_finished(&self) -> bool {
        self.shared.state().finished
    }

    /// Whether the render was cancelled before all samples were done.
    pub fn is_cancelled(&self) -> bool {
        self.shared.state().cancelled
    }

    /// Returns the error that ended the render, if any.
    pub fn error(&self) -> Option<String> {
        self.shared.state().error.clone()
    }

    /// Returns the number of samples per pixel that every pixel has.
    pub fn samples_done(&self) -> u32 {
        self.shared.film.samples_done()
    }

    /// Returns the passes that are filled.
    pub fn passes(&self) -> &[Pass] {
        self.shared.film.passes()
    }

    /// Whether traversal steps and triangle tests are counted.
    pub fn counts(&self) -> bool {
        self.shared.film.counts()
    }

    /// Writes the mean of the samples so far to `out`; see [`Film::copy_into`].
    ///
    /// # Errors
    /// As for [`Film::copy_into`].
    pub fn copy_into(&self, pass: Pass, unsampled: Unsampled, out: &mut [f32]) -> Result<()> {
        self.shared.film.copy_into(pass, unsampled, out)
    }

    /// Returns the rays recorded so far, by kind; none unless the settings request it.
    pub fn recorded(&self) -> Vec<Recorded> {
        let recorder = self.shared.recorder.as_ref();
        recorder.map(Recorder::recorded).unwrap_or_default()
    }

    /// Returns the statistics so far.
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
            // A worker's panic is caught and reported in `State::error` already.
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Locks the state. A panic in another thread leaves it usable.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs one thread to its end. A panic becomes the render's error and stops the other threads.
    fn run(&self) {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.work())) {
            self.stop.store(true, Ordering::Relaxed);
            self.state()
                .error
                .get_or_insert(Error::of_panic(&*panic).to_string());
        }
        self.thread_ended();
    }

    /// Counts one thread as ended; the last one ends the render.
    fn thread_ended(&self) {
        if self.running.fetch_sub(1, Ordering::AcqRel) == 1 {
            // The last thread decides whether the render is complete: a time limit counts as the planned end.
            let mut state = self.state();
            let complete = self.done.load(Ordering::Relaxed) == self.wanted
                || self.expired.load(Ordering::Relaxed) && !self.stop.load(Ordering::Relaxed);
            state.cancelled = !complete && state.error.is_none();
            state.seconds = self.started.elapsed().as_secs_f64();
            state.finished = true;
            self.ended.notify_all();
        }
    }

    /// Renders steps until none is left, the time is over or the render is cancelled.
    fn work(&self) {
        let mut wavefront = Wavefront::new(self.scenes[0].features(), self.film.wants_extra());
        let context = Context {
            scene: &self.scenes[0],
            moment: 0,
            scenes: &self.scenes,
            camera: &self.camera,
            filter: &self.filter,
            settings: &self.settings,
            film: &self.film,
            polygons: self.polygons.first(),
            all_polygons: &self.polygons,
            points: self.points.as_ref(),
            recorder: self.recorder.as_ref(),
            stop: &self.stop,
        };
        let mut active = Vec::new();
        let limit = f64::from(self.settings.time_limit);
        let tiles = self.film.tiles();
        loop {
            // Hand out steps round robin over the tiles, so that the whole image refines evenly.
            let step = self.next.fetch_add(1, Ordering::Relaxed);
            if step >= self.steps || self.stop.load(Ordering::Relaxed) {
                return;
            }
            // The time limit counts once every tile had its first step, so no part of the image stays empty.
            if step >= tiles && limit > 0.0 && self.started.elapsed().as_secs_f64() > limit {
                self.expired.store(true, Ordering::Relaxed);
                return;
            }
            // Render the tile's next step, unless all its blocks have stopped.
            let tile = step % tiles;
            let area = self.film.area(tile);
            // The lock keeps the steps of a tile in order, whichever thread renders them.
            let mut done = self.tile_samples[tile]
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            let count = self.settings.step_after(*done);
            if self.film.active(tile, &mut active) {
                let Ok(batch) = wavefront.render(&context, area, &active, *done, count) else {
                    return;
                };
                self.film.add(tile, batch, count, &self.settings);
            } else {
                self.film.skip(tile, count);
            }
            // Publish the progress and this thread's counts.
            *done += count;
            let finished = area.pixels() as u64 * u64::from(count);
            self.done.fetch_add(finished, Ordering::Relaxed);
            self.state().work.add(&wavefront.work);
            wavefront.work = Work::default();
        }
    }
}
