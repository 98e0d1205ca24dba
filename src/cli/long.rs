//! Options for renderings that take long.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;

use crate::error::{Error, Result};
use crate::render::checkpoint::{self, LateIdentity};
use crate::render::watch::{Rhythm, Saver, TevViewer};
use crate::render::{Moment, RenderParams, Session, Watcher};

/// What is added to an image's name for that of its checkpoint.
const EXTENSION: &str = ".checkpoint";

/// Partial images take no more than one part in so many of the time.
const PAUSE: u32 = 10;

/// How a long rendering is kept, continued and looked at.
#[derive(Args, Debug)]
pub struct LongOptions {
    /// Go on with an unfinished rendering from its checkpoint, to the same bits; from the beginning where there is none
    #[arg(long, help_heading = "Long renderings")]
    resume: bool,
    /// File that keeps an unfinished rendering [default: the first image's name with .checkpoint behind it]
    #[arg(long, value_name = "FILE", help_heading = "Long renderings")]
    checkpoint: Option<PathBuf>,
    /// Seconds between two times that it is written; 0 for no checkpoint
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, help_heading = "Long renderings")]
    checkpoint_every: f64,
    /// Write the images as they are so far every so many seconds [10]
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, default_missing_value = "10", help_heading = "Long renderings")]
    partial: Option<f64>,
    /// Show the image in tev while it is made [127.0.0.1:14158]
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:14158",
        help_heading = "Long renderings"
    )]
    tev: Option<String>,
}

impl LongOptions {
    /// Refuses values without meaning.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the option.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str| Err(Error::Usage(what.to_owned()));
        if !(0.0..1e9).contains(&self.checkpoint_every) {
            return refuse("--checkpoint-every must be a number of seconds, or 0 for no checkpoint");
        }
        if self.checkpoint_every == 0.0 && (self.resume || self.checkpoint.is_some()) {
            return refuse(
                "--checkpoint-every 0 means that there is no checkpoint: it goes with neither --resume nor --checkpoint",
            );
        }
        if self.partial.is_some_and(|seconds| !(seconds > 0.0 && seconds < 1e9)) {
            return refuse("--partial must be a number of seconds above 0");
        }
        let is_address =
            |a: &str| a.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
        if self.tev.as_deref().is_some_and(|address| !is_address(address)) {
            return refuse("--tev must be a host and a port, as in 127.0.0.1:14158");
        }
        Ok(())
    }

    /// The file that `--checkpoint` names.
    pub fn checkpoint(&self) -> Option<&Path> {
        self.checkpoint.as_deref()
    }

    /// Where the unfinished rendering of `image` is kept: in `named` where an option says so. `None` when it is not.
    ///
    /// # Errors
    /// A checkpoint that is to be continued but is damaged, or of another rendering than `identity` says; those of finding that out.
    pub fn keep(&self, image: &Path, named: Option<&Path>, identity: LateIdentity) -> Result<Option<Checkpoint>> {
        if self.checkpoint_every == 0.0 {
            return Ok(None);
        }
        let kept = Checkpoint { path: place(image, named), identity };
        let name = kept.path.display();
        match (self.resume, kept.path.exists()) {
            (true, true) => checkpoint::check(&kept.path, kept.identity.get()?)?,
            (true, false) => log::warn!("there is no checkpoint {name}: the rendering starts from the beginning"),
            (false, true) => {
                log::warn!("{name} is of an unfinished rendering, which --resume would go on with; it will be replaced")
            }
            (false, false) => (),
        }
        Ok(Some(kept))
    }

    /// Whether `image` is to be gone on with, though it may be there: a rendering that ended early has both.
    pub fn goes_on(&self, image: &Path, named: Option<&Path>) -> bool {
        self.resume && place(image, named).is_file()
    }

    /// Where a rendering starts.
    ///
    /// # Errors
    /// As [`LongOptions::keep`].
    pub fn session(&self, kept: Option<&Checkpoint>, params: &RenderParams) -> Result<Session> {
        match kept {
            Some(kept) if self.resume && kept.path.exists() => {
                checkpoint::read(&kept.path, kept.identity.get()?, params)
            }
            _ => Ok(Session::new(params)),
        }
    }

    /// Everybody who looks at the rendering of `image` (a file's name); `write` writes the images so far.
    pub fn watchers<'a>(
        &self,
        image: &Path,
        kept: Option<&Checkpoint>,
        write: impl FnMut(&Session) -> Result<()> + Send + 'a,
    ) -> Vec<Box<dyn Watcher + 'a>> {
        let mut watchers: Vec<Box<dyn Watcher + 'a>> = Vec::new();
        if let Some(address) = &self.tev {
            match TevViewer::connect(address, &image.display().to_string()) {
                Ok(viewer) => watchers.push(Box::new(viewer)),
                Err(error) => log::warn!("no tev listens at {address}: {error}; the rendering goes on without"),
            }
        }
        if let Some(Checkpoint { path, identity }) = kept {
            let every = Duration::from_secs_f64(self.checkpoint_every);
            watchers.push(Box::new(Saver::new(path, identity.clone(), every)));
        }
        if let Some(seconds) = self.partial {
            let rhythm = Rhythm::new(Duration::from_secs_f64(seconds), PAUSE);
            watchers.push(Box::new(Partial { write, rhythm }));
        }
        watchers
    }
}

/// The checkpoint of `image`: what an option names, or beside it.
fn place(image: &Path, named: Option<&Path>) -> PathBuf {
    let beside = || {
        let mut name = OsString::from(image);
        name.push(EXTENSION);
        PathBuf::from(name)
    };
    named.map_or_else(beside, Path::to_owned)
}

/// A file that keeps a rendering.
pub struct Checkpoint {
    path: PathBuf,
    identity: LateIdentity,
}

impl Checkpoint {
    /// What to do with it, for the end of a message; empty when there is none.
    pub fn advice(&self) -> String {
        if self.path.exists() { format!("; --resume goes on from {}", self.path.display()) } else { String::new() }
    }

    /// The rendering is finished and written.
    ///
    /// # Errors
    /// When the file cannot be removed.
    pub fn remove(&self) -> Result<()> {
        checkpoint::remove(&self.path)
    }
}

/// Writes images that are not finished.
struct Partial<F> {
    write: F,
    rhythm: Rhythm,
}

impl<F: FnMut(&Session) -> Result<()> + Send> Watcher for Partial<F> {
    fn wait(&self) -> Duration {
        self.rhythm.wait()
    }

    fn look(&mut self, session: &Session, moment: Moment) {
        // At the end comes the real one.
        if moment == Moment::Meanwhile
            && let Err(error) = self.rhythm.beat(|| (self.write)(session))
        {
            log::warn!("{error}");
        }
    }
}
