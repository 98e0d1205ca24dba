//! Both backends against brute force in f64, and against each other.

use super::*;

fn backends() -> Vec<Box<dyn RayBackend>> {
    vec![Box::new(embree::EmbreeBackend::new(1).unwrap())]
}

fn whole(count: usize, kind: PartKind) -> Vec<Part> {
    vec![Part { triangles: 0..count as u32, kind }]
}

fn closest(scene: &dyn RayScene, ray: Ray, visible: Visible) -> Hit {
    let mut hit = [Hit::MISS];
    scene.closest(&[ray], visible, Coherence::Incoherent, &mut hit);
    hit[0]
}

const SQUARE: ([Vec3; 4], [[u32; 3]; 2]) = (
    [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::new(-1.0, 1.0, 0.0)],
    [[0, 1, 2], [0, 2, 3]],
);

#[test]
fn one_triangle() {
    for backend in backends() {
        let (positions, triangles) = SQUARE;
        let parts = whole(2, PartKind::Opaque);
        let set = TriangleSet { positions: &positions, triangles: &triangles, parts: &parts, filter: None };
        let scene = backend.build(&set).unwrap();
        let hit = closest(&*scene, Ray::new(Vec3::new(0.5, -0.25, 3.0), Vec3::NEG_Z), Visible::All);
        assert_eq!(hit.triangle, 0, "{}", backend.name());
        // Embree divides by multiplying with a reciprocal, good to two units in the last place.
        for (value, exact) in [(hit.t, 3.0), (hit.u, 0.375), (hit.v, 0.375)] {
            assert!((value - exact).abs() <= 4.0 * f32::EPSILON * exact, "{}: {hit:?}", backend.name());
        }
        println!("{} {} bytes", backend.name(), scene.memory_bytes());
    }
}
