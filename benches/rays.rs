//! Rays per second of both backends on clutter: `cargo bench --bench rays`, in one thread.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::{Mat3, Vec2, Vec3};
use gsii::backend::embree::EmbreeBackend;
use gsii::backend::obvhs::ObvhsBackend;
use gsii::backend::{Coherence, Hit, Part, PartKind, Ray, RayBackend, RayScene, TriangleSet, Visible};
use gsii::sampling::{hash_all, uniform_sphere, unit};

/// Small boxes in the room.
const BOXES: u32 = 20_000;
/// Camera rays: this many squared.
const WIDTH: u32 = 256;

fn main() {
    divan::main();
}

fn random(key: &[u32]) -> f32 {
    unit(hash_all(key))
}

fn random_point(seed: u32, index: u32) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|axis| 2.0 * random(&[seed, index, axis]) - 1.0))
}

fn random_direction(seed: u32, index: u32) -> Vec3 {
    uniform_sphere(Vec2::new(random(&[seed, index, 3]), random(&[seed, index, 4])))
}

/// A room of 2 x 2 x 2 with boxes of a few hundredths turned any way, more of them near the floor.
fn clutter() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut add_box = |centre: Vec3, axes: Mat3| {
        let first = positions.len() as u32;
        positions.extend((0..8).map(|corner: u32| {
            let sign = |bit: u32| (corner >> bit & 1) as f32 * 2.0 - 1.0;
            centre + axes * Vec3::new(sign(0), sign(1), sign(2))
        }));
        for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            triangles.extend([[a, b, c], [a, c, d]].map(|corners| corners.map(|corner: u32| first + corner)));
        }
    };
    add_box(Vec3::ZERO, Mat3::IDENTITY);
    for i in 0..BOXES {
        let mut centre = random_point(1, i);
        centre.z = -1.0 + 2.0 * random(&[1, i, 5]).powi(3);
        let (axis, angle) = (random_direction(1, i), 6.3 * random(&[1, i, 6]));
        let size = 0.005 + 0.02 * Vec3::from_array([7, 8, 9].map(|what| random(&[1, i, what])));
        add_box(0.97 * centre, Mat3::from_axis_angle(axis, angle) * Mat3::from_diagonal(size));
    }
    (positions, triangles)
}

/// Camera rays in blocks of 8 x 8 pixels, or rays anywhere in any direction.
fn rays(coherence: Coherence) -> Vec<Ray> {
    (0..WIDTH * WIDTH)
        .map(|i| match coherence {
            Coherence::Coherent => {
                let (block, pixel) = (i / 64, i % 64);
                let x = block % (WIDTH / 8) * 8 + pixel % 8;
                let y = block / (WIDTH / 8) * 8 + pixel / 8;
                let on_film = |pixel: u32| (pixel as f32 + 0.5) / WIDTH as f32 - 0.5;
                Ray::new(Vec3::new(0.0, -0.95, 0.5), Vec3::new(on_film(x), 0.6, -0.3 - on_film(y)).normalize())
            }
            Coherence::Incoherent => Ray::new(0.9 * random_point(2, i), random_direction(2, i)),
        })
        .collect()
}

fn scene(backend: &dyn RayBackend) -> Box<dyn RayScene> {
    let (positions, triangles) = clutter();
    let parts = [Part { triangles: 0..triangles.len() as u32, kind: PartKind::Opaque }];
    let set = TriangleSet { positions: &positions, triangles: &triangles, parts: &parts, filter: None };
    backend.build(&set).expect("the scene is well formed")
}

/// A backend and the rays it is given.
#[derive(Clone, Copy)]
struct Case {
    backend: &'static str,
    coherence: Coherence,
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?}", self.backend, self.coherence)
    }
}

impl Case {
    fn scene(self) -> Box<dyn RayScene> {
        match self.backend {
            "embree" => scene(&EmbreeBackend::new(1).expect("Embree starts")),
            _ => scene(&ObvhsBackend),
        }
    }
}

const CASES: [Case; 4] = [
    Case { backend: "embree", coherence: Coherence::Coherent },
    Case { backend: "embree", coherence: Coherence::Incoherent },
    Case { backend: "obvhs", coherence: Coherence::Coherent },
    Case { backend: "obvhs", coherence: Coherence::Incoherent },
];

#[divan::bench(args = CASES)]
fn closest(bencher: Bencher, case: Case) {
    let (scene, rays) = (case.scene(), rays(case.coherence));
    let mut hits = vec![Hit::MISS; rays.len()];
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| scene.closest(black_box(&rays), Visible::All, case.coherence, black_box(&mut hits)));
}

/// Shadow rays that end half-way.
#[divan::bench(args = CASES)]
fn occluded(bencher: Bencher, case: Case) {
    let (scene, mut rays) = (case.scene(), rays(case.coherence));
    for ray in &mut rays {
        ray.t_far = 0.5;
    }
    let mut occluded = vec![false; rays.len()];
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| scene.occluded(black_box(&rays), Visible::All, case.coherence, black_box(&mut occluded)));
}

/// Building the acceleration structure.
#[divan::bench(args = ["embree", "obvhs"], sample_count = 5)]
fn build(bencher: Bencher, backend: &'static str) {
    let case = Case { backend, coherence: Coherence::Incoherent };
    bencher.counter(ItemsCount::new(12 * (BOXES + 1))).bench_local(|| case.scene());
}
