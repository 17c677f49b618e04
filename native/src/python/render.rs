// SPDX-License-Identifier: GPL-3.0-or-later
//! Scenes to render and renders in progress.

use super::arrays::{Threads, describe};
use super::instances::Instances;
use super::render_args as args;
use super::shader_args;
use super::structure::Structure;
use crate::error::{Error, Result};
use crate::render::job::Job;
use crate::render::scene::{self, SceneParams, SharedTracer};
use crate::render::settings::Pass;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::time::Duration;

/// A structure with materials, lights and world.
#[pyclass(frozen)]
pub struct RenderScene(Arc<scene::RenderScene>);

#[pymethods]
impl RenderScene {
    #[new]
    #[pyo3(signature = (structure, *, material_index=None, materials=None, corner_normals=None, surfaces=None, lights=None, world=None, indices=None, images=None, layers=None, objects=None, object_index=None, origin=None))]
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
    ) -> PyResult<Self> {
        let (tracer, placed): (SharedTracer, _) = match structure.cast::<Instances>() {
            Err(_) => {
                let structure = structure.cast::<Structure>().map_err(|_| {
                    let got = describe(structure);
                    Error::Spec(format!(
                        "structure: expected a Structure or Instances, got {got}"
                    ))
                })?;
                (Arc::clone(&structure.get().0) as SharedTracer, None)
            }
            Ok(instances) => {
                let instances = &instances.get().0;
                let (meshes, each) = args::surfaces(surfaces, instances)?;
                (
                    Arc::clone(instances) as SharedTracer,
                    Some((Arc::clone(instances), meshes, each)),
                )
            }
        };
        let params = SceneParams {
            placed,
            material_index: material_index.map(args::material_index).transpose()?,
            materials: args::materials(materials)?,
            corner_normals: corner_normals.map(args::corner_normals).transpose()?,
            images: shader_args::images(images)?,
            varying: shader_args::varying(layers, objects, object_index, origin)?,
            lights: args::lights(lights)?,
            world: args::world(world)?,
            indices: args::indices(indices)?,
        };
        let scene = py.detach(|| scene::RenderScene::new(tracer, params))?;
        Ok(Self(Arc::new(scene)))
    }

    #[getter]
    fn left_out(&self) -> Vec<String> {
        self.0.features().left_out()
    }
}

/// A render in progress, or its result.
#[pyclass(frozen)]
pub struct RenderJob(Job);

#[pymethods]
impl RenderJob {
    fn wait(&self, py: Python<'_>, milliseconds: i64) -> PyResult<bool> {
        let time = u64::try_from(milliseconds).map_err(|_| {
            Error::Spec(format!(
                "milliseconds must be at least 0, got {milliseconds}"
            ))
        })?;
        Ok(py.detach(|| self.0.wait(Duration::from_millis(time))))
    }

    fn cancel(&self) {
        self.0.cancel();
    }

    #[getter]
    fn progress(&self) -> f64 {
        self.0.progress()
    }

    #[getter]
    fn finished(&self) -> bool {
        self.0.is_finished()
    }

    #[getter]
    fn cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    #[getter]
    fn samples_done(&self) -> u32 {
        self.0.samples_done()
    }

    #[getter]
    fn error(&self) -> Option<String> {
        self.0.error()
    }

    #[getter]
    fn passes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for pass in self.0.passes() {
            dict.set_item(pass.name(), pass.channels())?;
        }
        Ok(dict)
    }

    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
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
        dict.set_item("mrays_s", rate)?;
        dict.set_item("steps", counted(work.steps))?;
        dict.set_item("tests", counted(work.tests))?;
        Ok(dict)
    }

    fn copy_into(&self, py: Python<'_>, name: &str, out: &Bound<'_, PyAny>) -> PyResult<()> {
        let pass = pass(name)?;
        let wrong = |what: &str| {
            Error::Shape(format!(
                "out: expected a {what} float32 array, got {}",
                describe(out)
            ))
        };
        let array = out
            .cast::<PyArray1<f32>>()
            .map_err(|_| wrong("one-dimensional"))?;
        let mut array = array.try_readwrite().map_err(|_| wrong("writable"))?;
        let slice = array.as_slice_mut().map_err(|_| wrong("C-contiguous"))?;
        // The film's locks are never held by anyone who waits for the interpreter.
        py.detach(|| self.0.copy_into(pass, slice))?;
        Ok(())
    }
}

fn pass(name: &str) -> Result<Pass> {
    Pass::named(name).map_err(|error| {
        let text = error.to_string();
        Error::Spec(text.replacen("settings['passes']", "name", 1))
    })
}

#[pyfunction]
#[pyo3(signature = (scene, camera, settings, *, threads=Threads::ALL))]
fn render(
    py: Python<'_>,
    scene: &RenderScene,
    camera: &Bound<'_, PyDict>,
    settings: &Bound<'_, PyDict>,
    threads: Threads,
) -> PyResult<RenderJob> {
    let (camera, settings) = (args::camera(camera)?, args::settings(settings)?);
    let scene = Arc::clone(&scene.0);
    let job = py.detach(|| Job::start(scene, &camera, settings, threads.0))?;
    Ok(RenderJob(job))
}

/// Adds rendering to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<RenderScene>()?;
    module.add_class::<RenderJob>()?;
    module.add_function(wrap_pyfunction!(render, module)?)
}
