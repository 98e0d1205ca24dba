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
use super::{BoxFit, Cluster, EquivalentBox, FitResidual, SimplifyParams, classify, geometry, support};
use crate::backend::{RayBackend, RayScene};
use crate::error::Result;
use crate::progress::Progress;
use crate::sampling;
use crate::scene::{Aabb, Scene};

/// Lines for all fits together, for each triangle of the scene and at least: what keeps simplification under two seconds per
/// million triangles.
const LINES_PER_TRIANGLE: usize = 1;
const LEAST_BUDGET: usize = 1 << 18;

/// Most lines for one fit; `sampling::sobol` has as many points in a stream.
const MOST_LINES: u32 = 1 << 15;

/// Clusters whose box misses more than this share of the intercepted flux are reported.
const BAD_FIT: f32 = 0.05;

/// A cluster longer than `r_thresh` is split when more than this share of the light leaving its surfaces meets it again
/// beyond `r_thresh`: the simplified scene does not show that part from inside the box.
pub(super) const MOST_HIDDEN: f32 = 0.02;

/// A cluster is split when both of its parts are worth a box and the flux its box intercepts is off by more than this share, summed over the directions around the
/// three axes. The paper's boxes are left as they come out.
const MOST_DIRECTIONAL: f32 = 0.25;

/// Times that clusters are split. More than about ten pairs deep nothing is longer than `r_thresh` any more.
const MOST_SPLITS: usize = 8;

/// Faces of a box, each a surface with a patch at least.
const BOX_FACES: u32 = 6;

/// Boxes and what the user should know about them.
#[derive(Default)]
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

/// Replaces groups by boxes; what fits badly is split, and stays normal where nothing is left to split.
pub(super) struct Replacer<'a> {
    pub(super) scene: &'a Arc<Scene>,
    pub(super) backend: &'a dyn RayBackend,
    pub(super) params: &'a SimplifyParams,
    /// Groups up to this diagonal need not hide their far parts.
    pub(super) compact: f32,
    pub(super) surface_of_triangle: &'a [u32],
    /// What no box may cover.
    pub(super) uncoverable: classify::BoundsAlongX,
    /// What may carry clusters.
    pub(super) normal: &'a SimplifiedGeometry,
}

impl Replacer<'_> {
    /// Fits boxes. Surfaces of groups that are in none of the clusters stay normal.
    pub(super) fn replace(&self, groups: Vec<Group>, progress: &Progress) -> Result<Replaced> {
        let mut replaced = Replaced::default();
        let mut candidates: Vec<Group> = groups.into_iter().filter(worth_a_box).collect();
        if candidates.is_empty() {
            return Ok(replaced);
        }
        let carriers = match self.params.box_fit {
            BoxFit::Flux => Some(self.normal.build(self.scene, self.backend)?),
            BoxFit::Paper1993 => None,
        };
        let params = self.params;
        let (mut vanished, mut split) = (0, 0);
        for round in 0..=MOST_SPLITS {
            let fitted = self.fit_all(&candidates, carriers.as_deref(), progress)?;
            let mut parts = Vec::new();
            for (group, fitted) in candidates.into_iter().zip(fitted) {
                replaced.rays += fitted.rays;
                let compact = group.bounds.diagonal() <= self.compact;
                let hides = !compact && fitted.residual.hidden > MOST_HIDDEN;
                let impossible = hides || self.uncoverable.any_overlap(&fitted.equivalent_box.bounds());
                let split_helps =
                    || params.box_fit == BoxFit::Flux && fitted.misfits() && group.parts().iter().all(worth_a_box);
                if round < MOST_SPLITS && group.has_parts() && (impossible || split_helps()) {
                    split += 1;
                    parts.extend(group.split().into_iter().filter(worth_a_box));
                } else if !impossible {
                    vanished += usize::from(fitted.vanished);
                    replaced.clusters.push(fitted.cluster(&group));
                }
            }
            candidates = parts;
            if candidates.is_empty() {
                break;
            }
        }
        replaced.clusters.sort_by_key(|c| c.surfaces[0]);
        replaced.warnings = report(&replaced.clusters, vanished, self.params.box_fit);
        log::debug!("{split} clusters were split because their boxes fitted badly");
        Ok(replaced)
    }

    fn fit_all(&self, groups: &[Group], carriers: Option<&dyn RayScene>, progress: &Progress) -> Result<Vec<Fitted>> {
        let Replacer { scene, params, .. } = *self;
        let triangles = self.triangles_of(groups);
        let frames: Vec<Frame> = triangles.par_iter().map(|t| choose_frame(scene, t, params)).collect();
        let contacts = carriers.map_or_else(|| vec![[false; 6]; frames.len()], |c| support::contacts(c, &frames));
        let placed: Vec<(&[u32], Frame)> = triangles.iter().map(Vec::as_slice).zip(frames.iter().copied()).collect();
        let stage = Stage::new(scene, &placed);
        let rays = stage.build(scene, self.backend)?;

        let budget = (LINES_PER_TRIANGLE * scene.mesh.triangles.len()).max(LEAST_BUDGET);
        let most = ((budget / groups.len()).next_power_of_two() as u32).clamp(LEAST_LINES, MOST_LINES);
        let bar = progress.stage("simplify", groups.len() as u64);
        let fitted = (0..groups.len())
            .into_par_iter()
            .map_init(Buffers::default, |buffers, i| {
                let probe = Probe::new(scene, &stage, rays.as_ref(), i, &frames[i], params.r_thresh);
                // The stream follows from what the cluster is, not from how many there are.
                let stream = sampling::hash_all(&[params.seed, groups[i].first]);
                let params = SimplifyParams { face_resolution: face_resolution(&groups[i], params), ..params.clone() };
                let fitted = fit(&probe, &frames[i], contacts[i], &params, most, stream, buffers);
                bar.inc(1);
                fitted
            })
            .collect();
        bar.finish_and_clear();
        Ok(fitted)
    }

    /// Triangles of each group, ascending, with those that its objects share with others: they close it, whosever they are.
    fn triangles_of(&self, groups: &[Group]) -> Vec<Vec<u32>> {
        const NONE: u32 = u32::MAX;
        let mut group_of = vec![NONE; self.surface_of_triangle.iter().max().map_or(0, |&m| m as usize + 1)];
        for (i, group) in (0u32..).zip(groups) {
            group.surfaces().into_iter().for_each(|s| group_of[s as usize] = i);
        }
        let mut triangles = vec![Vec::new(); groups.len()];
        for (t, &surface) in (0u32..).zip(self.surface_of_triangle) {
            let group = group_of[surface as usize];
            if group != NONE {
                triangles[group as usize].push(t);
            }
        }
        self.add_shared(groups, &mut triangles);
        triangles
    }

    fn add_shared(&self, groups: &[Group], triangles: &mut [Vec<u32>]) {
        let mesh = &self.scene.mesh;
        if mesh.shared.is_empty() {
            return;
        }
        let objects = |(i, own): (u32, &Vec<u32>)| {
            own.iter().map(move |&t| (mesh.object_of_triangle[t as usize], i)).collect::<Vec<_>>()
        };
        let mut groups_of: Vec<(u32, u32)> = (0u32..).zip(&*triangles).flat_map(objects).collect();
        groups_of.sort_unstable();
        groups_of.dedup();
        let mut lent = Vec::new();
        for &(t, object) in &mesh.shared {
            let first = groups_of.partition_point(|g| g.0 < object);
            let inside = |bounds: Aabb| mesh.corners(t).into_iter().fold(bounds, Aabb::with) == bounds;
            let around = groups_of[first..].iter().take_while(|g| g.0 == object).map(|g| g.1 as usize);
            lent.extend(around.filter(|&i| inside(groups[i].bounds)).map(|i| (i, t)));
        }
        for &(i, t) in &lent {
            triangles[i].push(t);
        }
        for (i, _) in lent {
            triangles[i].sort_unstable();
            triangles[i].dedup();
        }
    }
}

/// Whether a box is simpler than what it replaces: fewer triangles, and no more surfaces. A few quads, or a few round things, are not
/// worth one: they stay as they are, which is exact.
fn worth_a_box(group: &Group) -> bool {
    group.triangles > geometry::BOX_TRIANGLES && group.count >= BOX_FACES
}

/// Patches along each edge of a box face: as many as asked for, but no more on the whole box than the cluster has surfaces, which are
/// mostly a patch each.
fn face_resolution(group: &Group, params: &SimplifyParams) -> u32 {
    (group.count / BOX_FACES).isqrt().clamp(1, params.face_resolution)
}

impl Fitted {
    /// Whether the box intercepts other light than the cluster, by more than the noise of the measurement.
    fn misfits(&self) -> bool {
        let FitResidual { directional, intercepted_error, .. } = self.residual;
        directional > MOST_DIRECTIONAL + 3.0 * intercepted_error
    }

    fn cluster(&self, group: &Group) -> Cluster {
        Cluster {
            surfaces: group.surfaces(),
            triangles: group.triangles,
            bounds: group.bounds,
            equivalent_box: self.equivalent_box.clone(),
            residual: self.residual,
        }
    }
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

fn report(clusters: &[Cluster], vanished: usize, box_fit: BoxFit) -> Vec<String> {
    let mut warnings = Vec::new();
    if vanished > 0 {
        warnings.push(format!("{vanished} boxes vanished in the fit (flat clusters) and were given a least thickness"));
    }
    let bad = |c: &&Cluster| c.residual.intercepted.abs() > BAD_FIT + 3.0 * c.residual.intercepted_error;
    let bad = clusters.iter().filter(bad).count();
    if bad > 0 {
        let hint = if box_fit == BoxFit::Paper1993 { "; the flux fit conserves it" } else { "" };
        warnings.push(format!(
            "{bad} of {} boxes intercept over {:.0} % more or less light than their clusters{hint}",
            clusters.len(),
            100.0 * BAD_FIT
        ));
    }
    warnings
}
