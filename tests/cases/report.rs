//! What a case expects, what was measured, and the table of it all.

use std::fmt::Write;

use serde_json::Value;

/// A reference case: `tests/data/cases.json`.
pub struct Case {
    /// Identifier, such as `FF-001`.
    pub id: String,
    family: String,
    name: String,
    source: String,
    /// Expected value: a number, or several by name or number.
    pub expected: Value,
    tolerance: Value,
}

impl Case {
    /// All cases.
    pub fn all() -> Vec<Case> {
        let cases: Vec<Value> = serde_json::from_str(include_str!("../data/cases.json")).unwrap();
        let text = |c: &Value, key: &str| c[key].as_str().unwrap().to_owned();
        let case = |c: Value| Case {
            id: text(&c, "id"),
            family: text(&c, "family"),
            name: text(&c, "name"),
            source: text(&c, "source"),
            expected: c["expected"].clone(),
            tolerance: c["tolerance"].clone(),
        };
        cases.into_iter().map(case).collect()
    }

    /// The expected number.
    pub fn value(&self) -> f64 {
        self.expected.as_f64().unwrap()
    }

    /// The expected number or numbers at a JSON pointer (`""` is the whole), rows one after the other; null is left out.
    pub fn values(&self, pointer: &str) -> Vec<f64> {
        fn flatten(value: &Value, to: &mut Vec<f64>) {
            match value {
                Value::Array(items) => items.iter().for_each(|item| flatten(item, to)),
                other => to.extend(other.as_f64()),
            }
        }
        let mut values = Vec::new();
        flatten(self.expected.pointer(pointer).unwrap(), &mut values);
        values
    }

    /// A tolerance at a JSON pointer.
    pub fn tolerance(&self, pointer: &str) -> f64 {
        self.tolerance.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{}: {pointer}", self.id))
    }
}

/// Mean over independent seeds, and its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    pub fn of(values: &[f64]) -> Estimate {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        Estimate { mean, error: (squares / (n * (n - 1.0))).sqrt() }
    }

    pub fn times(self, factor: f64) -> Estimate {
        Estimate { mean: self.mean * factor, error: self.error * factor.abs() }
    }
}

struct Check {
    what: String,
    expected: f64,
    measured: f64,
    error: Option<f64>,
    /// Largest difference allowed.
    allowed: f64,
    /// Why it fails although the difference is allowed.
    fault: Option<String>,
}

impl Check {
    fn passes(&self) -> bool {
        (self.measured - self.expected).abs() <= self.allowed && self.fault.is_none()
    }

    /// Difference in units of what is allowed.
    fn strain(&self) -> f64 {
        let off = (self.measured - self.expected).abs();
        if !self.passes() && off <= self.allowed {
            f64::INFINITY
        } else if off == 0.0 {
            0.0
        } else if self.allowed == 0.0 || off.is_nan() {
            f64::INFINITY
        } else {
            off / self.allowed
        }
    }
}

/// All that was measured for a case.
pub struct Outcome<'a> {
    case: &'a Case,
    checks: Vec<Check>,
    notes: Vec<String>,
}

impl<'a> Outcome<'a> {
    pub fn new(case: &'a Case) -> Self {
        Outcome { case, checks: Vec::new(), notes: Vec::new() }
    }

    /// The case's identifier.
    pub fn id(&self) -> &'a str {
        &self.case.id
    }

    /// The case's expected number.
    pub fn expected(&self) -> f64 {
        self.case.value()
    }

    /// Something the table should say about how it was measured.
    pub fn note(&mut self, sentence: impl Into<String>) {
        self.notes.push(sentence.into());
    }

    fn push(&mut self, what: &str, expected: f64, measured: f64, error: Option<f64>, allowed: f64) {
        self.checks.push(Check { what: what.to_owned(), expected, measured, error, allowed, fault: None });
    }

    /// A number that may differ by `allowed`.
    pub fn near(&mut self, what: &str, expected: f64, measured: f64, allowed: f64) {
        self.push(what, expected, measured, None, allowed);
    }

    /// A number that may differ by a share of the expected one.
    pub fn relative(&mut self, what: &str, expected: f64, measured: f64, share: f64) {
        self.near(what, expected, measured, share * expected.abs());
    }

    /// The mean over seeds may differ by `allowed`.
    pub fn mean(&mut self, what: &str, expected: f64, measured: Estimate, allowed: f64) {
        self.push(what, expected, measured.mean, Some(measured.error), allowed);
    }

    /// No difference is allowed.
    pub fn exact(&mut self, what: &str, expected: f64, measured: f64) {
        self.push(what, expected, measured, None, 0.0);
    }

    /// A statement that must be true.
    pub fn holds(&mut self, what: &str, holds: bool) {
        self.exact(what, 1.0, f64::from(u8::from(holds)));
    }

    /// By the case's tolerance for ray casting.
    pub fn ray_cast(&mut self, what: &str, expected: f64, measured: Estimate) {
        self.mean(what, expected, measured, self.case.tolerance("/raycast/abs"));
    }

    /// By the case's tolerance for pixels: `sigma` standard errors and a bias, with a bound on the standard error.
    pub fn pixel(&mut self, what: &str, expected: f64, measured: Estimate) {
        let of = |key: &str| self.case.tolerance(&format!("/pixel/{key}"));
        let allowed = of("sigma") * measured.error + of("bias_rel") * expected.abs();
        let most = of("max_se_rel") * expected.abs();
        self.push(what, expected, measured.mean, Some(measured.error), allowed);
        if measured.error > most {
            let check = self.checks.last_mut().unwrap();
            check.fault = Some(format!("standard error above {most:.2e}"));
        }
    }

    pub fn passes(&self) -> bool {
        !self.checks.is_empty() && self.checks.iter().all(Check::passes)
    }

    /// The check that is closest to failing.
    fn worst(&self) -> Option<&Check> {
        self.checks.iter().max_by(|a, b| a.strain().total_cmp(&b.strain()))
    }

    /// What was measured: all that fails, else what came closest to it; and how, where there is something to say.
    pub fn line(&self) -> String {
        let mut text = String::new();
        let failed: Vec<&Check> = self.checks.iter().filter(|c| !c.passes()).collect();
        let shown = if failed.is_empty() { self.worst().into_iter().collect() } else { failed };
        for check in shown {
            let error = check.error.map_or(String::new(), |e| format!(" +- {e:.1e}"));
            let fault = check.fault.as_ref().map_or(String::new(), |f| format!(" ({f})"));
            let Check { what, expected, measured, allowed, .. } = check;
            let off = (measured - expected).abs();
            write!(
                text,
                "{what}: {measured:.7e}{error}, expected {expected:.7e}, off {off:.1e} of {allowed:.1e}{fault}; "
            )
            .unwrap();
        }
        write!(text, "{} checks", self.checks.len()).unwrap();
        self.notes.iter().for_each(|note| write!(text, "; {note}").unwrap());
        text
    }

    /// The row of `docs/accuracy.md`.
    fn row(&self, known: Option<&str>) -> String {
        let Some(worst) = self.worst() else { return String::new() };
        let failed = self.checks.iter().filter(|c| !c.passes()).count();
        let verdict = match (failed, known) {
            (0, _) => "pass".to_owned(),
            (n, Some(reason)) => format!("**deviates** ({n} of {}): {reason}", self.checks.len()),
            (n, None) => format!("**fails** ({n} of {})", self.checks.len()),
        };
        let Case { id, name, .. } = self.case;
        let count = self.checks.len();
        let what = if count == 1 { worst.what.clone() } else { format!("{}, worst of {count}", worst.what) };
        let notes: String = self.notes.iter().map(|n| format!(" {n}")).collect();
        let error = worst.error.map_or("-".to_owned(), |e| format!("{e:.1e}"));
        let Check { expected, measured, allowed, .. } = worst;
        format!(
            "| {id} | {name}: {what}.{notes} | {} | {} | {error} | {allowed:.1e} | {verdict} |\n",
            number(*expected),
            number(*measured)
        )
    }
}

fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { format!("{}", (x * 1e7).round() / 1e7) } else { format!("{x:.6e}") }
}

/// A case that was run.
pub struct Row<'a> {
    pub outcome: Outcome<'a>,
    /// Why it is known to fail.
    pub known: Option<&'a str>,
}

/// The table of all cases for `docs/accuracy.md`; all together they took `seconds` of processor time.
pub fn table(rows: &[Row<'_>], seconds: f64) -> String {
    let passed = rows.iter().filter(|r| r.outcome.passes()).count();
    let mut text = String::new();
    writeln!(text, "\n**{passed} of {} cases pass**, in {seconds:.0} s of processor time.", rows.len()).unwrap();
    let mut family = "";
    for row in rows {
        let case = row.outcome.case;
        let section = match case.family.as_str() {
            "point form factor" | "occluded form factor" => "form factor",
            "CIE 171 like" => "CIE 171",
            other => other,
        };
        if section != family {
            family = section;
            let title = format!("{}{}", family[..1].to_uppercase(), &family[1..]);
            writeln!(text, "\n### {title}\n").unwrap();
            text += "| case | what | expected | measured | standard error | allowed | verdict |\n";
            text += "|---|---|---:|---:|---:|---:|---|\n";
        }
        text += &row.outcome.row(row.known);
    }
    text += "\n### Sources\n\n";
    for row in rows {
        let Case { id, source, .. } = row.outcome.case;
        writeln!(text, "- {id}: {source}").unwrap();
    }
    text + "\n"
}
