//! Progress bars, and the wish to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Where long work reports how far it is and learns whether to stop. Cheap to clone; shared between threads.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    visible: bool,
    stop: Arc<AtomicBool>,
}

impl Progress {
    /// Reports nothing.
    pub fn silent() -> Self {
        Progress::default()
    }

    /// Draws bars on standard error when that is a terminal.
    pub fn on_terminal() -> Self {
        Progress { visible: true, stop: Arc::default() }
    }

    /// Draws nothing, but stops when this one does: for work that is a step of a longer one.
    pub fn quietly(&self) -> Self {
        Progress { visible: false, stop: Arc::clone(&self.stop) }
    }

    /// Asks all work to stop at the next good moment, keeping what is there.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Whether to stop.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// A bar for one stage of `total` steps (any unit); call `inc` or `set_position` on it, `finish_and_clear` at the end.
    pub fn stage(&self, name: &'static str, total: u64) -> ProgressBar {
        if !self.visible {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(total).with_message(name);
        let style = ProgressStyle::with_template("{msg:>12} {wide_bar} {percent:>3} %  {elapsed} + {eta}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}
