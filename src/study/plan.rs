//! What is run: every method of the paper over a ladder of settings.

use std::f32::consts::TAU;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::subject::{Subject, key};
use crate::pipeline::{GeometryKind, Method, Settings};
use crate::simplify::BoxFit;

/// The paper's `r_thresh` in units of the largest linear dimension of its room.
pub const PAPER_R_THRESH: f32 = 0.053;
/// The paper's beta.
pub const PAPER_BETA: f32 = 1.0 / TAU;
/// Edge length of patches, in units of the largest linear dimension of the room, and fewest patches of a surface with which the
/// office has about as many patches as the paper's: 74,924 on normal + complex surfaces, 1124 on normal + simple ones.
pub const PAPER_PATCHES: (f32, u32) = (0.1, 7);

/// The paper's share of the emitted flux at which radiosity stops.
pub const PAPER_UNSHOT: f64 = 0.01;

/// Longest cluster in units of `r_thresh`: the paper's are pieces of furniture, of any length.
pub const PAPER_CLUSTERS: f32 = 3.0;

/// What a run is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Path tracing.
    Mcpt,
    /// PMM as it is by default.
    Pmm,
    /// GSII as it is by default.
    Gsii,
    /// GSII without interpolation of indirect light.
    Gather,
    /// GSII with another `r_thresh`.
    RThresh,
    /// GSII with another beta.
    Beta,
    /// GSII with another box fit.
    Box,
    /// GSII with the paper's `r_thresh`, all else as by default.
    AtPaperRThresh,
    /// GSII with all of the paper's parameters.
    PaperGsii,
    /// PMM with as many patches as the paper's.
    PaperPmm,
    /// The radiosity solution on normal + simple surfaces, shown directly; the paper's parameters.
    RadiositySimple,
    /// The same on normal + complex surfaces.
    RadiosityComplex,
    /// One of the paper's timings: its stopping rule, for Tables 2 and 3.
    PassMcpt,
    /// The same for PMM.
    PassPmm,
    /// The same for GSII.
    PassGsii,
    /// One point of the scaling with the number of triangles.
    Scaling,
}

/// How many trials a run has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// As anyone renders: image after image is asked for with half the error of the one before ([`ERRORS`]), each from its beginning, until the
    /// curves have nothing more to show.
    Planned {
        /// Most trials of a pixel.
        most: u32,
    },
    /// Fixed sampling whose number of trials doubles from 2 to `most`.
    Rounds {
        /// Most trials of a pixel.
        most: u32,
    },
    /// The paper's rule: 10 to 30 trials, until the error is 5 % of a pixel.
    Paper,
}

/// One run.
#[derive(Clone, Debug)]
pub struct Run {
    /// What it is for.
    pub role: Role,
    /// How the report calls it.
    pub label: String,
    /// Its settings.
    pub settings: Settings,
    /// Its trials.
    pub sampling: Sampling,
    /// Whether indirect light is interpolated between places: as by default, but not where the paper is followed.
    pub interpolate: bool,
}

/// How much is run.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Most trials of a pixel of the three main methods.
    pub main_trials: u32,
    /// Most trials of a pixel of the other settings.
    pub other_trials: u32,
}

/// Errors of images that are asked for one after the other.
pub const ERRORS: [f32; 7] = [0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625];

/// relMSE of all light, and of direct and of indirect light alone, where curves of error against time have nothing more to show: below the
/// smallest error that crossings are reported for, and below 2 %.
pub const ENOUGH: [f64; 2] = [7e-4, 3.5e-4];

impl Run {
    /// Names what the run is a result of, compared with a reference of so many trials: two runs of the same key give the same result.
    pub fn key(&self, subject: &Subject, reference_trials: u32) -> String {
        let settings = serde_json::Value::Object(self.settings.parameters());
        let what = (self.role, &self.label, self.sampling, self.interpolate, reference_trials);
        key(&format!("{} {settings} {what:?}", subject.view()))
    }

    /// About what it costs, in trials of one pixel by path tracing: for the estimate of what is left to do.
    pub fn cost(&self, subject: &Subject) -> u64 {
        let pixels = f64::from(subject.size[0]) * f64::from(subject.size[1]);
        let trials = match self.sampling {
            Sampling::Planned { most } | Sampling::Rounds { most } => f64::from(most),
            Sampling::Paper => 30.0,
        };
        let (trial, preparation) = match self.settings.method {
            Method::Mcpt => (1.0, 0.0),
            Method::Gsii => (0.6, 5e5),
            Method::Pmm => (0.5, 8e5),
            Method::Radiosity => (0.1, 8e5),
        };
        (pixels * trials * trial + preparation) as u64
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(serde_json::json!(self).as_str().unwrap_or_default())
    }
}

/// MCPT, PMM and GSII as they are by default.
pub fn main_methods(base: &Settings, extent: Extent) -> Vec<Run> {
    [(Role::Gsii, Method::Gsii, "GSII"), (Role::Mcpt, Method::Mcpt, "MCPT"), (Role::Pmm, Method::Pmm, "PMM")]
        .into_iter()
        .map(|(role, method, label)| Run {
            role,
            label: label.to_owned(),
            settings: Settings { method, ..base.clone() },
            sampling: Sampling::Planned { most: extent.main_trials },
            interpolate: true,
        })
        .collect()
}

/// All runs of one scene whose automatic `r_thresh` is `auto`.
pub fn ladder(subject: &Subject, base: &Settings, auto: f32, extent: Extent) -> Vec<Run> {
    let paper_r_thresh = PAPER_R_THRESH * subject.length();
    let gsii = Settings { method: Method::Gsii, ..base.clone() };
    let paper = Settings {
        r_thresh: Some(paper_r_thresh),
        beta: PAPER_BETA,
        box_fit: BoxFit::Paper1993,
        patch_size: Some(PAPER_PATCHES.0 * subject.length()),
        least_patches: PAPER_PATCHES.1,
        longest_cluster: PAPER_CLUSTERS,
        unshot: PAPER_UNSHOT,
        ..gsii.clone()
    };
    let as_in_paper = |method| Settings { method, ..paper.clone() };
    let radiosity = |geometry| Settings { geometry, ..as_in_paper(Method::Radiosity) };

    let other = Sampling::Rounds { most: extent.other_trials };
    let shown = Sampling::Rounds { most: 16 };
    let mut runs = main_methods(base, extent);
    let mut add = |role, label: &str, settings: Settings, sampling| {
        let interpolate = ![Role::Gather, Role::PaperGsii, Role::PassGsii].contains(&role);
        runs.push(Run { role, label: label.to_owned(), settings, sampling, interpolate });
    };
    let main = Sampling::Planned { most: extent.main_trials };
    add(Role::Gather, "GSII, no interpolation", gsii.clone(), main);
    for factor in [0.5, 2.0, 4.0] {
        let settings = Settings { r_thresh: Some(factor * auto), ..gsii.clone() };
        add(Role::RThresh, &format!("GSII, r_thresh x {factor}"), settings, other);
    }
    for (beta, name) in [(0.25 * base.beta, format!("{}", 0.25 * base.beta)), (PAPER_BETA, "1/2\u{3c0}".to_owned())] {
        add(Role::Beta, &format!("GSII, beta {name}"), Settings { beta, ..gsii.clone() }, other);
    }
    let boxes = Settings { box_fit: BoxFit::Paper1993, ..gsii.clone() };
    add(Role::Box, "GSII, paper's boxes", boxes, other);
    let at_paper = Settings { r_thresh: Some(paper_r_thresh), ..gsii.clone() };
    add(Role::AtPaperRThresh, "GSII, paper's r_thresh", at_paper, main);
    // Runs that differ in their trials only come one after the other: they are prepared once.
    add(Role::PaperGsii, "GSII, as in the paper", as_in_paper(Method::Gsii), other);
    add(Role::PassGsii, "GSII", as_in_paper(Method::Gsii), Sampling::Paper);
    add(Role::PaperPmm, "PMM, as in the paper", as_in_paper(Method::Pmm), other);
    add(Role::PassPmm, "PMM", as_in_paper(Method::Pmm), Sampling::Paper);
    add(Role::PassMcpt, "MCPT", Settings { method: Method::Mcpt, ..base.clone() }, Sampling::Paper);
    add(Role::RadiositySimple, "Radiosity, N+S", radiosity(GeometryKind::Ns), shown);
    add(Role::RadiosityComplex, "Radiosity, N+C", radiosity(GeometryKind::Nc), shown);
    runs
}

/// The runs of one scene in the scaling with the number of triangles.
pub fn scaling(base: &Settings) -> Vec<Run> {
    let sampling = Sampling::Rounds { most: 16 };
    let extent = Extent { main_trials: 16, other_trials: 16 };
    main_methods(base, extent).into_iter().map(|run| Run { role: Role::Scaling, sampling, ..run }).collect()
}
