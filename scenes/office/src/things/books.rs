//! Books: standing and leaning on shelves, and in piles.

use glam::{Vec3, vec3};

use crate::office::{GAP, Office};
use crate::paint::{COVERS, PAGES};
use crate::primitives::{ALL_FACES, BOTTOM, TOP, X_HIGH, X_LOW, Z_HIGH, Z_LOW, cuboid};
use crate::rng::Rng;
use crate::scene::Pose;
use crate::shape::Shape;

/// Nominal thickness, height and depth of the formats, metres. Each book is a format scaled by up to 15 %.
const FORMATS: [[f32; 3]; 4] =
    [[0.018, 0.200, 0.135], [0.028, 0.235, 0.165], [0.040, 0.245, 0.175], [0.055, 0.270, 0.200]];
/// Thickness of a cover board.
const BOARD: f32 = 0.0025;
/// How far covers stand out over the pages.
const SQUARE: f32 = 0.003;

/// A closed book: spine at +z, standing on y = 0, centred in x and z.
fn shape([t, h, d]: [f32; 3]) -> [(bool, Shape); 2] {
    let (x, z) = (t / 2.0, d / 2.0);
    let cover = Shape::of([
        cuboid(vec3(-x, 0.0, -z), vec3(-x + BOARD, h, z), ALL_FACES),
        cuboid(vec3(x - BOARD, 0.0, -z), vec3(x, h, z), ALL_FACES),
        cuboid(vec3(-x + BOARD, 0.0, z - BOARD), vec3(x - BOARD, h, z), TOP | BOTTOM | Z_HIGH | Z_LOW),
    ]);
    let low = vec3(-x + BOARD, SQUARE, -z + SQUARE);
    let high = vec3(x - BOARD, h - SQUARE, z - BOARD);
    [(true, cover), (false, cuboid(low, high, ALL_FACES & !X_LOW & !X_HIGH & !Z_HIGH))]
}

/// One mesh a format and cover, made on first use so that no mesh is unused.
fn mesh(office: &mut Office, format: usize, cover: usize) -> usize {
    let name = format!("book {format} {}", COVERS[cover].name);
    if let Some(known) = office.scene.meshes.iter().position(|mesh| mesh.name == name) {
        return known;
    }
    let parts = shape(FORMATS[format]).map(|(is_cover, shape)| (if is_cover { COVERS[cover] } else { PAGES }, shape));
    office.mesh(&name, parts)
}

/// A book's format, cover and scale.
struct Book {
    format: usize,
    cover: usize,
    scale: Vec3,
}

impl Book {
    fn pick(rng: &mut Rng, cover: usize, tallest: f32, deepest: f32) -> Self {
        let format = [0, 0, 1, 1, 1, 2, 2, 3][rng.below(8)];
        let limit = |nominal: f32, most: f32, factor: f32| (most / nominal).min(factor);
        let [_, h, d] = FORMATS[format];
        let scale = vec3(
            rng.range(0.8, 1.15),
            limit(h, tallest, rng.range(0.88, 1.12)),
            limit(d, deepest, rng.range(0.9, 1.12)),
        );
        Book { format, cover, scale }
    }

    fn size(&self) -> Vec3 {
        Vec3::from(FORMATS[self.format]) * self.scale
    }

    fn place(&self, office: &mut Office, parent: Option<usize>, pose: Pose) {
        let mesh = mesh(office, self.format, self.cover);
        office.scene.place(parent, "book", mesh, pose.scaled(self.scale));
    }
}

/// Fills a shelf from left to right. Series share a cover; a gap is closed by a book that leans, or holds a small pile.
pub fn fill(office: &mut Office, parent: Option<usize>, purpose: &str, width: f32, height: f32, depth: f32) {
    let mut rng = office.rng(purpose);
    let most = office.count(18).min(60);
    let tallest = height - 0.015;
    let mut x = -0.5 * width + 0.004;
    let right = 0.5 * width - 0.004;
    let mut cover = rng.below(COVERS.len());
    let mut series: Option<(usize, Vec3)> = None;
    let mut left_in_series = 0;
    let mut placed = 0;
    while placed < most {
        if left_in_series == 0 {
            cover = rng.below(COVERS.len());
            left_in_series = if rng.unit() < 0.25 { 3 + rng.below(4) } else { 1 };
            series = None;
        }
        left_in_series -= 1;
        let mut book = Book::pick(&mut rng, cover, tallest, depth - 0.03);
        // Volumes of a series share a format.
        let (format, scale) = *series.get_or_insert((book.format, book.scale));
        (book.format, book.scale) = (format, scale);
        let size = book.size();
        if x + size.x > right {
            break;
        }
        // Spines stand near the front edge, pushed in unevenly.
        let z = 0.5 * depth - 0.012 - 0.5 * size.z - rng.unit().powi(2) * 0.02;
        book.place(office, parent, Pose::at(x + 0.5 * size.x, 0.0, z).yaw(rng.around(0.003)));
        x += size.x + 0.0008 + 0.003 * depth * 0.5 + rng.unit() * 0.0006;
        placed += 1;
        let roll = rng.unit();
        if roll < 0.05 && right - x > 0.20 {
            x = lean(office, parent, &mut rng, x, tallest, depth);
            placed += 1;
        } else if roll < 0.09 && right - x > 0.34 {
            // A small pile lying flat, spines to the front.
            let pile_at = Pose::at(x + 0.15, 0.0, 0.02);
            flat(office, parent, &mut rng, pile_at, 3, 0.14);
            x += 0.30;
            placed += 3;
        }
    }
    // The last book leans against the row when there is room for it.
    if right - x > 0.20 && placed > 0 {
        lean(office, parent, &mut rng, x, tallest, depth);
    }
}

/// A book leaning to the left on its neighbour at `x`; returns where the next may stand.
fn lean(office: &mut Office, parent: Option<usize>, rng: &mut Rng, x: f32, tallest: f32, depth: f32) -> f32 {
    let cover = rng.below(COVERS.len());
    let book =
        Book { format: 0, cover, scale: vec3(rng.range(0.8, 1.1), (tallest / 0.2).min(rng.range(0.9, 1.05)), 1.0) };
    let size = book.size();
    let angle = rng.range(0.16, 0.30);
    let (sin, cos) = angle.sin_cos();
    // Turned by +angle about z the top goes left: the lower left corner is the pivot's highest, the lower right rests.
    let left = -0.5 * size.x * cos - size.y * sin;
    let at = vec3(x + 0.0015 - left, 0.5 * size.x * sin + GAP, 0.5 * depth - 0.015 - 0.5 * size.z);
    book.place(office, parent, Pose::at(at.x, at.y, at.z).roll(angle));
    at.x + 0.5 * size.x * cos + 0.003
}

/// Books lying on each other, spine along the local x axis towards +z. `reach` is half the room in x.
fn flat(office: &mut Office, parent: Option<usize>, rng: &mut Rng, pose: Pose, books: usize, reach: f32) {
    let group = Some(office.scene.group(parent, "pile of books", pose));
    let mut y = 0.0;
    for i in 0..books {
        let format = [3, 2, 1, 1, 0, 0, 0][i.min(6)];
        let book = Book {
            format,
            cover: rng.below(COVERS.len()),
            scale: vec3(rng.range(0.8, 1.0), rng.range(0.9, 1.0), rng.range(0.9, 1.0)),
        };
        let size = book.size();
        let slack = (reach - 0.5 * size.y - 0.012).max(0.0).min(0.008);
        // Standing height becomes the x direction: turned by -90 degrees about z, it starts at the left.
        let at = Pose::at(-0.5 * size.y + rng.around(slack), y + 0.5 * size.x, rng.around(0.006));
        book.place(office, group, at.yaw(rng.around(0.04)).roll(-std::f32::consts::FRAC_PI_2));
        y += size.x + GAP;
    }
}

/// A free-standing pile.
pub fn pile(office: &mut Office, parent: Option<usize>, purpose: &str, pose: Pose, books: usize) {
    let mut rng = office.rng(purpose);
    flat(office, parent, &mut rng, pose, books, 0.3);
}
