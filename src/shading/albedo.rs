//! Directional albedo of the GGX lobe, tabulated.
//!
//! With Schlick's Fresnel term the albedo is linear in both of its colours, `F0 a + F90 b` (split sum, Karis 2013);
//! `a + b` is the albedo of a lossless single-scattering mirror, one minus which is what multiple scattering must
//! return (Kulla and Conty 2017).

use std::sync::LazyLock;

use glam::Vec3;

use super::{fresnel, ggx};

/// Grid points along the square root of the cosine and along roughness.
const COSINES: usize = 64;
const ROUGHNESSES: usize = 32;
/// Quadrature points per axis of the visible normals' square.
const RADIAL: u32 = 24;
const ANGULAR: u32 = 12;

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
pub fn directional(cosine: f32, roughness: f32) -> Split {
    let (row, t) = cell(roughness, ROUGHNESSES);
    let (column, s) = cell(cosine.max(0.0).sqrt(), COSINES);
    let at = |row: usize| TABLE.albedo[row][column].lerp(TABLE.albedo[row][column + 1], s);
    at(row).lerp(at(row + 1), t)
}

/// Cosine-weighted average of [`directional`] over the hemisphere: exactly that of the interpolated table, so that
/// what is built from both conserves energy.
pub fn average(roughness: f32) -> Split {
    let (row, t) = cell(roughness, ROUGHNESSES);
    TABLE.average[row].lerp(TABLE.average[row + 1], t)
}

/// Index of the grid cell that holds `x` in 0..=1, and where in the cell.
fn cell(x: f32, points: usize) -> (usize, f32) {
    let scaled = x.clamp(0.0, 1.0) * (points - 1) as f32;
    let index = (scaled as usize).min(points - 2);
    (index, scaled - index as f32)
}

struct Table {
    /// By roughness, then square root of the cosine.
    albedo: [[Split; COSINES]; ROUGHNESSES],
    average: [Split; ROUGHNESSES],
}

/// Computed on one thread: a parallel loop here could wait for a worker that itself waits for the table.
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let albedo = std::array::from_fn(|row| {
        let roughness = row as f32 / (ROUGHNESSES - 1) as f32;
        std::array::from_fn(|column| {
            let root = column as f32 / (COSINES - 1) as f32;
            integrate(root * root, roughness * roughness, RADIAL, ANGULAR)
        })
    });
    Table { average: std::array::from_fn(|row| average_of(&albedo[row])), albedo }
});

/// Albedo by a midpoint rule over the square from which visible normals are sampled; half of it, as the other half is
/// its mirror image.
fn integrate(cosine: f32, alpha: f32, radial: u32, angular: u32) -> Split {
    if alpha == 0.0 {
        return smooth(cosine);
    }
    let outgoing = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let (mut a, mut b) = (0.0, 0.0);
    for i in 0..radial {
        for j in 0..angular {
            let u = [(i as f32 + 0.5) / radial as f32, 0.5 * (j as f32 + 0.5) / angular as f32];
            let h = ggx::sample_visible(outgoing, alpha, u);
            let along = outgoing.dot(h);
            let incoming = 2.0 * along * h - outgoing;
            if incoming.z <= 0.0 {
                continue;
            }
            // G2 / G1, as a ratio of sums that stays finite at grazing angles.
            let (lo, li) = (ggx::lambda(outgoing, alpha), ggx::lambda(incoming, alpha));
            let weight = (1.0 + lo) / (1.0 + lo + li);
            let schlick = fresnel::schlick_weight(along);
            a += weight * (1.0 - schlick);
            b += weight * schlick;
        }
    }
    let scale = 1.0 / (radial * angular) as f32;
    Split { a: a * scale, b: b * scale }
}

/// `2 int E(mu) mu dmu = 4 int E(s^2) s^3 ds` for `E` linear between grid points in `s`, exact.
fn average_of(row: &[Split; COSINES]) -> Split {
    let (mut a, mut b) = (0.0, 0.0);
    let width = 1.0 / (COSINES - 1) as f64;
    for (i, pair) in row.windows(2).enumerate() {
        let s = i as f64 * width;
        // Moments of 4 s^3 over the cell, of order zero and (for the slope) one.
        let end = s + width;
        let whole = end.powi(4) - s.powi(4);
        let rise = (0.8 * (end.powi(5) - s.powi(5)) - s * whole) / width;
        a += f64::from(pair[0].a) * (whole - rise) + f64::from(pair[1].a) * rise;
        b += f64::from(pair[0].b) * (whole - rise) + f64::from(pair[1].b) * rise;
    }
    Split { a: a as f32, b: b as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SPEC-008 of the reference cases: white furnace of single-scattering GGX, by half-vector quadrature.
    #[test]
    fn matches_reference_values() {
        let expected = [
            (0.2, [0.998_297_466, 0.997_780_329, 0.995_456_550, 0.975_147_481, 0.928_993_332]),
            (0.35, [0.981_891_992, 0.976_175_993, 0.954_349_813, 0.887_689_817, 0.884_372_894]),
            (0.5, [0.915_812_430, 0.897_271_774, 0.857_263_437, 0.848_159_957, 0.891_622_361]),
            (0.7, [0.697_750_360, 0.690_554_031, 0.703_973_491, 0.792_715_540, 0.861_913_377]),
            (0.85, [0.485_452_095, 0.510_796_150, 0.578_430_850, 0.723_883_050, 0.816_331_177]),
            (1.0, [0.306_852_819, 0.351_255_830, 0.450_693_863, 0.641_648_116, 0.760_210_483]),
        ];
        for (roughness, row) in expected {
            for (cosine, expected) in [1.0, 0.8, 0.5, 0.2, 0.1].into_iter().zip(row) {
                let albedo = directional(cosine, roughness).total();
                // The tolerance of the reference case.
                assert!((albedo - expected).abs() < 0.002, "{roughness} {cosine}: {albedo}, expected {expected}");
            }
        }
    }

    #[test]
    #[ignore = "prints the table's error and time"]
    fn table_error() {
        let start = std::time::Instant::now();
        LazyLock::force(&TABLE);
        println!("built in {:?}", start.elapsed());
        let mut worst = [(0.0_f32, 0.0, 0.0); 3];
        for i in 0..=150 {
            for j in 0..=90 {
                let (cosine, roughness) = ((i as f32 / 150.0).powi(2), j as f32 / 90.0);
                if roughness < 0.01 {
                    continue;
                }
                let exact = integrate(cosine, roughness * roughness, 200, 100);
                let table = directional(cosine, roughness);
                for (worst, e) in
                    worst.iter_mut().zip([table.total() - exact.total(), table.a - exact.a, table.b - exact.b])
                {
                    if e.abs() > worst.0.abs() {
                        *worst = (e, cosine, roughness);
                    }
                }
            }
        }
        println!("total, a, b: {worst:?}");
    }
}
