//! Tables 1 to 4 of the paper with its numbers beside ours, and those that it did not have.

use super::crossing::{Crossing, LEVELS, crossing, crossing_after};
use super::error::MeanRelative;
use super::plan::Role;
use super::record::{Point, Record};
use super::table::{Table, number, signed_percent};

/// What a table says of one scene.
pub struct Chapter<'a> {
    /// The scene's name.
    pub name: &'a str,
    /// Mean reflectance.
    pub reflectance: f64,
    /// Finished runs.
    pub records: &'a [Record],
}

impl Chapter<'_> {
    /// The run with this role; the first one where there are several.
    pub fn run(&self, role: Role) -> Option<&Record> {
        self.records.iter().find(|r| r.role == role)
    }

    /// The paper's office of this reflectance, 0 for low, 1 for high; other scenes have none.
    fn paper(&self) -> Option<usize> {
        ["office-low", "office-high"].iter().position(|name| *name == self.name)
    }

    fn case(&self) -> String {
        format!("{} ({:.2})", self.name, self.reflectance)
    }
}

const DASH: &str = "\u{2013}";

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| DASH.to_owned())
}

/// The paper's Table 1: N+S and N+C, hours and minutes by reflectance.
const PAPER_1: [[&str; 2]; 2] = [["0:25", "50:25"], ["0:52", "> 142:14"]];
/// The same as ratios of minutes.
const PAPER_1_RATIO: [&str; 2] = ["121", "> 164"];
/// The paper's Table 2: mean `L_dev / L`, hours and minutes.
const PAPER_2: [[&str; 2]; 2] = [["0.074", "3:17"], ["0.074", "3:16"]];
/// The paper's Table 3: MCPT, PMM, GSII.
const PAPER_3: [[[&str; 2]; 3]; 2] = [
    [["0.349", "7:22"], ["0.280", "3:39"], ["0.276", "4:14"]],
    [["0.282", "10:29"], ["0.189", "3:47"], ["0.193", "4:17"]],
];
/// The paper's Table 4, high reflectance: GSII, PMM, noise of MCPT.
const PAPER_4: [[&str; 3]; 3] = [["0.11", "0.10", "0.12"], ["0.18", "0.16", "0.14"], ["0.10", "0.07", "0.06"]];

/// How much faster radiosity is on the simplified geometry than on the complete one; core seconds.
fn radiosity_ratio(chapter: &Chapter<'_>) -> Option<f64> {
    let (simple, complete) = (chapter.run(Role::RadiositySimple)?, chapter.run(Role::RadiosityComplex)?);
    Some(complete.preparation.radiosity.cpu / simple.preparation.radiosity.cpu)
}

fn table_1(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "table-1",
        "Table 1. Radiosity before the first pixel",
        "The paper's r_thresh, beta and boxes; patches of a tenth of the room's length, but at least 7 for each surface, as the paper has on average, so that there are about as many as in \
         the paper. Unshot: share of the emitted flux. Error: relative standard error of \
         the solution, which the paper's hemi-cubes did not state. Ratio: time of N+C over that of this row. The paper's times (hours:minutes) are those of an SGI \
         4D/20; its last one did not run to the end.",
        &[
            "Average reflectance",
            "Representation",
            "Surfaces",
            "Patches",
            "Unshot",
            "Error",
            "Core seconds",
            "Ratio",
            "Paper's surfaces",
            "Patches",
            "Time",
            "Ratio",
        ],
    );
    for chapter in chapters {
        let rows = [
            (Role::RadiositySimple, "N+S", 0, ["105", "1124"]),
            (Role::RadiosityComplex, "N+C", 1, ["10948", "74924"]),
        ];
        for (role, representation, k, counts) in rows {
            let Some(run) = chapter.run(role) else { continue };
            let p = &run.preparation;
            let paper = chapter.paper();
            let ratio = (k == 0).then(|| radiosity_ratio(chapter)).flatten();
            table.push(vec![
                chapter.case(),
                representation.to_owned(),
                p.surfaces.to_string(),
                p.patches.to_string(),
                format!("{:.2} %", 100.0 * p.unshot),
                format!("{:.1} %", 100.0 * p.error),
                number(p.radiosity.cpu),
                or_dash(ratio.map(number)),
                or_dash(paper.map(|_| counts[0].to_owned())),
                or_dash(paper.map(|_| counts[1].to_owned())),
                or_dash(paper.map(|i| PAPER_1[i][k].to_owned())),
                or_dash(paper.filter(|_| k == 0).map(|i| PAPER_1_RATIO[i].to_owned())),
            ]);
        }
    }
    table
}

fn table_2(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "table-2",
        "Table 2. HIRES pass",
        "The paper's rule: 10 to 30 trials of a pixel, until its standard error is 5 %. L_dev is the standard error of a pixel's mean; \
         the mean is over pixels and bands that are not black.",
        &["Average reflectance", "Average L_dev / L", "Core seconds", "Paper's L_dev / L", "Paper's time"],
    );
    for chapter in chapters {
        let Some(run) = chapter.run(Role::PassGsii) else { continue };
        let Some(point) = run.last() else { continue };
        let paper = chapter.paper().map(|i| PAPER_2[i]);
        table.push(vec![
            chapter.case(),
            format!("{:.3}", point.dev[0]),
            number(point.hires_share * point.rendering.cpu),
            or_dash(paper.map(|p| p[0].to_owned())),
            or_dash(paper.map(|p| p[1].to_owned())),
        ]);
    }
    table
}

const PASSES: [(Role, &str); 3] = [(Role::PassMcpt, "MCPT"), (Role::PassPmm, "PMM"), (Role::PassGsii, "GSII")];

fn table_3(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "table-3",
        "Table 3. LORES pass",
        "As Table 2, with the paper's r_thresh, beta and boxes, and patches as in Table 1. Time to the same noise: time x (L_dev / L)\u{b2}, MCPT = 1.",
        &[
            "Average reflectance",
            "Method",
            "Average L_dev / L",
            "Core seconds",
            "Time to the same noise",
            "Paper's L_dev / L",
            "Paper's time",
            "Paper's time to the same noise",
        ],
    );
    // Hours and minutes to minutes.
    let minutes = |text: &str| {
        let (h, m) = text.split_once(':').unwrap_or(("0", text));
        60.0 * h.parse::<f64>().unwrap_or(0.0) + m.parse::<f64>().unwrap_or(0.0)
    };
    for chapter in chapters {
        let effort = |role| {
            let point = chapter.run(role)?.last()?;
            Some((1.0 - point.hires_share) * point.rendering.cpu * point.dev[1].powi(2))
        };
        for (k, (role, method)) in PASSES.into_iter().enumerate() {
            let Some(point) = chapter.run(role).and_then(Record::last) else { continue };
            let relative = effort(role).zip(effort(Role::PassMcpt)).map(|(a, b)| number(a / b));
            let paper = chapter.paper().map(|i| PAPER_3[i]);
            let paper_effort = |k: usize| {
                let rows = paper?;
                Some(minutes(rows[k][1]) * rows[k][0].parse::<f64>().ok()?.powi(2))
            };
            table.push(vec![
                chapter.case(),
                method.to_owned(),
                format!("{:.3}", point.dev[1]),
                number((1.0 - point.hires_share) * point.rendering.cpu),
                or_dash(relative),
                or_dash(paper.map(|p| p[k][0].to_owned())),
                or_dash(paper.map(|p| p[k][1].to_owned())),
                or_dash(paper_effort(k).zip(paper_effort(0)).map(|(a, b)| number(a / b))),
            ]);
        }
    }
    table
}

/// Mean relative difference of indirect light of a run's best image.
pub fn indirect_difference(chapter: &Chapter<'_>, role: Role) -> Option<MeanRelative> {
    Some(chapter.run(role)?.last()?.indirect?.mean_relative)
}

fn table_4(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "table-4",
        "Table 4. Average relative differences, indirect component of radiance only",
        "Images averaged to about the paper's 100 pixels across. 'Without noise' is a lower bound that noise does not raise; the truth \
         lies between it and the line above. 'All of noise' is what the noise of both images would make of an image without any bias.",
        &["Scene", "Quantity", "R", "G", "B", "Paper's R", "G", "B"],
    );
    for chapter in chapters {
        let mut add = |what: &str, values: [f64; 3], paper: Option<usize>| {
            let mut row = vec![chapter.name.to_owned(), what.to_owned()];
            row.extend(values.map(|v| format!("{v:.3}")));
            let paper = paper.filter(|_| chapter.paper() == Some(1)).map(|k| PAPER_4[k]);
            row.extend((0..3).map(|c| or_dash(paper.map(|p| p[c].to_owned()))));
            table.push(row);
        };
        let methods = [
            (Role::PaperGsii, "|MCPT \u{2212} GSII| / MCPT, as in the paper", Some(0)),
            (Role::AtPaperRThresh, "|MCPT \u{2212} GSII| / MCPT, the paper's r_thresh", None),
            (Role::Gsii, "|MCPT \u{2212} GSII| / MCPT, defaults", None),
            (Role::PaperPmm, "|MCPT \u{2212} PMM| / MCPT, as in the paper", Some(1)),
            (Role::Pmm, "|MCPT \u{2212} PMM| / MCPT, defaults", None),
        ];
        for (role, what, paper) in methods {
            if let Some(m) = indirect_difference(chapter, role) {
                add(what, m.measured, paper);
                add("\u{2003}without noise, at least", m.at_least, None);
                add("\u{2003}all of noise", m.noise, None);
            }
        }
        if let Some(m) = indirect_difference(chapter, Role::Gsii) {
            add("L_dev / L for the reference (MCPT)", m.reference_noise, Some(2));
        }
    }
    table
}

/// relMSE of 2 % relative error.
const TWO_PER_CENT: f64 = 4e-4;

/// When direct light of GSII, and its indirect light, come to 2 % relative error. Acceleration structures, which both need, count for
/// neither.
fn price(chapter: &Chapter<'_>) -> Option<[Crossing; 2]> {
    let run = chapter.run(Role::Gsii)?;
    let preparation = |p: &Point| p.preparation.cpu - run.preparation.build.cpu;
    let hires = |p: &Point| p.hires_share * p.rendering.cpu;
    let lores = |p: &Point| (1.0 - p.hires_share) * p.rendering.cpu;
    let direct = crossing_after(run, TWO_PER_CENT, |_| 0.0, hires, |p| p.direct);
    let indirect = crossing_after(run, TWO_PER_CENT, preparation, lores, |p| p.indirect);
    Some([direct, indirect])
}

fn prices(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "prices",
        "Global light at the price of direct light",
        "Core seconds of GSII until direct light (HIRES) has 2 % relative error (root of relMSE of that light alone), and until indirect light has \
         (simplification, radiosity and LORES; bias included). Bias: of the whole image's mean, with its 95 % interval.",
        &["Scene", "Direct", "Indirect", "Indirect / direct", "Bias"],
    );
    for chapter in chapters {
        let Some([direct, indirect]) = price(chapter) else { continue };
        let ratio = direct.seconds().zip(indirect.seconds()).map(|(d, i)| number(i / d));
        let errors = chapter.run(Role::Gsii).and_then(|r| r.last()?.whole);
        let bias = errors.map(|e| signed_percent(e.relative_bias, e.relative_bias_error));
        table.push(vec![chapter.name.to_owned(), direct.text(), indirect.text(), or_dash(ratio), or_dash(bias)]);
    }
    table
}

fn crossings(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "crossings",
        "Time to a given error",
        "Core seconds from the scene in memory (acceleration structures, simplification and radiosity included) until relMSE of the image \
         is reached and kept. \u{2248}: continued beyond the last image measured. 'Best GSII' is the fastest of all its settings that were tried.",
        &["Scene", "Light", "relMSE", "MCPT", "PMM", "GSII", "MCPT / GSII", "Best GSII", "with"],
    );
    for chapter in chapters {
        for (light, whole) in [("all", true), ("indirect", false)] {
            for level in LEVELS {
                let of = |r: &Record| crossing(r, level, |p| if whole { p.whole } else { p.indirect });
                let text = |role| or_dash(chapter.run(role).map(|r| of(r).text()));
                let seconds = |role| chapter.run(role).and_then(|r| of(r).seconds());
                let ratio = seconds(Role::Mcpt).zip(seconds(Role::Gsii)).map(|(a, b)| number(a / b));
                let gsii = [
                    Role::Gsii,
                    Role::Gather,
                    Role::RThresh,
                    Role::Beta,
                    Role::Box,
                    Role::AtPaperRThresh,
                    Role::PaperGsii,
                ];
                let best = chapter
                    .records
                    .iter()
                    .filter(|r| gsii.contains(&r.role))
                    .filter_map(|r| Some((of(r).seconds()?, r)))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                table.push(vec![
                    chapter.name.to_owned(),
                    light.to_owned(),
                    format!("{level:.0e}"),
                    text(Role::Mcpt),
                    text(Role::Pmm),
                    text(Role::Gsii),
                    or_dash(ratio),
                    or_dash(best.map(|(_, r)| of(r).text())),
                    or_dash(best.map(|(_, r)| r.label.clone())),
                ]);
            }
        }
    }
    table
}

fn settings(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new(
        "settings",
        "All settings",
        "relMSE of the image with the most trials; of that, what more trials would not remove (below 0: next to none, within its \
         standard error). Bias of the mean with its 95 % confidence interval.",
        &[
            "Scene",
            "Run",
            "r_thresh",
            "Patches",
            "Clusters",
            "Preparation, core s",
            "Trials",
            "Rendering, core s",
            "relMSE",
            "not noise",
            "Bias of the mean",
            "relMSE, indirect",
            "not noise",
            "Bias, indirect",
        ],
    );
    let passes = [Role::PassMcpt, Role::PassPmm, Role::PassGsii];
    for chapter in chapters {
        for run in chapter.records.iter().filter(|r| !passes.contains(&r.role)) {
            let Some((point, whole)) = run.last().and_then(|p| Some((p, p.whole?))) else { continue };
            let bias = |e: super::error::Errors| signed_percent(e.relative_bias, e.relative_bias_error);
            let r_thresh = match run.parameter("r_thresh") {
                _ if run.parameters.get("method").is_some_and(|m| m == "radiosity") => DASH.to_owned(),
                Some(r) if r < f64::from(f32::MAX) => number(r),
                _ => "\u{221e}".to_owned(),
            };
            table.push(vec![
                chapter.name.to_owned(),
                run.label.clone(),
                r_thresh,
                run.preparation.patches.to_string(),
                run.preparation.clusters.to_string(),
                number(point.preparation.cpu),
                number(point.trials),
                number(point.rendering.cpu),
                format!("{:.1e}", whole.rel_mse),
                format!("{:.1e}", whole.bias_rel_mse),
                bias(whole),
                or_dash(point.indirect.map(|e| format!("{:.1e}", e.rel_mse))),
                or_dash(point.indirect.map(|e| format!("{:.1e}", e.bias_rel_mse))),
                or_dash(point.indirect.map(bias)),
            ]);
        }
    }
    table
}

/// Time against the number of triangles.
pub fn scaling(records: &[Record]) -> Table {
    let mut table = Table::new(
        "scaling",
        "Scaling with the number of triangles",
        "One office with more and more detail. Time for 10 % noise: rendering time x (noise / 10 %)\u{b2}, with the noise measured from the image's own \
         halves. No reference is needed for this, and bias is not in it.",
        &[
            "Scene",
            "Triangles",
            "Method",
            "Clusters",
            "Patches",
            "Preparation, core s",
            "Core \u{b5}s per trial",
            "Noise",
            "Core s for 10 % noise, with preparation",
        ],
    );
    for run in records {
        let Some(point) = run.last() else { continue };
        table.push(vec![
            run.scene.clone(),
            run.triangles.to_string(),
            run.label.clone(),
            run.preparation.clusters.to_string(),
            run.preparation.patches.to_string(),
            number(run.preparation.all.cpu),
            number(microseconds_per_trial(run)),
            format!("{:.1} %", 100.0 * point.noise),
            number(to_ten_per_cent(run)),
        ]);
    }
    table
}

/// Core microseconds for one trial of one pixel.
pub fn microseconds_per_trial(run: &Record) -> f64 {
    run.last().map_or(0.0, |p| 1e6 * p.rendering.cpu / (p.trials * run.parameter("pixels").unwrap_or(1.0)))
}

/// Core seconds until an image has 10 % noise, preparation included.
pub fn to_ten_per_cent(run: &Record) -> f64 {
    run.last().map_or(0.0, |p| p.preparation.cpu + p.rendering.cpu * (p.noise / 0.1).powi(2))
}

/// All tables about scenes with a reference.
pub fn all(chapters: &[Chapter<'_>]) -> Vec<Table> {
    vec![
        table_1(chapters),
        table_2(chapters),
        table_3(chapters),
        table_4(chapters),
        crossings(chapters),
        prices(chapters),
        settings(chapters),
    ]
}

/// What the project set out to reach, and whether it does.
pub fn goals(chapters: &[Chapter<'_>]) -> Table {
    let mut table = Table::new("goals", "Goals", "", &["Goal", "Scene", "Measured", ""]);
    let verdict = |met: bool| (if met { "\u{2713} met" } else { "\u{2717} not met" }).to_owned();
    for chapter in chapters.iter().filter(|c| c.paper().is_some()) {
        if let [Some(simple), Some(complete)] = [Role::RadiositySimple, Role::RadiosityComplex].map(|r| chapter.run(r))
        {
            let (simple, complete) = (&simple.preparation, &complete.preparation);
            let share = |a: u64, b: u64| 100.0 * a as f64 / b.max(1) as f64;
            let (surfaces, patches) =
                (share(simple.surfaces, complete.surfaces), share(simple.patches, complete.patches));
            table.push(vec![
                "N+S has at most 2 % of the surfaces and patches of N+C at the paper's parameters".to_owned(),
                chapter.name.to_owned(),
                format!("{surfaces:.2} % and {patches:.2} %"),
                verdict(surfaces <= 2.0 && patches <= 2.0),
            ]);
        }
        if let Some(ratio) = radiosity_ratio(chapter) {
            table.push(vec![
                "Radiosity on N+S at least 100 times faster than on N+C, to the same unshot share".to_owned(),
                chapter.name.to_owned(),
                format!("{} times", number(ratio)),
                verdict(ratio >= 100.0),
            ]);
        }
    }
    for chapter in chapters {
        let mean = |v: [f64; 3]| v.iter().sum::<f64>() / 3.0;
        if let Some(m) = indirect_difference(chapter, Role::AtPaperRThresh) {
            let (least, most) = (mean(m.at_least), mean(m.measured));
            let met = match (most <= 0.03, least > 0.03) {
                (true, _) => verdict(true),
                (_, true) => verdict(false),
                _ => "open: hidden by noise".to_owned(),
            };
            table.push(vec![
                "Mean relative difference of indirect light, GSII against MCPT, at most 0.03 at the paper's r_thresh"
                    .to_owned(),
                chapter.name.to_owned(),
                format!("between {least:.3} and {most:.3}"),
                met,
            ]);
            let noise = mean(m.reference_noise);
            table.push(vec![
                "\u{2003}with at most 0.005 of noise in the reference".to_owned(),
                chapter.name.to_owned(),
                format!("{noise:.4}"),
                verdict(noise <= 0.005),
            ]);
        }
    }
    for chapter in chapters {
        for level in LEVELS {
            let of = |role| chapter.run(role).map(|r| crossing(r, level, |p| p.whole));
            let (Some(gsii), Some(mcpt)) = (of(Role::Gsii), of(Role::Mcpt)) else { continue };
            let met = match (gsii.seconds(), mcpt.seconds()) {
                (Some(a), Some(b)) => a < b,
                (a, _) => a.is_some(),
            };
            table.push(vec![
                format!("GSII reaches relMSE {level:.0e} before MCPT"),
                chapter.name.to_owned(),
                format!("GSII {}, MCPT {} core s", gsii.text(), mcpt.text()),
                verdict(met),
            ]);
        }
        if let Some([direct, indirect]) = price(chapter) {
            let met = direct.seconds().zip(indirect.seconds()).is_some_and(|(d, i)| i <= d);
            table.push(vec![
                "Indirect light at 2 % takes no longer than direct light at 2 %".to_owned(),
                chapter.name.to_owned(),
                format!("indirect {}, direct {} core s", indirect.text(), direct.text()),
                verdict(met),
            ]);
        }
    }
    table
}
