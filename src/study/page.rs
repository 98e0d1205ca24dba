//! The page: one file of HTML that needs nothing else.

use super::pictures::FULL_DIFFERENCE;
use super::report::Section;
use super::table::{Table, escape, number};

/// An image with its difference from the reference.
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// More about it.
    pub caption: String,
    /// As a data URI.
    pub image: String,
    /// Signed relative difference, as a data URI; none for the reference itself.
    pub difference: Option<String>,
}

const CSS: &str = include_str!("page.css");

/// The whole page.
pub fn html(goals: &Table, tables: &[Table], sections: &[Section], scaling: &[String]) -> String {
    let links = sections
        .iter()
        .map(|s| (s.name.clone(), s.name.clone()))
        .chain([("tables".to_owned(), "Tables".to_owned())])
        .chain((!scaling.is_empty()).then(|| ("scaling-plots".to_owned(), "Scaling".to_owned())))
        .chain([("how".to_owned(), "How it was measured".to_owned())]);
    let nav: String = links.map(|(id, text)| format!("<a href=\"#{}\">{}</a>", escape(&id), escape(&text))).collect();
    let body: String = sections.iter().map(section).collect();
    let in_scaling = |t: &&Table| t.name == "scaling";
    let of_scenes: String = tables.iter().filter(|t| !in_scaling(t)).map(Table::html).collect();
    let of_scaling: String = tables.iter().filter(in_scaling).map(Table::html).collect();
    let scaling = if scaling.is_empty() {
        String::new()
    } else {
        format!("<h2 id=scaling-plots>Scaling</h2>{}{of_scaling}", plots(scaling))
    };
    format!(
        "<!doctype html>\n<html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width,initial-scale=1\">\
         <meta name=color-scheme content=\"light dark\"><title>gsii: speed against error</title><style>{CSS}</style>\n<main>\
         <h1>Speed against error</h1>\
         <p class=lead>Five ways to compute global illumination, through one scene, one sampler and one film, so that a difference is the \
         method's and nothing else's: path tracing (MCPT), the progressive multi-pass method (PMM), geometric simplification for \
         indirect illumination (GSII), and radiosity shown directly on both geometries. After Rushmeier, Patterson and Veerasamy, 1993.</p>\
         <nav>{nav}</nav>\n{}\n{body}\n<h2 id=tables>Tables</h2>\n{of_scenes}\n{scaling}\n{}</main></html>\n",
        goals.html(),
        how()
    )
}

fn section(s: &Section) -> String {
    let scale = format!(
        "Red is too bright, blue too dark<span class=scale></span>full colour from {:.0} %. Point at an image to see where it differs.",
        100.0 * FULL_DIFFERENCE
    );
    format!(
        "<h2 id=\"{}\">{}</h2><p>{}</p>\n<h3>After the same time: about {} core seconds</h3><p class=note>{scale}</p>{}\n\
         <h3>Error against time</h3>{}\n<h3>After all trials</h3>\
         <p class=note>Each image above, its difference from the reference below.</p>{}\n",
        escape(&s.name),
        escape(&s.name),
        escape(&s.facts),
        number(s.time),
        grid(&s.same_time),
        plots(&s.plots),
        grid(&s.settled),
    )
}

fn grid(figures: &[Figure]) -> String {
    let figure = |f: &Figure| {
        let alt = escape(&f.title);
        let (over, below) = f.difference.as_ref().map_or_else(Default::default, |d| {
            (
                format!("<img class=over src=\"{d}\" alt=\"\">"),
                format!("<img src=\"{d}\" alt=\"difference of {alt} from the reference\">"),
            )
        });
        format!(
            "<figure class=shot><span class=stack><img src=\"{}\" alt=\"{alt}\">{over}</span>{below}\
             <figcaption><b>{alt}</b>{}</figcaption></figure>\n",
            f.image,
            escape(&f.caption)
        )
    };
    format!("<div class=grid>{}</div>", figures.iter().map(figure).collect::<String>())
}

fn plots(svgs: &[String]) -> String {
    format!("<div class=plots>{}</div>", svgs.iter().map(|svg| format!("<div>{svg}</div>\n")).collect::<String>())
}

fn how() -> &'static str {
    "<h2 id=how>How it was measured</h2>\
     <p><b>Time</b> is that of all cores together (core seconds): it does not depend on what else the machine does. It starts with the scene \
     in memory and includes acceleration structures, simplification and radiosity.</p>\
     <p><b>relMSE</b> is the mean over pixels and bands of (image \u{2212} reference)\u{b2} / (reference\u{b2} + 0.01 mean\u{b2}). The reference is path \
     traced in two halves with independent random numbers; the product of the differences to each half has the expectation of the squared error \
     without the reference's own noise. Each image has two halves too: mixing those tells what more trials would not remove (its bias) from noise. What both halves share, the interpolated indirect light of GSII and its radiosity \
     solution, counts as bias here, though part of it is noise of another kind.</p>\
     <p><b>Curves</b> of MCPT, PMM and GSII as they are by default, of GSII without interpolation and of GSII with the paper's r_thresh show images that were asked for with half the error of the one before (gsii render \
     --error), each with all that it takes from its beginning. Those of other settings come from one run each whose trials double. Seeds of images and \
     reference differ.</p>\
     <p>Thick lines: the methods as they are by default. Dashed: GSII with other settings.</p>"
}
