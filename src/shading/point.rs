//! Surface points with error bounds, and ray origins that stay on the right side.

use glam::{Mat3, Vec2, Vec3};

use crate::backend::Hit;
use crate::scene::{Plane, Scene, TextureSlot};

/// Unit roundoff of f32, 2^-24, with room for the rounding of the bound itself.
const ROUNDOFF: f32 = f32::EPSILON * 0.500_001;

/// Cosine of the largest angle between geometric and shading normal, 89 degrees.
const MIN_NORMAL_COSINE: f32 = 0.017_452_406;

/// Geometry of a point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position, recomputed from barycentrics.
    pub position: Vec3,
    /// Bound on the absolute error of `position` along each axis, and of a ray started there against the plane of
    /// its own triangle.
    pub error: Vec3,
    /// Unit geometric normal of the counter-clockwise face (not flipped towards the viewer).
    pub geometric_normal: Vec3,
    /// Unit shading normal on the side of `geometric_normal`, at most 89 degrees away from it.
    pub shading_normal: Vec3,
    /// Triangle.
    pub triangle: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
    /// Width over which textures may be averaged, scene units; zero reads them at the point.
    pub footprint: f32,
}

impl SurfacePoint {
    /// The point that `hit` names. `hit` must be a hit on `scene.mesh`.
    #[inline]
    pub fn new(scene: &Scene, hit: &Hit) -> Self {
        let mesh = &scene.mesh;
        let plane = &mesh.planes[hit.triangle as usize];
        let (position, error) = locate(mesh.corners(hit.triangle), plane, hit.u, hit.v);
        let geometric_normal = plane.normal;
        let mut shading_normal = geometric_normal;
        if !plane.flat {
            let [a, b, c] = mesh.triangles[hit.triangle as usize];
            let [a, b, c] = [mesh.normals[a as usize], mesh.normals[b as usize], mesh.normals[c as usize]];
            shading_normal = ((1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c).normalize_or(geometric_normal);
            if shading_normal.dot(geometric_normal) < 0.0 {
                shading_normal = -shading_normal;
            }
        }
        let material = &scene.materials[mesh.object(hit.triangle).material as usize];
        if let Some(slot) = &material.normal_texture {
            let bent = mapped_normal(scene, hit, slot, material.normal_scale, shading_normal);
            // What is bent below the surface stays unbent
            shading_normal = bent.filter(|n| n.dot(geometric_normal) > 0.0).unwrap_or(shading_normal);
        }
        SurfacePoint {
            position,
            error,
            geometric_normal,
            shading_normal: within_limit(shading_normal, geometric_normal),
            triangle: hit.triangle,
            u: hit.u,
            v: hit.v,
            footprint: 0.0,
        }
    }

    /// The point at `u`, `v` of a triangle with the given corners, which need not belong to a scene: flat.
    /// `triangle` is only stored.
    pub fn flat(corners: [Vec3; 3], triangle: u32, u: f32, v: f32) -> Self {
        Self::on_plane(corners, &Plane::of(corners), triangle, u, v)
    }

    /// As [`SurfacePoint::flat`], with the plane of the corners known.
    pub fn on_plane(corners: [Vec3; 3], plane: &Plane, triangle: u32, u: f32, v: f32) -> Self {
        let (position, error) = locate(corners, plane, u, v);
        SurfacePoint {
            position,
            error,
            geometric_normal: plane.normal,
            shading_normal: plane.normal,
            triangle,
            u,
            v,
            footprint: 0.0,
        }
    }

    /// The shading normal on the side of the surface that `outgoing` points to.
    pub fn shading_normal_towards(&self, outgoing: Vec3) -> Vec3 {
        if self.geometric_normal.dot(outgoing) > 0.0 { self.shading_normal } else { -self.shading_normal }
    }

    /// What the inside of a solid leaves of light that came through it to this point along `distance` and is seen from
    /// `outgoing`: less than one only where that is behind the surface of something that absorbs.
    #[inline]
    pub fn absorption(&self, scene: &Scene, outgoing: Vec3, distance: f32) -> Vec3 {
        // The side first: it is at hand, the material is not.
        let behind = outgoing.dot(self.geometric_normal) < 0.0;
        let material = behind.then(|| scene.material(self.triangle)).filter(|material| material.absorbs());
        material.map_or(Vec3::ONE, |material| material.left_after(distance))
    }

    /// Origin for a ray that leaves into `direction`: moved along the geometric normal to the side of `direction`
    /// by the error bound, and rounded away from the surface (pbrt 4ed 6.8.6).
    #[inline]
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        let n = self.geometric_normal;
        let distance = n.abs().dot(self.error);
        let offset = if direction.dot(n) < 0.0 { -distance * n } else { distance * n };
        let away = |origin: f32, offset: f32| {
            if offset > 0.0 {
                origin.next_up()
            } else if offset < 0.0 {
                origin.next_down()
            } else {
                origin
            }
        };
        let origin = self.position + offset;
        Vec3::new(away(origin.x, offset.x), away(origin.y, offset.y), away(origin.z, offset.z))
    }
}

/// `normal` as the normal map bends it at a hit; `None` where texture coordinates span no area.
fn mapped_normal(scene: &Scene, hit: &Hit, slot: &TextureSlot, scale: f32, normal: Vec3) -> Option<Vec3> {
    let coordinates = scene.mesh.uvs.get(usize::from(slot.uv_set)).filter(|uvs| !uvs.is_empty())?;
    let [a, b, c] = scene.mesh.triangles[hit.triangle as usize].map(|i| coordinates[i as usize]);
    let [duv1, duv2] = [b - a, c - a].map(|d| slot.transform.transform_vector2(d));
    let [a, b, c] = scene.mesh.corners(hit.triangle);
    let frame = texture_frame(normal, [b - a, c - a], [duv1, duv2])?;

    let map = 2.0 * scene.texture(slot, hit.triangle, hit.u, hit.v).truncate() - Vec3::ONE;
    (frame * Vec3::new(map.x * scale, map.y * scale, map.z)).try_normalize()
}

/// Position and error bound at barycentric weights `u` and `v` of the second and third corner.
///
/// Evaluated in f64, so that the position's own error is its rounding to f32.
fn locate(corners: [Vec3; 3], plane: &Plane, u: f32, v: f32) -> (Vec3, Vec3) {
    // Not `map`, which compilers make a call of.
    let (a, b, c) = (corners[0].as_dvec3(), corners[1].as_dvec3(), corners[2].as_dvec3());
    let position = (a + f64::from(u) * (b - a) + f64::from(v) * (c - a)).as_vec3();
    let rounding = ROUNDOFF * position.abs() + plane.interpolation;
    (position, rounding + plane.clearance * plane.normal.abs())
}

/// Axes of a normal map on a triangle with these edges in space and in texture coordinates: x along u, y up in the
/// image, which is against v, z along `normal`.
fn texture_frame(normal: Vec3, edges: [Vec3; 2], uv_edges: [Vec2; 2]) -> Option<Mat3> {
    let area = uv_edges[0].perp_dot(uv_edges[1]);
    if area == 0.0 {
        return None;
    }
    let along_u = (edges[0] * uv_edges[1].y - edges[1] * uv_edges[0].y) * area.signum();
    let tangent = (along_u - normal * normal.dot(along_u)).try_normalize()?;
    // Seen from the front, an image that is not mirrored has v clockwise from u: negative area.
    Some(Mat3::from_cols(tangent, normal.cross(tangent) * -area.signum(), normal))
}

/// `normal`, turned towards `geometric` until it is at most 89 degrees away.
fn within_limit(normal: Vec3, geometric: Vec3) -> Vec3 {
    if normal.dot(geometric) >= MIN_NORMAL_COSINE {
        return normal;
    }
    let tangent = (normal - geometric * normal.dot(geometric)).normalize_or_zero();
    let sine = (1.0 - MIN_NORMAL_COSINE * MIN_NORMAL_COSINE).sqrt();
    (geometric * MIN_NORMAL_COSINE + tangent * sine).normalize_or(geometric)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, uniform_sphere, unit};
    use crate::scene::Material;
    use crate::shading::testing::scene_of;

    /// Moeller and Trumbore 1997, in f32, both faces; the ray parameter where `0 <= t`.
    fn moeller_trumbore([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(e2);
        let inverse = 1.0 / e1.dot(p);
        let s = origin - a;
        let u = s.dot(p) * inverse;
        let q = s.cross(e1);
        let v = direction.dot(q) * inverse;
        let t = e2.dot(q) * inverse;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t.is_finite()).then_some(t)
    }

    /// The edge test in Pluecker coordinates relative to the origin, in f32, both faces.
    fn pluecker([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
        let [v0, v1, v2] = [a - origin, b - origin, c - origin];
        let (e0, e1, e2) = (v2 - v0, v0 - v1, v1 - v2);
        let u = (v2 + v0).cross(e0).dot(direction);
        let v = (v0 + v1).cross(e1).dot(direction);
        let w = (v1 + v2).cross(e2).dot(direction);
        let slack = f32::EPSILON * (u + v + w).abs();
        let inside = u.min(v).min(w) >= -slack || u.max(v).max(w) <= slack;
        let n = e0.cross(e1);
        let t = v0.dot(n) / n.dot(direction);
        (inside && t >= 0.0 && t.is_finite()).then_some(t)
    }

    fn random(keys: &[u32]) -> f32 {
        unit(hash_all(keys))
    }

    /// A triangle whose coordinates spread over 16 decades, as in pbrt's Triangle.Reintersect.
    fn wild_triangle(seed: u32) -> [Vec3; 3] {
        std::array::from_fn(|vertex| {
            Vec3::from_array(std::array::from_fn(|axis| {
                let key = [seed, vertex as u32, axis as u32];
                let size = 10.0_f32.powf(-8.0 + 16.0 * random(&[1, key[0], key[1], key[2]]));
                if random(&[2, key[0], key[1], key[2]]) < 0.5 { -size } else { size }
            }))
        })
    }

    fn barycentrics(seed: u32) -> (f32, f32) {
        let (r, s) = (random(&[3, seed]).sqrt(), random(&[4, seed]));
        (1.0 - r, s * r)
    }

    #[test]
    fn no_ray_hits_the_triangle_it_leaves() {
        let mut rays = 0;
        for seed in 0..1000 {
            // Every third one a shape as in rooms, at a distance from the origin.
            let corners = if seed % 3 == 0 {
                std::array::from_fn(|i| {
                    let r = |k| random(&[5, seed, i as u32, k]);
                    Vec3::new(10.0 + 4.0 * r(0), -3.0 + 4.0 * r(1), 8.0 + 0.1 * r(2))
                })
            } else {
                wild_triangle(seed)
            };
            let scene = scene_of(corners, Material::default());
            if scene.mesh.normal(0) == Vec3::ZERO {
                continue;
            }
            for k in 0..500 {
                let key = hash_all(&[seed, k]);
                let (u, v) = barycentrics(key);
                let point = SurfacePoint::new(&scene, &Hit { t: 1.0, u, v, triangle: 0 });
                let mut direction = uniform_sphere(Vec2::new(random(&[6, key]), random(&[7, key])));
                if k % 4 == 0 {
                    // Grazing rays are where the sign of the determinant is in doubt.
                    let n = point.geometric_normal;
                    let tilt = 1e-6 * (random(&[8, key]) - 0.5);
                    direction = (direction - n * n.dot(direction) + tilt * n).normalize();
                }
                let origin = point.ray_origin(direction);
                let moeller = moeller_trumbore(corners, origin, direction);
                assert_eq!(moeller, None, "Moeller-Trumbore, {corners:?}, {point:?}, {direction}");
                assert_eq!(pluecker(corners, origin, direction), None, "Pluecker, {corners:?}, {point:?}, {direction}");
                rays += 1;
            }
        }
        assert!(rays > 400_000);
    }

    #[test]
    fn the_tests_above_can_hit() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let (origin, direction) = (Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
        assert_eq!(moeller_trumbore(corners, origin, direction), Some(1.0));
        assert_eq!(pluecker(corners, origin, direction), Some(1.0));
    }

    /// Two sheets 1e-4 apart at coordinates of 10: a ray that leaves one inwards must meet the other.
    #[test]
    fn thin_walls_do_not_leak() {
        for seed in 0..300 {
            // An axis-aligned wall, then tilted ones.
            let normal = if seed < 100 {
                [Vec3::X, Vec3::Y, Vec3::Z][seed as usize % 3]
            } else {
                uniform_sphere(Vec2::new(random(&[11, seed]), random(&[12, seed])))
            };
            let frame = crate::sampling::basis(normal);
            let centre = Vec3::new(10.0, -9.0, 8.0);
            let near = [(-3.0, -3.0), (3.0, -3.0), (0.0, 3.0)].map(|(x, y)| centre + frame * Vec3::new(x, y, 0.0));
            let far = near.map(|p| p - 1e-4 * normal);
            let scene = scene_of(near, Material::default());
            for k in 0..100 {
                let (u, v) = (0.2 + 0.2 * random(&[13, seed, k]), 0.2 + 0.2 * random(&[14, seed, k]));
                let point = SurfacePoint::new(&scene, &Hit { t: 1.0, u, v, triangle: 0 });
                let mut direction = uniform_sphere(Vec2::new(random(&[15, seed, k]), random(&[16, seed, k])));
                if direction.dot(normal) > 0.0 {
                    direction = -direction;
                }
                if direction.dot(normal) > -0.01 {
                    continue;
                }
                let origin = point.ray_origin(direction);
                assert!(moeller_trumbore(far, origin, direction).is_some(), "{normal} {direction} {point:?}");
                assert!(pluecker(far, origin, direction).is_some(), "{normal} {direction} {point:?}");
            }
        }
    }

    #[test]
    fn position_error_is_bounded() {
        for seed in 0..2000 {
            let mut corners = wild_triangle(seed);
            if seed % 2 == 0 {
                // In a plane along the axes the bound is that of the position alone.
                corners[1].z = corners[0].z;
                corners[2].z = corners[0].z;
            }
            let (u, v) = barycentrics(seed);
            let scene = scene_of(corners, Material::default());
            let point = SurfacePoint::new(&scene, &Hit { t: 1.0, u, v, triangle: 0 });
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            let exact = (1.0 - f64::from(u) - f64::from(v)) * a + f64::from(u) * b + f64::from(v) * c;
            let off = (point.position.as_dvec3() - exact).abs();
            assert!(off.cmple(point.error.as_dvec3()).all(), "{corners:?}: off {off}, bound {}", point.error);
        }
    }

    #[test]
    fn shading_normal_is_interpolated_on_the_geometric_side() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mut scene = scene_of(corners, Material::default());
        let hit = Hit { t: 1.0, u: 0.25, v: 0.25, triangle: 0 };
        assert_eq!(SurfacePoint::new(&scene, &hit).shading_normal, Vec3::Z);
        let tilted = Vec3::new(0.6, 0.0, 0.8);
        scene.mesh.normals = vec![-tilted; 3];
        scene.mesh.measure();
        assert!((SurfacePoint::new(&scene, &hit).shading_normal - tilted).length() < 1e-6);
        scene.mesh.normals = vec![tilted, tilted, Vec3::ZERO];
        scene.mesh.measure();
        assert_eq!(SurfacePoint::new(&scene, &hit).shading_normal, Vec3::Z);
        scene.mesh.normals = vec![Vec3::X; 3];
        scene.mesh.measure();
        let limited = SurfacePoint::new(&scene, &hit).shading_normal;
        assert!((limited.z - MIN_NORMAL_COSINE).abs() < 1e-6 && limited.is_normalized());
    }

    #[test]
    fn normal_map_axes_follow_the_image() {
        // A unit square seen from +z with the image upright on it: v runs down.
        let upright = |x: f32, y: f32| Vec2::new(x, 1.0 - y);
        let uv_edges = [upright(1.0, 0.0) - upright(0.0, 0.0), upright(0.0, 1.0) - upright(0.0, 0.0)];
        assert_eq!(texture_frame(Vec3::Z, [Vec3::X, Vec3::Y], uv_edges), Some(Mat3::IDENTITY));
        // Mirrored: u runs to the left, up stays up.
        let mirrored = uv_edges.map(|d| Vec2::new(-d.x, d.y));
        let expected = Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::Z);
        assert_eq!(texture_frame(Vec3::Z, [Vec3::X, Vec3::Y], mirrored), Some(expected));
        assert_eq!(texture_frame(Vec3::Z, [Vec3::X, Vec3::Y], [Vec2::ONE; 2]), None);
    }
}
