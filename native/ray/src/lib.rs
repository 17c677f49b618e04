// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays: their frames, hits, counters and recordings.

pub mod beam_path;
pub mod cases;
pub mod columns;
pub mod counters;
pub mod frame;
pub mod frame_ray;
pub mod interval;
pub mod path;
pub mod query;
pub mod ray;
pub mod ray_ref;
pub mod rays;
pub mod replay;
pub mod selection;
pub mod to_frame;

pub use frame_ray::FrameRay;
pub use interval::Interval;
pub use ray::{Hit, HitKey, Order, Ray, RayCounters, SelectiveTracer, Tracer};
pub use ray_ref::{BoundedRay, FramedScene, RayRef, RaySlice};
pub use rays::Rays;
