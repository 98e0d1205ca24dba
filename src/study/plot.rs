//! Plots as SVG that follow the reader's light or dark theme.

use std::error::Error as StdError;

use plotters::coord::combinators::BindKeyPoints;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Stands for the colour of text; the reader's theme decides which that is.
const INK: RGBColor = RGBColor(1, 2, 3);
/// The same as it comes out in the file.
const INK_TEXT: &str = "\"#010203\"";

const WIDTH: u32 = 1240;
const HEIGHT: u32 = 720;
const LEGEND: u32 = 330;
const FONT: &str = "system-ui, sans-serif";

/// Colours that can be told apart by everybody on light and dark paper (after Okabe and Ito).
const COLOURS: [RGBColor; 8] = [
    RGBColor(226, 88, 34),
    RGBColor(45, 133, 202),
    RGBColor(222, 160, 10),
    RGBColor(30, 160, 125),
    RGBColor(185, 105, 180),
    RGBColor(120, 130, 140),
    RGBColor(100, 185, 225),
    RGBColor(165, 110, 60),
];

/// One line of a [`Chart`].
#[derive(Clone, Debug)]
pub struct Line {
    /// For the legend.
    pub label: String,
    /// Number of its colour.
    pub colour: usize,
    /// Thin and dashed: a setting among others.
    pub minor: bool,
    /// In order.
    pub points: Vec<(f64, f64)>,
}

/// Lines over logarithmic axes.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// What the horizontal axis shows, with its unit.
    pub x: String,
    /// What the vertical axis shows.
    pub y: String,
    /// Lines; values that are not above 0 are left out.
    pub lines: Vec<Line>,
}

/// A value with its 95 % confidence interval, beside others.
#[derive(Clone, Debug)]
pub struct Bar {
    /// What it belongs to.
    pub label: String,
    /// Two values (all light, indirect light) and half of their intervals.
    pub values: [Option<(f64, f64)>; 2],
}

/// Values around 0 with their intervals, one below the other.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Heading.
    pub title: String,
    /// What the axis shows.
    pub x: String,
    /// What the two values of each bar are.
    pub names: [&'static str; 2],
    /// From the top.
    pub bars: Vec<Bar>,
}

/// SVG of a plot for a file of its own: text is dark, or light where the reader prefers dark pages.
pub fn standalone(svg: &str) -> String {
    let style = "<style>svg{color:#1c2024}@media (prefers-color-scheme:dark){svg{color:#e8eaed}}</style>";
    match svg.split_once(">\n") {
        Some((head, rest)) => format!("{head} color=\"#1c2024\">\n{style}\n{rest}"),
        None => svg.to_owned(),
    }
}

fn finish(svg: String, size: (u32, u32)) -> String {
    // The width is the page's business, and text takes the colour of the text around it.
    let fixed = format!("width=\"{}\" height=\"{}\" ", size.0, size.1);
    svg.replacen(&fixed, "", 1).replace(INK_TEXT, "\"currentColor\"")
}

/// Smallest and largest of some values with room around them, as whole or half decades.
fn log_range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = values.fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    (low <= high).then(|| {
        let snug = |x: f64, up: bool| {
            let x = 3.0 * x.log10();
            10f64.powf(if up { (x + 0.15).ceil() } else { (x - 0.15).floor() } / 3.0)
        };
        (snug(low, false), snug(high, true))
    })
}

/// Ticks of a logarithmic axis: decades, with 2 and 5 between them where there are few.
fn log_ticks((low, high): (f64, f64)) -> Vec<f64> {
    let steps: &[f64] = if (high / low).log10() > 2.4 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = decades.flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
    all.filter(|t| (low * 0.999..=high * 1.001).contains(t)).collect()
}

/// `1000`, `0.01`, `10^-4` with raised digits.
fn tick_label(v: &f64) -> String {
    let exponent = v.log10().floor() as i32;
    if (-3..=4).contains(&exponent) {
        // f64's shortest form, without the rounding noise of powers.
        return format!("{}", (v * 1e6).round() / 1e6);
    }
    let digits = [
        '\u{2070}', '\u{b9}', '\u{b2}', '\u{b3}', '\u{2074}', '\u{2075}', '\u{2076}', '\u{2077}', '\u{2078}',
        '\u{2079}',
    ];
    let raised: String = exponent.unsigned_abs().to_string().bytes().map(|b| digits[usize::from(b - b'0')]).collect();
    let sign = if exponent < 0 { "\u{207b}" } else { "" };
    let factor = (v / 10f64.powi(exponent)).round();
    if factor == 1.0 { format!("10{sign}{raised}") } else { format!("{factor}\u{b7}10{sign}{raised}") }
}

fn text(size: u32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&INK)
}

fn colour(number: usize) -> RGBColor {
    COLOURS[number % COLOURS.len()]
}

/// Draws a chart; `None` when it has no point.
pub fn chart(chart: &Chart) -> Option<String> {
    let positive = |line: &Line| line.points.iter().copied().filter(|p| p.0 > 0.0 && p.1 > 0.0).collect::<Vec<_>>();
    let lines: Vec<Line> = chart.lines.iter().map(|l| Line { points: positive(l), ..l.clone() }).collect();
    let x = log_range(lines.iter().flat_map(|l| l.points.iter().map(|p| p.0)))?;
    let y = log_range(lines.iter().flat_map(|l| l.points.iter().map(|p| p.1)))?;
    let mut svg = String::new();
    // Drawing into a string fails for want of memory only.
    draw_chart(&mut svg, chart, &lines, x, y).inspect_err(|e| log::warn!("{}: {e}", chart.title)).ok()?;
    Some(finish(svg, (WIDTH, HEIGHT)))
}

fn draw_chart(
    svg: &mut String,
    chart: &Chart,
    lines: &[Line],
    x: (f64, f64),
    y: (f64, f64),
) -> Result<(), Box<dyn StdError>> {
    {
        let root = SVGBackend::with_string(svg, (WIDTH, HEIGHT)).into_drawing_area();
        root.draw(&Text::new(chart.title.clone(), (12, 8), text(30).pos(Pos::new(HPos::Left, VPos::Top))))?;
        let (left, right) = root.margin(54, 6, 6, 0).split_horizontally(WIDTH - LEGEND);
        let mut context = ChartBuilder::on(&left)
            .x_label_area_size(72)
            .y_label_area_size(104)
            .margin_right(16)
            .margin_top(10)
            .build_cartesian_2d(
                (x.0..x.1).log_scale().with_key_points(log_ticks(x)),
                (y.0..y.1).log_scale().with_key_points(log_ticks(y)),
            )?;
        context
            .configure_mesh()
            .bold_line_style(INK.mix(0.16))
            .light_line_style(TRANSPARENT)
            .axis_style(INK.mix(0.5))
            .x_desc(chart.x.clone())
            .y_desc(chart.y.clone())
            .axis_desc_style(text(25))
            .label_style(text(23))
            .x_label_formatter(&tick_label)
            .y_label_formatter(&tick_label)
            .draw()?;
        for line in lines {
            let c = colour(line.colour);
            if line.minor {
                context.draw_series(DashedLineSeries::new(line.points.clone(), 9, 6, c.stroke_width(3)))?;
            } else {
                context.draw_series(LineSeries::new(line.points.clone(), c.stroke_width(5)))?;
            }
            let radius = if line.minor { 4 } else { 7 };
            context.draw_series(line.points.iter().map(|p| Circle::new(*p, radius, c.filled())))?;
        }
        for (i, line) in lines.iter().enumerate() {
            let row = 26 + 38 * i as i32;
            let width = if line.minor { 3 } else { 6 };
            right.draw(&PathElement::new(vec![(8, row), (44, row)], colour(line.colour).stroke_width(width)))?;
            right.draw(&Text::new(line.label.clone(), (54, row), text(23).pos(Pos::new(HPos::Left, VPos::Center))))?;
        }
        root.present()?;
    }
    Ok(())
}

/// A linear axis whose ticks are chosen here.
struct Ticks(RangedCoordf64, Vec<f64>);

impl Ranged for Ticks {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;
    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.0.map(value, limit)
    }
    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.1.clone()
    }
    fn range(&self) -> std::ops::Range<f64> {
        self.0.range()
    }
}

impl plotters::coord::ranged1d::ValueFormatter<f64> for Ticks {
    fn format(value: &f64) -> String {
        format!("{value}")
    }
}

/// Draws bars; `None` when there are none.
pub fn bars(bars: &Bars) -> Option<String> {
    let all = || bars.bars.iter().flat_map(|b| b.values.iter().flatten());
    let reach = all().map(|(v, ci)| v.abs() + ci).fold(0.0_f64, f64::max);
    if reach <= 0.0 || !reach.is_finite() {
        return None;
    }
    let size = (WIDTH, 190 + 48 * bars.bars.len() as u32);
    let mut svg = String::new();
    draw_bars(&mut svg, bars, 1.06 * reach, size).inspect_err(|e| log::warn!("{}: {e}", bars.title)).ok()?;
    Some(finish(svg, size))
}

fn draw_bars(svg: &mut String, bars: &Bars, reach: f64, size: (u32, u32)) -> Result<(), Box<dyn StdError>> {
    // Steps of 1, 2 or 5 that give about eight ticks.
    let rough = reach / 4.0;
    let decade = 10f64.powf(rough.log10().floor());
    let step = decade * [1.0, 2.0, 5.0, 10.0].into_iter().find(|s| s * decade >= rough).unwrap_or(10.0);
    let ticks = (-9..=9).map(|i| f64::from(i) * step).filter(|t| t.abs() <= reach).collect();
    let n = bars.bars.len() as f64;
    let rows = (0..bars.bars.len()).map(|i| i as f64 + 0.5).collect();
    {
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        root.draw(&Text::new(bars.title.clone(), (12, 8), text(30).pos(Pos::new(HPos::Left, VPos::Top))))?;
        for (k, name) in bars.names.into_iter().enumerate() {
            let at = (WIDTH as i32 - 420 + 200 * k as i32, 24);
            root.draw(&Circle::new(at, 7, colour(k).filled()))?;
            root.draw(&Text::new(name, (at.0 + 16, at.1), text(23).pos(Pos::new(HPos::Left, VPos::Center))))?;
        }
        let area = root.margin(54, 6, 6, 16);
        let mut context = ChartBuilder::on(&area)
            .x_label_area_size(72)
            .y_label_area_size(370)
            .build_cartesian_2d(Ticks((-reach..reach).into(), ticks), Ticks((n..0.0).into(), rows))?;
        let name = |y: &f64| bars.bars.get(*y as usize).map_or(String::new(), |b| b.label.clone());
        context
            .configure_mesh()
            .bold_line_style(INK.mix(0.16))
            .light_line_style(TRANSPARENT)
            .axis_style(INK.mix(0.5))
            .x_desc(bars.x.clone())
            .axis_desc_style(text(25))
            .label_style(text(23))
            .x_label_formatter(&|v| match (v * 1e6).round() / 1e6 {
                0.0 => "0".to_owned(),
                v => format!("{v:+}"),
            })
            .y_label_formatter(&name)
            .draw()?;
        context.draw_series(LineSeries::new([(0.0, 0.0), (0.0, n)], INK.mix(0.8).stroke_width(2)))?;
        for (i, bar) in bars.bars.iter().enumerate() {
            for (k, value) in bar.values.iter().enumerate() {
                let Some((v, ci)) = value else { continue };
                let y = i as f64 + 0.36 + 0.28 * k as f64;
                let c = colour(k);
                context.draw_series(LineSeries::new([(v - ci, y), (v + ci, y)], c.mix(0.7).stroke_width(4)))?;
                context.draw_series([Circle::new((*v, y), 7, c.filled())])?;
            }
        }
        root.present()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside() {
        assert_eq!(log_ticks((0.9, 11.0)), [1.0, 2.0, 5.0, 10.0]);
        assert_eq!(log_ticks((1e-4, 1.0)), [1e-4, 1e-3, 1e-2, 0.1, 1.0]);
        let labels: Vec<String> = [1e-5, 2e-6, 0.01, 5.0, 1000.0, 1e6].iter().map(tick_label).collect();
        assert_eq!(labels, ["10\u{207b}\u{2075}", "2\u{b7}10\u{207b}\u{2076}", "0.01", "5", "1000", "10\u{2076}"]);
    }

    #[test]
    fn a_chart_is_svg_without_fixed_ink() {
        let line = Line {
            label: "a & b".into(),
            colour: 0,
            minor: false,
            points: vec![(1.0, 0.1), (10.0, 0.0), (100.0, 0.01)],
        };
        let svg = chart(&Chart { title: "t".into(), x: "x".into(), y: "y".into(), lines: vec![line] }).unwrap();
        assert!(svg.starts_with("<svg viewBox=") && svg.contains("a &amp; b") && svg.contains("currentColor"));
        assert!(!svg.contains(INK_TEXT));
        assert!(standalone(&svg).contains("prefers-color-scheme"));
        let empty = Chart { title: "t".into(), x: "x".into(), y: "y".into(), lines: Vec::new() };
        assert!(chart(&empty).is_none());
    }
}
