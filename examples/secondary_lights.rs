//! What light source reclassification (Chen et al. 1991) could bring: how much of the noise of a gather ray comes from bright patches,
//! and how much would be left if those were sampled like light sources.
//!
//! At points that the camera sees, gather rays look radiosities up as in LORES. Points on patches brighter than a bound become light
//! sources: one of them is chosen in exact proportion to what it would send here unshadowed (no light tree chooses better) and asked by a
//! shadow ray. For each bound the table has the share of all light that comes from bright patches, and the variance of a trial over that
//! without reclassification: of the rest, of the shadow ray, and of both. A trial then costs a shadow ray and the choice more.
//!
//! The last column is the same for records of the irradiance cache, at equal cost: the variance of a record whose stratified rays are fewer
//! by as many shadow rays to bright places, stratified too, as bring its ray count back, over that of a record without.
//!
//! `cargo run --release --example secondary_lights -- [--points N] SCENE...`

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use gsii::backend::{Coherence, Hit, Ray, Visible};
use gsii::pipeline::{Prepared, Settings, Stats};
use gsii::progress::Progress;
use gsii::render::FarField;
use gsii::sampling::{basis, cosine_hemisphere, hash_all, sobol, unit};
use gsii::scene::{LoadOptions, load};
use gsii::shading::SurfacePoint;

/// Gather rays from each point.
const RAYS: u32 = 64;
/// Points that are tried as places on bright patches.
const CANDIDATES: u32 = 1 << 17;
/// Places among those that stand for all of them at one point of the image.
const PLACES: usize = 1 << 11;
/// Rings and sectors of a record of the irradiance cache, of one with bright places, and its shadow rays.
const RECORD: [u32; 2] = [8, 24];
const LIT_RECORD: [u32; 2] = [7, 21];
const SHADOWS: u32 = RECORD[0] * RECORD[1] - LIT_RECORD[0] * LIT_RECORD[1];
/// Records at each point.
const REPEATS: u32 = 8;
/// Bounds: radiance over the mean radiance that gather rays meet.
const BOUNDS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut points, mut scenes) = (500, Vec::new());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--points" => points = args.next().ok_or("--points needs a number")?.parse()?,
            _ => scenes.push(arg),
        }
    }
    println!(
        "{:<18} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "scene", "bound", "light", "rest", "shadow", "both", "record"
    );
    for scene in scenes {
        measure(Path::new(&scene), points)?;
    }
    Ok(())
}

/// A place on a patch.
#[derive(Clone, Copy)]
struct Place {
    position: Vec3,
    normal: Vec3,
    radiance: f64,
}

fn grey(v: Vec3) -> f64 {
    f64::from(v.element_sum()) / 3.0
}

fn measure(path: &Path, points: u32) -> Result<(), Box<dyn std::error::Error>> {
    let scene = Arc::new(load(path, &LoadOptions::default())?);
    let camera = scene.cameras[0].clone();
    let progress = Progress::silent();
    let prepared = Prepared::new(Arc::clone(&scene), &camera, Settings::default(), &progress, &mut Stats::new())?;
    let world = prepared.world();
    let far = world.far.ok_or("GSII always has a far field")?;
    let (places, area) = places(&prepared, &far);

    // Receivers, and what their gather rays meet.
    let views: Vec<Ray> = (0..points)
        .map(|i| {
            let u = sobol(i, 0, 1);
            camera.ray(Vec2::new(u[0], u[1]), camera.aspect.unwrap_or(1.5))
        })
        .collect();
    let hits = closest(world.detailed, &views);
    let mut receivers = Vec::new();
    for (view, hit) in views.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
        let point = SurfacePoint::new(&scene, hit);
        let facing = point.geometric_normal.dot(view.direction) < 0.0;
        receivers.push((point, if facing { point.geometric_normal } else { -point.geometric_normal }));
    }
    let mut seen: Vec<Vec<f64>> = Vec::new();
    for (i, (point, normal)) in receivers.iter().enumerate() {
        let rays: Vec<Ray> = (0..RAYS)
            .map(|k| {
                let random = [0, 1].map(|d| unit(hash_all(&[i as u32, k, d])));
                let direction = basis(*normal) * cosine_hemisphere(random.into());
                Ray::new(point.ray_origin(direction), direction)
            })
            .collect();
        let hits = closest(far.rays, &rays);
        let radiance =
            |(ray, hit): (&Ray, &Hit)| if hit.is_hit() { grey(far.reflected(hit, ray.direction)) } else { 0.0 };
        seen.push(rays.iter().zip(&hits).map(radiance).collect());
    }
    // What each ray of some records meets: with all strata and with fewer.
    let records = |shape: [u32; 2]| -> Vec<Vec<Vec<f64>>> {
        let of = |(i, (point, normal)): (usize, &(SurfacePoint, Vec3))| {
            let record = |k: u32| {
                let rays = record_rays(point, *normal, shape, hash_all(&[i as u32, k, shape[0]]));
                let hits = closest(far.rays, &rays);
                let radiance =
                    |(ray, hit): (&Ray, &Hit)| if hit.is_hit() { grey(far.reflected(hit, ray.direction)) } else { 0.0 };
                rays.iter().zip(&hits).map(radiance).collect()
            };
            (0..REPEATS).map(record).collect()
        };
        receivers.iter().enumerate().map(of).collect()
    };
    let (plain, fewer) = (records(RECORD), records(LIT_RECORD));
    let mean_of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mean = seen.iter().flatten().sum::<f64>() / (f64::from(RAYS) * seen.len() as f64);
    let variance = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
    };
    let all: f64 = seen.iter().map(|v| variance(v)).sum();
    let all_records: f64 = plain.iter().map(|r| variance(&r.iter().map(|v| mean_of(v)).collect::<Vec<_>>())).sum();
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for bound in BOUNDS {
        let limit = bound * mean;
        let bright: Vec<Place> = places.iter().copied().filter(|p| p.radiance > limit).collect();
        let share: f64 = seen.iter().flatten().filter(|v| **v > limit).sum::<f64>();
        let light = share / (mean * f64::from(RAYS) * seen.len() as f64);
        let rest: f64 = seen
            .iter()
            .map(|v| variance(&v.iter().map(|&l| if l > limit { 0.0 } else { l }).collect::<Vec<_>>()))
            .sum();
        let dimmed =
            |values: &Vec<f64>| mean_of(&values.iter().map(|&l| if l > limit { 0.0 } else { l }).collect::<Vec<_>>());
        let rest_of_records: f64 = fewer.iter().map(|r| variance(&r.iter().map(dimmed).collect::<Vec<_>>())).sum();
        let (shadow, shadow_of_records) = receivers
            .iter()
            .enumerate()
            .map(|(i, (point, normal))| {
                let stride = (bright.len() / PLACES).max(1);
                let chosen: Vec<Place> = bright.iter().copied().skip(i % stride).step_by(stride).collect();
                let weight = area * bright.len() as f64 / (f64::from(CANDIDATES) * chosen.len().max(1) as f64);
                shadow_variances(&prepared, &far, point, *normal, &chosen, weight)
            })
            .fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        println!(
            "{name:<18} {bound:>6} {:>8.1}% {:>9.3} {:>9.3} {:>9.3} {:>9.3}",
            100.0 * light,
            rest / all,
            shadow / all,
            (rest + shadow) / all,
            (rest_of_records + shadow_of_records) / all_records
        );
    }
    Ok(())
}

fn closest(scene: &dyn gsii::backend::RayScene, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    scene.closest(rays, Visible::All, Coherence::Incoherent, &mut hits);
    hits
}

/// Uniform points on both sides of the far field's geometry, and the area (of both sides) that all of them stand for.
fn places(prepared: &Prepared, far: &FarField<'_>) -> (Vec<Place>, f64) {
    let set = far.geometry.triangle_set();
    let corners = |t: usize| set.triangles[t].map(|i| set.positions[i as usize]);
    let areas: Vec<f64> = (0..set.triangles.len())
        .map(|t| {
            let [a, b, c] = corners(t);
            0.5 * f64::from((b - a).cross(c - a).length())
        })
        .collect();
    let total: f64 = areas.iter().sum();
    let mut places = Vec::new();
    let (mut triangle, mut passed) = (0, 0.0);
    for i in 0..CANDIDATES {
        let random = [1, 2, 3].map(|d| unit(hash_all(&[i, d, prepared.settings.seed])));
        // Stratified along the areas, then uniform on the triangle (Turk 1990).
        let at = total * (f64::from(i) + f64::from(random[0])) / f64::from(CANDIDATES);
        while passed + areas[triangle] < at && triangle + 1 < areas.len() {
            passed += areas[triangle];
            triangle += 1;
        }
        let [a, b, c] = corners(triangle);
        let root = random[1].sqrt();
        let (u, v) = (root * (1.0 - random[2]), root * random[2]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let side = if i & 1 == 0 { normal } else { -normal };
        let hit = Hit { triangle: triangle as u32, u, v, ..Hit::MISS };
        let radiance = grey(far.reflected(&hit, -side));
        places.push(Place { position: a + u * (b - a) + v * (c - a), normal: side, radiance });
    }
    (places, 2.0 * total)
}

/// Rays of a record: rings of equal projected solid angle, cut into sectors, one ray in each.
fn record_rays(point: &SurfacePoint, normal: Vec3, [rings, sectors]: [u32; 2], stream: u32) -> Vec<Ray> {
    (0..rings * sectors)
        .map(|k| {
            let [u, v] = [0, 1].map(|d| unit(hash_all(&[stream, k, d])));
            let sin2 = ((k / sectors) as f32 + u) / rings as f32;
            let (sin, cos) = (std::f32::consts::TAU * ((k % sectors) as f32 + v) / sectors as f32).sin_cos();
            let direction =
                basis(normal) * Vec3::new(sin2.sqrt() * cos, sin2.sqrt() * sin, (1.0 - sin2).max(0.0).sqrt());
            Ray::new(point.ray_origin(direction), direction)
        })
        .collect()
}

/// Variance of one shadow ray to one of the places, each chosen in proportion to what it sends unshadowed, and of the mean of the shadow
/// rays of a record, stratified along the places; in units of radiance that a cosine-distributed gather ray brings.
fn shadow_variances(
    prepared: &Prepared,
    far: &FarField<'_>,
    point: &SurfacePoint,
    normal: Vec3,
    places: &[Place],
    weight: f64,
) -> (f64, f64) {
    let mut sent = Vec::new();
    let mut rays = Vec::new();
    let least = prepared.settings.r_thresh();
    for place in places {
        let away = place.position - point.position;
        let distance = away.length();
        let direction = away / distance;
        let cosines = normal.dot(direction).max(0.0) * (-place.normal.dot(direction)).max(0.0);
        // What is near is path traced and stays as it is.
        if cosines > 0.0 && distance > least {
            sent.push(weight * place.radiance * f64::from(cosines / (distance * distance)) / PI);
            rays.push(Ray { t_far: distance * (1.0 - 1e-3), ..Ray::new(point.ray_origin(direction), direction) });
        }
    }
    let all: f64 = sent.iter().sum();
    let seen: Vec<bool> = closest(far.rays, &rays).iter().map(|hit| !hit.is_hit()).collect();
    let arrives: f64 = seen.iter().zip(&sent).filter(|(seen, _)| **seen).map(|(_, s)| s).sum();
    // Each stratum holds an equal part of what is sent; its one ray brings `all / SHADOWS` with the probability that its part arrives.
    let part = all / f64::from(SHADOWS);
    let mut arriving = [0.0; SHADOWS as usize];
    let mut passed = 0.0;
    for (seen, sent) in seen.iter().zip(&sent) {
        let stratum = ((passed / part) as usize).min(arriving.len() - 1);
        arriving[stratum] += if *seen { *sent } else { 0.0 };
        passed += sent;
    }
    let of_stratum = |arrives: &f64| arrives.min(part) * (part - arrives.min(part));
    // The value of a single ray is `all` with probability `arrives / all`, else 0.
    (arrives * (all - arrives), arriving.iter().map(of_stratum).sum())
}
