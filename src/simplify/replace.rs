//! Clusters become boxes.

use std::sync::Arc;

use glam::Mat3;
use rayon::prelude::*;

use super::cluster::Group;
use super::fit::flux::{LEAST_LINES, LineTally};
use super::fit::lines::Buffers;
use super::fit::paper1993::RAYS_ALONG_PATCH;
use super::fit::{FluxFit, Frame, PaperFit, Probe, Stage, fill_patches, frame_along};
use super::geometry::SimplifiedGeometry;
use super::{BoxFit, Cluster, EquivalentBox, FitResidual, SimplifyParams, support};
use crate::backend::RayBackend;
use crate::error::Result;
use crate::progress::Progress;
use crate::sampling;
use crate::scene::Scene;

/// Lines for all fits together, for each triangle of the scene and at least: what keeps simplification under two seconds per
/// million triangles.
const LINES_PER_TRIANGLE: usize = 1;
const LEAST_BUDGET: usize = 1 << 19;

/// Most lines for one fit; `sampling::sobol` has as many points in a stream.
const MOST_LINES: u32 = 1 << 15;

/// Clusters whose box misses more than this share of the intercepted flux are reported.
const BAD_FIT: f32 = 0.05;

/// Boxes and what the user should know about them.
pub(super) struct Replaced {
    pub(super) clusters: Vec<Cluster>,
    pub(super) rays: u64,
    pub(super) warnings: Vec<String>,
}

struct Fitted {
    equivalent_box: EquivalentBox,
    residual: FitResidual,
    vanished: bool,
    rays: u64,
}

/// Fits a box to each group. `normal` is what may carry them.
pub(super) fn replace(
    scene: &Arc<Scene>,
    backend: &dyn RayBackend,
    params: &SimplifyParams,
    groups: &[Group],
    surface_of_triangle: &[u32],
    normal: &SimplifiedGeometry,
    progress: &Progress,
) -> Result<Replaced> {
    if groups.is_empty() {
        return Ok(Replaced { clusters: Vec::new(), rays: 0, warnings: Vec::new() });
    }
    let triangles = triangles_of(groups, surface_of_triangle);
    let frames: Vec<Frame> = triangles.par_iter().map(|t| choose_frame(scene, t, params)).collect();
    let contacts = match params.box_fit {
        BoxFit::Flux => support::contacts(backend.build(&normal.triangle_set())?.as_ref(), &frames),
        BoxFit::Paper1993 => vec![[false; 6]; frames.len()],
    };
    let placed: Vec<(&[u32], Frame)> = triangles.iter().map(Vec::as_slice).zip(frames.iter().copied()).collect();
    let stage = Stage::new(scene, &placed);
    let rays = stage.build(scene, backend)?;

    let budget = (LINES_PER_TRIANGLE * scene.mesh.triangles.len()).max(LEAST_BUDGET);
    let most = ((budget / groups.len()).next_power_of_two() as u32).clamp(LEAST_LINES, MOST_LINES);
    let bar = progress.stage("simplify", groups.len() as u64);
    let fitted: Vec<Fitted> = (0..groups.len())
        .into_par_iter()
        .map_init(Buffers::default, |buffers, i| {
            let probe = Probe::new(scene, &stage, rays.as_ref(), i);
            // The stream follows from what the cluster is, not from how many there are.
            let stream = sampling::hash_all(&[params.seed, groups[i].surfaces[0]]);
            let fitted = fit(&probe, &frames[i], contacts[i], params, most, stream, buffers);
            bar.inc(1);
            fitted
        })
        .collect();
    bar.finish_and_clear();

    let warnings = report(&fitted, params.box_fit);
    let rays = fitted.iter().map(|f| f.rays).sum();
    let clusters = fitted
        .into_iter()
        .zip(groups.iter().zip(&triangles))
        .map(|(fitted, (group, triangles))| Cluster {
            surfaces: group.surfaces.clone(),
            triangles: triangles.len() as u32,
            bounds: group.bounds,
            equivalent_box: fitted.equivalent_box,
            residual: fitted.residual,
        })
        .collect();
    Ok(Replaced { clusters, rays, warnings })
}

/// Triangles of each group, ascending.
fn triangles_of(groups: &[Group], surface_of_triangle: &[u32]) -> Vec<Vec<u32>> {
    const NONE: u32 = u32::MAX;
    let mut group_of = vec![NONE; surface_of_triangle.iter().max().map_or(0, |&m| m as usize + 1)];
    for (i, group) in (0u32..).zip(groups) {
        group.surfaces.iter().for_each(|&s| group_of[s as usize] = i);
    }
    let mut triangles = vec![Vec::new(); groups.len()];
    for (t, &surface) in (0u32..).zip(surface_of_triangle) {
        let group = group_of[surface as usize];
        if group != NONE {
            triangles[group as usize].push(t);
        }
    }
    triangles
}

/// The paper aligns a box "to the coordinate axis used in modelling the object": those of the one object that the cluster
/// belongs to, else the scene's.
fn choose_frame(scene: &Scene, triangles: &[u32], params: &SimplifyParams) -> Frame {
    match params.box_fit {
        BoxFit::Flux => Frame::suited(&scene.mesh, triangles, params.r_thresh),
        BoxFit::Paper1993 => {
            let axes = scene.mesh.object(triangles[0]).axes;
            let shared = triangles.iter().all(|&t| scene.mesh.object(t).axes == axes);
            frame_along(scene, triangles, if shared { axes } else { Mat3::IDENTITY })
        }
    }
}

fn fit(
    probe: &Probe<'_>,
    frame: &Frame,
    contacts: [bool; 6],
    params: &SimplifyParams,
    most: u32,
    stream: u32,
    buffers: &mut Buffers,
) -> Fitted {
    let size = 2.0 * frame.half;
    let resolution = params.face_resolution;
    let (edges, reflectance, lines, vanished, rays) = match params.box_fit {
        BoxFit::Flux => {
            let tally = LineTally::measure(probe, resolution, most, stream, buffers);
            let fit = FluxFit::new(size, &tally);
            (fit.edges, fit.reflectance, tally.lines, tally.hit_count() == 0, tally.rays)
        }
        BoxFit::Paper1993 => {
            let fit = PaperFit::measure(probe, size, resolution, RAYS_ALONG_PATCH, stream);
            let reflectance = fill_patches(&fit.reflectance, fit.mean_reflectance);
            (fit.edges(size), reflectance, most, fit.vanished(size), fit.rays)
        }
    };
    let fresh = LineTally::measure(probe, 1, lines, sampling::hash(!stream), buffers);
    Fitted {
        residual: FitResidual::new(size, edges, &reflectance, &fresh),
        equivalent_box: EquivalentBox {
            centre: frame.centre + frame.axes * support::resting_offset(frame, edges, contacts),
            half: 0.5 * edges,
            axes: frame.axes,
            resolution,
            reflectance,
        },
        vanished,
        rays: rays + fresh.rays,
    }
}

fn report(fitted: &[Fitted], box_fit: BoxFit) -> Vec<String> {
    let mut warnings = Vec::new();
    let vanished = fitted.iter().filter(|f| f.vanished).count();
    if vanished > 0 {
        warnings.push(format!("{vanished} boxes vanished in the fit (flat clusters) and were given a least thickness"));
    }
    let bad = |f: &&Fitted| f.residual.intercepted.abs() > BAD_FIT + 3.0 * f.residual.intercepted_error;
    let bad = fitted.iter().filter(bad).count();
    if bad > 0 {
        let hint = if box_fit == BoxFit::Paper1993 { "; the flux fit conserves it" } else { "" };
        warnings.push(format!(
            "{bad} of {} boxes intercept over {:.0} % more or less light than their clusters{hint}",
            fitted.len(),
            100.0 * BAD_FIT
        ));
    }
    warnings
}
