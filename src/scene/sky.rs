//! A clear sky with its sun.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use chrono::{DateTime, FixedOffset};
use glam::{Mat3, Vec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};
use rayon::prelude::*;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};

use super::environment::{Environment, SunDisk};
use crate::error::{Error, Result};
use crate::image::view::EFFICACY;

/// Columns and rows of the map: texels of 0.18 degrees.
const SIZE: [usize; 2] = [2048, 1024];

/// Sine of the sun's mean angular radius, 0.2666 degrees.
const SUN_SIN_RADIUS: f32 = 0.004_653;

/// From radiance weighted by the eye's sensitivity, of which 1 W/(sr m^2) is 683 cd/m^2 by definition, to ours.
const PER_WEIGHTED: f32 = (683.0 / EFFICACY) as f32;

/// Effective temperature of the sun, kelvin.
const SUN_TEMPERATURE: f64 = 5772.0;

/// A clear sky: where its sun stands and what the air and the ground are like.
///
/// North is -z, east +x, as in Blender's exports of scenes whose north is +y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// The sun's angle above the horizon, radians, 0 to pi/2.
    pub elevation: f32,
    /// Its direction, radians clockwise from north.
    pub azimuth: f32,
    /// Haze, 1 (pure air) to 10: 2 is very clear, 3 clear, 6 hazy.
    pub turbidity: f32,
    /// Reflectance of the ground, 0 to 1: it lights the sky from below and is what is seen below the horizon.
    pub ground: f32,
}

impl Default for Sky {
    fn default() -> Self {
        Sky { elevation: 45f32.to_radians(), azimuth: PI, turbidity: 3.0, ground: 0.2 }
    }
}

/// Elevation and azimuth (clockwise from north) of the sun, radians, refraction included.
///
/// # Errors
/// For a place that is not on Earth, or when the sun is not up.
pub fn sun_position(time: &DateTime<FixedOffset>, latitude: f64, longitude: f64) -> Result<(f32, f32)> {
    let position = delta_t::estimate_from_date_like(time).and_then(|delta_t| {
        let place = Location { latitude, longitude };
        SolarPositions::new().at(time, place, 0.0, delta_t, Some(RefractionCorrection::standard()))
    });
    let position = position.map_err(|error| Error::Usage(format!("the sun's position cannot be found: {error}")))?;
    let elevation = position.elevation_angle();
    if elevation < 0.0 {
        return Err(Error::Usage(format!("the sun is {:.1} degrees below the horizon then and there", -elevation)));
    }
    Ok((elevation.to_radians() as f32, position.azimuth().to_radians() as f32))
}

impl Sky {
    /// Unit direction to the sun.
    pub fn sun_direction(&self) -> Vec3 {
        let (sin, cos) = self.elevation.sin_cos();
        let (east, north) = self.azimuth.sin_cos();
        Vec3::new(cos * east, sin, -cos * north)
    }

    /// The sky by Hosek and Wilkie, "An analytic model for full spectral sky-dome radiance" (2012), with a disk for the sun and
    /// an endless diffuse ground that both light. Radiance is W/(sr m^2) of visible light: [`EFFICACY`] times its luminance is
    /// cd/m^2.
    ///
    /// # Errors
    /// [`Error::Usage`] for values out of range.
    pub fn environment(&self) -> Result<Environment> {
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if !(0.0..=FRAC_PI_2).contains(&self.elevation) || !self.azimuth.is_finite() {
            return refuse("the sun must stand 0 to 90 degrees above the horizon, at a finite azimuth");
        }
        if !(1.0..=10.0).contains(&self.turbidity) {
            return refuse("the sky's turbidity must be between 1 and 10");
        }
        if !(0.0..=1.0).contains(&self.ground) {
            return refuse("the ground's reflectance must be between 0 and 1");
        }
        let params = SkyParams { elevation: self.elevation, turbidity: self.turbidity, albedo: [self.ground; 3] };
        let model = SkyState::new(&params).map_err(|error| Error::Usage(format!("no such sky: {error}")))?;
        let sun = SunDisk {
            direction: self.sun_direction(),
            sin_radius: SUN_SIN_RADIUS,
            radiance: sun_radiance(self.elevation, self.turbidity),
        };
        let [w, h] = SIZE;
        // Directions only: the map's values come after.
        let frame = Environment::uniform(Vec3::ZERO);
        let angle = |row: usize| (row as f32 + 0.5) * PI / h as f32;
        let mut texels: Vec<Vec3> = (0..w * h / 2)
            .into_par_iter()
            .map(|i| {
                let theta = angle(i / w);
                let direction = frame.direction(((i % w) as f32 + 0.5) / w as f32, theta.cos());
                let gamma = direction.cross(sun.direction).length().atan2(direction.dot(sun.direction));
                let band = |channel| model.radiance(theta, gamma, channel);
                PER_WEIGHTED * Vec3::new(band(Channel::R), band(Channel::G), band(Channel::B)).max(Vec3::ZERO)
            })
            .collect();
        let above = |(row, texels): (usize, &[Vec3])| {
            let (sin, cos) = angle(row).sin_cos();
            let sum: Vec3 = texels.iter().sum();
            sum * (sin * cos * (PI / h as f32) * (TAU / w as f32))
        };
        let of_sky: Vec3 = texels.chunks(w).enumerate().map(above).sum();
        let of_sun = sun.radiance * (sun.solid_angle() as f32 * self.elevation.sin());
        let ground = (of_sky + of_sun) * (self.ground / PI);
        texels.resize(w * h, ground);
        Ok(Environment::new("clear sky".to_owned(), SIZE, texels).with_sun(sun))
    }
}

/// Radiance of the sun's disk at sea level: a black body behind Rayleigh scattering and haze (Preetham, Shirley and Smits,
/// "A practical analytic model for daylight" (1999), appendix 1; ozone and water, which take a few per cent, are left out).
fn sun_radiance(elevation: f32, turbidity: f32) -> Vec3 {
    let degrees = f64::from(elevation.to_degrees());
    // Relative optical air mass (Kasten and Young 1989).
    let mass = 1.0 / (degrees.to_radians().sin() + 0.505_72 * (degrees + 6.079_95).powf(-1.6364));
    let haze = (0.04608 * f64::from(turbidity) - 0.04586).max(0.0);
    const STEP: f64 = 5.0;
    let mut xyz = glam::DVec3::ZERO;
    for i in 0..=80 {
        let nanometres = 380.0 + STEP * f64::from(i);
        let micrometres = 1e-3 * nanometres;
        let depth = 0.008_735 * micrometres.powf(-4.08) + haze * micrometres.powf(-1.3);
        xyz += colour_matching(nanometres) * (black_body(1e-9 * nanometres) * (-depth * mass).exp() * 1e-9 * STEP);
    }
    // CIE XYZ to linear Rec. 709 primaries with white D65; light at sunset lies outside of them.
    let to_rgb = Mat3::from_cols(
        Vec3::new(3.240_97, -0.969_244, 0.055_63),
        Vec3::new(-1.537_383, 1.875_968, -0.203_977),
        Vec3::new(-0.498_611, 0.041_555, 1.056_972),
    );
    PER_WEIGHTED * (to_rgb * xyz.as_vec3()).max(Vec3::ZERO)
}

/// Spectral radiance of a black body of the sun's temperature, W/(sr m^3), at a wavelength in metres (Planck).
fn black_body(wavelength: f64) -> f64 {
    const PLANCK: f64 = 6.626_070_15e-34;
    const LIGHT: f64 = 299_792_458.0;
    const BOLTZMANN: f64 = 1.380_649e-23;
    let exponent = PLANCK * LIGHT / (wavelength * BOLTZMANN * SUN_TEMPERATURE);
    2.0 * PLANCK * LIGHT * LIGHT / (wavelength.powi(5) * exponent.exp_m1())
}

/// The CIE 1931 colour matching functions at a wavelength in nanometres, by the fits of Wyman, Sloan and Shirley, "Simple
/// analytic approximations to the CIE XYZ color matching functions" (2013).
fn colour_matching(nanometres: f64) -> glam::DVec3 {
    let lobe = |centre: f64, below: f64, above: f64| {
        let width = if nanometres < centre { below } else { above };
        (-0.5 * ((nanometres - centre) / width).powi(2)).exp()
    };
    glam::DVec3::new(
        1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
        0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
        1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::view::luminance;

    /// Kilolux on the ground from the sky, and on a surface that faces the sun.
    fn illuminances(sky: &Sky) -> [f64; 2] {
        let map = sky.environment().unwrap();
        let sun = map.sun().unwrap();
        let (rows, columns) = (200, 400);
        let mut of_sky = 0.0;
        for row in 0..rows {
            // Equal steps of the square of the sine are equal shares of the projected solid angle.
            let cos = (1.0 - (row as f32 + 0.5) / rows as f32).sqrt();
            for column in 0..columns {
                let direction = map.direction((column as f32 + 0.5) / columns as f32, cos);
                of_sky += luminance(map.map_radiance(direction).to_array());
            }
        }
        of_sky *= std::f64::consts::PI / f64::from(rows * columns);
        [1e-3 * EFFICACY * of_sky, 1e-3 * EFFICACY * luminance(sun.radiance.to_array()) * sun.solid_angle()]
    }

    /// The clear sky of the IES (Calculation Procedures Committee, "Recommended practice for the calculation of daylight availability",
    /// 1984): sky 0.8 + 15.5 sin(a)^0.5 klx, sun 127.5 exp(-0.21 / sin(a)) klx. It stands for means of clear days, between
    /// which the haze differs: the models must agree within a quarter for clear air.
    #[test]
    fn skies_are_as_bright_as_measured_ones() {
        for degrees in [15.0f32, 30.0, 45.0, 70.0] {
            let sky = Sky { elevation: degrees.to_radians(), turbidity: 2.5, ..Sky::default() };
            let sin = f64::from(sky.elevation.sin());
            let measured = [0.8 + 15.5 * sin.sqrt(), 127.5 * (-0.21 / sin).exp()];
            let ours = illuminances(&sky);
            println!(
                "{degrees}: sky {:.1} and sun {:.1} klx, IES {:.1} and {:.1}",
                ours[0], ours[1], measured[0], measured[1]
            );
            for (a, b) in ours.iter().zip(measured) {
                assert!((a / b - 1.0).abs() < 0.25, "{degrees} degrees: {a} against {b}");
            }
        }
    }

    #[test]
    fn the_sky_is_blue_the_low_sun_red_and_the_ground_lit() {
        let day = Sky::default().environment().unwrap();
        let zenith = day.radiance(Vec3::Y);
        assert!(zenith.z > zenith.y && zenith.y > zenith.x, "{zenith}");
        let evening = sun_radiance(2f32.to_radians(), 3.0);
        assert!(evening.x > 2.0 * evening.y && evening.y > 2.0 * evening.z, "{evening}");
        assert!(evening.x < 0.2 * sun_radiance(FRAC_PI_2, 3.0).x);
        let sky = Sky { ground: 0.5, ..Sky::default() };
        let below = luminance(sky.environment().unwrap().radiance(Vec3::NEG_Y).to_array());
        let [of_sky, of_sun] = illuminances(&sky).map(|klx| klx / (1e-3 * EFFICACY));
        let exact = 0.5 / std::f64::consts::PI * (of_sky + of_sun * f64::from(sky.elevation.sin()));
        // Two quadratures of one function with 0.2 degree steps.
        assert!((below / exact - 1.0).abs() < 0.01, "{below} {exact}");
    }

    #[test]
    fn the_sun_stands_where_the_almanac_says() {
        // NREL's example of the algorithm (Reda and Andreas 2004, table A5.1), with its refraction.
        let time = DateTime::parse_from_rfc3339("2003-10-17T12:30:30-07:00").unwrap();
        let (elevation, azimuth) = sun_position(&time, 39.742476, -105.1786).unwrap();
        assert!((elevation.to_degrees() - 39.888).abs() < 0.02, "{}", elevation.to_degrees());
        assert!((azimuth.to_degrees() - 194.340).abs() < 0.02, "{}", azimuth.to_degrees());
        let night = DateTime::parse_from_rfc3339("2003-10-17T23:30:30-07:00").unwrap();
        assert!(sun_position(&night, 39.742476, -105.1786).unwrap_err().to_string().contains("below the horizon"));
        assert!(sun_position(&time, 99.0, 0.0).is_err());
        // South-south-west at that height: half of the way up, behind (+z) and to the left (west, -x).
        let sky = Sky { elevation, azimuth, ..Sky::default() };
        let d = sky.sun_direction();
        assert!(d.is_normalized() && d.z > 0.7 && d.x < 0.0 && d.y > 0.6);
        assert_eq!(sky.environment().unwrap().sun().unwrap().direction, d);
    }

    #[test]
    fn impossible_skies_are_refused() {
        for sky in [
            Sky { elevation: -0.1, ..Sky::default() },
            Sky { turbidity: 0.5, ..Sky::default() },
            Sky { ground: 1.5, ..Sky::default() },
            Sky { azimuth: f32::NAN, ..Sky::default() },
        ] {
            assert!(matches!(sky.environment(), Err(Error::Usage(_))));
        }
    }
}
