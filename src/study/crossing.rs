//! When a curve of error against time falls below a given error.

use super::error::Errors;
use super::plan::Role;
use super::record::{Point, Record};

/// Errors that crossings are reported for.
pub const LEVELS: [f64; 2] = [1e-2, 1e-3];

/// When a method is as good as wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossing {
    /// After so many core seconds.
    At(f64),
    /// After about so many: the curve ends above, and was continued with the noise falling as trials grow.
    About(f64),
    /// Never: what does not vanish with more trials is larger.
    Never {
        /// That part of relMSE.
        floor: f64,
    },
    /// The curve has no point.
    Unknown,
}

/// When `errors` of a run fall below `level`; core seconds, preparation included.
pub fn crossing(record: &Record, level: f64, errors: impl Fn(&Point) -> Option<Errors>) -> Crossing {
    crossing_after(record, level, |p| p.preparation.cpu, |p| p.rendering.cpu, errors)
}

/// The same for a part of a run: of preparation and of rendering, so many core seconds for an image.
pub fn crossing_after(
    record: &Record,
    level: f64,
    preparation: impl Fn(&Point) -> f64,
    rendering: impl Fn(&Point) -> f64,
    errors: impl Fn(&Point) -> Option<Errors>,
) -> Crossing {
    let spent = |p: &Point| preparation(p) + rendering(p);
    let curve: Vec<(&Point, Errors)> = record.points.iter().filter_map(|p| Some((p, errors(p)?))).collect();
    let Some(&(end, last)) = curve.last() else { return Crossing::Unknown };
    // From the end: the last time that the curve passes the level is when it stays below.
    if let Some(k) = curve.iter().rposition(|(_, e)| e.rel_mse >= level) {
        if let Some(&(p1, e1)) = curve.get(k + 1) {
            let (p0, e0) = curve[k];
            return Crossing::At(between(spent(p0), e0.rel_mse, spent(p1), e1.rel_mse, level));
        }
    } else {
        return Crossing::At(spent(curve[0].0));
    }
    // Path tracing has no bias; of the others only what is significant counts.
    let floor = match record.role {
        Role::Mcpt => 0.0,
        _ => (last.bias_rel_mse - 2.0 * last.bias_rel_mse_error).max(0.0),
    };
    if floor >= level {
        return Crossing::Never { floor };
    }
    // Beyond the curve, what is noise falls with the number of trials; the bias stays.
    let noise = (last.rel_mse - floor).max(0.0);
    Crossing::About(preparation(end) + rendering(end) * noise / (level - floor))
}

/// Where a line through two points in logarithmic axes passes a level.
fn between(t0: f64, e0: f64, t1: f64, e1: f64, level: f64) -> f64 {
    // An error estimate without noise can come out at or below 0; there the line is straight down.
    let share = (e0 / level).ln() / (e0 / e1.max(1e-12)).ln();
    t0 * (t1 / t0).powf(share.clamp(0.0, 1.0))
}

impl Crossing {
    /// For tables.
    pub fn text(self) -> String {
        use super::table::number;
        match self {
            Crossing::At(t) => number(t),
            Crossing::About(t) => format!("\u{2248} {}", number(t)),
            Crossing::Never { floor } => format!("never: stays above {floor:.1e}"),
            Crossing::Unknown => "\u{2013}".to_owned(),
        }
    }

    /// Core seconds, where there is a crossing.
    pub fn seconds(self) -> Option<f64> {
        match self {
            Crossing::At(t) | Crossing::About(t) => Some(t),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::Spent;
    use crate::study::plan::Role;
    use crate::study::record::Preparation;

    /// A run with one core second of preparation, `errors[k]` at `2^k` seconds of rendering, and a bias.
    fn record(errors: &[f64], bias: f64) -> Record {
        let point = |(k, rel_mse): (usize, &f64)| Point {
            trials: 2.0,
            preparation: Spent { wall: 0.0, cpu: 1.0 },
            rendering: Spent { wall: 0.0, cpu: f64::from(1 << k) },
            hires_share: 0.5,
            rays: 0,
            noise: 0.0,
            dev: [0.0; 2],
            whole: Some(Errors { rel_mse: *rel_mse, bias_rel_mse: bias, ..Errors::default() }),
            direct: None,
            indirect: None,
        };
        Record {
            key: String::new(),
            scene: String::new(),
            role: Role::Gsii,
            label: String::new(),
            parameters: Default::default(),
            threads: 1,
            version: String::new(),
            triangles: 0,
            preparation: Preparation::default(),
            points: errors.iter().enumerate().map(point).collect(),
        }
    }

    fn seconds(errors: &[f64], bias: f64, level: f64) -> Crossing {
        crossing(&record(errors, bias), level, |p| p.whole)
    }

    #[test]
    fn crossings_are_found_continued_or_denied() {
        // At 2 and 3 seconds in all: in logarithmic axes the level is half of the way.
        let half_way = seconds(&[4.0, 1.0], 0.0, 2.0).seconds().unwrap();
        assert!((half_way - 6.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(seconds(&[1.0, 0.5], 0.0, 2.0), Crossing::At(2.0));
        // 2 seconds of rendering leave 1.0, of which 0.5 is noise; a quarter of it is left after 8.
        assert_eq!(seconds(&[2.0, 1.0], 0.5, 0.625), Crossing::About(1.0 + 8.0));
        assert_eq!(seconds(&[2.0, 1.0], 0.7, 0.6), Crossing::Never { floor: 0.7 });
        assert_eq!(seconds(&[], 0.0, 1.0), Crossing::Unknown);
    }
}
