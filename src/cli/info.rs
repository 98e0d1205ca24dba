//! `gsii info`: what is in a scene and what would be done.

use std::process::ExitCode;

use clap::Args;

use super::options::{MethodOptions, SceneOptions, Talk, load, set_threads};
use super::outside::OutsideOptions;
use super::page::Page;
use crate::error::Result;
use crate::pipeline::{Prepared, Stats, choose_camera};
use crate::scene::{LightKind, Projection, Scene};

/// Options of `gsii info`.
#[derive(Args, Debug)]
pub struct Options {
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    outside: OutsideOptions,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    talk: Talk,
    /// Only the contents of the file: no simplification, no radiosity
    #[arg(long)]
    contents: bool,
}

/// Runs the command.
///
/// # Errors
/// As loading and preparing the scene.
pub fn run(options: &Options) -> Result<ExitCode> {
    set_threads(options.method.threads)?;
    let progress = options.talk.progress();
    let mut stats = Stats::new();
    let mut scene = load(&options.scene, &mut stats)?;
    options.outside.surround(&mut scene)?;
    contents(&scene, stats.seconds.load).print()?;
    if options.contents {
        return Ok(ExitCode::SUCCESS);
    }
    let camera = choose_camera(&scene, options.scene.camera.as_deref())?.clone();
    let prepared = Prepared::new(scene, &camera, options.method.settings(), &progress, &mut stats)?;
    plan(&prepared, &stats).print()?;
    Ok(ExitCode::SUCCESS)
}

fn contents(scene: &Scene, seconds: f64) -> Page {
    let mut page = Page::default();
    let mesh = &scene.mesh;
    let size = mesh.bounds.size();
    page.line(format_args!("{} (read in {seconds:.2} s)", scene.name));
    page.line(format_args!("  size        {:.4} x {:.4} x {:.4}, centre {:.4}", size.x, size.y, size.z, scene.centre));
    page.line(format_args!("  triangles   {} in {} objects", mesh.triangles.len(), mesh.objects.len()));
    page.line(format_args!("  materials   {}, textures {}", scene.materials.len(), scene.textures.len()));
    let emitting = mesh.objects.iter().filter(|o| scene.materials[o.material as usize].is_emitter());
    let (objects, triangles) = emitting.fold((0, 0), |(o, t), object| (o + 1, t + object.triangles.len()));
    page.line(format_args!("  emitters    {triangles} triangles in {objects} objects"));
    for light in &scene.lights {
        let kind = match light.kind {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Directional { .. } => "directional",
        };
        page.line(format_args!("  light       {} ({kind}), intensity {}", light.name, light.intensity));
    }
    if let Some(environment) = &scene.environment {
        let [width, height] = environment.size();
        page.line(format_args!("  outside     {}, {width} x {height} texels", environment.name));
        if let Some(sun) = environment.sun() {
            let d = sun.direction;
            let azimuth = d.x.atan2(-d.z).to_degrees().rem_euclid(360.0);
            page.line(format_args!(
                "  sun         {:.1} degrees high, {azimuth:.1} clockwise from north (-z)",
                d.y.asin().to_degrees()
            ));
        }
    }
    for (i, camera) in scene.cameras.iter().enumerate() {
        let kind = match camera.projection {
            Projection::Perspective { y_fov } => format!("perspective, {:.1} degrees high", y_fov.to_degrees()),
            Projection::Orthographic { x_mag, y_mag } => format!("orthographic, {x_mag} x {y_mag}"),
        };
        page.line(format_args!("  camera {i}    {} ({kind})", camera.name));
    }
    let notes = &scene.notes;
    for (count, what) in [
        (notes.degenerate_triangles, "triangles without area"),
        (notes.duplicate_triangles, "repeated triangles"),
        (notes.non_finite_triangles, "triangles with coordinates that are not finite"),
    ] {
        if count > 0 {
            page.line(format_args!("  dropped     {count} {what}"));
        }
    }
    page
}

fn plan(prepared: &Prepared, stats: &Stats) -> Page {
    let mut page = Page::default();
    let settings = &prepared.settings;
    page.line(format_args!("with --method {}", serde_json::json!(settings.method).as_str().unwrap_or_default()));
    let Some(far) = &prepared.far else {
        page.line(format_args!("  path tracing: nothing is simplified"));
        return page;
    };
    page.line(format_args!("  r_thresh    {:.4}, beta {:.4}", settings.r_thresh(), settings.beta));
    if let Some(simplified) = &far.simplified {
        let count = &stats.counts;
        page.line(format_args!("  A_thresh    {:.4}", simplified.a_thresh));
        page.line(format_args!(
            "  surfaces    {} = {} normal + {} complex",
            count.surfaces, count.normal, count.complex
        ));
        page.line(format_args!(
            "  clusters    {}, mean misfit of intercepted flux {:.3}",
            count.clusters, stats.error.fit
        ));
        page.line(format_args!(
            "  simplified  {} surfaces, {} triangles",
            count.normal + count.simple,
            far.geometry.triangles.len()
        ));
    }
    page.line(format_args!("  patches     {} of size {:.4}", stats.counts.patches, settings.patch_size.unwrap_or(0.0)));
    page.line(format_args!(
        "  radiosity   error {:.4}, {} shots, {} rays",
        stats.error.radiosity, far.solution.shots, far.solution.rays
    ));
    let s = &stats.seconds;
    page.line(format_args!(
        "  seconds     simplify {:.2}, build {:.2}, radiosity {:.2}",
        s.simplify, s.build, s.radiosity
    ));
    page
}
