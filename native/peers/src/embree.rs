// SPDX-License-Identifier: GPL-3.0-or-later
//! Embree 4 by its C interface: packets of eight rays, which embreex does not offer.

#![expect(unsafe_code, reason = "a C interface")]

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::sync::OnceLock;

use libloading::Library;

use crate::{Hit, MISS, Mesh, NONE, Ray, Tracer};

/// Rays of a packet.
const WIDTH: usize = 8;

/// Lanes of a column.
type Column<T> = [T; WIDTH];

/// `RTCRayHit8` of `rtcore_ray.h`, version 4.
#[repr(C, align(32))]
#[derive(Clone, Copy)]
struct RayHit8 {
    origin: [Column<f32>; 3],
    t_near: Column<f32>,
    direction: [Column<f32>; 3],
    time: Column<f32>,
    t_far: Column<f32>,
    mask: Column<c_uint>,
    id: Column<c_uint>,
    flags: Column<c_uint>,
    normal: [Column<f32>; 3],
    u: Column<f32>,
    v: Column<f32>,
    triangle: Column<c_uint>,
    geometry: Column<c_uint>,
    instance: Column<c_uint>,
    /// With instance arrays only.
    instance_primitive: Column<c_uint>,
}

/// The values of the header's enumerations that are used here.
mod values {
    pub const TRIANGLES: i32 = 0;
    pub const INDICES: i32 = 0;
    pub const VERTICES: i32 = 1;
    pub const UINT3: i32 = 0x5003;
    pub const FLOAT3: i32 = 0x9003;
    pub const ROBUST: i32 = 4;
    pub const HIGH: i32 = 2;
}

type Handle = *mut c_void;

/// The functions of the library.
struct Functions {
    device: unsafe extern "C" fn(*const c_char) -> Handle,
    error: unsafe extern "C" fn(Handle) -> c_int,
    scene: unsafe extern "C" fn(Handle) -> Handle,
    set_quality: unsafe extern "C" fn(Handle, c_int),
    set_flags: unsafe extern "C" fn(Handle, c_int),
    geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    buffer: unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void,
    commit_geometry: unsafe extern "C" fn(Handle),
    attach: unsafe extern "C" fn(Handle, Handle) -> c_uint,
    commit: unsafe extern "C" fn(Handle),
    release_geometry: unsafe extern "C" fn(Handle),
    release_scene: unsafe extern "C" fn(Handle),
    release_device: unsafe extern "C" fn(Handle),
    intersect: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit8, *mut c_void),
    occluded: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit8, *mut c_void),
    _library: Library,
}

static FUNCTIONS: OnceLock<Functions> = OnceLock::new();

/// Opens the library at `path`, once.
///
/// # Errors
///
/// It cannot be opened, or a function of version 4 is missing: the loader's words.
pub fn open(path: &str) -> Result<(), String> {
    if FUNCTIONS.get().is_some() {
        return Ok(());
    }
    let load = || -> Result<Functions, libloading::Error> {
        // SAFETY: Embree's library runs no code of ours when it is loaded; signatures are those of its header.
        unsafe {
            let library = Library::new(path)?;
            Ok(Functions {
                device: *library.get(b"rtcNewDevice")?,
                error: *library.get(b"rtcGetDeviceError")?,
                scene: *library.get(b"rtcNewScene")?,
                set_quality: *library.get(b"rtcSetSceneBuildQuality")?,
                set_flags: *library.get(b"rtcSetSceneFlags")?,
                geometry: *library.get(b"rtcNewGeometry")?,
                buffer: *library.get(b"rtcSetNewGeometryBuffer")?,
                commit_geometry: *library.get(b"rtcCommitGeometry")?,
                attach: *library.get(b"rtcAttachGeometry")?,
                commit: *library.get(b"rtcCommitScene")?,
                release_geometry: *library.get(b"rtcReleaseGeometry")?,
                release_scene: *library.get(b"rtcReleaseScene")?,
                release_device: *library.get(b"rtcReleaseDevice")?,
                intersect: *library.get(b"rtcIntersect8")?,
                occluded: *library.get(b"rtcOccluded8")?,
                _library: library,
            })
        }
    };
    let functions = load().map_err(|error| error.to_string())?;
    FUNCTIONS.get_or_init(|| functions);
    Ok(())
}

/// A committed scene. `HIGH`: built with spatial splits and without the robust mode; otherwise robust and as usual.
pub struct Packets<const HIGH: bool> {
    device: Handle,
    scene: Handle,
}

// SAFETY: a committed scene is only read, which Embree allows from any number of threads.
unsafe impl<const HIGH: bool> Send for Packets<HIGH> {}
// SAFETY: the same.
unsafe impl<const HIGH: bool> Sync for Packets<HIGH> {}

impl<const HIGH: bool> Drop for Packets<HIGH> {
    fn drop(&mut self) {
        if let Some(call) = FUNCTIONS.get() {
            // SAFETY: both handles are valid, and no other value refers to them.
            unsafe {
                (call.release_scene)(self.scene);
                (call.release_device)(self.device);
            }
        }
    }
}

/// Packets and the number of rays.
pub struct Batch {
    packets: Vec<RayHit8>,
    count: usize,
}

/// A mask of lanes, aligned as Embree reads it.
#[repr(C, align(32))]
struct Lanes(Column<c_int>);

/// The lanes of packet `number` that hold rays.
fn valid(count: usize, number: usize) -> Lanes {
    Lanes(std::array::from_fn(|lane| {
        if number * WIDTH + lane < count { -1 } else { 0 }
    }))
}

impl<const HIGH: bool> Tracer for Packets<HIGH> {
    type Rays = Batch;

    fn build(mesh: Mesh) -> Result<Self, String> {
        let call = FUNCTIONS
            .get()
            .ok_or("the library of Embree has not been named")?;
        // SAFETY: the calls follow the library's manual; both buffers have the sizes that were asked for.
        unsafe {
            let device = (call.device)(c"threads=1".as_ptr());
            if device.is_null() {
                return Err("Embree makes no device".to_owned());
            }
            let made = Self {
                device,
                scene: (call.scene)(device),
            };
            if HIGH {
                (call.set_quality)(made.scene, values::HIGH);
            } else {
                (call.set_flags)(made.scene, values::ROBUST);
            }
            let geometry = (call.geometry)(device, values::TRIANGLES);
            let fill = |kind, form, bytes: &[u8], count: usize| {
                let buffer =
                    (call.buffer)(geometry, kind, 0, form, bytes.len() / count.max(1), count);
                if !buffer.is_null() {
                    std::ptr::copy_nonoverlapping(bytes.as_ptr(), buffer.cast(), bytes.len());
                }
            };
            let vertices: Vec<u8> = mesh
                .vertices
                .iter()
                .flatten()
                .flat_map(|x| x.to_ne_bytes())
                .collect();
            let indices: Vec<u8> = mesh
                .triangles
                .iter()
                .flatten()
                .flat_map(|x| x.to_ne_bytes())
                .collect();
            fill(
                values::VERTICES,
                values::FLOAT3,
                &vertices,
                mesh.vertices.len(),
            );
            fill(
                values::INDICES,
                values::UINT3,
                &indices,
                mesh.triangles.len(),
            );
            (call.commit_geometry)(geometry);
            (call.attach)(made.scene, geometry);
            (call.release_geometry)(geometry);
            (call.commit)(made.scene);
            // Ask one packet: a library without packets answers with an error, and no hits.
            made.closest(&Self::rays(&[Ray {
                origin: [0.0; 3],
                direction: [0.0, 0.0, 1.0],
                t_max: 1.0,
            }]));
            match (call.error)(device) {
                0 => Ok(made),
                code => Err(format!("Embree reports its error {code}")),
            }
        }
    }

    fn rays(rays: &[Ray]) -> Batch {
        let packet = |some: &[Ray]| {
            let ray = |lane: usize| some[lane.min(some.len() - 1)];
            let column = |of: &dyn Fn(Ray) -> f32| std::array::from_fn(|lane| of(ray(lane)));
            let axes =
                |of: fn(Ray) -> [f32; 3]| std::array::from_fn(|axis| column(&|ray| of(ray)[axis]));
            let (none, zero) = ([NONE; WIDTH], [0.0; WIDTH]);
            RayHit8 {
                origin: axes(|ray| ray.origin),
                t_near: zero,
                direction: axes(|ray| ray.direction),
                time: zero,
                t_far: column(&|ray| ray.t_max),
                mask: none,
                id: [0; WIDTH],
                flags: [0; WIDTH],
                normal: [zero; 3],
                u: zero,
                v: zero,
                triangle: none,
                geometry: none,
                instance: none,
                instance_primitive: none,
            }
        };
        Batch {
            packets: rays.chunks(WIDTH).map(packet).collect(),
            count: rays.len(),
        }
    }

    fn closest(&self, rays: &Batch) -> Vec<Hit> {
        let Some(call) = FUNCTIONS.get() else {
            return Vec::new();
        };
        let mut hits = Vec::with_capacity(rays.packets.len() * WIDTH);
        for (number, packet) in rays.packets.iter().enumerate() {
            let mut packet = *packet;
            // SAFETY: the scene is committed; packet and mask have the layout and the alignment of the header.
            unsafe {
                (call.intersect)(
                    valid(rays.count, number).0.as_ptr(),
                    self.scene,
                    &mut packet,
                    std::ptr::null_mut(),
                );
            }
            hits.extend((0..WIDTH).map(|lane| match packet.triangle[lane] {
                NONE => MISS,
                triangle => Hit {
                    t: packet.t_far[lane],
                    triangle,
                    u: packet.u[lane],
                    v: packet.v[lane],
                },
            }));
        }
        hits.truncate(rays.count);
        hits
    }

    fn occluded(&self, rays: &Batch) -> Vec<bool> {
        let Some(call) = FUNCTIONS.get() else {
            return Vec::new();
        };
        let mut found = Vec::with_capacity(rays.packets.len() * WIDTH);
        for (number, packet) in rays.packets.iter().enumerate() {
            let mut packet = *packet;
            // SAFETY: as above; the query only reads and writes the part before the hit.
            unsafe {
                (call.occluded)(
                    valid(rays.count, number).0.as_ptr(),
                    self.scene,
                    &mut packet,
                    std::ptr::null_mut(),
                );
            }
            // A ray that is blocked ends at minus infinity.
            found.extend(packet.t_far.map(|end| end == f32::NEG_INFINITY));
        }
        found.truncate(rays.count);
        found
    }
}
