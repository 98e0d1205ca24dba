//! Those who look at a rendering while it goes on.

mod saver;
mod tev;

use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

pub use saver::Saver;
pub use tev::TevViewer;

use super::session::Session;

/// When a [`Watcher`] looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Work goes on.
    Meanwhile,
    /// It was cut short: nothing comes after this.
    Stopped,
    /// All trials are done.
    Finished,
}

/// Looks at a rendering from time to time.
pub trait Watcher: Send {
    /// Time until it wants to look again.
    fn wait(&self) -> Duration;

    /// Looks, from a thread of its own while work goes on, and once more when it ends.
    fn look(&mut self, session: &Session, moment: Moment);
}

/// Several watchers as one.
impl Watcher for Vec<Box<dyn Watcher + '_>> {
    fn wait(&self) -> Duration {
        self.iter().map(|one| one.wait()).min().unwrap_or(Duration::MAX)
    }

    fn look(&mut self, session: &Session, moment: Moment) {
        for one in self.iter_mut().filter(|one| moment != Moment::Meanwhile || one.wait().is_zero()) {
            one.look(session, moment);
        }
    }
}

/// Something is done again after a while: at its own pace, but not so often that it takes more than a share of the time.
#[derive(Clone, Copy, Debug)]
pub struct Rhythm {
    every: Duration,
    /// Time between two times, in units of what the last one took.
    pause: u32,
    next: Instant,
}

impl Rhythm {
    /// The first time is after `every`. From one time to the next goes at least `pause` times what it takes.
    pub fn new(every: Duration, pause: u32) -> Self {
        Rhythm { every, pause, next: Instant::now() + every }
    }

    /// Time until the next time.
    pub fn wait(&self) -> Duration {
        self.next.saturating_duration_since(Instant::now())
    }

    /// Does it now.
    pub fn beat<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let end = Instant::now();
        self.next = end + self.every.max(self.pause * (end - start));
        result
    }
}

/// Longest sleep of a watcher's thread: channels do not take endless ones.
const LONGEST: Duration = Duration::from_secs(3600);

/// Does work that changes what is shared in a session while a watcher looks at it.
pub(super) fn watched<T>(session: &Session, watcher: &mut Option<&mut dyn Watcher>, work: impl FnOnce() -> T) -> T {
    let Some(watcher) = watcher else { return work() };
    let (done, working) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while working.recv_timeout(watcher.wait().min(LONGEST)) == Err(RecvTimeoutError::Timeout) {
                if watcher.wait().is_zero() {
                    watcher.look(session, Moment::Meanwhile);
                }
            }
        });
        // The thread ends when this goes, also when the work panics.
        let _done = done;
        work()
    })
}
