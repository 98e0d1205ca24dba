//! Writes what a study found: tables, plots, pictures, one file of all numbers, and the page.

use std::path::{Path, PathBuf};

use base64::Engine;
use serde_json::json;

use super::error::difference;
use super::page::{self, Figure};
use super::plan::Role;
use super::plot::{self, Bar, Bars, Chart, Line};
use super::record::{Point, Record, make_folder, write_file};
use super::table::Table;
use super::tables;
use super::{Chapter, Study, pictures};
use crate::error::{Error, Result};

/// What a page shows of one scene.
pub struct Section {
    /// The scene's name.
    pub name: String,
    /// Facts about the scene and its reference.
    pub facts: String,
    /// Methods after the same time.
    pub same_time: Vec<Figure>,
    /// What the time was, core seconds.
    pub time: f64,
    /// Settings after all of their trials.
    pub settled: Vec<Figure>,
    /// Plots as SVG.
    pub plots: Vec<String>,
}

/// Writes everything into a folder.
///
/// # Errors
/// When a file cannot be written or an image of a finished run cannot be read.
pub fn write(study: &Study, output: &Path) -> Result<()> {
    for name in ["tables", "plots", "images"] {
        make_folder(&output.join(name))?;
    }
    let chapters: Vec<tables::Chapter<'_>> = study
        .chapters
        .iter()
        .map(|c| tables::Chapter { name: &c.subject.name, reflectance: c.subject.reflectance, records: &c.records })
        .collect();
    let mut all = tables::all(&chapters);
    if !study.scaling.is_empty() {
        all.push(tables::scaling(&study.scaling));
    }
    // Without scenes that all methods run on, some have nothing to say.
    all.retain(|table| !table.rows.is_empty());
    let goals = tables::goals(&chapters);
    let mut sections = Vec::new();
    for chapter in &study.chapters {
        sections.push(section(study, chapter, output)?);
    }
    let scaling = scaling_plots(&study.scaling, output)?;
    for table in &all {
        write_file(&output.join("tables").join(format!("{}.csv", table.name)), table.csv().as_bytes())?;
    }
    let markdown: Vec<String> = std::iter::once(&goals).chain(&all).map(Table::markdown).collect();
    let head = "# Speed against error\n\nMade by `gsii study`; [index.html](index.html) shows the same with plots and pictures.\n\n";
    write_file(&output.join("README.md"), format!("{head}{}", markdown.join("\n")).as_bytes())?;
    write_file(&output.join("study.json"), numbers(study).as_bytes())?;
    write_file(&output.join("index.html"), page::html(&goals, &all, &sections, &scaling).as_bytes())
}

fn numbers(study: &Study) -> String {
    let scenes: Vec<_> = study
        .chapters
        .iter()
        .map(|c| {
            json!({
                "name": c.subject.name,
                "average_reflectance": c.subject.reflectance,
                "size": c.subject.size,
                "reference_trials": c.reference.trials,
                "runs": c.records,
            })
        })
        .collect();
    let all = json!({ "version": env!("CARGO_PKG_VERSION"), "scenes": scenes, "scaling": study.scaling });
    format!("{all:#}\n")
}

fn section(study: &Study, chapter: &Chapter, output: &Path) -> Result<Section> {
    let name = &chapter.subject.name;
    let album = Album::new(study, chapter, output)?;
    let time = same_time(&chapter.records);
    let mut same = vec![album.reference()?];
    for role in [Role::Gsii, Role::Pmm, Role::Mcpt] {
        let run = chapter.records.iter().find(|r| r.role == role);
        if let Some((run, point)) = run.and_then(|r| Some((r, nearest(r, time)?))) {
            same.push(album.figure(run, point, "same-time")?);
        }
    }
    let mut settled = Vec::new();
    let shown = [
        Role::Gsii,
        Role::Gather,
        Role::AtPaperRThresh,
        Role::PaperGsii,
        Role::Pmm,
        Role::PaperPmm,
        Role::RadiositySimple,
        Role::RadiosityComplex,
    ];
    for run in shown.iter().filter_map(|role| chapter.records.iter().find(|r| r.role == *role)) {
        if let Some(point) = run.last() {
            settled.push(album.figure(run, point, "settled")?);
        }
    }
    if let Some((run, point)) = chapter.records.iter().find(|r| r.role == Role::Gsii).and_then(|r| Some((r, r.last()?)))
    {
        settled.insert(0, album.direct(run, point)?);
    }
    let mut plots = Vec::new();
    for (file, svg) in curves(chapter) {
        write_file(&output.join("plots").join(format!("{name}-{file}.svg")), plot::standalone(&svg).as_bytes())?;
        plots.push(svg);
    }
    Ok(Section { name: name.clone(), facts: facts(chapter), same_time: same, time, settled, plots })
}

fn facts(chapter: &Chapter) -> String {
    let subject = &chapter.subject;
    let noise = chapter.records.iter().find_map(|r| Some(r.last()?.indirect?.mean_relative.reference_noise));
    let noise = noise.map_or(String::new(), |n| {
        format!(
            ", whose indirect light has {:.1} % noise left in the mean over bands",
            100.0 * n.iter().sum::<f64>() / 3.0
        )
    });
    format!(
        "{} triangles, average reflectance {:.2}, {} x {} pixels. Reference: {} path-traced trials of each pixel in two independent halves{noise}.",
        subject.scene.mesh.triangles.len(),
        subject.reflectance,
        subject.size[0],
        subject.size[1],
        chapter.reference.trials
    )
}

/// The time at which methods are shown side by side: when GSII has 16 trials of each pixel.
fn same_time(records: &[Record]) -> f64 {
    let gsii = records.iter().find(|r| r.role == Role::Gsii);
    let point = gsii.and_then(|r| r.points.iter().find(|p| p.trials >= 16.0).or(r.last()));
    point.map_or(0.0, |p| p.total().cpu)
}

/// The image that was there at about a time.
fn nearest(run: &Record, time: f64) -> Option<&Point> {
    let distance = |p: &Point| (p.total().cpu / time).ln().abs();
    run.points.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Makes pictures of one scene.
struct Album<'a> {
    study: &'a Study,
    chapter: &'a Chapter,
    folder: PathBuf,
    exposure: f32,
    reference: super::error::Plane,
}

impl<'a> Album<'a> {
    fn new(study: &'a Study, chapter: &'a Chapter, output: &Path) -> Result<Album<'a>> {
        let reference = chapter.reference.picture.whole.mean();
        let exposure = pictures::exposure(chapter.subject.size[0], &reference);
        Ok(Album { study, chapter, folder: output.join("images"), exposure, reference })
    }

    fn width(&self) -> u32 {
        self.chapter.subject.size[0]
    }

    fn path(&self, what: &str) -> PathBuf {
        let plain: String =
            what.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
        self.folder.join(format!("{}-{plain}.jpg", self.chapter.subject.name))
    }

    fn photograph(&self, what: &str, plane: &super::error::Plane) -> Result<String> {
        let path = self.path(what);
        pictures::photograph(&path, self.width(), plane, self.exposure)?;
        data_uri(&path)
    }

    fn reference(&self) -> Result<Figure> {
        Ok(Figure {
            title: "Reference".to_owned(),
            caption: format!("MCPT, {} trials", self.chapter.reference.trials),
            image: self.photograph("reference", &self.reference)?,
            difference: None,
        })
    }

    fn figure(&self, run: &Record, point: &Point, series: &str) -> Result<Figure> {
        let [whole, _] = pictures::read(&self.study.store.image(&run.key, point.trials))?;
        let name = format!("{series}-{}", run.role);
        let path = self.path(&format!("{name}-difference"));
        pictures::difference(&path, self.width(), &whole, &self.reference)?;
        let error = point.whole.map_or(String::new(), |e| {
            format!(", relMSE {:.1e}, bias of the mean {:+.1} %", e.rel_mse, 100.0 * e.relative_bias)
        });
        Ok(Figure {
            title: run.label.clone(),
            caption: format!("{:.0} trials, {:.1} core s{error}", point.trials, point.total().cpu),
            image: self.photograph(&name, &whole)?,
            difference: Some(data_uri(&path)?),
        })
    }

    fn direct(&self, run: &Record, point: &Point) -> Result<Figure> {
        let [whole, indirect] = pictures::read(&self.study.store.image(&run.key, point.trials))?;
        let direct = difference(&whole, &indirect);
        let truth = difference(&self.reference, &self.chapter.reference.picture.indirect.mean());
        let path = self.path("direct-difference");
        pictures::difference(&path, self.width(), &direct, &truth)?;
        Ok(Figure {
            title: "Direct light alone (HIRES)".to_owned(),
            caption: format!("the same for all methods, {:.0} trials", point.trials),
            image: self.photograph("direct", &direct)?,
            difference: Some(data_uri(&path)?),
        })
    }
}

fn data_uri(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::Input { path: path.to_owned(), reason: e.to_string() })?;
    Ok(format!("data:image/jpeg;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes)))
}

/// A run's curve.
type Curve = Box<dyn Fn(&Record, &Point) -> Option<f64>>;

fn curves(chapter: &Chapter) -> Vec<(&'static str, String)> {
    let main = [Role::Gsii, Role::Mcpt, Role::Pmm];
    let others = [Role::Gather, Role::AtPaperRThresh, Role::PaperGsii, Role::RThresh];
    let lines = |roles: &[Role], first: usize, minor: bool, y: &Curve| -> Vec<Line> {
        let runs = roles.iter().flat_map(|role| chapter.records.iter().filter(move |r| r.role == *role));
        runs.enumerate()
            .map(|(i, run)| Line {
                label: run.label.clone(),
                colour: first + i,
                minor,
                points: run.points.iter().filter_map(|p| Some((p.total().cpu, y(run, p)?))).collect(),
            })
            .collect()
    };
    let wanted: [(&str, &str, &str, Curve); 4] = [
        ("relmse", "Error of the image against time", "relMSE", Box::new(|_, p| Some(p.whole?.rel_mse))),
        ("relmse-indirect", "Error of indirect light alone", "relMSE", Box::new(|_, p| Some(p.indirect?.rel_mse))),
        (
            "mean-relative",
            "Mean relative error of the image",
            "mean |difference| / reference",
            Box::new(|_, p| Some(p.whole?.mean_relative.measured.iter().sum::<f64>() / 3.0)),
        ),
        (
            "mean-relative-indirect",
            "Mean relative error of indirect light",
            "mean |difference| / reference",
            Box::new(|_, p| Some(p.indirect?.mean_relative.measured.iter().sum::<f64>() / 3.0)),
        ),
    ];
    let mut plots = Vec::new();
    for (file, title, y, curve) in wanted {
        let mut all = lines(&main, 0, false, &curve);
        all.extend(lines(&others, 3, true, &curve));
        let chart = Chart {
            title: format!("{}: {}", chapter.subject.name, title.to_lowercase()),
            x: "core seconds, preparation included".to_owned(),
            y: y.to_owned(),
            lines: all,
        };
        plots.extend(plot::chart(&chart).map(|svg| (file, svg)));
    }
    let passes = [Role::PassMcpt, Role::PassPmm, Role::PassGsii];
    let percent = |e: super::error::Errors| (100.0 * e.relative_bias, 196.0 * e.relative_bias_error);
    let bars = chapter.records.iter().filter(|r| !passes.contains(&r.role)).filter_map(|run| {
        let point = run.last()?;
        Some(Bar { label: run.label.clone(), values: [point.whole.map(percent), point.indirect.map(percent)] })
    });
    let bars = Bars {
        title: format!("{}: bias of the mean, apart from noise", chapter.subject.name),
        x: "brighter than the reference, per cent, with 95 % confidence intervals".to_owned(),
        names: ["all light", "indirect light"],
        bars: bars.collect(),
    };
    plots.extend(plot::bars(&bars).map(|svg| ("bias", svg)));
    plots
}

fn scaling_plots(records: &[Record], output: &Path) -> Result<Vec<String>> {
    let methods = ["GSII", "MCPT", "PMM"];
    let chart = |title: &str, y: &str, value: &dyn Fn(&Record) -> f64| Chart {
        title: title.to_owned(),
        x: "triangles".to_owned(),
        y: y.to_owned(),
        lines: methods
            .iter()
            .enumerate()
            .map(|(colour, label)| Line {
                label: (*label).to_owned(),
                colour,
                minor: false,
                points: records.iter().filter(|r| r.label == *label).map(|r| (r.triangles as f64, value(r))).collect(),
            })
            .collect(),
    };
    let charts = [
        ("scaling-preparation", chart("Preparation against triangles", "core seconds", &|r| r.preparation.all.cpu)),
        (
            "scaling-trial",
            chart("Cost of a trial against triangles", "core \u{b5}s per trial", &tables::microseconds_per_trial),
        ),
        (
            "scaling-noise",
            chart(
                "Time to 10 % noise against triangles",
                "core seconds, preparation included",
                &tables::to_ten_per_cent,
            ),
        ),
    ];
    let mut plots = Vec::new();
    for (file, svg) in charts.iter().filter_map(|(file, c)| Some((file, plot::chart(c)?))) {
        write_file(&output.join("plots").join(format!("{file}.svg")), plot::standalone(&svg).as_bytes())?;
        plots.push(svg);
    }
    Ok(plots)
}
