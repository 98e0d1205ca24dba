//! The scene: meshes, nodes that place them, materials and cameras.

use glam::{Affine3A, Quat, Vec3};

use crate::flight::Flight;
use crate::paint::Paint;
use crate::shape::Shape;
use crate::surfaces::{cross, surfaces, weld};

/// Triangles of one material, ready to be written.
#[derive(Clone, Debug)]
pub struct Primitive {
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Positions, welded except where normals differ.
    pub positions: Vec<Vec3>,
    /// Unit normals, or empty when every surface is flat.
    pub normals: Vec<Vec3>,
    /// Triangles, none degenerate.
    pub triangles: Vec<[u32; 3]>,
    /// How many surfaces they form.
    pub surfaces: u32,
}

/// A named mesh.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Name.
    pub name: String,
    /// One a material.
    pub primitives: Vec<Primitive>,
}

/// Where a node stands relative to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub translation: Vec3,
    /// Unit quaternion.
    pub rotation: Quat,
    /// Scale along the own axes.
    pub scale: Vec3,
}

impl Pose {
    /// Moved only.
    pub fn at(x: f32, y: f32, z: f32) -> Self {
        Pose { translation: Vec3::new(x, y, z), rotation: Quat::IDENTITY, scale: Vec3::ONE }
    }

    /// Turned about its own y axis (counter-clockwise from above, radians) before what it already does.
    pub fn yaw(self, angle: f32) -> Self {
        self.turned(Quat::from_rotation_y(angle))
    }

    /// Turned about its own x axis.
    pub fn pitch(self, angle: f32) -> Self {
        self.turned(Quat::from_rotation_x(angle))
    }

    /// Turned about its own z axis.
    pub fn roll(self, angle: f32) -> Self {
        self.turned(Quat::from_rotation_z(angle))
    }

    /// Turned by a quaternion before what it already does.
    pub fn turned(mut self, rotation: Quat) -> Self {
        self.rotation = (self.rotation * rotation).normalize();
        self
    }

    /// Scaled along its own axes.
    pub fn scaled(mut self, scale: Vec3) -> Self {
        self.scale *= scale;
        self
    }

    /// As a map.
    pub fn map(&self) -> Affine3A {
        Affine3A::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// A node: a group or a placed mesh.
#[derive(Clone, Debug)]
pub struct Node {
    /// Name.
    pub name: String,
    /// Relative to the parent.
    pub pose: Pose,
    /// Index into [`Scene::meshes`].
    pub mesh: Option<usize>,
    /// Index into [`Scene::nodes`], smaller than its own.
    pub parent: Option<usize>,
}

/// A camera, looking from a point at a point.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name.
    pub name: &'static str,
    /// Eye, metres.
    pub eye: Vec3,
    /// What it looks at.
    pub target: Vec3,
    /// Full vertical field of view, degrees.
    pub y_fov: f32,
    /// Width over height.
    pub aspect: f32,
}

/// Everything.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Materials, in order of first use.
    pub materials: Vec<Paint>,
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Nodes, parents first.
    pub nodes: Vec<Node>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// What moves the last of them.
    pub flight: Option<Flight>,
}

impl Scene {
    /// Adds a camera that flies from one camera to another.
    pub fn fly(&mut self, from: usize, to: usize) {
        let flight = Flight::between(&self.cameras[from], &self.cameras[to]);
        self.cameras.push(flight.camera.clone());
        self.flight = Some(flight);
    }

    /// Index of a material, added when new.
    pub fn material(&mut self, paint: Paint) -> usize {
        self.materials.iter().position(|known| known.name == paint.name).unwrap_or_else(|| {
            self.materials.push(paint);
            self.materials.len() - 1
        })
    }

    /// Finishes a mesh: one primitive a paint, welded, with normals where it curves.
    pub fn mesh(&mut self, name: &str, parts: impl IntoIterator<Item = (Paint, Shape)>) -> usize {
        let mut by_material: Vec<(usize, Shape)> = Vec::new();
        for (paint, shape) in parts {
            let material = self.material(paint);
            match by_material.iter_mut().find(|(m, _)| *m == material) {
                Some((_, all)) => all.join(shape),
                None => by_material.push((material, shape)),
            }
        }
        let primitives = by_material.into_iter().map(|(material, shape)| finish(material, &shape)).collect();
        self.meshes.push(Mesh { name: name.into(), primitives });
        self.meshes.len() - 1
    }

    /// Adds a group.
    pub fn group(&mut self, parent: Option<usize>, name: &str, pose: Pose) -> usize {
        self.nodes.push(Node { name: name.into(), pose, mesh: None, parent });
        self.nodes.len() - 1
    }

    /// Places a mesh.
    pub fn place(&mut self, parent: Option<usize>, name: &str, mesh: usize, pose: Pose) -> usize {
        self.nodes.push(Node { name: name.into(), pose, mesh: Some(mesh), parent });
        self.nodes.len() - 1
    }

    /// World map of every node.
    pub fn world(&self) -> Vec<Affine3A> {
        let mut maps: Vec<Affine3A> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let own = node.pose.map();
            maps.push(node.parent.map_or(own, |parent| maps[parent] * own));
        }
        maps
    }

    /// Every placed primitive with its world map.
    pub fn instances(&self) -> impl Iterator<Item = (&Node, &Primitive, Affine3A)> {
        self.nodes.iter().zip(self.world()).flat_map(|(node, map)| {
            let primitives = node.mesh.map_or(&[][..], |mesh| &self.meshes[mesh].primitives);
            primitives.iter().map(move |primitive| (node, primitive, map))
        })
    }

    /// Triangles, every instance counted.
    pub fn triangle_count(&self) -> u64 {
        self.instances().map(|(_, primitive, _)| primitive.triangles.len() as u64).sum()
    }

    /// Surfaces, every instance counted.
    pub fn surface_count(&self) -> u64 {
        self.instances().map(|(_, primitive, _)| u64::from(primitive.surfaces)).sum()
    }
}

/// Welds, drops what has no area, counts surfaces and gives curved ones normals.
fn finish(material: usize, shape: &Shape) -> Primitive {
    let (positions, index) = weld(&shape.positions);
    let triangles: Vec<[u32; 3]> =
        shape.triangles.iter().map(|t| t.map(|i| index[i as usize])).filter(|&t| is_proper(&positions, t)).collect();
    let (surface, count) = surfaces(&positions, &triangles);
    let face: Vec<Vec3> = triangles.iter().map(|&t| cross(&positions, t).normalize_or_zero().as_vec3()).collect();
    let mut first = vec![u32::MAX; count as usize];
    let mut curved = false;
    for (t, &s) in surface.iter().enumerate() {
        let first = &mut first[s as usize];
        if *first == u32::MAX {
            *first = t as u32;
        }
        // Flat up to rounding: more than a tenth of a degree is a curve.
        curved |= face[t].dot(face[*first as usize]) < 0.1_f32.to_radians().cos();
    }
    if !curved {
        return Primitive { material, positions, normals: Vec::new(), triangles, surfaces: count };
    }
    // One vertex for each corner and surface; its normal averages the surface's triangles there, weighted by angle.
    let mut corners: Vec<(u32, u32, usize)> = (0..3 * triangles.len())
        .map(|corner| (triangles[corner / 3][corner % 3], surface[corner / 3], corner))
        .collect();
    corners.sort_unstable();
    let mut split = vec![[0; 3]; triangles.len()];
    let (mut out, mut normals) = (Vec::new(), Vec::new());
    for group in corners.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let normal: Vec3 =
            group.iter().map(|&(_, _, corner)| angle(&positions, &triangles, corner) * face[corner / 3]).sum();
        for &(_, _, corner) in group {
            split[corner / 3][corner % 3] = out.len() as u32;
        }
        out.push(positions[group[0].0 as usize]);
        normals.push(normal.try_normalize().unwrap_or(face[group[0].2 / 3]));
    }
    Primitive { material, positions: out, normals, triangles: split, surfaces: count }
}

/// Whether a triangle has three different corners and a height above the rounding of its coordinates.
fn is_proper(positions: &[Vec3], t: [u32; 3]) -> bool {
    let [a, b, c] = t.map(|i| positions[i as usize].as_dvec3());
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    longest > 0.0 && (b - a).cross(c - a).length() > 1e-7 * longest
}

fn angle(positions: &[Vec3], triangles: &[[u32; 3]], corner: usize) -> f32 {
    let t = triangles[corner / 3];
    let [p, q, r] = [0, 1, 2].map(|k| positions[t[(corner % 3 + k) % 3] as usize]);
    (q - p).angle_between(r - p)
}
