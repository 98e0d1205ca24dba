//! Directional albedo of the GGX lobe, tabulated.
//!
//! With Schlick's Fresnel term the albedo is linear in both of its colours, `F0 a + F90 b` (split sum, Karis 2013);
//! `a + b` is the albedo of a lossless single-scattering mirror, one minus which is what multiple scattering must
//! return (Kulla and Conty 2017).

use std::sync::LazyLock;

use glam::Vec3;

use super::{fresnel, ggx};

/// Grid points along the cosine and along roughness.
const COSINES: usize = 40;
const ROUGHNESSES: usize = 28;
/// Roughness of the first row; smoother lobes than that are delta functions.
const MIN_ROUGHNESS: f32 = 0.01;
/// Quadrature points per axis of the visible normals' square.
const RADIAL: u32 = 22;
const ANGULAR: u32 = 12;
/// Largest error of a tabulated lossless albedo, and of the share of F90 in it.
#[cfg(test)]
pub const TOTAL_ERROR: f32 = 0.005;
#[cfg(test)]
pub const SPLIT_ERROR: f32 = 0.01;
/// Points for averages over the cosine.
const AVERAGE_POINTS: u32 = 128;

/// Albedo split into the parts that `F0` and `F90` multiply.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Split {
    /// Multiplies F0.
    pub a: f32,
    /// Multiplies F90.
    pub b: f32,
}

impl Split {
    /// Albedo of a mirror without loss.
    pub fn total(self) -> f32 {
        self.a + self.b
    }

    /// Albedo for these Fresnel colours.
    pub fn with(self, f0: Vec3, f90: Vec3) -> Vec3 {
        f0 * self.a + f90 * self.b
    }

    fn lerp(self, other: Split, t: f32) -> Split {
        Split { a: self.a + (other.a - self.a) * t, b: self.b + (other.b - self.b) * t }
    }
}

/// Albedo of a smooth surface towards `cosine`.
pub fn smooth(cosine: f32) -> Split {
    let b = fresnel::schlick_weight(cosine);
    Split { a: 1.0 - b, b }
}

/// Cosine-weighted average of [`smooth`] over the hemisphere: `2 int mu (1 - mu)^5 dmu = 1/21`.
pub const SMOOTH_AVERAGE: Split = Split { a: 20.0 / 21.0, b: 1.0 / 21.0 };

/// Albedo towards `cosine` at `roughness` (square root of the GGX width), both 0..=1.
///
/// The sum of both parts is within 0.005 of the integral, each part within 0.01, the largest errors at cosines below
/// 0.01.
pub fn directional(cosine: f32, roughness: f32) -> Split {
    TABLE.directional(cosine.clamp(0.0, 1.0), roughness)
}

/// Cosine-weighted average of [`directional`] over the hemisphere: that of the interpolated table, so that what is
/// built from both conserves energy.
pub fn average(roughness: f32) -> Split {
    let (row, t) = cell(rows(roughness), ROUGHNESSES);
    TABLE.average[row].lerp(TABLE.average[row + 1], t)
}

/// Position 0..=1 among the rows of the table.
fn rows(roughness: f32) -> f32 {
    (roughness - MIN_ROUGHNESS) / (1.0 - MIN_ROUGHNESS)
}

/// Index of the grid cell that holds `x` in 0..=1, and where in the cell.
fn cell(x: f32, points: usize) -> (usize, f32) {
    let scaled = x.clamp(0.0, 1.0) * (points - 1) as f32;
    let index = (scaled as usize).min(points - 2);
    (index, scaled - index as f32)
}

/// Both quantities are stored so that they are nearly linear between grid points: the lossless albedo depends on
/// `cosine / alpha` while that is small, and the share that F90 gets is close to Schlick's fifth power.
struct Table {
    /// Lossless albedo by roughness, then `cosine (1 + alpha) / (cosine + alpha)`.
    total: [[f32; COSINES]; ROUGHNESSES],
    /// Fifth root of the share of F90 by roughness, then square root of the cosine.
    root: [[f32; COSINES]; ROUGHNESSES],
    average: [Split; ROUGHNESSES],
}

impl Table {
    fn directional(&self, cosine: f32, roughness: f32) -> Split {
        let bilinear = |table: &[[f32; COSINES]; ROUGHNESSES], x: f32| {
            let ((row, t), (column, s)) = (cell(rows(roughness), ROUGHNESSES), cell(x, COSINES));
            let at = |row: usize| table[row][column] + (table[row][column + 1] - table[row][column]) * s;
            at(row) + (at(row + 1) - at(row)) * t
        };
        let alpha = roughness * roughness;
        let total = bilinear(&self.total, cosine * (1.0 + alpha) / (cosine + alpha).max(f32::MIN_POSITIVE));
        let b = total * bilinear(&self.root, cosine.sqrt()).powi(5);
        Split { a: total - b, b }
    }
}

/// Computed on one thread: a parallel loop here could wait for a worker that itself waits for the table.
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let roughness = |row: usize| MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * row as f32 / (ROUGHNESSES - 1) as f32;
    let grid = |of: &dyn Fn(f32, f32) -> f32| {
        std::array::from_fn(|row| {
            std::array::from_fn(|column| of(column as f32 / (COSINES - 1) as f32, roughness(row).powi(2)))
        })
    };
    let mut table = Table {
        total: grid(&|x, alpha| integrate(x * alpha / (1.0 + alpha - x), alpha, RADIAL, ANGULAR).total()),
        root: grid(&|root, alpha| {
            let split = integrate(root * root, alpha, RADIAL, ANGULAR);
            (split.b / split.total()).powf(0.2)
        }),
        average: [Split::default(); ROUGHNESSES],
    };
    table.average = std::array::from_fn(|row| {
        let (mut a, mut b) = (0.0, 0.0);
        for i in 0..AVERAGE_POINTS {
            // Midpoints of the sine squared, weighted towards grazing where smooth lobes vary most.
            let x = (i as f32 + 0.5) / AVERAGE_POINTS as f32;
            let split = table.directional(x * x, roughness(row));
            let weight = f64::from(4.0 * x * x * x) / f64::from(AVERAGE_POINTS);
            a += weight * f64::from(split.a);
            b += weight * f64::from(split.b);
        }
        Split { a: a as f32, b: b as f32 }
    });
    table
});

/// Albedo by a midpoint rule over the square from which visible normals are sampled; half of it, as the other half is
/// its mirror image.
fn integrate(cosine: f32, alpha: f32, radial: u32, angular: u32) -> Split {
    let outgoing = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let lambda = ggx::lambda(outgoing, alpha);
    let (mut a, mut b) = (0.0, 0.0);
    for i in 0..radial {
        // Facets steep enough to lose light are the last of the radial axis, fewer the smoother the surface is.
        let [upper, lower] = [i, i + 1].map(|k| (1.0 - k as f32 / radial as f32).powi(3));
        let (rest, cell) = (0.5 * (upper + lower), upper - lower);
        for j in 0..angular {
            let u = [1.0 - rest, 0.5 * (j as f32 + 0.5) / angular as f32];
            let h = ggx::sample_visible(outgoing, alpha, u);
            let along = outgoing.dot(h);
            let incoming = 2.0 * along * h - outgoing;
            if incoming.z <= 0.0 {
                continue;
            }
            // G2 / G1, as a ratio of sums that stays finite at grazing angles.
            let weight = (1.0 + lambda) / (1.0 + lambda + ggx::lambda(incoming, alpha));
            let schlick = fresnel::schlick_weight(along);
            a += cell * weight * (1.0 - schlick);
            b += cell * weight * schlick;
        }
    }
    let scale = 1.0 / angular as f32;
    Split { a: a * scale, b: b * scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SPEC-008 of the reference cases: white furnace of single-scattering GGX, by half-vector quadrature.
    #[test]
    fn matches_reference_values() {
        let expected: [(f32, [f64; 5]); 6] = [
            (0.2, [0.998_297_466, 0.997_780_329, 0.995_456_550, 0.975_147_481, 0.928_993_332]),
            (0.35, [0.981_891_992, 0.976_175_993, 0.954_349_813, 0.887_689_817, 0.884_372_894]),
            (0.5, [0.915_812_430, 0.897_271_774, 0.857_263_437, 0.848_159_957, 0.891_622_361]),
            (0.7, [0.697_750_360, 0.690_554_031, 0.703_973_491, 0.792_715_540, 0.861_913_377]),
            (0.85, [0.485_452_095, 0.510_796_150, 0.578_430_850, 0.723_883_050, 0.816_331_177]),
            (1.0, [0.306_852_819, 0.351_255_830, 0.450_693_863, 0.641_648_116, 0.760_210_483]),
        ];
        for (roughness, row) in expected {
            for (cosine, expected) in [1.0, 0.8, 0.5, 0.2, 0.1_f32].into_iter().zip(row) {
                let albedo = f64::from(directional(cosine, roughness).total());
                // The tolerance of the reference case.
                assert!((albedo - expected).abs() < 0.002, "{roughness} {cosine}: {albedo}, expected {expected}");
            }
        }
    }

    /// The bounds of this test are the accuracy that the documentation of [`directional`] promises.
    #[test]
    fn table_is_as_accurate_as_promised() {
        for i in 0..=40 {
            for j in 0..=30 {
                let cosine = (i as f32 / 40.0).powi(2);
                let roughness = MIN_ROUGHNESS + (1.0 - MIN_ROUGHNESS) * j as f32 / 30.0;
                let exact = integrate(cosine, roughness * roughness, 80, 50);
                let table = directional(cosine, roughness);
                assert!(
                    (table.total() - exact.total()).abs() < TOTAL_ERROR,
                    "{cosine} {roughness}: {table:?} {exact:?}"
                );
                assert!((table.b - exact.b).abs() < SPLIT_ERROR, "{cosine} {roughness}: {table:?} {exact:?}");
            }
        }
    }
}
