//! All that a user can choose, independent of the command line.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::error::{Error, Result};
use crate::radiosity::{DirectLight, Focus};
use crate::simplify::{self, BoxFit};

/// The paper's methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Radiosity on the simplified scene beyond `r_thresh`, path tracing within.
    #[default]
    Gsii,
    /// Progressive multi-pass method: radiosity on the complete scene at every distance.
    Pmm,
    /// Monte Carlo path tracing: unbiased, the reference.
    Mcpt,
    /// The radiosity solution, shown directly.
    Radiosity,
}

/// What radiosity is solved on, for `--method radiosity`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum GeometryKind {
    /// Normal and simple surfaces.
    #[default]
    Ns,
    /// Normal and complex surfaces.
    Nc,
}

/// Ray-tracing libraries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum BackendKind {
    /// Embree 4.
    #[default]
    Embree,
    /// obvhs: pure Rust, for validation.
    Obvhs,
}

/// Settings of a run. `None` means: choose from the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Method.
    pub method: Method,
    /// Geometry of `Method::Radiosity`.
    pub geometry: GeometryKind,
    /// `r_thresh`, scene length units; 0 is PMM, infinity is MCPT.
    pub r_thresh: Option<f32>,
    /// The paper's beta, 0..=1.
    pub beta: f32,
    /// Box fit.
    pub box_fit: BoxFit,
    /// Largest angle between neighbouring triangles of one surface, radians.
    pub crease_angle: f32,
    /// Largest diagonal of a cluster in units of `r_thresh`, 1 or more.
    pub longest_cluster: f32,
    /// Patches along each edge of a box face.
    pub face_resolution: u32,
    /// Target edge length of patches, scene length units.
    pub patch_size: Option<f32>,
    /// Fewest patches that a surface is cut into, about, 1 or more.
    pub least_patches: u32,
    /// Share of emitted flux that may stay unshot.
    pub unshot: f64,
    /// How light sources light the patches.
    pub direct: DirectLight,
    /// Relative statistical error of the radiosity solution.
    pub radiosity_error: f32,
    /// Where the radiosity solution must be good; filled in from what the camera sees.
    pub focus: Option<Focus>,
    /// Most rays that first bounces of the radiosity solution are shot with, whatever its error then is.
    pub radiosity_rays: u64,
    /// Roughness under which a specular lobe counts as highly directional.
    pub glossy_threshold: f32,
    /// Roughness that gather rays see opaque surfaces at least as rough as: bright small sources mirrored in them are then
    /// found by next-event estimation instead of by luck. 0 for none; path tracing uses none.
    pub filter_glossy: f32,
    /// Scattering events after which paths end.
    pub max_depth: u32,
    /// Ray-tracing library.
    pub backend: BackendKind,
    /// Folder that the simplified scene and the radiosity solution are kept in for later runs; see [`Cache`](super::Cache). No result
    /// depends on it.
    pub cache: Option<PathBuf>,
    /// Threads for the library's own work; 0 for all.
    pub threads: usize,
    /// Seed of everything random.
    pub seed: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::Gsii,
            geometry: GeometryKind::Ns,
            r_thresh: None,
            beta: 0.02,
            box_fit: BoxFit::Flux,
            crease_angle: 30.0_f32.to_radians(),
            longest_cluster: simplify::LONGEST_CLUSTER,
            face_resolution: 2,
            patch_size: None,
            least_patches: 1,
            unshot: 0.002,
            direct: DirectLight::Gather,
            radiosity_error: 0.15,
            focus: None,
            radiosity_rays: 1 << 22,
            glossy_threshold: 0.3,
            filter_glossy: 0.3,
            max_depth: u32::MAX,
            backend: BackendKind::Embree,
            cache: None,
            threads: 0,
            seed: 0,
        }
    }
}

impl Settings {
    /// [`Settings::radiosity_error`] for images with a relative error of `error`: each gather averages over dozens of patches. As by default where
    /// no error is asked for (infinity).
    pub fn radiosity_error_for(error: f32) -> f32 {
        if error.is_finite() { (5.0 * error).clamp(0.15, 0.3) } else { Settings::default().radiosity_error }
    }

    /// `r_thresh`, after automatic choices were filled in.
    pub fn r_thresh(&self) -> f32 {
        self.r_thresh.unwrap_or(0.0)
    }

    /// Whether radiosity is solved on normal + complex surfaces.
    pub fn complete_geometry(&self) -> bool {
        match self.method {
            Method::Pmm => true,
            Method::Gsii => self.r_thresh() == 0.0,
            Method::Radiosity => self.geometry == GeometryKind::Nc,
            Method::Mcpt => false,
        }
    }

    /// Refuses values without meaning.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the option.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str, why: &str| Err(Error::Usage(format!("{what} {why}")));
        match self {
            s if s.r_thresh.is_some_and(|r| r.is_nan() || r < 0.0) => {
                refuse("--r-thresh", "must be a length, 0 or more (inf is allowed)")
            }
            s if !(0.0..=1.0).contains(&s.beta) => refuse("--beta", "must be between 0 and 1"),
            s if s.patch_size.is_some_and(|p| p.is_nan() || p <= 0.0) => {
                refuse("--patch-size", "must be a length above 0")
            }
            s if !(s.unshot > 0.0 && s.unshot <= 1.0) => refuse("--unshot", "must be above 0 and at most 1"),
            s if !(0.0..=1.0).contains(&s.filter_glossy) => refuse("--filter-glossy", "must be between 0 and 1"),
            s if s.least_patches == 0 => refuse("--least-patches", "must be at least 1"),
            s if s.face_resolution == 0 => refuse("face resolution", "must be at least 1"),
            _ => Ok(()),
        }
    }

    /// Everything needed to repeat the run, by option name.
    pub fn parameters(&self) -> Map<String, Value> {
        let length = |l: Option<f32>| l.map_or(Value::Null, |l| json!(if l.is_finite() { l } else { f32::MAX }));
        let mut map = Map::new();
        for (key, value) in [
            ("method", json!(self.method)),
            ("geometry", json!(self.geometry)),
            ("r_thresh", length(self.r_thresh)),
            ("beta", json!(self.beta)),
            ("box", json!(self.box_fit)),
            ("patch_size", length(self.patch_size)),
            ("least_patches", json!(self.least_patches)),
            ("unshot", json!(self.unshot)),
            ("radiosity_error", json!(self.radiosity_error)),
            ("glossy_threshold", json!(self.glossy_threshold)),
            ("filter_glossy", json!(self.filter_glossy)),
            ("max_depth", json!(self.max_depth)),
            ("backend", json!(self.backend)),
            ("seed", json!(self.seed)),
        ] {
            map.insert(key.to_owned(), value);
        }
        map
    }
}
