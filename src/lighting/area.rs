//! Light sources with area: single triangles, and rectangles made of two.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3, Vec2, Vec3};

use super::bilinear::{Bilinear, RectanglePoint, SeenRectangle};
use super::spherical::{Rectangle, Triangle, uniform_triangle};
use crate::backend::Hit;
use crate::scene::{Alpha, Material, Scene, TextureSlot};

/// How far from a right angle (cosine) and from a parallelogram (share of the shorter side) two triangles may be to count
/// as a rectangle.
const RECTANGLE_TOLERANCE: f64 = 1e-4;

/// Squared ratio of distance to radius beyond which points are chosen by area. From there (3e-4 sr when facing,
/// the limit of pbrt 4ed 6.5.4) the density per solid angle varies by less than a few percent over the light, and the
/// choice by area is exact and cheap. Lights that are small only because they are seen edge-on stay with the solid angle.
const FAR_SQUARED: f64 = 1e4;

/// Squared ratio of distance to radius beyond which points of a rectangle are chosen with a bilinear density. At 1.5 radii
/// that is off from the light that arrives by up to 20 %, at three by some percent; the uniform solid angle, which costs
/// several times as much, leaves out the cosine at the receiver.
const BILINEAR_SQUARED: f64 = 2.25;

/// Smallest solid angle that is sampled as such; the f64 formulas are good to about 1e-15 sr.
const MIN_SOLID_ANGLE: f64 = 1e-7;

/// A point that sees a light source under a hemisphere less this solid angle is on it, as far as positions tell: its
/// distance is less than about 1e-9 of the light's size.
const ON_THE_LIGHT: f64 = 1e-9;

/// Rounding error of a point that is computed in f32 from three corners and two weights, as a share of the largest coordinate: gamma(7) of
/// pbrt 4ed 6.8.4.
const POSITION_ROUNDING: f64 = 3.5 * f32::EPSILON as f64;

/// Texture samples along one side of a triangle, at most.
const MAX_TEXTURE_STEPS: u32 = 512;

/// An emitting triangle or rectangle.
#[derive(Clone, Debug)]
pub(super) struct AreaLight {
    /// First corner (of a rectangle: where the first triangle has its right angle).
    corner: DVec3,
    /// From the first corner to the second and third; counter-clockwise.
    edges: [DVec3; 2],
    /// Cross product of the edges.
    cross: DVec3,
    /// Centre of gravity, and the largest distance of a corner from it.
    centre: DVec3,
    radius: f64,
    /// Area, f64.
    area: f64,
    /// The triangle, or both of a rectangle (the second `Hit::NONE` for a triangle).
    pub triangles: [u32; 2],
    rough: Rough,
    /// What only rectangles have.
    rectangle: Option<RectangleFrame>,
    /// Mean emitted radiance.
    pub radiance: Vec3,
    /// Whether the radiance differs from point to point.
    varies: bool,
    /// Whether the clockwise side emits, too.
    pub both_faces: bool,
}

/// All that points of view need that are far enough, in single precision.
#[derive(Clone, Copy, Debug)]
struct Rough {
    corner: Vec3,
    edges: [Vec3; 2],
    cross: Vec3,
    centre: Vec3,
    /// Squared distances from the centre between which this is enough; none for triangles.
    distance_squared: [f32; 2],
    /// Least value of [`AreaLight::view`]'s `side` that tells on which side of the plane a point is: at a distance of zero, and its growth over
    /// the square of the distance.
    sharp: [f32; 2],
}

impl Rough {
    fn new(corner: DVec3, [e, f]: [DVec3; 2], centre: DVec3, radius: f64, rectangle: bool) -> Self {
        let cross = e.cross(f);
        // Coordinates of light and point are rounded by half a unit each, those of the latter no larger than the light's and their
        // distance d; ten more roundings follow. d < d^2 / r where this is used.
        let rounding = 16.0 * f64::from(f32::EPSILON) * cross.length();
        let reach = corner.abs().max((corner + e).abs()).max((corner + f).abs()).max((corner + e + f).abs());
        let squares = if rectangle { [BILINEAR_SQUARED, FAR_SQUARED].map(|d2| d2 * radius * radius) } else { [0.0; 2] };
        Rough {
            corner: corner.as_vec3(),
            edges: [e.as_vec3(), f.as_vec3()],
            cross: cross.as_vec3(),
            centre: centre.as_vec3(),
            distance_squared: [1.0001 * squares[0], 0.9999 * squares[1]].map(|d2| d2 as f32),
            sharp: [rounding * reach.length(), rounding / radius].map(|s| s as f32),
        }
    }

    /// The rectangle as seen from a point that is neither close nor afar nor near its plane.
    #[inline(always)]
    fn seen(&self, position: Vec3, normal: Vec3, both_faces: bool) -> Option<SeenRectangle> {
        let corner = self.corner - position;
        let d2 = (self.centre - position).length_squared();
        let side = -corner.dot(self.cross);
        let side = if both_faces { side.abs() } else { side };
        let [least, most] = self.distance_squared;
        let usable = d2 > least && d2 < most && side > self.sharp[0] + self.sharp[1] * d2;
        usable.then_some(SeenRectangle { corner, edges: self.edges, cross: self.cross, normal })
    }
}

/// What is known of a rectangle before it is seen from anywhere.
#[derive(Clone, Copy, Debug)]
struct RectangleFrame {
    /// Unit vectors along the edges.
    x: DVec3,
    y: DVec3,
    /// Unit normal of the counter-clockwise side.
    normal: DVec3,
    /// Lengths of the edges.
    lengths: [f64; 2],
    /// Which of its three corners each triangle has at its right angle.
    right_corner: [u8; 2],
}

/// A point on a light source.
#[derive(Clone, Copy, Debug)]
pub(super) struct AreaPoint {
    pub position: DVec3,
    pub triangle: u32,
    /// Barycentric weights of the triangle's second and third vertex.
    pub uv: Vec2,
}

/// A point on a light source as seen from where it lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub triangle: u32,
    /// Barycentric weights of the triangle's second and third vertex.
    pub uv: Vec2,
    /// Unit vector to the point. As good where the difference of the positions would be lost in rounding.
    pub direction: Vec3,
    pub distance: f32,
    /// Per solid angle.
    pub density: f64,
}

/// How points of a light source are chosen from one point of view.
#[derive(Clone, Copy, Debug)]
pub(super) enum View {
    /// From afar: uniformly by area.
    Area,
    /// A rectangle at some distance: with a bilinear density.
    Bilinear(SeenRectangle),
    /// From close by: uniformly by solid angle. On which side of its plane the point of view is, positive on the counter-clockwise one.
    SolidAngle(f64),
}

/// A light source that is close, as seen from the point of view.
#[derive(Clone, Copy, Debug)]
enum Near {
    /// Columns are the rectangle's axes and the direction from the point of view to its plane.
    Rectangle(Rectangle, DMat3),
    Triangle(Triangle),
}

impl AreaLight {
    /// Whether it is made of two triangles.
    pub(super) fn is_rectangle(&self) -> bool {
        self.rectangle.is_some()
    }

    /// Area in square scene units.
    pub(super) fn area(&self) -> f64 {
        self.area
    }

    /// Unit normal of the counter-clockwise side.
    pub(super) fn normal(&self) -> DVec3 {
        self.cross.normalize_or_zero()
    }

    /// First corner.
    #[cfg(test)]
    pub(super) fn first_corner(&self) -> DVec3 {
        self.corner
    }

    /// Centre of gravity and largest distance from it.
    pub(super) fn sphere(&self) -> (Vec3, f32) {
        (self.centre.as_vec3(), self.radius as f32)
    }

    /// Corner points.
    pub(super) fn corners(&self) -> impl Iterator<Item = Vec3> {
        let [e, f] = self.edges;
        let last = if self.is_rectangle() { e + f } else { f };
        [DVec3::ZERO, e, f, last].into_iter().map(move |o| (self.corner + o).as_vec3())
    }

    /// Radiance emitted at a point of one of its triangles.
    pub(super) fn radiance_at(&self, scene: &Scene, triangle: u32, uv: Vec2) -> Vec3 {
        if self.varies { emission(scene, triangle, uv.x, uv.y) } else { self.radiance }
    }

    /// A uniform point; continuous in `u` on rectangles.
    pub(super) fn uniform_point(&self, u: [f32; 2]) -> AreaPoint {
        let u = u.map(f64::from);
        self.at(if self.is_rectangle() { u } else { uniform_triangle(u) })
    }

    /// How points on it are chosen for `position` on a surface with unit `normal` (zero: from all around). `None` from the dark
    /// side and from edge-on.
    #[inline(always)]
    pub(super) fn view(&self, position: Vec3, normal: Vec3) -> Option<View> {
        match self.rough.seen(position, normal, self.both_faces) {
            Some(seen) => Some(View::Bilinear(seen)),
            None => self.view_exactly(position.as_dvec3(), normal),
        }
    }

    fn view_exactly(&self, position: DVec3, normal: Vec3) -> Option<View> {
        let corner = self.corner - position;
        let side = -corner.dot(self.cross);
        if !(side > 0.0 || (side < 0.0 && self.both_faces)) {
            return None;
        }
        let (d2, r2) = ((self.centre - position).length_squared(), self.radius * self.radius);
        Some(if d2 > FAR_SQUARED * r2 {
            View::Area
        } else if self.is_rectangle() && d2 > BILINEAR_SQUARED * r2 {
            // From that far away f32 is as good as the position is
            let Rough { edges, cross, .. } = self.rough;
            View::Bilinear(SeenRectangle { corner: corner.as_vec3(), edges, cross, normal })
        } else if side.abs() > self.rounding() {
            View::SolidAngle(side)
        } else {
            return None;
        })
    }

    /// [`AreaLight::view`]'s `side` up to which a point may lie in the light's own plane, but for the rounding of its coordinates. On a
    /// tilted light every other point of its own surface would otherwise see it from a hair's breadth, over half of all directions.
    fn rounding(&self) -> f64 {
        let [e, f] = self.edges;
        let reach = [e, f, e + f].into_iter().fold(self.corner.abs(), |reach, o| reach.max((self.corner + o).abs()));
        POSITION_ROUNDING * reach.dot(self.cross.abs())
    }

    /// A point as seen from `position`. `None` from edge-on.
    pub(super) fn sample(&self, position: DVec3, view: &View, u: [f32; 2]) -> Option<Seen> {
        match view {
            View::Bilinear(seen) => self.seen_bilinear(&seen.sample(u)),
            View::Area => self.sample_area(position, u),
            View::SolidAngle(side) => {
                let (near, angle) = self.near(self.corner - position, *side)?;
                // Also where NaN
                let sharp = angle >= MIN_SOLID_ANGLE;
                if sharp { Some(self.sample_near(position, near, angle, u)) } else { self.sample_area(position, u) }
            }
        }
    }

    /// Density per solid angle with which [`AreaLight::sample`] chooses the point at `offset` from `position`.
    pub(super) fn density(&self, position: Vec3, normal: Vec3, offset: DVec3) -> f64 {
        let by_area = || self.area_density(offset).unwrap_or(0.0);
        let view = self.view(position, normal);
        let position = position.as_dvec3();
        match view {
            None => 0.0,
            Some(View::Area) => by_area(),
            Some(View::Bilinear(seen)) => {
                let from_corner = position + offset - self.corner;
                let at = self.edges.map(|e| (from_corner.dot(e) / e.length_squared()).clamp(0.0, 1.0) as f32);
                by_area() * f64::from(Bilinear::new(seen.corner, seen.edges, normal).at(at))
            }
            Some(View::SolidAngle(side)) => match self.near(self.corner - position, side) {
                None => 0.0,
                Some((_, angle)) if angle >= MIN_SOLID_ANGLE => 1.0 / angle,
                Some(_) => by_area(),
            },
        }
    }

    /// A point chosen with a bilinear density. `None` from edge-on.
    pub(super) fn seen_bilinear(
        &self,
        &RectanglePoint { at, direction, distance, density }: &RectanglePoint,
    ) -> Option<Seen> {
        let (triangle, uv) = self.place(at.map(f64::from));
        let usable = density.is_finite() && density > 0.0;
        usable.then_some(Seen { triangle, uv, direction, distance, density: f64::from(density) })
    }

    fn sample_area(&self, position: DVec3, u: [f32; 2]) -> Option<Seen> {
        let point = self.uniform_point(u);
        let offset = point.position - position;
        Some(seen((point.triangle, point.uv), offset, self.area_density(offset)?))
    }

    fn sample_near(&self, position: DVec3, near: Near, angle: f64, u: [f32; 2]) -> Seen {
        let u = u.map(f64::from);
        match near {
            Near::Rectangle(rectangle, axes) => {
                let [x, y] = rectangle.sample(angle, u);
                let share = |v: f64, [v0, v1]: [f64; 2]| ((v - v0) / (v1 - v0)).clamp(0.0, 1.0);
                let place = self.place([share(x, rectangle.x), share(y, rectangle.y)]);
                seen(place, axes * DVec3::new(x, y, rectangle.z), 1.0 / angle)
            }
            Near::Triangle(triangle) => {
                let (direction, weights) = triangle.sample(angle, u);
                let distance = (self.corner - position).dot(self.cross) / direction.dot(self.cross);
                // No point is farther than the corners; a direction within rounding of the plane may say so (or NaN)
                let distance = distance.abs().min(triangle.farthest());
                seen(self.place(weights), distance * direction, 1.0 / angle)
            }
        }
    }

    fn area_density(&self, offset: DVec3) -> Option<f64> {
        let d2 = offset.length_squared();
        // area times cosine, without dividing by the length of the cross product
        let scale = if self.is_rectangle() { 1.0 } else { 0.5 };
        let projected = scale * offset.dot(self.cross).abs();
        let density = d2 * d2.sqrt() / projected;
        (density.is_finite() && density > 0.0).then_some(density)
    }

    /// What it looks like from close by, and its solid angle. `None` on the light itself.
    fn near(&self, corner: DVec3, side: f64) -> Option<(Near, f64)> {
        let (near, angle) = if let Some(RectangleFrame { x, y, normal, lengths, .. }) = self.rectangle {
            let (x0, y0) = (corner.dot(x), corner.dot(y));
            let z = corner.dot(normal).abs();
            let rectangle = Rectangle { x: [x0, x0 + lengths[0]], y: [y0, y0 + lengths[1]], z };
            let axes = DMat3::from_cols(x, y, -side.signum() * normal);
            (Near::Rectangle(rectangle, axes), rectangle.solid_angle())
        } else {
            let triangle = Triangle::new(corner, self.edges, self.cross);
            (Near::Triangle(triangle), triangle.solid_angle())
        };
        (angle <= TAU - ON_THE_LIGHT || angle.is_nan()).then_some((near, angle))
    }

    /// The point `corner + s e0 + t e1`.
    fn at(&self, [s, t]: [f64; 2]) -> AreaPoint {
        let (triangle, uv) = self.place([s, t]);
        AreaPoint { position: self.corner + s * self.edges[0] + t * self.edges[1], triangle, uv }
    }

    /// Its triangle, and the barycentric weights of the triangle's second and third vertex.
    fn place(&self, [s, t]: [f64; 2]) -> (u32, Vec2) {
        let Some(frame) = &self.rectangle else {
            return (self.triangles[0], Vec2::new(s as f32, t as f32));
        };
        // Weights of the right-angled corner and, counter-clockwise, of the other two; the second half is the first, turned. Without a
        // branch that would go either way every other time
        let second = s + t > 1.0;
        let half = usize::from(second);
        let turned = |x: f64| if second { 1.0 - x } else { x };
        let (s, t) = (turned(s), turned(t));
        let weights = [1.0 - s - t, s, t];
        let right = usize::from(frame.right_corner[half]);
        let weight = |vertex: usize| weights[(vertex + 3 - right) % 3] as f32;
        (self.triangles[half], Vec2::new(weight(1), weight(2)))
    }
}

/// A point at `offset` from where it is seen.
fn seen((triangle, uv): (u32, Vec2), offset: DVec3, density: f64) -> Seen {
    let distance = offset.length();
    Seen { triangle, uv, direction: (offset / distance).as_vec3(), distance: distance as f32, density }
}

/// The light sources with area of a scene.
#[derive(Debug, Default)]
pub(super) struct AreaLights {
    pub lights: Vec<AreaLight>,
    /// For each object the first entry of `light_of`, or `Hit::NONE`.
    first: Vec<u32>,
    /// For each triangle of emitting objects its light, or `Hit::NONE`.
    light_of: Vec<u32>,
    /// Triangles of emitting materials without area or without light.
    pub dropped: usize,
}

impl AreaLights {
    /// Collects the emitting triangles and joins pairs to rectangles.
    pub(super) fn new(scene: &Scene) -> Self {
        let mut all = AreaLights::default();
        for object in &scene.mesh.objects {
            let material = &scene.materials[object.material as usize];
            if !material.is_emitter() {
                all.first.push(Hit::NONE);
                continue;
            }
            let first = all.light_of.len();
            all.first.push(first as u32);
            all.light_of.resize(first + object.triangles.len(), Hit::NONE);
            let mut lights: Vec<AreaLight> = Vec::new();
            for triangle in object.triangles.clone() {
                match triangle_light(scene, triangle) {
                    Some(light) => lights.push(light),
                    None => all.dropped += 1,
                }
            }
            for light in join_rectangles(scene, lights) {
                for triangle in light.triangles.into_iter().filter(|&t| t != Hit::NONE) {
                    all.light_of[first + (triangle - object.triangles.start) as usize] = all.lights.len() as u32;
                }
                all.lights.push(light);
            }
        }
        all
    }

    /// The light that `triangle` belongs to.
    pub(super) fn of_triangle(&self, scene: &Scene, triangle: u32) -> Option<usize> {
        let object = scene.mesh.object_of_triangle[triangle as usize] as usize;
        let first = self.first[object];
        if first == Hit::NONE {
            return None;
        }
        let offset = triangle - scene.mesh.objects[object].triangles.start;
        let light = self.light_of[(first + offset) as usize];
        (light != Hit::NONE).then_some(light as usize)
    }
}

/// A triangle of an emitting material as a light, unless it has no area or is black.
fn triangle_light(scene: &Scene, triangle: u32) -> Option<AreaLight> {
    let [a, b, c] = scene.mesh.corners(triangle).map(Vec3::as_dvec3);
    let edges = [b - a, c - a];
    let cross = edges[0].cross(edges[1]);
    let area = 0.5 * cross.length();
    let material = &scene.materials[scene.mesh.object(triangle).material as usize];
    let radiance = mean_radiance(scene, triangle);
    if !(area > 0.0 && area.is_finite() && radiance.max_element() > 0.0 && radiance.is_finite()) {
        return None;
    }
    let centre = (a + b + c) / 3.0;
    let radius = [a, b, c].into_iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
    Some(AreaLight {
        corner: a,
        edges,
        cross,
        rough: Rough::new(a, edges, centre, radius, false),
        centre,
        radius,
        area,
        triangles: [triangle, Hit::NONE],
        rectangle: None,
        radiance,
        varies: varies(material),
        both_faces: material.double_sided,
    })
}

/// Whether emission or presence differ from point to point.
fn varies(material: &Material) -> bool {
    material.emission_texture.is_some() || material.alpha != Alpha::Opaque
}

/// Radiance emitted at a point, weighted with the probability that the surface is there: shadow rays end before it, and
/// do not ask.
fn emission(scene: &Scene, triangle: u32, u: f32, v: f32) -> Vec3 {
    scene.emission(triangle, u, v) * scene.opacity(triangle, u, v)
}

/// Mean of the radiance emitted by a triangle: one sample a texel along its sides.
fn mean_radiance(scene: &Scene, triangle: u32) -> Vec3 {
    let material = scene.material(triangle);
    if !varies(material) {
        return material.emission;
    }
    let side_in_texels = |slot: &TextureSlot| {
        let texture = &scene.textures[slot.texture as usize];
        let size = Vec2::new(texture.width as f32, texture.height as f32);
        let at = |u, v| slot.transform.transform_point2(scene.uv(slot.uv_set, triangle, u, v)) * size;
        let (a, b, c) = (at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0));
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    };
    let alpha = material.base_color_texture.as_ref().filter(|_| material.alpha != Alpha::Opaque);
    let side = material.emission_texture.iter().chain(alpha).map(side_in_texels).fold(1.0, f32::max);
    let steps = (side.ceil() as u32).min(MAX_TEXTURE_STEPS);
    // Centres of steps^2 congruent triangles, the upright ones and those upside down
    let mut sum = DVec3::ZERO;
    for i in 0..steps {
        for j in 0..steps - i {
            let at = |o: f32| {
                let scale = 1.0 / steps as f32;
                emission(scene, triangle, (i as f32 + o) * scale, (j as f32 + o) * scale).as_dvec3()
            };
            sum += at(1.0 / 3.0);
            if i + j + 1 < steps {
                sum += at(2.0 / 3.0);
            }
        }
    }
    (sum / f64::from(steps * steps)).as_vec3()
}

/// Joins pairs of lights of one object that make up a rectangle.
fn join_rectangles(scene: &Scene, lights: Vec<AreaLight>) -> Vec<AreaLight> {
    // The two halves of a rectangle share their hypotenuse; sorting brings them together. Positions, not indices:
    // files often repeat vertices
    let mut diagonals: Vec<([[u32; 3]; 2], usize, u8)> = Vec::new();
    for (i, light) in lights.iter().enumerate() {
        let corners = scene.mesh.corners(light.triangles[0]);
        if let Some(right) = right_corner(corners) {
            let key = |k: usize| corners[(usize::from(right) + k) % 3].to_array().map(|c| (c + 0.0).to_bits());
            let (p, q) = (key(1), key(2));
            diagonals.push(([p.min(q), p.max(q)], i, right));
        }
    }
    diagonals.sort_unstable();
    let mut partner: Vec<Option<(usize, [u8; 2])>> = vec![None; lights.len()];
    let mut i = 0;
    while i + 1 < diagonals.len() {
        let ((key, first, right), (other_key, second, other_right)) = (diagonals[i], diagonals[i + 1]);
        let pair = [(first, right), (second, other_right)];
        if key == other_key && is_rectangle(scene, pair.map(|(l, r)| (lights[l].triangles[0], r))) {
            partner[first] = Some((second, [right, other_right]));
            partner[second] = Some((first, [other_right, right]));
            i += 1;
        }
        i += 1;
    }
    let mut joined = Vec::with_capacity(lights.len());
    for (i, light) in lights.iter().enumerate() {
        match partner[i] {
            None => joined.push(light.clone()),
            Some((other, right_corner)) if i < other => {
                joined.push(rectangle_light(scene, light, &lights[other], right_corner));
            }
            Some(_) => {}
        }
    }
    joined
}

/// The corner with a right angle.
fn right_corner(corners: [Vec3; 3]) -> Option<u8> {
    let p = corners.map(Vec3::as_dvec3);
    (0..3_u8).find(|&k| {
        let at = |i: usize| p[(usize::from(k) + i) % 3];
        let (e, f) = (at(1) - at(0), at(2) - at(0));
        e.dot(f).abs() <= RECTANGLE_TOLERANCE * e.length() * f.length()
    })
}

/// Whether two right-angled triangles with a common hypotenuse make up a rectangle that emits to one side.
fn is_rectangle(scene: &Scene, halves: [(u32, u8); 2]) -> bool {
    let [[a, b, c], [d, e, f]] = halves.map(|(triangle, right)| {
        let corners = scene.mesh.corners(triangle).map(Vec3::as_dvec3);
        [0, 1, 2].map(|k| corners[(usize::from(right) + k) % 3])
    });
    // Counter-clockwise both, the common edge runs the other way in the second
    let same_side = b == f && c == e;
    let tolerance = RECTANGLE_TOLERANCE * a.distance(b).min(a.distance(c));
    same_side && (b + c - a).distance(d) <= tolerance
}

fn rectangle_light(scene: &Scene, first: &AreaLight, second: &AreaLight, right_corner: [u8; 2]) -> AreaLight {
    let corners = scene.mesh.corners(first.triangles[0]).map(Vec3::as_dvec3);
    let [a, b, c] = [0, 1, 2].map(|k| corners[(usize::from(right_corner[0]) + k) % 3]);
    let edges = [b - a, c - a];
    let cross = edges[0].cross(edges[1]);
    let mean = (first.radiance.as_dvec3() * first.area + second.radiance.as_dvec3() * second.area)
        / (first.area + second.area);
    let lengths = edges.map(DVec3::length);
    let x = edges[0] / lengths[0];
    let normal = cross.normalize();
    let (centre, radius) = (0.5 * (b + c), 0.5 * b.distance(c));
    AreaLight {
        corner: a,
        edges,
        cross,
        rough: Rough::new(a, edges, centre, radius, true),
        centre,
        radius,
        area: cross.length(),
        triangles: [first.triangles[0], second.triangles[0]],
        rectangle: Some(RectangleFrame { x, y: normal.cross(x), normal, lengths, right_corner }),
        radiance: mean.as_vec3(),
        varies: first.varies,
        both_faces: first.both_faces,
    }
}
