//! All reference cases with exact or high-precision answers (`tests/data/cases.json`), built from their recipes through the
//! library's public interface and checked with their own tolerances.
//!
//! `cargo test --release --test cases -- FF RAD-01` runs the cases whose names contain one of the words. With
//! `GSII_WRITE_ACCURACY=1` a complete run writes the table in `docs/accuracy.md`.

mod box_fits;
mod cie;
#[path = "../common/mod.rs"]
mod common;
mod direct_light;
mod form_factors;
mod gsii;
mod hard;
mod kit;
mod radiosity;
mod report;
mod specular;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::thread::available_parallelism;

use ::gsii::clock::Stopwatch;
use rayon::ThreadPoolBuilder;
use report::{Case, Outcome, Row, table};
use rustix::time::{ClockId, clock_gettime};

/// Measures a case.
type Recipe = fn(&Case, &mut Outcome<'_>);

/// Cases that are known to fail, with the reason.
const KNOWN: &[(&str, &str)] = &[];

/// The case that takes longest, a minute: it is begun first, so that no core waits for it in the end.
const LONGEST: &str = "SPEC-006";

fn recipe(id: &str) -> Option<Recipe> {
    let all = [
        form_factors::RECIPES,
        radiosity::RECIPES,
        direct_light::RECIPES,
        cie::RECIPES,
        specular::RECIPES,
        box_fits::RECIPES,
        gsii::RECIPES,
        hard::RECIPES,
    ];
    all.iter().flat_map(|r| r.iter()).find(|(name, _)| *name == id).map(|(_, recipe)| *recipe)
}

/// Measures one case.
fn measure(case: &Case) -> Row<'_> {
    let start = thread_time();
    let mut outcome = Outcome::new(case);
    match recipe(&case.id) {
        None => outcome.holds("has a recipe", false),
        Some(recipe) => {
            if catch_unwind(AssertUnwindSafe(|| recipe(case, &mut outcome))).is_err() {
                outcome.holds("measured without a panic", false);
            }
        }
    }
    let known = KNOWN.iter().find(|(id, _)| *id == case.id).map(|(_, reason)| *reason);
    let verdict = match (outcome.passes(), known) {
        (true, None) => "ok",
        (false, Some(_)) => "deviates as known",
        (true, Some(_)) => "PASSES ALTHOUGH LISTED AS DEVIATING",
        (false, None) => "FAILS",
    };
    println!("{} {verdict} ({:.1} s): {}", case.id, thread_time() - start, outcome.line());
    Row { outcome, known }
}

/// Measures cases, as many at a time as there are cores and each on one thread: no result depends on the number of threads, and
/// no core idles while a case does something that cannot be shared out.
fn measure_all<'a>(cases: &'a [&Case]) -> Vec<Row<'a>> {
    let mut order: Vec<_> = cases.iter().enumerate().collect();
    order.sort_by_key(|(_, case)| case.id != LONGEST);
    let queue = Mutex::new(order.into_iter());
    let rows = Mutex::new(Vec::new());
    let work = || loop {
        let Some((number, case)) = queue.lock().unwrap().next() else { break };
        let row = measure(case);
        rows.lock().unwrap().push((number, row));
    };
    std::thread::scope(|scope| {
        for _ in 0..available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(work));
        }
    });
    let mut rows = rows.into_inner().unwrap();
    rows.sort_by_key(|(number, _)| *number);
    rows.into_iter().map(|(_, row)| row).collect()
}

/// Seconds of processor time of this thread.
fn thread_time() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let cases = Case::all();
    if std::env::args().any(|a| a == "--list") {
        cases.iter().for_each(|c| println!("{}: test", c.id));
        return;
    }
    if cfg!(debug_assertions) {
        println!("reference cases: not run, they take long without optimisation; use --release");
        return;
    }
    let chosen = |c: &&Case| words.is_empty() || words.iter().any(|w| c.id.contains(w.as_str()));
    let chosen: Vec<&Case> = cases.iter().filter(chosen).collect();
    let start = Stopwatch::start();
    let rows = measure_all(&chosen);
    let seconds = start.spent().cpu;
    let bad: Vec<&str> =
        rows.iter().filter(|r| r.outcome.passes() == r.known.is_some()).map(|r| r.outcome.id()).collect();
    let passed = rows.iter().filter(|r| r.outcome.passes()).count();
    println!(
        "{passed} of {} reference cases pass, in {seconds:.0} s of processor time; unexpected: {bad:?}",
        rows.len()
    );
    if words.is_empty() {
        common::write_accuracy("cases", &table(&rows, seconds));
    }
    if !bad.is_empty() {
        std::process::exit(1);
    }
}
