//! Light from outside: what rays see that leave the scene.

use std::f32::consts::{PI, TAU};
use std::path::Path;

use glam::Vec3;

use crate::error::{Error, Result};
use crate::image;

/// Radiance from every direction, infinitely far away: a latitude-longitude map, and where there is one the disk of the sun.
///
/// The map's middle column lies at +x and columns further right towards +z, the zenith (+y) is its upper edge: as in Blender,
/// whose exporter writes its x, y, z axes as x, -z, y.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Where it came from, for messages.
    pub name: String,
    size: [usize; 2],
    /// Radiance at the middle of each texel, row by row from the zenith, finite and not negative.
    texels: Vec<Vec3>,
    /// Angle by which it is turned about the up axis, radians, counter-clockwise seen from above.
    rotation: f32,
    sun: Option<SunDisk>,
}

/// The sun: a disk of constant radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunDisk {
    /// Unit direction to its middle.
    pub direction: Vec3,
    /// Sine of its angular radius, above 0 and at most 1.
    pub sin_radius: f32,
    /// Radiance in addition to the map's, W/(sr m^2) per band.
    pub radiance: Vec3,
}

impl SunDisk {
    /// Whether a unit direction lies within the disk.
    pub fn holds(&self, direction: Vec3) -> bool {
        // The sine is precise where the cosine of half a degree has lost its digits.
        self.direction.dot(direction) > 0.0
            && self.direction.cross(direction).length_squared() < self.sin_radius * self.sin_radius
    }

    /// Its solid angle, steradians.
    pub fn solid_angle(&self) -> f64 {
        std::f64::consts::TAU * self.one_minus_cos()
    }

    /// One minus the cosine of its angular radius, without cancellation.
    pub(crate) fn one_minus_cos(&self) -> f64 {
        let square = f64::from(self.sin_radius).powi(2);
        square / (1.0 + (1.0 - square).max(0.0).sqrt())
    }
}

impl Environment {
    /// The same radiance from everywhere.
    pub fn uniform(radiance: Vec3) -> Self {
        Self::new("uniform".to_owned(), [1, 1], vec![radiance])
    }

    /// A map of `size` (width, height) texels, row by row from the zenith. Negative and undefined values become 0, infinite ones
    /// the largest finite value of the map.
    ///
    /// # Panics
    /// If there is not one value a texel, or none at all: a mistake of the calling code.
    pub fn new(name: String, size: [usize; 2], mut texels: Vec<Vec3>) -> Self {
        assert!(!texels.is_empty() && texels.len() == size[0] * size[1], "an environment needs one value a texel");
        let finite = texels.iter().flat_map(|t| t.to_array()).filter(|x| x.is_finite());
        let most = finite.fold(0.0, f32::max);
        for texel in &mut texels {
            // max() turns NaN into 0.
            *texel = Vec3::from_array(texel.to_array().map(|x| x.max(0.0).min(most)));
        }
        Environment { name, size, texels, rotation: 0.0, sun: None }
    }

    /// Reads a latitude-longitude image in any format that OpenImageIO reads. Also returns what the user should know of it.
    ///
    /// # Errors
    /// When the file is no image, or has no colour.
    pub fn read(path: &Path) -> Result<(Self, Vec<String>)> {
        let image = image::read(path)?;
        let failed = |reason: &str| Error::Input { path: path.to_owned(), reason: reason.to_owned() };
        let [r, g, b] = image.rgb_or_grey().ok_or_else(|| {
            failed("an environment needs channels R, G and B (or a single one), this image has others")
        })?;
        let texels: Vec<Vec3> = (0..image.pixels()).map(|i| Vec3::new(r[i], g[i], b[i])).collect();
        if texels.is_empty() {
            return Err(failed("the image has no pixels"));
        }
        let mut warnings = Vec::new();
        let odd = texels.iter().filter(|t| !t.is_finite() || t.min_element() < 0.0).count();
        if odd > 0 {
            warnings.push(format!(
                "{}: {odd} pixels are negative, infinite or undefined; they count as 0 or the largest finite value",
                path.display()
            ));
        }
        let size = [image.width() as usize, image.height() as usize];
        if size[0] != 2 * size[1] {
            warnings.push(format!(
                "{}: {} x {} pixels; a latitude-longitude image is twice as wide as high, this one is stretched to it",
                path.display(),
                size[0],
                size[1]
            ));
        }
        let environment = Self::new(path.display().to_string(), size, texels);
        if environment.texels.iter().all(|t| *t == Vec3::ZERO) {
            warnings.push(format!("{}: the environment is black", path.display()));
        }
        Ok((environment, warnings))
    }

    /// The same with a sun in it.
    pub fn with_sun(self, sun: SunDisk) -> Self {
        Environment { sun: Some(sun), ..self }
    }

    /// The same with all radiance multiplied by `factor`, finite and not negative.
    pub fn scaled(mut self, factor: f32) -> Self {
        self.texels.iter_mut().for_each(|t| *t *= factor);
        self.sun = self.sun.map(|sun| SunDisk { radiance: sun.radiance * factor, ..sun });
        self
    }

    /// The same, turned about the up axis (+y) by `angle` radians more, counter-clockwise seen from above.
    pub fn rotated(mut self, angle: f32) -> Self {
        self.rotation = (self.rotation + angle) % TAU;
        let turn = glam::Quat::from_rotation_y(angle);
        self.sun = self.sun.map(|sun| SunDisk { direction: (turn * sun.direction).normalize(), ..sun });
        self
    }

    /// Number of columns and rows.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Radiance at the middle of each texel before the map is turned, row by row from the zenith.
    pub(super) fn texels(&self) -> &[Vec3] {
        &self.texels
    }

    /// Angle by which the map is turned, radians.
    pub(super) fn rotation(&self) -> f32 {
        self.rotation
    }

    /// The sun, where there is one.
    pub fn sun(&self) -> Option<&SunDisk> {
        self.sun.as_ref()
    }

    /// Radiance that arrives from a unit direction, W/(sr m^2) per band.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let sun = self.sun.as_ref().filter(|sun| sun.holds(direction)).map_or(Vec3::ZERO, |sun| sun.radiance);
        self.map_radiance(direction) + sun
    }

    /// Radiance of the map alone, bilinear between the middles of texels.
    pub(crate) fn map_radiance(&self, direction: Vec3) -> Vec3 {
        let [u, v] = self.coordinates(direction);
        let [w, h] = self.size;
        let x = u * w as f32 - 0.5;
        let y = (v * h as f32 - 0.5).clamp(0.0, (h - 1) as f32);
        let (x0, y0) = (x.floor(), y.floor());
        let column = |d: i64| (x0 as i64 + d).rem_euclid(w as i64) as usize;
        let row = |d: usize| (y0 as usize + d).min(h - 1) * w;
        let (fx, fy) = (x - x0, y - y0);
        let across = |row: usize| self.texels[row + column(0)].lerp(self.texels[row + column(1)], fx);
        across(row(0)).lerp(across(row(1)), fy)
    }

    /// Where a direction lies in the map, both 0..=1.
    pub(crate) fn coordinates(&self, direction: Vec3) -> [f32; 2] {
        let u = 0.5 + (direction.z.atan2(direction.x) + self.rotation) / TAU;
        // The arc cosine would lose the poles' digits.
        let v = direction.x.hypot(direction.z).atan2(direction.y) / PI;
        [u - u.floor(), v]
    }

    /// Unit direction to column coordinate `u` at the cosine of an angle from the zenith.
    pub(crate) fn direction(&self, u: f32, cos: f32) -> Vec3 {
        let (sin_phi, cos_phi) = ((u - 0.5) * TAU - self.rotation).sin_cos();
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        Vec3::new(sin * cos_phi, cos, sin * sin_phi)
    }

    /// Mean radiance over the cell of texel `column`, `row`, at equal weight of all angles: the bilinear function reaches half a
    /// texel into its neighbours.
    pub(crate) fn cell_mean(&self, column: usize, row: usize) -> Vec3 {
        let [w, h] = self.size;
        let columns = [(column + w - 1) % w, column, (column + 1) % w];
        let rows = [row.saturating_sub(1), row, (row + 1).min(h - 1)];
        const WEIGHT: [f32; 3] = [0.125, 0.75, 0.125];
        let mut sum = Vec3::ZERO;
        for (row, weight) in rows.into_iter().zip(WEIGHT) {
            for (column, share) in columns.into_iter().zip(WEIGHT) {
                sum += self.texels[row * w + column] * (weight * share);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map whose texels hold their column and row.
    fn numbered(w: usize, h: usize) -> Environment {
        let texels = (0..w * h).map(|i| Vec3::new((i % w) as f32, (i / w) as f32, 1.0)).collect();
        Environment::new("numbers".to_owned(), [w, h], texels)
    }

    #[test]
    fn the_middle_faces_x_and_right_is_z() {
        let map = numbered(8, 4);
        // Between columns 3 and 4, rows 1 and 2.
        assert_eq!(map.radiance(Vec3::X), Vec3::new(3.5, 1.5, 1.0));
        // A quarter further: columns 5 and 6.
        assert!((map.radiance(Vec3::Z) - Vec3::new(5.5, 1.5, 1.0)).length() < 1e-5);
        assert_eq!((map.radiance(Vec3::Y).y, map.radiance(Vec3::NEG_Y).y), (0.0, 3.0));
        // Turned counter-clockwise by 90 degrees, what was at +x is at -z (y up, right-handed).
        let turned = map.rotated(0.5 * PI);
        assert!((turned.radiance(Vec3::NEG_Z) - Vec3::new(3.5, 1.5, 1.0)).length() < 1e-5);
    }

    #[test]
    fn directions_and_coordinates_are_inverse() {
        let map = numbered(8, 4).rotated(1.0);
        for i in 0..100 {
            let (u, cos) = ((i as f32 + 0.5) / 100.0, 0.98 * ((i * 37 % 100) as f32 / 50.0 - 1.0));
            let direction = map.direction(u, cos);
            assert!(direction.is_normalized());
            let [x, y] = map.coordinates(direction);
            assert!((x - u).abs() < 1e-6 && (y - cos.acos() / PI).abs() < 1e-6, "{u} {cos}: {x} {y}");
        }
    }

    #[test]
    fn the_sun_turns_with_the_map_and_has_its_size() {
        let sun = SunDisk { direction: Vec3::X, sin_radius: 0.01, radiance: Vec3::splat(5.0) };
        let sky = Environment::uniform(Vec3::ONE).with_sun(sun).rotated(0.5 * PI);
        assert_eq!(sky.radiance(Vec3::NEG_Z), Vec3::splat(6.0));
        assert_eq!(sky.radiance(Vec3::new(0.011, 0.0, -1.0).normalize()), Vec3::ONE);
        assert_eq!(sky.radiance(Vec3::new(0.0, 0.009, -1.0).normalize()), Vec3::splat(6.0));
        assert_eq!(sky.radiance(Vec3::Z), Vec3::ONE, "not on the other side");
        let exact = std::f64::consts::TAU * (1.0 - f64::from(0.01f32).asin().cos());
        assert!((sun.solid_angle() / exact - 1.0).abs() < 1e-10);
    }

    #[test]
    fn bad_values_do_no_harm() {
        let texels = vec![Vec3::new(f32::NAN, -1.0, 2.0), Vec3::new(f32::INFINITY, 0.5, f32::NEG_INFINITY)];
        let map = Environment::new("odd".to_owned(), [2, 1], texels);
        assert_eq!(map.texels, [Vec3::new(0.0, 0.0, 2.0), Vec3::new(2.0, 0.5, 0.0)]);
    }
}
