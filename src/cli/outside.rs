//! Options for light from outside.

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use chrono::{DateTime, FixedOffset};
use clap::Args;
use serde_json::{Map, Value, json};

use crate::error::{Error, Result};
use crate::scene::sky::{Sky, sun_position};
use crate::scene::{Environment, Scene};

/// Two numbers with a comma between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair(pub [f64; 2]);

impl FromStr for Pair {
    type Err = String;

    fn from_str(s: &str) -> std::result::Result<Self, String> {
        let number = |s: &str| s.trim().parse::<f64>().ok().filter(|x| x.is_finite());
        let pair = s.split_once(',').and_then(|(a, b)| Some([number(a)?, number(b)?]));
        pair.map(Pair).ok_or_else(|| "expected two numbers with a comma between them, as in 45,180".to_owned())
    }
}

fn date(s: &str) -> std::result::Result<DateTime<FixedOffset>, String> {
    DateTime::parse_from_rfc3339(s)
        .map_err(|e| format!("{e}: expected a date, a time and its distance from UTC, as in 2026-06-21T15:00:00+02:00"))
}

/// What lies around the scene.
#[derive(Args, Debug)]
pub struct OutsideOptions {
    /// Latitude-longitude image around the scene, in any format OpenImageIO reads
    #[arg(long, value_name = "IMAGE", group = "outside", help_heading = "Light from outside")]
    environment: Option<PathBuf>,
    /// A clear sky with its sun around the scene
    #[arg(long, group = "outside", help_heading = "Light from outside")]
    sky: bool,
    /// Turn what lies around by so many degrees, counter-clockwise seen from above
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        allow_hyphen_values = true,
        requires = "outside",
        help_heading = "Light from outside"
    )]
    environment_rotation: f32,
    /// Factor on the radiance of what lies around
    #[arg(long, value_name = "X", default_value_t = 1.0, requires = "outside", help_heading = "Light from outside")]
    environment_strength: f32,
    /// Where the sun of --sky stands: degrees above the horizon, and clockwise from north, which is -z [default: 45,180]
    #[arg(
        long,
        value_name = "ELEVATION,AZIMUTH",
        allow_hyphen_values = true,
        requires = "sky",
        help_heading = "Light from outside"
    )]
    sun: Option<Pair>,
    /// Date and time that say where the sun stands, together with --place: 2026-06-21T15:00:00+02:00
    #[arg(
        long,
        value_name = "TIME",
        value_parser = date,
        requires = "sky",
        requires = "place",
        conflicts_with = "sun",
        help_heading = "Light from outside"
    )]
    date: Option<DateTime<FixedOffset>>,
    /// Degrees north and east of the place that --date is about
    #[arg(
        long,
        value_name = "LATITUDE,LONGITUDE",
        allow_hyphen_values = true,
        requires = "date",
        help_heading = "Light from outside"
    )]
    place: Option<Pair>,
    /// Haze of --sky, 1 to 10: 2 is very clear air, 3 clear, 6 hazy
    #[arg(long, value_name = "X", default_value_t = Sky::default().turbidity, requires = "sky", help_heading = "Light from outside")]
    turbidity: f32,
    /// Reflectance of the ground under --sky, 0 to 1: it brightens the sky and is seen below the horizon
    #[arg(long, value_name = "X", default_value_t = Sky::default().ground, requires = "sky", help_heading = "Light from outside")]
    ground: f32,
}

impl OutsideOptions {
    /// Puts a scene where the options say, and warns when no light comes from anywhere.
    ///
    /// # Errors
    /// An image that cannot be read, values out of range, a sun that is not up.
    pub fn surround(&self, scene: &mut Arc<Scene>) -> Result<()> {
        if let Some(environment) = self.environment(&scene.name)? {
            Arc::make_mut(scene).environment = Some(Arc::new(environment));
        }
        if scene.is_dark() {
            log::warn!(
                "{}: nothing gives light, so the image will be black; --sky or --environment IMAGE light the scene from outside",
                scene.name
            );
        }
        Ok(())
    }

    fn environment(&self, scene: &str) -> Result<Option<Environment>> {
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if !self.environment_rotation.is_finite() {
            return refuse("--environment-rotation must be a number of degrees");
        }
        if !(self.environment_strength.is_finite() && self.environment_strength >= 0.0) {
            return refuse("--environment-strength must be a factor of 0 or more");
        }
        let environment = match (&self.environment, self.sky) {
            (Some(path), _) => {
                let (environment, warnings) = Environment::read(path)?;
                for warning in warnings {
                    log::warn!("{scene}: {warning}");
                }
                environment
            }
            (None, true) => self.sky()?.environment()?,
            (None, false) => return Ok(None),
        };
        let turned = environment.rotated(self.environment_rotation.to_radians());
        Ok(Some(turned.scaled(self.environment_strength)))
    }

    fn sky(&self) -> Result<Sky> {
        let (mut elevation, mut azimuth) = (Sky::default().elevation, Sky::default().azimuth);
        if let Some(Pair(sun)) = self.sun {
            if !(0.0..=90.0).contains(&sun[0]) {
                return Err(Error::Usage(format!(
                    "--sun: the sun must stand 0 to 90 degrees above the horizon, not {}",
                    sun[0]
                )));
            }
            [elevation, azimuth] = sun.map(|degrees| degrees.to_radians() as f32);
        }
        if let (Some(date), Some(Pair([latitude, longitude]))) = (&self.date, self.place) {
            (elevation, azimuth) = sun_position(date, latitude, longitude)?;
        }
        Ok(Sky { elevation, azimuth, turbidity: self.turbidity, ground: self.ground })
    }

    /// Adds what is needed to repeat the run.
    ///
    /// # Errors
    /// As [`OutsideOptions::surround`].
    pub fn record(&self, map: &mut Map<String, Value>) -> Result<()> {
        let path = self.environment.as_ref().map(|path| path.display().to_string());
        map.insert("environment".to_owned(), json!(path));
        map.insert("sky".to_owned(), json!(self.sky));
        if path.is_some() || self.sky {
            map.insert("environment_rotation".to_owned(), json!(self.environment_rotation));
            map.insert("environment_strength".to_owned(), json!(self.environment_strength));
        }
        if self.sky {
            let sky = self.sky()?;
            let sun = [sky.elevation, sky.azimuth].map(f32::to_degrees);
            map.insert("sun".to_owned(), json!(format!("{},{}", sun[0], sun[1])));
            map.insert("turbidity".to_owned(), json!(sky.turbidity));
            map.insert("ground".to_owned(), json!(sky.ground));
        }
        Ok(())
    }
}
