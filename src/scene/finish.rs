//! The last step of making a scene: placing, recentring, ordering and cleaning of all triangles.

use glam::{DAffine3, DMat3, DVec3, Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::builder::{Instance, MeshData, SceneBuilder, normal_matrix};
use super::{Aabb, Alpha, Camera, LightKind, Material, Mesh, Object, Projection, PunctualLight, Scene, Texture};
use super::{clean, overview, pane};
use crate::backend::PartKind;
use crate::error::Result;

/// Largest coordinate. Embree ignores primitives beyond 1.844e18 without a word.
const MAX_COORDINATE: f64 = 1.8e18;

/// Makes the scene. See [`SceneBuilder::finish`].
pub(super) fn finish(mut builder: SceneBuilder) -> Result<Scene> {
    for material in &builder.materials {
        material.check(builder.textures.len()).map_err(|e| builder.error(e))?;
    }
    for texture in &builder.textures {
        texture.check().map_err(|e| builder.error(e))?;
    }
    silence_dark_emitters(&mut builder);
    let centre = builder.centre.unwrap_or_else(|| middle(&builder));
    let mut lights = Vec::with_capacity(builder.lights.len());
    for (transform, light) in &builder.lights {
        lights.push(place_light(light, transform, centre).map_err(|e| builder.error(e))?);
    }
    let mut cameras = Vec::with_capacity(builder.cameras.len().max(1));
    for (transform, camera) in &builder.cameras {
        cameras.push(place_camera(camera, transform, centre).map_err(|e| builder.error(e))?);
    }
    let mut mesh = assemble(&builder, centre);
    let textures = with_smaller(&builder.materials, builder.textures);
    let emits: Vec<bool> = builder.materials.iter().map(|m| m.is_emitter()).collect();
    clean::clean(&mut mesh, &emits, &mut builder.notes);
    if cameras.is_empty() {
        cameras.push(overview::camera(&mesh));
    }
    Ok(Scene {
        environment: None,
        name: builder.name,
        mesh,
        materials: builder.materials,
        textures,
        lights,
        cameras,
        centre,
        notes: builder.notes,
    })
}

/// Makes the smaller images of textures that are read with a footprint. Others keep their one: normal maps, whose mean is a smoother
/// surface, what emits, which light sources are sampled by, and what is cut out.
fn with_smaller(materials: &[Material], textures: Vec<Texture>) -> Vec<Texture> {
    let mut wanted = vec![false; textures.len()];
    for material in materials {
        for slot in material.filtered_slots() {
            wanted[slot.texture as usize] = true;
        }
    }
    textures.into_par_iter().zip(wanted).map(|(t, wanted)| if wanted { t.with_smaller() } else { t }).collect()
}

/// A material whose emission texture is black everywhere is no light source; as one it would cost samples for nothing.
fn silence_dark_emitters(builder: &mut SceneBuilder) {
    let dark: Vec<usize> = (0..builder.materials.len())
        .filter(|&m| {
            let material = &builder.materials[m];
            let texture = material.emission_texture.as_ref().map(|t| &builder.textures[t.texture as usize]);
            material.is_emitter()
                && texture.is_some_and(|t| (t.mean().truncate() * material.emission).max_element() <= 0.0)
        })
        .collect();
    for m in dark {
        builder.materials[m].emission = Vec3::ZERO;
        let name = builder.materials[m].name.clone();
        builder.warn(format!("material '{name}': its emission texture is black; it does not emit"));
    }
}

fn world_corners(data: &MeshData, triangle: [u32; 3], transform: &DAffine3) -> Option<[DVec3; 3]> {
    let corners = triangle.map(|i| transform.transform_point3(data.positions[i as usize].as_dvec3()));
    // NaN fails every comparison.
    corners.iter().all(|p| p.abs().max_element() <= MAX_COORDINATE && p.is_finite()).then_some(corners)
}

/// Middle of the bounds of all usable triangles in file coordinates; the origin without any.
fn middle(builder: &SceneBuilder) -> DVec3 {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let union = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0.min(b.0), a.1.max(b.1));
    // Minimum and maximum do not depend on the order of reduction.
    let bounds = builder
        .instances
        .par_iter()
        .map(|instance| {
            let data = &builder.geometries[instance.geometry as usize];
            let corners = data.triangles.iter().filter_map(|&t| world_corners(data, t, &instance.transform));
            corners.flatten().fold(empty, |b, p| (b.0.min(p), b.1.max(p)))
        })
        .reduce(|| empty, union);
    if bounds.0.cmple(bounds.1).all() { 0.5 * (bounds.0 + bounds.1) } else { DVec3::ZERO }
}

/// Orthonormal axes nearest to the columns of a linear map, in their order.
fn orthonormal(m: &DMat3) -> DMat3 {
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

/// Ranges of an object's output.
struct Slot<'a> {
    instance: &'a Instance,
    first_vertex: u32,
    positions: &'a mut [Vec3],
    normals: &'a mut [Vec3],
    uvs: [&'a mut [Vec2]; 2],
    colors: &'a mut [[f32; 4]],
    triangles: &'a mut [[u32; 3]],
    owners: &'a mut [u32],
    number: u32,
}

fn take<'a, T>(rest: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let n = n.min(rest.len()); // attributes that no object has stay empty
    let (head, tail) = std::mem::take(rest).split_at_mut(n);
    *rest = tail;
    head
}

/// All triangles of all instances, ordered by kind.
fn assemble(builder: &SceneBuilder, centre: DVec3) -> Mesh {
    let kinds: Vec<PartKind> = builder.instances.par_iter().map(|i| kind(builder, i)).collect();
    let rank = |k: PartKind| match k {
        PartKind::Opaque => 0,
        PartKind::OneSided => 1,
        PartKind::Filtered => 2,
        PartKind::Pane => 3,
    };
    let mut order: Vec<usize> = (0..builder.instances.len()).collect();
    order.sort_by_key(|&i| rank(kinds[i]));
    let order: Vec<&Instance> = order.iter().map(|&i| &builder.instances[i]).collect();
    let mut kinds = kinds;
    kinds.sort_by_key(|&k| rank(k));
    let data = |i: &Instance| &builder.geometries[i.geometry as usize];
    let any = |has: &dyn Fn(&MeshData) -> bool| order.iter().any(|i| has(data(i)));
    // Coordinates that no texture reads are not kept.
    let used = |set: u8| builder.materials.iter().flat_map(|m| m.texture_slots()).any(|s| s.uv_set == set);
    let vertices: usize = order.iter().map(|i| data(i).positions.len()).sum();
    let triangles: usize = order.iter().map(|i| data(i).triangles.len()).sum();
    let sized = |want: bool| if want { vertices } else { 0 };
    let mut mesh = Mesh {
        positions: vec![Vec3::ZERO; vertices],
        normals: vec![Vec3::ZERO; sized(any(&|d| !d.normals.is_empty()))],
        uvs: [0, 1].map(|s| vec![Vec2::ZERO; sized(used(s as u8) && any(&|d| !d.uvs[s].is_empty()))]),
        colors: vec![[1.0; 4]; sized(any(&|d| !d.colors.is_empty()))],
        triangles: vec![[0; 3]; triangles],
        object_of_triangle: vec![0; triangles],
        planes: Vec::new(),
        objects: Vec::with_capacity(order.len()),
        shared: Vec::new(),
        bounds: Aabb::EMPTY,
    };
    let [uv0, uv1] = &mut mesh.uvs;
    let (mut positions, mut normals) = (&mut mesh.positions[..], &mut mesh.normals[..]);
    let (mut uv0, mut uv1, mut colors) = (&mut uv0[..], &mut uv1[..], &mut mesh.colors[..]);
    let (mut triangles, mut owners) = (&mut mesh.triangles[..], &mut mesh.object_of_triangle[..]);
    let (mut first_vertex, mut first_triangle) = (0, 0);
    let mut slots = Vec::with_capacity(order.len());
    for (number, (instance, kind)) in order.iter().zip(kinds).enumerate() {
        let (v, t) = (data(instance).positions.len(), data(instance).triangles.len());
        slots.push(Slot {
            instance,
            first_vertex,
            positions: take(&mut positions, v),
            normals: take(&mut normals, v),
            uvs: [take(&mut uv0, v), take(&mut uv1, v)],
            colors: take(&mut colors, v),
            triangles: take(&mut triangles, t),
            owners: take(&mut owners, t),
            number: number as u32,
        });
        mesh.objects.push(Object {
            name: instance.name.clone(),
            material: instance.material,
            triangles: first_triangle..first_triangle + t as u32,
            axes: Mat3::from_cols_array(&orthonormal(&instance.transform.matrix3).to_cols_array().map(|x| x as f32)),
            kind,
        });
        first_vertex += v as u32;
        first_triangle += t as u32;
    }
    slots.into_par_iter().for_each(|slot| fill(slot, builder, centre));
    mesh
}

fn fill(slot: Slot<'_>, builder: &SceneBuilder, centre: DVec3) {
    let data = &builder.geometries[slot.instance.geometry as usize];
    let transform = &slot.instance.transform;
    for (out, p) in slot.positions.iter_mut().zip(&data.positions) {
        let p = transform.transform_point3(p.as_dvec3());
        // Overflow and NaN become NaN, which cleaning finds.
        *out = if p.abs().max_element() <= MAX_COORDINATE { (p - centre).as_vec3() } else { Vec3::NAN };
    }
    let normals = normal_matrix(&transform.matrix3);
    for (out, n) in slot.normals.iter_mut().zip(&data.normals) {
        *out = (normals * n.as_dvec3()).normalize_or_zero().as_vec3();
    }
    for (out, set) in slot.uvs.into_iter().zip(&data.uvs) {
        let n = set.len().min(out.len());
        out[..n].copy_from_slice(&set[..n]);
    }
    if !data.colors.is_empty() {
        slot.colors.copy_from_slice(&data.colors);
    }
    let mirrored = transform.matrix3.determinant() < 0.0;
    for (out, t) in slot.triangles.iter_mut().zip(&data.triangles) {
        let [a, b, c] = t.map(|i| i + slot.first_vertex);
        *out = if mirrored { [a, c, b] } else { [a, b, c] };
    }
    slot.owners.fill(slot.number);
}

/// How rays treat an object.
fn kind(builder: &SceneBuilder, instance: &Instance) -> PartKind {
    let material = &builder.materials[instance.material as usize];
    let data = &builder.geometries[instance.geometry as usize];
    let threshold = match material.alpha {
        Alpha::Opaque => None,
        Alpha::Mask { cutoff } => Some(cutoff),
        Alpha::Blend => Some(1.0),
    };
    if let Some(threshold) = threshold {
        let texture = material.base_color_texture.as_ref().map(|t| &builder.textures[t.texture as usize]);
        let texture = texture.map_or(1.0, |t| t.min_alpha());
        let vertices = data.colors.iter().map(|c| c[3]).fold(1.0, f32::min);
        // Exporters mark whole scenes as blended; what is opaque everywhere need not ask a filter.
        if material.opacity * texture * vertices < threshold {
            return PartKind::Filtered;
        }
    }
    if material.transmits_smoothly() && (!material.refracts || pane::is_pane(data, &instance.transform)) {
        return PartKind::Pane;
    }
    PartKind::Opaque
}

fn place_light(
    light: &PunctualLight,
    transform: &DAffine3,
    centre: DVec3,
) -> std::result::Result<PunctualLight, String> {
    let point = |p: Vec3| (transform.transform_point3(p.as_dvec3()) - centre).as_vec3();
    let vector = |v: Vec3| transform.transform_vector3(v.as_dvec3()).normalize_or_zero().as_vec3();
    let kind = match light.kind {
        LightKind::Point { position } => LightKind::Point { position: point(position) },
        LightKind::Spot { position, direction, cos_inner, cos_outer } => {
            LightKind::Spot { position: point(position), direction: vector(direction), cos_inner, cos_outer }
        }
        LightKind::Directional { direction } => LightKind::Directional { direction: vector(direction) },
    };
    let light = PunctualLight { kind, ..light.clone() };
    light.check()?;
    Ok(light)
}

pub(super) fn place_camera(
    camera: &Camera,
    transform: &DAffine3,
    centre: DVec3,
) -> std::result::Result<Camera, String> {
    let position = transform.transform_point3(camera.position.as_dvec3()) - centre;
    let column = |c: Vec3| transform.transform_vector3(c.as_dvec3()).normalize_or_zero();
    // The direction of view counts most, then up; a mirrored node does not mirror the image.
    let back = column(camera.axes.z_axis);
    let up = column(camera.axes.y_axis);
    let up = (up - back * back.dot(up)).normalize_or_zero();
    let right = up.cross(back);
    if back == DVec3::ZERO || up == DVec3::ZERO || !position.is_finite() {
        return Err(format!("camera '{}': its node's transform leaves no direction of view", camera.name));
    }
    let fits = match camera.projection {
        Projection::Perspective { y_fov } => y_fov > 0.0 && y_fov < std::f32::consts::PI,
        Projection::Orthographic { x_mag, y_mag } => {
            x_mag > 0.0 && y_mag > 0.0 && x_mag.is_finite() && y_mag.is_finite()
        }
    };
    if !fits {
        return Err(format!("camera '{}': impossible field of view {:?}", camera.name, camera.projection));
    }
    let axes = Mat3::from_cols(right.as_vec3(), up.as_vec3(), back.as_vec3());
    Ok(Camera { position: position.as_vec3(), axes, ..camera.clone() })
}
