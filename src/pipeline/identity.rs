//! What a rendering is of, so that an unfinished one is not taken for another.

use xxhash_rust::xxh3::xxh3_64;

use super::Settings;
use crate::error::Result;
use crate::render::RenderParams;
use crate::render::checkpoint::Identity;
use crate::scene::{Camera, Scene};

/// Names and values of all that the pixels of an image depend on: program, scene, cameras, settings (before automatic choices, which
/// follow from the rest) and parameters. `cameras` are those that the scene is prepared for. Not among them: threads and the time
/// limit.
///
/// # Errors
/// When the ray-tracing library cannot be used.
pub fn identity(
    scene: &Scene,
    cameras: &[Camera],
    camera: &Camera,
    settings: &Settings,
    params: &RenderParams,
) -> Result<Identity> {
    let digest = scene.digest();
    let RenderParams {
        width,
        height,
        region,
        min_trials,
        max_trials,
        error,
        hires_error,
        lores_error,
        time_limit: _,
        features,
        interpolate,
        seed: _,
        frame,
    } = params;
    // Those of the settings that are not among its parameters.
    let Settings { crease_angle, longest_cluster, face_resolution, direct, focus, radiosity_rays, .. } = settings;
    let mut all: Vec<(String, String)> = Vec::new();
    let mut add = |name: &str, value: String| all.push((name.to_owned(), value));
    add("program", program());
    add("ray tracer", settings.backend.create(settings.threads)?.name());
    add("scene (geometry, materials or textures)", digest.surfaces.to_string());
    add("scene (lamps or light from outside)", digest.lights.to_string());
    add("camera", format!("{camera:?}"));
    if cameras.len() > 1 {
        add("set of cameras", format!("{cameras:?}"));
    }
    if let Some(frame) = frame {
        add("frame", frame.to_string());
    }
    add("width", width.to_string());
    add("height", height.to_string());
    add("region", region.map_or("the whole image".to_owned(), |r| format!("{:?} to {:?}", r.low, r.high)));
    add("min_trials", min_trials.to_string());
    add("max_trials", max_trials.to_string());
    add("error", error.to_string());
    add("hires_error", hires_error.to_string());
    add("lores_error", lores_error.to_string());
    add("per_pixel", (!interpolate).to_string());
    add("recording of layers", features.to_string());
    for (name, value) in settings.parameters() {
        add(&name, value.to_string());
    }
    let others = (crease_angle, longest_cluster, face_resolution, direct, focus, radiosity_rays);
    add("set of other settings", format!("{others:?}"));
    Ok(Identity(all))
}

/// Version, and the program file's own hash: another build may round differently.
pub(super) fn program() -> String {
    let build = std::env::current_exe().and_then(std::fs::read).map(|bytes| xxh3_64(&bytes));
    match build {
        Ok(hash) => format!("gsii {}, build {hash:016x}", env!("CARGO_PKG_VERSION")),
        Err(_) => format!("gsii {}", env!("CARGO_PKG_VERSION")),
    }
}
