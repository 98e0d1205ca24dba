//! Keeps a rendering on disk, to go on with it later.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::{Moment, Rhythm, Watcher};
use crate::error::Result;
use crate::render::checkpoint::{self, LateIdentity};
use crate::render::session::Session;

/// From one checkpoint to the next goes so many times what writing takes: most of that is waiting for the disk.
const PAUSE: u32 = 4;

/// Writes a [checkpoint] from time to time, and when work is cut short.
pub struct Saver {
    path: PathBuf,
    identity: LateIdentity,
    rhythm: Rhythm,
    failed: bool,
}

impl Saver {
    /// Writes to `path` about `every` so long.
    pub fn new(path: &Path, identity: LateIdentity, every: Duration) -> Self {
        Saver { path: path.to_owned(), identity, rhythm: Rhythm::new(every, PAUSE), failed: false }
    }

    fn save(&mut self, session: &Session) -> Result<()> {
        let (path, identity) = (&self.path, self.identity.get()?);
        let before = session.spent().wall;
        self.rhythm.beat(|| checkpoint::write(path, identity, session))?;
        let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
        log::debug!("checkpoint: {:.1} MB in {:.3} s", bytes as f64 * 1e-6, session.spent().wall - before);
        Ok(())
    }
}

impl Watcher for Saver {
    fn wait(&self) -> Duration {
        self.rhythm.wait()
    }

    fn look(&mut self, session: &Session, moment: Moment) {
        if moment == Moment::Finished || !session.is_begun() {
            return;
        }
        // Work goes on without it, and maybe there is place for it later.
        match self.save(session) {
            Ok(()) => self.failed = false,
            Err(error) if !self.failed => {
                log::warn!("{error}; there is no new checkpoint");
                self.failed = true;
            }
            Err(_) => (),
        }
    }
}
