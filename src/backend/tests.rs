//! Both backends against brute force in f64, and against each other.

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec3, Vec2};

use super::compare::{Comparison, compare};
use super::embree::EmbreeBackend;
use super::obvhs::ObvhsBackend;
use super::*;
use crate::sampling::{hash_all, uniform_sphere, unit};

const COHERENCES: [Coherence; 2] = [Coherence::Coherent, Coherence::Incoherent];
const VISIBLES: [Visible; 3] = [Visible::All, Visible::WithoutPanes, Visible::OnlyPanes];

fn backends() -> Vec<Box<dyn RayBackend>> {
    vec![Box::new(EmbreeBackend::new(1).unwrap()), Box::new(ObvhsBackend)]
}

/// Uniform number in [0, 1), named by what it is for.
fn random(key: &[u32]) -> f32 {
    unit(hash_all(key))
}

fn random_in_cube(seed: u32, index: u32, what: u32) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|axis| 2.0 * random(&[seed, index, what, axis]) - 1.0))
}

fn random_direction(seed: u32, index: u32) -> Vec3 {
    uniform_sphere(Vec2::new(random(&[seed, index, 100]), random(&[seed, index, 101])))
}

struct Soup {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<Part>,
    filter: Option<Arc<dyn HitFilter>>,
}

impl Soup {
    /// Triangles in a cube of half-width `scale`, their sizes over four decades below that.
    fn random(seed: u32, count: u32, scale: f32, kinds: &[PartKind]) -> Soup {
        let mut positions = Vec::new();
        for i in 0..count {
            let size = scale * 10f32.powf(-4.0 * random(&[seed, i, 0]));
            let centre = random_in_cube(seed, i, 1) * scale;
            positions.extend([2, 3, 4].map(|corner| centre + random_in_cube(seed, i, corner) * size));
        }
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let share = count / kinds.len() as u32;
        let parts = (0u32..)
            .zip(kinds)
            .map(|(i, &kind)| {
                let end = if i as usize + 1 == kinds.len() { count } else { (i + 1) * share };
                Part { triangles: i * share..end, kind }
            })
            .collect();
        Soup { positions, triangles, parts, filter: Some(Arc::new(Halves)) }
    }

    fn cube() -> Soup {
        let positions =
            (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)).collect::<Vec<_>>();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<_> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let parts = vec![Part { triangles: 0..12, kind: PartKind::Opaque }];
        Soup { positions, triangles, parts, filter: None }
    }

    fn set(&self) -> TriangleSet<'_> {
        TriangleSet {
            positions: &self.positions,
            triangles: &self.triangles,
            parts: &self.parts,
            filter: self.filter.clone(),
        }
    }

    /// Half of them towards a triangle's middle, the others anywhere; some shorter than it takes.
    fn rays(&self, seed: u32, count: u32, scale: f32) -> Vec<Ray> {
        (0..count)
            .map(|i| {
                let origin = random_in_cube(seed, i, 10) * 2.0 * scale;
                let target = hash_all(&[seed, i, 11]) as usize % self.triangles.len();
                let middle =
                    self.triangles[target].map(|v| self.positions[v as usize]).iter().copied().sum::<Vec3>() / 3.0;
                let direction = if i % 2 == 0 { (middle - origin).normalize() } else { random_direction(seed, i) };
                let mut ray = Ray::new(origin, direction);
                if i % 5 == 0 {
                    ray.t_near = random(&[seed, i, 12]) * scale;
                    ray.t_far = ray.t_near + random(&[seed, i, 13]) * 3.0 * scale;
                }
                ray
            })
            .collect()
    }
}

/// Accepts half of each triangle.
struct Halves;

impl HitFilter for Halves {
    fn accepts(&self, triangle: u32, u: f32, v: f32) -> bool {
        (u < v) == (triangle % 2 == 0)
    }
}

/// Every ray against every triangle (Möller & Trumbore 1997, in f64).
struct Brute<'a>(TriangleSet<'a>);

impl Brute<'_> {
    fn trace(&self, ray: &Ray, visible: Visible) -> Hit {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut best = Hit::MISS;
        for part in self.0.parts {
            match (visible, part.kind) {
                (Visible::OnlyPanes, PartKind::Pane) | (Visible::All, _) => {}
                (Visible::OnlyPanes, _) | (Visible::WithoutPanes, PartKind::Pane) => continue,
                (Visible::WithoutPanes, _) => {}
            }
            for triangle in part.triangles.clone() {
                let [a, b, c]: [DVec3; 3] =
                    self.0.triangles[triangle as usize].map(|v| self.0.positions[v as usize].as_dvec3());
                let (ab, ac) = (b - a, c - a);
                let p = direction.cross(ac);
                let det = ab.dot(p);
                let s = origin - a;
                let q = s.cross(ab);
                let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, ac.dot(q) / det);
                if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0) {
                    continue;
                }
                if t < ray.t_near.into() || t > ray.t_far.into() || t >= best.t.into() {
                    continue;
                }
                // det is positive when the ray arrives against the normal.
                let counts = match part.kind {
                    PartKind::OneSided => det >= 0.0,
                    PartKind::Filtered => {
                        self.0.filter.as_ref().is_none_or(|f| f.accepts(triangle, u as f32, v as f32))
                    }
                    PartKind::Opaque | PartKind::Pane => true,
                };
                if counts {
                    best = Hit { t: t as f32, u: u as f32, v: v as f32, triangle };
                }
            }
        }
        best
    }
}

impl RayScene for Brute<'_> {
    fn closest(&self, rays: &[Ray], visible: Visible, _: Coherence, hits: &mut [Hit]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.trace(ray, visible);
        }
    }

    fn occluded(&self, rays: &[Ray], visible: Visible, _: Coherence, occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.trace(ray, visible).is_hit();
        }
    }

    fn memory_bytes(&self) -> usize {
        0
    }
}

fn closest(scene: &dyn RayScene, ray: Ray) -> Hit {
    let mut hit = [Hit::MISS];
    scene.closest(&[ray], Visible::All, Coherence::Incoherent, &mut hit);
    hit[0]
}

#[track_caller]
fn assert_explained(result: &Comparison, context: &str) {
    assert_eq!(result.unexplained, 0, "{context}: {result:#?}");
    assert_eq!(result.misses + result.identical + result.tied + result.borderline, result.rays, "{context}");
}

#[test]
fn distance_and_barycentric_weights() {
    let positions = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)];
    let parts = [Part { triangles: 0..1, kind: PartKind::Opaque }];
    let set = TriangleSet { positions: &positions, triangles: &[[0, 1, 2]], parts: &parts, filter: None };
    for backend in backends() {
        let scene = backend.build(&set).unwrap();
        let hit = closest(&*scene, Ray::new(Vec3::new(0.75, -0.5, 3.0), Vec3::NEG_Z));
        assert_eq!(hit.triangle, 0, "{}", backend.name());
        // Embree multiplies with a reciprocal that is good to two units in the last place.
        for (value, exact) in [(hit.t, 3.0), (hit.u, 0.625), (hit.v, 0.25)] {
            assert!((value - exact).abs() <= 4.0 * f32::EPSILON * exact, "{}: {hit:?}", backend.name());
        }
        assert!(scene.memory_bytes() > 0, "{}", backend.name());
    }
}

#[test]
fn soups_of_all_scales_agree_with_brute_force() {
    let kinds = [PartKind::Opaque, PartKind::OneSided, PartKind::Filtered, PartKind::Pane];
    for backend in backends() {
        for (seed, scale) in (0..).zip([1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9]) {
            let soup = Soup::random(seed, 400, scale, &kinds);
            let set = soup.set();
            let scene = backend.build(&set).unwrap();
            let rays = soup.rays(seed, 2000, scale);
            for visible in VISIBLES {
                for coherence in COHERENCES {
                    let result = compare(&rays, visible, coherence, &*scene, &Brute(set.clone()), &set);
                    let context = format!("{}, scale {scale}, {visible:?}, {coherence:?}", backend.name());
                    assert_explained(&result, &context);
                    assert!(result.identical > result.rays / 20, "{context}: hardly a hit in {result:?}");
                }
            }
        }
    }
}

#[test]
fn one_sided_triangles_stop_only_rays_from_the_front() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let parts = [Part { triangles: 0..1, kind: PartKind::OneSided }];
    let set = TriangleSet { positions: &positions, triangles: &[[0, 1, 2]], parts: &parts, filter: None };
    for backend in backends() {
        let scene = backend.build(&set).unwrap();
        // Counter-clockwise seen from +z.
        assert!(closest(&*scene, Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z)).is_hit(), "{}", backend.name());
        assert!(!closest(&*scene, Ray::new(Vec3::new(0.2, 0.2, -1.0), Vec3::Z)).is_hit(), "{}", backend.name());
    }
}

#[test]
fn the_interval_is_closed() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let parts = [Part { triangles: 0..1, kind: PartKind::Opaque }];
    let set = TriangleSet { positions: &positions, triangles: &[[0, 1, 2]], parts: &parts, filter: None };
    for backend in backends() {
        let scene = backend.build(&set).unwrap();
        let ray = |height: f32, t_near, t_far| Ray {
            origin: Vec3::new(0.25, 0.25, height),
            t_near,
            direction: Vec3::NEG_Z,
            t_far,
        };
        for (ray, expected) in [
            (ray(2.0, 2.0, 3.0), true),
            (ray(2.0, 1.0, 2.0), true),
            (ray(2.0, 2.001, 3.0), false),
            (ray(2.0, 1.0, 1.999), false),
            (ray(0.0, 0.0, 1.0), true),
            (ray(-0.5, -1.0, 1.0), false),
        ] {
            for coherence in COHERENCES {
                let mut hit = [Hit::MISS];
                let mut occluded = [false];
                scene.closest(&[ray], Visible::All, coherence, &mut hit);
                scene.occluded(&[ray], Visible::All, coherence, &mut occluded);
                let [hit] = hit;
                assert_eq!(
                    (hit.is_hit(), occluded),
                    (expected, [expected]),
                    "{} {coherence:?} {ray:?}",
                    backend.name()
                );
                assert!(!hit.is_hit() || (hit.t >= ray.t_near && hit.t <= ray.t_far), "{}: {hit:?}", backend.name());
            }
        }
    }
}

#[test]
fn nothing_is_hit_where_there_is_nothing() {
    let empty = TriangleSet { positions: &[], triangles: &[], parts: &[], filter: None };
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let parts = [Part { triangles: 0..0, kind: PartKind::Filtered }, Part { triangles: 0..0, kind: PartKind::Pane }];
    let empty_parts = TriangleSet { positions: &positions, triangles: &[], parts: &parts, filter: None };
    for backend in backends() {
        for set in [&empty, &empty_parts] {
            let scene = backend.build(set).unwrap();
            for coherence in COHERENCES {
                let rays = [Ray::new(Vec3::splat(0.1), Vec3::NEG_Z); 9];
                let mut hits = [Hit { triangle: 0, ..Hit::MISS }; 9];
                let mut occluded = [true; 9];
                scene.closest(&rays, Visible::All, coherence, &mut hits);
                scene.occluded(&rays, Visible::All, coherence, &mut occluded);
                assert_eq!((hits, occluded), ([Hit::MISS; 9], [false; 9]), "{}", backend.name());
                scene.closest(&[], Visible::All, coherence, &mut []);
            }
        }
    }
}

#[test]
fn unusable_rays_miss_and_leave_their_neighbours_alone() {
    let cube = Soup::cube();
    let good = Ray::new(Vec3::splat(0.5), Vec3::new(0.3, 0.2, 0.9));
    let bad = [
        Ray { direction: Vec3::new(f32::NAN, 0.0, 1.0), ..good },
        Ray { direction: Vec3::new(0.0, f32::INFINITY, 1.0), ..good },
        Ray { direction: Vec3::ZERO, ..good },
        Ray { origin: Vec3::new(0.5, f32::NAN, 0.5), ..good },
        Ray { origin: Vec3::new(0.5, 0.5, f32::NEG_INFINITY), ..good },
        Ray { t_near: f32::NAN, ..good },
        Ray { t_near: f32::INFINITY, ..good },
        Ray { t_far: f32::NAN, ..good },
        Ray { t_far: -1.0, ..good },
    ];
    assert!(bad.iter().all(|ray| !ray.is_usable()) && good.is_usable());
    let rays: Vec<Ray> = bad.iter().flat_map(|&bad| [good, bad]).collect();
    for backend in backends() {
        let scene = backend.build(&cube.set()).unwrap();
        for coherence in COHERENCES {
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut occluded = vec![true; rays.len()];
            scene.closest(&rays, Visible::All, coherence, &mut hits);
            scene.occluded(&rays, Visible::All, coherence, &mut occluded);
            for (i, (hit, occluded)) in hits.iter().zip(occluded).enumerate() {
                let usable = i % 2 == 0;
                assert_eq!((hit.is_hit(), occluded), (usable, usable), "{}: {:?}", backend.name(), rays[i]);
            }
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_cube() {
    let cube = Soup::cube();
    let rays: Vec<Ray> = (0..1_000_000)
        .map(|i| {
            let origin = Vec3::splat(0.5) + 0.499 * random_in_cube(7, i, 0);
            // Every second one straight at an edge or corner, or along an axis.
            let direction = match i % 8 {
                0 => Vec3::new((i >> 3 & 1) as f32, (i >> 4 & 1) as f32, (i >> 5 & 1) as f32) - origin,
                2 => Vec3::new((i >> 3 & 1) as f32, (i >> 4 & 1) as f32, random(&[7, i, 1])) - origin,
                4 => Vec3::new(random(&[7, i, 1]), random(&[7, i, 1]), (i >> 3 & 1) as f32) - origin,
                6 => [Vec3::X, Vec3::Y, Vec3::Z][(i as usize >> 3) % 3],
                _ => random_direction(7, i),
            };
            Ray::new(origin, direction)
        })
        .collect();
    for backend in backends() {
        let scene = backend.build(&cube.set()).unwrap();
        for coherence in COHERENCES {
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut occluded = vec![false; rays.len()];
            scene.closest(&rays, Visible::All, coherence, &mut hits);
            scene.occluded(&rays, Visible::All, coherence, &mut occluded);
            let lost = hits.iter().filter(|hit| !hit.is_hit()).count();
            let seen_through = occluded.iter().filter(|&&occluded| !occluded).count();
            assert_eq!((lost, seen_through), (0, 0), "{} {coherence:?}", backend.name());
        }
    }
}

#[test]
fn backends_agree_and_every_difference_is_explained() {
    let kinds = [PartKind::Opaque, PartKind::Filtered, PartKind::OneSided, PartKind::Opaque, PartKind::Pane];
    let [embree, obvhs] = &backends()[..] else { panic!("two backends") };
    for (seed, soup) in (20..).zip([Soup::random(20, 20_000, 10.0, &kinds), Soup::cube()]) {
        let set = soup.set();
        let (a, b) = (embree.build(&set).unwrap(), obvhs.build(&set).unwrap());
        let rays = soup.rays(seed, 100_000, 10.0);
        for visible in VISIBLES {
            for coherence in COHERENCES {
                let result = compare(&rays, visible, coherence, &*a, &*b, &set);
                println!("{visible:?} {coherence:?} {result:?}");
                assert_explained(&result, "embree against obvhs");
            }
        }
    }
}

#[test]
fn compare_finds_what_rounding_does_not_explain() {
    let (cube, mut moved) = (Soup::cube(), Soup::cube());
    for position in &mut moved.positions {
        *position += Vec3::splat(1e-4);
    }
    let rays: Vec<Ray> = (0..10_000).map(|i| Ray::new(Vec3::splat(0.5), random_direction(30, i))).collect();
    let (a, b) = (ObvhsBackend.build(&cube.set()).unwrap(), ObvhsBackend.build(&moved.set()).unwrap());
    let result = compare(&rays, Visible::All, Coherence::Incoherent, &*a, &*b, &cube.set());
    // The faces moved by more than fifty roundings of t, which are at most 1e-6 seen from the middle; only where the
    // ray meets an outline (1e-4 of the face's width) may that pass for rounding.
    assert!(result.unexplained > 9_900, "{result:?}");
    assert!(!result.examples.is_empty());
}

#[test]
fn a_panic_in_the_filter_comes_out_of_the_query() {
    struct Panics;
    impl HitFilter for Panics {
        fn accepts(&self, _: u32, _: f32, _: f32) -> bool {
            panic!("from the filter")
        }
    }
    let mut cube = Soup::cube();
    cube.parts[0].kind = PartKind::Filtered;
    cube.filter = Some(Arc::new(Panics));
    for backend in backends() {
        let scene = backend.build(&cube.set()).unwrap();
        let query = std::panic::AssertUnwindSafe(|| closest(&*scene, Ray::new(Vec3::splat(0.5), Vec3::X)));
        let payload = std::panic::catch_unwind(query).unwrap_err();
        assert_eq!(payload.downcast_ref(), Some(&"from the filter"), "{}", backend.name());
    }
}

#[test]
fn floating_point_state_is_the_callers_own_after_and_inside() {
    static FLUSHED: AtomicBool = AtomicBool::new(false);
    fn flushes() -> bool {
        black_box(f32::MIN_POSITIVE) * black_box(0.5) == 0.0
    }
    struct Looks;
    impl HitFilter for Looks {
        fn accepts(&self, _: u32, _: f32, _: f32) -> bool {
            FLUSHED.fetch_or(flushes(), Ordering::Relaxed);
            true
        }
    }
    let mut cube = Soup::cube();
    cube.parts[0].kind = PartKind::Filtered;
    cube.filter = Some(Arc::new(Looks));
    let scene = EmbreeBackend::new(1).unwrap().build(&cube.set()).unwrap();
    assert!(closest(&*scene, Ray::new(Vec3::splat(0.5), Vec3::X)).is_hit());
    assert!(!FLUSHED.load(Ordering::Relaxed), "inside the filter");
    assert!(!flushes(), "after the query");
}

#[test]
fn sets_that_make_no_sense_are_refused() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let part = |triangles| Part { triangles, kind: PartKind::Opaque };
    let build = |triangles: &[[u32; 3]], parts: &[Part], backend: &dyn RayBackend| {
        backend.build(&TriangleSet { positions: &positions, triangles, parts, filter: None }).map(|_| ())
    };
    for backend in backends() {
        let backend = &*backend;
        build(&[[0, 1, 2]], &[part(0..1)], backend).unwrap();
        build(&[[0, 1, 2]; 2], &[part(1..2), part(0..1)], backend).unwrap();
        for (triangles, parts) in [
            (&[[0, 1, 3]; 1][..], &[part(0..1)][..]),
            (&[[0, 1, 2]; 2], &[part(0..1)]),
            (&[[0, 1, 2]; 2], &[part(0..2), part(1..2)]),
            (&[[0, 1, 2]; 2], &[part(0..3)]),
        ] {
            assert!(matches!(build(triangles, parts, backend), Err(crate::error::Error::Backend { .. })));
        }
    }
}
