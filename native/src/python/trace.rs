// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays from arrays, hits to arrays, and the exact oracle.

use super::arrays::{self, Limits, PerRay, Points};
use super::whole::Threads;
use crate::error::{Error, Result, caught};
use crate::geom::Aabb;
use crate::memory::check_room;
use crate::oracle::exact_closest;
use crate::scene::Triangles;
use crate::traverse::reorder;
use crate::traverse::{Hit, Order, Ray, RayCounters, Tracer};
use numpy::{PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::num::NonZero;
use std::ops::Range;
use std::sync::Mutex;
use std::thread::Builder;

/// Rays handed to a worker at once: enough to forget the cost of handing them over, and to learn whether they go
/// well in tiles; few enough to stay in its cache.
const CHUNK: usize = 4096;

/// The arguments of `closest` and `occluded`, which own or hold on to the arrays.
pub struct RayArrays<'py> {
    origins: Points<'py>,
    directions: Points<'py>,
    t_min: PerRay<'py>,
    t_max: PerRay<'py>,
    order: Order,
}

/// Checked rays of one call.
#[derive(Clone, Copy)]
pub struct Rays<'a> {
    origins: &'a [[f32; 3]],
    directions: &'a [[f32; 3]],
    t_min: Limits<'a>,
    t_max: Limits<'a>,
    order: Order,
}

impl<'py> RayArrays<'py> {
    /// Checks types, shapes and numbers.
    pub fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        order: &str,
    ) -> Result<Self> {
        let origin_points = Points::new("origins", origins)?;
        let direction_points = Points::new("directions", directions)?;
        let (origins, directions) = (origin_points.rows(), direction_points.rows());
        arrays::check_finite("origins", origins)?;
        arrays::check_finite("directions", directions)?;
        if origins.len() != directions.len() {
            return Err(Error::Shape(format!(
                "directions: expected one per origin, {}, got {}",
                origins.len(),
                directions.len()
            )));
        }
        let order = match order {
            "none" => Order::None,
            "tile8" => Order::Tiles,
            other => {
                return Err(Error::Spec(format!(
                    "order: expected none or tile8, got {other}"
                )));
            }
        };
        if order == Order::Tiles && origins.len() % 64 != 0 {
            return Err(Error::Shape(format!(
                "order: tile8 wants a multiple of 64 rays, got {}",
                origins.len()
            )));
        }
        let limit = |name, value: Option<&Bound<'py, PyAny>>, default| match value {
            None => Ok(PerRay::Same(default)),
            Some(value) => arrays::per_ray(name, value, origins.len()),
        };
        let t_min = limit("t_min", t_min, 0.0)?;
        let t_max = limit("t_max", t_max, f32::INFINITY)?;
        Ok(Self {
            origins: origin_points,
            directions: direction_points,
            t_min,
            t_max,
            order,
        })
    }

    /// The rays, free of Python.
    pub fn rays(&self) -> Rays<'_> {
        Rays {
            origins: self.origins.rows(),
            directions: self.directions.rows(),
            t_min: self.t_min.limits(),
            t_max: self.t_max.limits(),
            order: self.order,
        }
    }
}

impl<'a> Rays<'a> {
    /// All of them.
    pub fn all(&self) -> Vec<Ray> {
        let mut rays = vec![BLANK; self.origins.len()];
        self.put(0, &mut rays);
        rays
    }

    /// Those in a range of places.
    fn part(&self, range: Range<usize>) -> Self {
        let limits = |limits: Limits<'a>| match limits {
            Limits::Same(t) => Limits::Same(t),
            Limits::Each(t) => Limits::Each(&t[range.clone()]),
        };
        Self {
            origins: &self.origins[range.clone()],
            directions: &self.directions[range.clone()],
            t_min: limits(self.t_min),
            t_max: limits(self.t_max),
            ..*self
        }
    }

    /// Overwrites `rays` with those at these places.
    fn put_those(&self, places: &[u32], rays: &mut [Ray]) {
        let at = |limits: Limits<'_>, i: usize| match limits {
            Limits::Same(t) => t,
            Limits::Each(t) => t[i],
        };
        for (ray, &place) in rays.iter_mut().zip(places) {
            let i = place as usize;
            *ray = Ray {
                o: self.origins[i],
                d: self.directions[i],
                t_min: at(self.t_min, i),
                t_max: at(self.t_max, i),
            };
        }
    }

    /// Overwrites `rays` with those from the `first` on.
    // Field by field, and with the kinds of limits told apart outside the loops: rays that are put together
    // first and copied then take longer to bring in than to trace in tiles.
    fn put(&self, first: usize, rays: &mut [Ray]) {
        let range = first..first + rays.len();
        let ends = self.origins[range.clone()]
            .iter()
            .zip(&self.directions[range.clone()]);
        for (ray, (o, d)) in rays.iter_mut().zip(ends) {
            ray.o = *o;
            ray.d = *d;
        }
        match self.t_min {
            Limits::Same(t_min) => rays.iter_mut().for_each(|ray| ray.t_min = t_min),
            Limits::Each(t_min) => {
                for (ray, t_min) in rays.iter_mut().zip(&t_min[range.clone()]) {
                    ray.t_min = *t_min;
                }
            }
        }
        match self.t_max {
            Limits::Same(t_max) => rays.iter_mut().for_each(|ray| ray.t_max = t_max),
            Limits::Each(t_max) => {
                for (ray, t_max) in rays.iter_mut().zip(&t_max[range]) {
                    ray.t_max = *t_max;
                }
            }
        }
    }
}

/// What buffers of rays hold before they are filled.
const BLANK: Ray = Ray {
    o: [0.0; 3],
    d: [0.0; 3],
    t_min: 0.0,
    t_max: 0.0,
};

/// Answers of closest(), one per ray.
///
/// t: (n,) float32, distance in units of the direction, correctly rounded; inf = miss.
/// triangle: (n,) int32, -1 = miss; of several at the same t the one with the smallest number.
/// u, v: (n,) float32, weights of the second and third corner: the point is
/// (1 - u - v) a + u b + v c. Each access makes a new array.
/// counters: None, or per ray (n,) uint32 under "steps", "steps_axis", "steps_oblique", "leaves",
/// "leaves_empty", "tests", "verdicts", "spared" (1: answered without a walk of its own); from TA-B
/// also the cases of ray and split plane, "case_n1" to "case_n5" (origin below the plane: 1 away from
/// it, 2 along it, 3 towards it but the cell ends before, 4 through it inside the cell, 5 through it
/// before the cell), "case_p1" to "case_p5" (above), "case_z1" (in the plane: upwards), "case_z2"
/// (downwards), "case_z3" (along); from beam-hh "beam_visits" (of nodes, by the beam whose first ray this is),
/// "beam_cuts" (a polygon parted it) and "beam_singles" (1: the ray went singly).
/// on_boundary: None, or from exact_closest (n,) bool: the ray passes exactly through an edge or
/// a corner of the triangle that it hits.
#[pyclass(frozen)]
pub struct Hits {
    hits: Vec<Hit>,
    /// What the walks told apart, and what each ray cost.
    counts: Option<(&'static [&'static str], Vec<RayCounters>)>,
    on_boundary: Option<Vec<bool>>,
}

#[pymethods]
impl Hits {
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.column(py, |h| h.t)
    }

    #[getter]
    fn triangle<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        // The number of a miss, all bits set, reads as -1.
        self.column(py, |h| h.triangle.cast_signed())
    }

    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.column(py, |h| h.u)
    }

    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.column(py, |h| h.v)
    }

    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.counts
            .as_ref()
            .map(|(cases, counts)| counters(py, cases, counts))
            .transpose()
    }

    #[getter]
    fn on_boundary<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        self.on_boundary
            .as_ref()
            .map(|flags| flags.to_pyarray(py).into_any())
    }

    fn __len__(&self) -> usize {
        self.hits.len()
    }
}

impl Hits {
    fn column<'py, T: numpy::Element + Copy>(
        &self,
        py: Python<'py>,
        get: impl Fn(&Hit) -> T,
    ) -> Bound<'py, PyAny> {
        self.hits
            .iter()
            .map(get)
            .collect::<Vec<_>>()
            .to_pyarray(py)
            .into_any()
    }
}

/// What each ray cost: name to (n,) uint32.
pub fn counters<'py>(
    py: Python<'py>,
    cases: &[&str],
    counters: &[RayCounters],
) -> PyResult<Bound<'py, PyDict>> {
    type Column = (&'static str, fn(&RayCounters) -> u32);
    const COLUMNS: [Column; 8] = [
        ("steps", |c| c.steps_axis + c.steps_oblique),
        ("steps_axis", |c| c.steps_axis),
        ("steps_oblique", |c| c.steps_oblique),
        ("leaves", |c| c.leaves),
        ("leaves_empty", |c| c.leaves_empty),
        ("tests", |c| c.tests),
        ("verdicts", |c| c.verdicts),
        ("spared", |c| c.spared),
    ];
    let dict = PyDict::new(py);
    for (name, get) in COLUMNS {
        let column: Vec<_> = counters.iter().map(get).collect();
        dict.set_item(name, column.to_pyarray(py))?;
    }
    for (i, name) in cases.iter().enumerate() {
        let column: Vec<_> = counters.iter().map(|c| c.cases[i]).collect();
        dict.set_item(name, column.to_pyarray(py))?;
    }
    Ok(dict)
}

/// Runs `work` on chunks of rays, their answers and their counters, on `threads` threads.
fn in_chunks<T: Clone + Send>(
    rays: Rays<'_>,
    threads: usize,
    counted: bool,
    blank: T,
    work: impl Fn(&[Ray], &mut [T], Option<&mut [RayCounters]>) + Sync,
) -> Result<(Vec<T>, Option<Vec<RayCounters>>)> {
    let n = rays.origins.len();
    let counter = if counted { size_of::<RayCounters>() } else { 0 };
    check_room("origins", (n * (size_of::<T>() + counter)) as u64)?;
    let mut answers = vec![blank; n];
    let mut counts = if counted {
        vec![RayCounters::default(); n]
    } else {
        Vec::new()
    };
    let mut counts_left = counts.as_mut_slice();
    let chunks: Vec<_> = answers
        .chunks_mut(CHUNK)
        .enumerate()
        .map(|(i, answers)| {
            let own = if counted { answers.len() } else { 0 };
            let (counts, rest) = std::mem::take(&mut counts_left).split_at_mut(own);
            counts_left = rest;
            (i * CHUNK, answers, counts)
        })
        .collect();
    share_out(chunks, threads, |buffer, (first, answers, counts)| {
        let buffer = &mut buffer[..answers.len()];
        rays.put(first, buffer);
        work(buffer, answers, counted.then_some(counts));
    })?;
    Ok((answers, counted.then_some(counts)))
}

/// Runs `work` on all parts, on `threads` threads, each with room for [`CHUNK`] rays.
fn share_out<P: Send>(
    parts: Vec<P>,
    threads: usize,
    work: impl Fn(&mut [Ray], P) + Sync,
) -> Result<()> {
    let threads = wanted(threads).min(parts.len()).max(1);
    let queue = Mutex::new(parts.into_iter());
    let worker = || {
        let mut buffer = vec![BLANK; CHUNK];
        loop {
            let next = queue
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner)
                .next();
            let Some(part) = next else {
                return;
            };
            work(&mut buffer, part);
        }
    };
    caught(|| {
        std::thread::scope(|scope| {
            for _ in 1..threads {
                // Where no more threads can start, those that did do all the work.
                if Builder::new().spawn_scoped(scope, worker).is_err() {
                    break;
                }
            }
            worker();
        });
        Ok(())
    })
}

/// How many threads are asked for; 0: as many as there are processors.
fn wanted(threads: usize) -> usize {
    if threads == 0 {
        std::thread::available_parallelism().map_or(1, NonZero::get)
    } else {
        threads
    }
}

/// Nearest hits.
pub fn closest(
    (tracer, cases): (&dyn Tracer, &'static [&'static str]),
    rays: Rays<'_>,
    threads: usize,
    counters: bool,
) -> Result<Hits> {
    let order = rays.order;
    if !counters
        && order == Order::None
        && let Some(bounds) = tracer.near_rays()
        && reorder::scattered(rays.origins, &bounds)
    {
        return Ok(Hits {
            hits: closest_reordered(tracer, rays, threads, &bounds)?,
            counts: None,
            on_boundary: None,
        });
    }
    let (hits, counts) = in_chunks(rays, threads, counters, Hit::MISS, |rays, hits, counts| {
        tracer.closest_ordered(rays, hits, counts, order);
    })?;
    Ok(Hits {
        hits,
        counts: counts.map(|counts| (cases, counts)),
        on_boundary: None,
    })
}

/// Nearest hits of rays in random order, which are walked in another: each thread puts its own share in order.
fn closest_reordered(
    tracer: &dyn Tracer,
    rays: Rays<'_>,
    threads: usize,
    bounds: &Aabb,
) -> Result<Vec<Hit>> {
    let n = rays.origins.len();
    let window = reorder::window(n, wanted(threads));
    let in_order = n.min(window * wanted(threads)) * reorder::BYTES;
    check_room("origins", (n * size_of::<Hit>() + in_order) as u64)?;
    let mut hits = vec![Hit::MISS; n];
    let windows = hits.chunks_mut(window).enumerate().collect();
    share_out(
        windows,
        threads,
        |buffer, (i, hits): (usize, &mut [Hit])| {
            let own = rays.part(i * window..i * window + hits.len());
            let places = reorder::order(own.origins, own.directions, bounds);
            let mut found = vec![Hit::MISS; CHUNK];
            for places in places.chunks(CHUNK) {
                let (buffer, found) = (&mut buffer[..places.len()], &mut found[..places.len()]);
                own.put_those(places, buffer);
                tracer.closest(buffer, found, None);
                for (&place, hit) in places.iter().zip(found) {
                    hits[place as usize] = *hit;
                }
            }
        },
    )?;
    Ok(hits)
}

/// Any hits.
pub fn occluded(
    tracer: &dyn Tracer,
    rays: Rays<'_>,
    threads: usize,
    counters: bool,
) -> Result<(Vec<bool>, Option<Vec<RayCounters>>)> {
    in_chunks(rays, threads, counters, false, |rays, answers, counts| {
        tracer.occluded(rays, answers, counts);
    })
}

/// Any hits, or a pair of them and what each ray cost.
pub fn occluded_answer<'py>(
    py: Python<'py>,
    occluded: &[bool],
    counts: Option<Vec<RayCounters>>,
    cases: &[&str],
) -> PyResult<Bound<'py, PyAny>> {
    let occluded = occluded.to_pyarray(py).into_any();
    match counts {
        None => Ok(occluded),
        Some(counts) => Ok((occluded, counters(py, cases, &counts)?)
            .into_pyobject(py)?
            .into_any()),
    }
}

/// The nearest triangle by exact integer arithmetic alone, O(n) per ray: for small inputs.
///
/// Arguments and errors as for build() and Structure.closest().
#[pyfunction]
#[pyo3(name = "exact_closest", signature = (vertices, triangles, origins, directions, t_min=None, t_max=None, *, threads=Threads::ALL), text_signature = "(vertices, triangles, origins, directions, t_min=None, t_max=None, *, threads=0)")]
#[expect(clippy::too_many_arguments, reason = "Python keywords")]
fn exact(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    origins: &Bound<'_, PyAny>,
    directions: &Bound<'_, PyAny>,
    t_min: Option<&Bound<'_, PyAny>>,
    t_max: Option<&Bound<'_, PyAny>>,
    threads: Threads,
) -> PyResult<Hits> {
    let vertices = arrays::points("vertices", vertices)?;
    let indices = arrays::indices("triangles", triangles, vertices.len())?;
    let arguments = RayArrays::new(origins, directions, t_min, t_max, "none")?;
    let rays = arguments.rays();
    let (hits, on_boundary) = py.detach(|| {
        let scene = Triangles::new(vertices, indices)?;
        let blank = (Hit::MISS, false);
        let (answers, _) = in_chunks(rays, threads.0, false, blank, |rays, answers, _| {
            for (ray, answer) in rays.iter().zip(answers) {
                let exact = exact_closest(&scene, ray);
                *answer = (exact.hit, exact.on_boundary);
            }
        })?;
        Ok::<_, Error>(answers.into_iter().unzip::<_, _, Vec<_>, Vec<_>>())
    })?;
    Ok(Hits {
        hits,
        counts: None,
        on_boundary: Some(on_boundary),
    })
}

/// How many floats lie between two of the same sign, counted through zero; NaN is far from all.
fn ulps(a: f32, b: f32) -> i64 {
    if a.is_nan() || b.is_nan() {
        return if a.is_nan() && b.is_nan() {
            0
        } else {
            i64::MAX
        };
    }
    let order = |x: f32| {
        let bits = i64::from(x.to_bits() & 0x7fff_ffff);
        if x.is_sign_negative() { -bits } else { bits }
    };
    (order(a) - order(b)).abs()
}

/// How many float32 steps lie between a and b, (n,) each, counted through zero.
///
/// Two NaN are 0 apart, NaN and a number 2**63 - 1. Raises ShapeError when the lengths differ.
#[pyfunction]
fn ulp_distance<'py>(
    py: Python<'py>,
    a: PyReadonlyArray1<'_, f32>,
    b: PyReadonlyArray1<'_, f32>,
) -> PyResult<Bound<'py, PyAny>> {
    let (a, b) = (a.as_array(), b.as_array());
    if a.len() != b.len() {
        return Err(
            Error::Shape(format!("b: expected {} numbers, got {}", a.len(), b.len())).into(),
        );
    }
    let distances: Vec<_> = a.iter().zip(&b).map(|(&a, &b)| ulps(a, b)).collect();
    Ok(distances.to_pyarray(py).into_any())
}

/// Adds hits and the oracle to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Hits>()?;
    module.add_function(wrap_pyfunction!(exact, module)?)?;
    module.add_function(wrap_pyfunction!(ulp_distance, module)?)
}
