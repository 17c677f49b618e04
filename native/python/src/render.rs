// SPDX-License-Identifier: GPL-3.0-or-later
//! Scenes to render, and renders in progress.

use crate::args::arrays::describe;
use crate::args::integers::{Milliseconds, Threads};
use crate::args::{camera_settings, points, scene as scene_args, shader, surface, volume};
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use crate::inspection;
use crate::instances::Instances;
use crate::structure::Structure;
use halfspace_base::error::{Error, Result};
use halfspace_ray::Ray;
use halfspace_render::film::Unsampled;
use halfspace_render::job::{Job, Moments};
use halfspace_render::scene::attributes::InstancedAttributes;
use halfspace_render::scene::{self, SceneParams, Shared, SharedTracer};
use halfspace_render::settings::Pass;
use halfspace_render::values::varying::Varying;
use numpy::{PyArray1, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::time::Duration;

/// A scene to render: a structure with materials, lights and background, without the camera.
///
/// Lengths and positions are in the structure's space, colours are linear RGB. Unknown keys raise an error, so that
/// misspelt ones are not ignored.
///
/// structure: a Structure or Instances; shared, not copied.
/// material_index: (m,) int32, the material of each of the structure's m triangles, including dropped ones;
///     None = the first for all.
/// materials: dictionaries, all keys optional, the defaults being Blender's Principled BSDF:
///     "name" (for messages), "base_color" (3,), "metallic" 0..1, "roughness" 0..1, "ior" > 0,
///     "transmission" 0..1, "specular" (0.5: the layer that "ior" gives, 0: no layer), "emission" (3,)
///     radiance on both sides, "alpha" (0 = invisible). An empty list is one default material.
///     What varies over a surface is given by "program" and "closures" instead. A program is a list
///     of steps, dictionaries with "op", "args" and the settings of the operation; an argument is
///     the index of an earlier step (an int) or a constant (a float, or three or four floats). A
///     closure has a "kind" (principled, diffuse, translucent, glossy, glass, refraction, transparent,
///     emission, conductor, sheen, velvet, toon_diffuse, toon_glossy, subsurface, hair, hair_reflection,
///     hair_transmission, holdout), inputs of the names above and "weight", "color", "specular_tint", "coat_weight",
///     "coat_roughness", "coat_ior", "coat_tint", "diffuse_roughness",
///     "anisotropy", "rotation" (turns), "tangent", "coat_normal" (scene space, 0 = the surface's), "sheen_weight",
///     "sheen_roughness", "sheen_tint", "smooth" (a toon lobe's edge), "extinction" (a conductor's, whose "color" is
///     the index), "film_thickness" (nm), "film_ior", "subsurface_weight", "subsurface_radius" (a colour),
///     "subsurface_scale", "subsurface_ior", "subsurface_anisotropy", "radial_roughness", "offset", "melanin",
///     "redness", "absorption" (those of hair), "translucency" (the share of principled's diffuse base that sends
///     light to the other side), each an argument as in a program, and "normal",
///     "multiscatter" (True), "distribution" (ggx, beckmann, ashikhmin_shirley), "method" (of subsurface scattering:
///     random_walk, random_walk_skin, random_walk_legacy). At most 8 closures, 4 of them principled.
///     "hidden_from" names the kinds of rays
///     that pass through its surfaces: camera, shadow, diffuse, glossy, transmission, volume (scattered in one).
///     "receives" and "blocks" have a bit for each set of linked lights that shine on it and that it shades (all);
///     "receivers" and "blockers", 0 to 31, are the sets that its own emission belongs to, as a light (0).
///     "hole" (False): camera rays see a hole in the picture, except where it is transparent. "catcher" (False): camera
///     rays see only what the other objects take from the light of its surfaces, as alpha or in a pass.
///     "opaque_shadow" (False): shadow rays do not pass it. "terminator" (0.1): cosine towards the light below which
///     shadow rays start on the curved surface that corner normals describe, 0 = never.
///     "strands": the number of a layer that is 1 on tubes around hairs, whose inside rays do not see if the material
///     has a closure of hair. "tube" (False): all its surfaces are such tubes, with the normals of their corners at right
///     angles to the hair; their sides are shaded as round hair.
///     "outputs" pairs of a number below 64 and an argument, the values of the passes "Output" and that number.
///     "volume" fills the objects whose surfaces have the material: {"closures", "program"}, closures
///     with "scattering", "absorption" and "emission", coefficients per scene unit, and "anisotropy"
///     (-1 to 1; Henyey and Greenstein's phase function), each an argument as in a program, 0 by
///     default; they add up, and what is constant is traversed in closed form. Path tracing only.
/// corner_normals: (m, 3, 3) float32, shading normals of each triangle's corners, any length;
///     None = flat.
/// surfaces: for Instances, in place of these two; None = the first material and flat: "meshes", a list of
///     {"material_index": (m,) int32 slots or None, "corner_normals": (m, 3, 3) float32 in the mesh's space or None};
///     "materials" (s,) int32, the materials of the slots, instance after instance; "first_material" (k + 1,) int32,
///     where each instance's slots begin; slots beyond its last use the last one; "normal_matrix" (k, 3, 3) float32,
///     the inverse transpose that transforms normals to the scene, row by row; "keeps_length" (k,) bool, whether it
///     preserves unit length.
/// lights: dictionaries with "kind" ("point", "sun", "spot", "area"), "to_world" (4, 4), "power"
///     (3,), and, as the kind needs, "radius", "angle", "spot_size", "spot_blend", "shape"
///     ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"), "size", "size_y", "spread" (π), "sphere" (False: points and
///     spots are discs that face the receiver); "casts_shadow" (True). "receivers" and "blockers", 0 to 31, are the
///     sets of objects that the light shines on and that shade it (0: all).
///     A light shines along its -Z. Angles are full angles in radians. Brightness is that of
///     Cycles: power P gives a point or spot light the radiant intensity P / 4π W/sr, an area
///     light the radiance P / (π area) on one side, a sun the irradiance P in W/m². Rays of all kinds except those
///     in "hidden_from" (default ("camera",)) see a light with a size, and it lights the lobes that scatter
///     such rays. Negative power darkens. Lights without power are left out.
///     "group" (0): the light group, from 1 to 64, 0 = none. "max_bounces" (no limit): largest number of times that a
///     path has scattered before its light samples see the light. With "program" and "radiance", an argument as in a
///     material, the power is multiplied by the result; "frame" is a list of one object, the light's own space.
/// world: {"color": (3,)}, radiance of the background; None = black. With "program" and "radiance",
///     an argument as in a material, the radiance of each direction. "hidden_from" and "volume", which must not
///     vary, as for materials. "group", "max_bounces" and "casts_shadow" as for lights.
/// images: dictionaries of "name", "pixels", (h, w, 1 to 4) uint8, uint16, float16 or float32, rows from the bottom,
///     and "srgb", whether colours are decoded after interpolation. An image without pixels is missing: pink. Arrays
///     that view a `bytes` object are not copied. With "tiles", such dictionaries with a "number" each (UDIM), the
///     image consists of these.
/// layers: (m, 3, 2 to 4) float32 arrays, attributes of the corners for programs, or None for a missing one. For
///     Instances, m counts the triangles of all meshes, mesh after mesh; the same holds for "uvs" of indices.
/// objects: dictionaries of "to_object", (3, 4), scene to object space, and "generated",
///     (2, 3), offset and then factor that map object space to 0..1 in the object's box, and "values",
///     rows of four floats that the steps "object_value" read by "column" (none). For Instances, one of each.
/// object_index: (m,) uint32, the object of each triangle; None = the first for all. Not for Instances.
/// origin: (3,), the world position of the scene's origin.
/// grids: dictionaries of "values", (x, y, z, 1 or 3) float32, voxels that the step "voxels" reads by their number
///     in this list, counted from 1, at a position in object space, and "to_index", (3, 4), object space to the
///     array's indices, where the voxels lie at whole numbers.
/// indices: object and material indices for the passes of that name; None = all 0. "first" (n,) int32,
///     the first triangle of each run of triangles of one object, ascending from 0; "object" (n,) float32, the
///     index of each run's object; "material" float32, the index of each material; "uvs" (m, 3, 2) float32, NaN
///     for triangles without, or None, for the UV pass.
///     For mattes "identities" (n, 2) uint32, of each run's object and of that with its children, and
///     "material_identities" (s,) uint32, not 0 (None: no surfaces in the mattes).
///     "groups" (n,) uint8, the light group of each run's object, counted from 1 (None: none).
///     "motion", two (m, 3, 3) float32, the corners of all triangles in the picture before this one and in the one
///     after, for the pass "Vector" (None: they stay). For Instances, two tuples: the corners of the meshes' triangles
///     there, each in its mesh's space; (k,) int64, for each instance the difference from the index of its triangle here
///     to that there; (k, 3, 4) float64, the transforms to the scene there.
/// like: the same scene at another time (None: there is none). Materials, images, layers, the "meshes" of surfaces, world
///     and indices that are not given are those of it, without a copy.
///
/// Raises ShapeError (array of the wrong shape or type, index out of range), NonFiniteError,
/// SpecError (a number out of range, a missing or unknown key); each names the key and its index.
/// Releases the GIL while it compiles the scene.
#[pyclass(frozen, module = "halfspace_native")]
pub struct RenderScene(Arc<scene::RenderScene>);

#[pymethods]
impl RenderScene {
    #[new]
    #[pyo3(signature = (structure, *, material_index=None, materials=None, corner_normals=None, surfaces=None, lights=None, world=None, indices=None, images=None, layers=None, objects=None, object_index=None, origin=None, grids=None, like=None))]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn new(
        py: Python<'_>,
        structure: &Bound<'_, PyAny>,
        material_index: Option<&Bound<'_, PyAny>>,
        materials: Option<&Bound<'_, PyAny>>,
        corner_normals: Option<&Bound<'_, PyAny>>,
        surfaces: Option<&Bound<'_, PyDict>>,
        lights: Option<&Bound<'_, PyAny>>,
        world: Option<&Bound<'_, PyDict>>,
        indices: Option<&Bound<'_, PyDict>>,
        images: Option<&Bound<'_, PyAny>>,
        layers: Option<&Bound<'_, PyAny>>,
        objects: Option<&Bound<'_, PyAny>>,
        object_index: Option<&Bound<'_, PyAny>>,
        origin: Option<[f64; 3]>,
        grids: Option<&Bound<'_, PyAny>>,
        like: Option<&Bound<'_, Self>>,
    ) -> PyResult<Self> {
        let _mode = DefaultMode::set(py)?;
        // Rays are traced through a single structure or through instances.
        let (tracer, instanced): (SharedTracer, _) = match structure.cast::<Instances>() {
            Err(_) => {
                let structure = structure
                    .cast::<Structure>()
                    .map_err(|_| {
                        let got = describe(structure);
                        Error::Spec(format!(
                            "structure: expected a Structure or Instances, got {got}"
                        ))
                    })
                    .map_err(raise)?;
                (Arc::clone(&structure.get().0) as SharedTracer, None)
            }
            Ok(instances) => {
                let instances = &instances.get().0;
                let (meshes, each) = surface::surfaces(surfaces, instances).map_err(raise)?;
                (
                    Arc::clone(instances) as SharedTracer,
                    Some(InstancedAttributes {
                        instances: Arc::clone(instances),
                        meshes,
                        each,
                    }),
                )
            }
        };
        let like = like.map(|scene| Arc::clone(&scene.get().0));
        let shared = Shared {
            materials: materials.is_none(),
            images: images.is_none(),
            layers: layers.is_none(),
            meshes: (surfaces.map(|dict| dict.contains("meshes")).transpose()?) == Some(false),
            world: world.is_none(),
            indices: indices.is_none(),
        };
        // Convert all parts before the scene is compiled without the GIL.
        let varying = Varying {
            grids: volume::grids(grids).map_err(raise)?,
            ..shader::varying(layers, objects, object_index, origin).map_err(raise)?
        };
        let params = SceneParams {
            instanced,
            material_index: material_index
                .map(surface::material_index)
                .transpose()
                .map_err(raise)?,
            materials: scene_args::materials(materials).map_err(raise)?,
            corner_normals: corner_normals
                .map(surface::corner_normals)
                .transpose()
                .map_err(raise)?,
            images: shader::images(images).map_err(raise)?,
            varying,
            lights: scene_args::lights(lights).map_err(raise)?,
            world: scene_args::world(world).map_err(raise)?,
            indices: surface::indices(indices).map_err(raise)?,
        };
        let scene = py
            .detach(|| match &like {
                None => scene::RenderScene::new(tracer, params),
                Some(like) => like.later(shared, tracer, params),
            })
            .map_err(raise)?;
        Ok(Self(Arc::new(scene)))
    }

    /// Features that this scene does not need and its paths do not compute, each with its reason, such as "shadow
    /// rays: no lights".
    #[getter]
    fn left_out(&self) -> Vec<String> {
        self.0.features().left_out()
    }
}

/// A render on its own threads, or its result.
///
/// Deleting it cancels the render and waits for its threads. All methods may be called from any
/// Python thread.
#[pyclass(frozen, module = "halfspace_native")]
pub struct RenderJob(Job);

#[pymethods]
impl RenderJob {
    /// Waits until the render has ended, at most the given time; True if it has ended: done, failed or cancelled.
    /// Releases the GIL. SpecError for a negative time.
    fn wait(&self, py: Python<'_>, milliseconds: Milliseconds) -> bool {
        py.detach(|| self.0.wait(Duration::from_millis(milliseconds.0)))
    }

    /// Requests the render to stop, which takes at most 0.1 s, and returns at once. The samples so far stay
    /// readable.
    fn cancel(&self) {
        self.0.cancel();
    }

    /// Fraction of all pixel samples that are done, 0..1.
    #[getter]
    fn progress(&self) -> f64 {
        self.0.progress()
    }

    /// Whether the render has ended: done, failed or cancelled.
    #[getter]
    fn finished(&self) -> bool {
        self.0.is_finished()
    }

    /// Whether the render was cancelled before it was done. False until it has stopped.
    #[getter]
    fn cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    /// Number of samples that every pixel has, or no longer needs.
    #[getter]
    fn samples_done(&self) -> u32 {
        self.0.samples_done()
    }

    /// The error that ended the render, or None.
    #[getter]
    fn error(&self) -> Option<String> {
        self.0.error()
    }

    /// The passes that are filled, with their number of channels.
    #[getter]
    fn passes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for pass in self.0.passes() {
            dict.set_item(pass.name(), pass.channels())?;
        }
        Ok(dict)
    }

    /// Statistics of the render so far.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        // Traversal work is None unless a pass counts it.
        let statistics = self.0.statistics();
        let work = statistics.work;
        let counted = |n: u64| self.0.counts().then_some(n);
        #[expect(clippy::cast_precision_loss, reason = "a rate")]
        let rate = work.rays() as f64 / 1e6 / statistics.seconds.max(1e-9);
        let dict = PyDict::new(py);
        dict.set_item("seconds", statistics.seconds)?;
        dict.set_item("rays_primary", work.rays_primary)?;
        dict.set_item("rays_shadow", work.rays_shadow)?;
        dict.set_item("rays_secondary", work.rays_secondary)?;
        dict.set_item("rays_programs", work.rays_programs)?;
        dict.set_item("beams", work.beams)?;
        dict.set_item("rays_beams", work.rays_beams)?;
        dict.set_item("beam_deviation", work.beam_deviation)?;
        dict.set_item("mrays_s", rate)?;
        dict.set_item("steps", counted(work.steps))?;
        dict.set_item("tests", counted(work.tests))?;
        Ok(dict)
    }

    /// The rays recorded so far, by kind: "camera", "shadow 0", "diffuse 1", ..., with the number of times that their
    /// path has scattered (8: at least 8 times), "nearest" for shadow rays that may pass surfaces, and "continued"
    /// behind such a surface. Empty without the setting "record_rays".
    ///
    /// Each kind is a dictionary of "origins" and "directions", (n, 3) float32 in the structure's space, "t_min" and
    /// "t_max", (n,) float32, "any", whether any hit answers the rays, and "traced", the number of rays of the kind,
    /// of which these n are a uniform choice in random order. Once the render has ended, it is the same for all
    /// structures and numbers of threads. Rays of the node programs and of media around the camera are not recorded.
    fn recorded<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let kinds = PyDict::new(py);
        for kind in py.detach(|| self.0.recorded()) {
            let dict = PyDict::new(py);
            let vectors =
                |of: fn(&Ray) -> [f32; 3]| -> Vec<_> { kind.rays.iter().map(of).collect() };
            let numbers = |of: fn(&Ray) -> f32| -> Vec<_> { kind.rays.iter().map(of).collect() };
            dict.set_item("origins", inspection::points(py, &vectors(|ray| ray.o))?)?;
            dict.set_item("directions", inspection::points(py, &vectors(|ray| ray.d))?)?;
            dict.set_item("t_min", numbers(|ray| ray.t_min).to_pyarray(py))?;
            dict.set_item("t_max", numbers(|ray| ray.t_max).to_pyarray(py))?;
            dict.set_item("any", kind.any)?;
            dict.set_item("traced", kind.traced)?;
            kinds.set_item(kind.name, dict)?;
        }
        Ok(kinds)
    }

    /// Writes the current state of a pass: rows from the bottom up, channels innermost.
    ///
    /// out: float32, one-dimensional, C-contiguous, width * height * channels elements, where
    ///     width and height are those of the border.
    /// keep: whether pixels without a sample yet keep their values in `out`; otherwise they become zero.
    /// "Combined" is the mean so far, premultiplied RGBA, scene linear. "Depth" (along the view axis, 1e10 =
    /// nothing hit), "Position", "Object Index" and "Material Index" are those of the first sample, because a mean
    /// across an edge belongs to no surface; "Normal" and "UV" (with 1 as third channel) are means, not
    /// renormalised. "Mist" is a mean, 1 where nothing is hit, "Denoising Albedo" the mean albedo of the first
    /// surface. "Traversal Steps", "Triangle Tests" and "Leaf Depth" (of the last leaf tested) are means per camera
    /// ray. "Sample Count" is the number of samples of each pixel. Light passes are those of Cycles: the direct
    /// and indirect light of diffuse, glossy and transmitting lobes divided by their colours, which multiplied by them
    /// add up to Combined with the direct and indirect light of volumes, emission and environment; light of shadow
    /// catchers is in none of them. "CryptoObject00" to "CryptoAsset07" are two identities with their shares each,
    /// "Output 0" to "Output 63" means of what the materials of the first surfaces output, with 1 as fourth channel.
    /// "Vector" is the motion of the first surface in pixels, to the picture before and from the one after.
    /// "Shadow Catcher" is the light of shadow catchers among all objects divided by that among catchers alone; without
    /// it, Combined holds the shadow. "Roughness" is a mean, as the nodes of the first surfaces give it.
    /// "Light Group 0" to "Light Group 63" are the parts of Combined that come from the emitters of each group.
    ///
    /// Raises SpecError (a pass that is unknown or not filled), ShapeError (type, size, contiguity or a read-only
    /// array). Releases the GIL.
    #[pyo3(signature = (name, out, *, keep = false))]
    fn copy_into(
        &self,
        py: Python<'_>,
        name: &str,
        out: &Bound<'_, PyAny>,
        keep: bool,
    ) -> PyResult<()> {
        let _mode = DefaultMode::set(py)?;
        let pass = pass(name).map_err(raise)?;
        let unsampled = if keep {
            Unsampled::Kept
        } else {
            Unsampled::Zero
        };
        let wrong = |what: &str| {
            Error::Shape(format!(
                "out: expected a {what} float32 array, got {}",
                describe(out)
            ))
        };
        let array = out
            .cast::<PyArray1<f32>>()
            .map_err(|_| wrong("one-dimensional"))
            .map_err(raise)?;
        let mut array = array
            .try_readwrite()
            .map_err(|_| wrong("writable"))
            .map_err(raise)?;
        let slice = array
            .as_slice_mut()
            .map_err(|_| wrong("C-contiguous"))
            .map_err(raise)?;
        // No thread holds a lock of the film while it waits for the interpreter, so releasing the GIL cannot
        // deadlock.
        py.detach(|| self.0.copy_into(pass, unsampled, slice))
            .map_err(raise)?;
        Ok(())
    }
}

/// Parses the name of a pass; the message names the argument of copy_into().
fn pass(name: &str) -> Result<Pass> {
    Pass::named(name).map_err(|error| {
        let text = error.to_string();
        Error::Spec(text.replacen("settings['passes']", "name", 1))
    })
}

/// A scene, or the same one at several times.
#[derive(FromPyObject)]
enum Moving<'py> {
    Still(Bound<'py, RenderScene>),
    Times(Vec<Bound<'py, RenderScene>>),
}

/// Starts a render and returns at once.
///
/// scene: a RenderScene, or a sequence of the same scene in the middles of equal parts of the time in which the shutter
///     is open; the samples take them in turn.
/// camera: "kind" ("perspective", "orthographic"), "to_world" (4, 4) (the camera looks along its
///     -Z, +Y is up; scale is ignored), "window" (left, right, bottom, top) of the full frame at
///     distance 1 (perspective) or in scene units (orthographic), "clip_start" and "clip_end" as
///     depths along -Z. Depth of field: "aperture_radius" (0: none) in scene units, "aperture_blades" (0: round),
///     "aperture_rotation" in radians, "aperture_ratio" (1: as high as wide), "focus_distance" along -Z.
///     Panoramic kinds have the window (0, 1, 0, 1), focus and clip by distance, and need more keys, angles in
///     radians: "equirectangular" (2,) "longitude" and "latitude"; "equidistant" "fov"; "equisolid" "fov", "focal"
///     length and (2,) "sensor" in its unit; "polynomial" "fov", "sensor" and (5,) "polynomial";
///     "central_cylindrical" (2,) "longitude" and (2,) "height" on a cylinder of radius 1; "mirror_ball" and
///     "cube_face" none. "motion": a pair of cameras, of the picture before this one and of the one after, for the
///     pass "Vector" (None: the camera stays). "poses": transforms (4, 4) at equal intervals from the opening of the
///     shutter to its end, between which rays are interpolated; fewer than two: none.
///     "rolling_shutter": share of the opening, 0 to 1, for which a row is exposed, from the top row to the bottom one
///     (None: all rows together); "shutter_curve": the times, 0 to 1, at which equal shares of a row's light have passed
///     (none: they are even). With it "poses" and the scenes of several times are at equal intervals of time.
/// settings: "width" and "height" of the full frame in pixels; "border" (x0, y0, x1, y1) in pixels
///     from the lower left, half open, or None; "samples" per pixel: cost in proportion;
///     "integrator" ("path", "whitted": direct light, mirrors and clear glass, or "ao": openness within
///     "ambient_distance" (inf));
///     "max_bounces" (4): 0 = direct light only, as in Cycles;
///     "diffuse_bounces", "glossy_bounces", "transmission_bounces" (1024): the same by kind;
///     "volume_bounces" (0): the same for scattering in
///     volumes; "transparent_bounces" (8): transparent surfaces that a path passes before one is black, as in Cycles;
///     "clamp_indirect" (0): upper limit of what a sample
///     adds after its first bounce, as the mean of its channels, 0 = no limit; "clamp_direct" (0): the same limit
///     for what it adds up to and with its first bounce; "filter_glossy" (0: off): blurs lobes met after an
///     improbable bounce; "caustics_reflective" and "caustics_refractive" (True): whether reflecting and refracting
///     lobes are kept after a diffuse bounce; all three as in Cycles, and biased; "secondary_beams" (False), for
///     whitted: rays that flat polygons mirror or refract go as beams from the polygon's virtual eye, with
///     refraction approximate (Heckbert and Hanrahan 1984); "seed" (0);
///     "film_transparent" (False), also behind glass of a roughness up to "transparent_glass" (-1: none);
///     "passes" (["Combined"]), names as in RenderJob.passes; "step_samples" (None):
///     samples (at most 64) between two updates of a tile, None = 1, 3, 4, then 8; "filter"
///     ("blackman_harris", or "box") and "filter_width" (1.5), as in Cycles. "exposure" (1): factor on the colours
///     of Combined. "noise_threshold" (0: off): blocks of
///     8 x 8 pixels with less noise get no more samples, after "min_samples" (0: derived from the threshold), which is
///     biased. "time_limit" (0: none): seconds after which no samples begin, once each pixel has one. "mist":
///     {"start" (5), "depth" (25), "falloff" ("QUADRATIC", "LINEAR", "INVERSE_QUADRATIC")} of the pass. "record_rays"
///     (0): largest number of rays of each kind for RenderJob.recorded(), at most 65536; costs time.
/// threads: 0 = one per core.
/// points: the points of surfaces that the pixels show in place of what the camera sees, to bake pictures, row by row
///     from the bottom; for scenes without instances: "triangle" (n,) uint32, 2^32 - 1 = none, "place" (n, 6) float32,
///     the barycentric weights of the second and third corner at the pixel's centre, then their changes from pixel to
///     pixel to the right, and upwards. "seen" from "above" (default: along the shading normal), or from the "camera";
///     with "background", the background in the direction of the points from the world's origin at "origin" (3,).
///
/// The image depends only on scene, camera and settings, bit for bit: not on the structure, the number of threads
/// or step_samples; and a border shows the same pixels as the full frame. With a noise threshold a border may stop
/// other blocks; with a time limit the image depends on the machine.
///
/// Raises SpecError, ShapeError or NonFiniteError naming the key. An error during the render does not raise: see
/// RenderJob.error.
#[pyfunction]
#[pyo3(signature = (scene, camera, settings, *, threads=Threads::ALL, points=None), text_signature = "(scene, camera, settings, *, threads=0, points=None)")]
fn render(
    py: Python<'_>,
    scene: Moving<'_>,
    camera: &Bound<'_, PyDict>,
    settings: &Bound<'_, PyDict>,
    threads: Threads,
    points: Option<&Bound<'_, PyDict>>,
) -> PyResult<RenderJob> {
    let _mode = DefaultMode::set(py)?;
    let (camera, settings) = (
        camera_settings::camera(camera).map_err(raise)?,
        camera_settings::settings(settings).map_err(raise)?,
    );
    let points = points.map(points::points).transpose().map_err(raise)?;
    let scenes = Moments(match scene {
        Moving::Still(scene) => vec![Arc::clone(&scene.get().0)],
        Moving::Times(scenes) => scenes.iter().map(|s| Arc::clone(&s.get().0)).collect(),
    });
    let job = py
        .detach(|| Job::start_at(scenes, &camera, settings, threads.0, points))
        .map_err(raise)?;
    Ok(RenderJob(job))
}

/// Adds rendering to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<RenderScene>()?;
    module.add_class::<RenderJob>()?;
    module.add_function(wrap_pyfunction!(render, module)?)
}
