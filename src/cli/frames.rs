//! `gsii render --frames`: an animation, frame by frame.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Arc;

use clap::Args;
use serde_json::{Map, Value};

use super::options::load_with;
use super::render::{Options, View};
use crate::clock::Stopwatch;
use crate::error::{Error, Result};
use crate::pipeline::{Prepared, Settings, Stats, automatic};
use crate::progress::Progress;
use crate::scene::gltf::{Arrangement, Motion};
use crate::scene::{Camera, LoadOptions, Scene};

/// Most moments of an animation that decide what suits all of it.
const MOMENTS: u32 = 256;

/// Some frames: `7`, `1-24` or `1-24:2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    first: u32,
    last: u32,
    step: u32,
}

impl FromStr for Range {
    type Err = String;

    fn from_str(s: &str) -> std::result::Result<Self, String> {
        let parse = || {
            let (ends, step) = s.split_once(':').unwrap_or((s, "1"));
            let (first, last) = ends.split_once('-').unwrap_or((ends, ends));
            Some(Range { first: first.parse().ok()?, last: last.parse().ok()?, step: step.parse().ok()? })
        };
        parse()
            .filter(|r| r.first <= r.last && r.step > 0 && r.last <= 1 << 24)
            .ok_or_else(|| "expected frames from 0 on, the smaller number first, as in 7, 1-24 or 1-24:2".to_owned())
    }
}

impl Range {
    fn frames(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step as usize)
    }
}

/// Which frames of an animation.
#[derive(Args, Debug)]
pub struct FrameOptions {
    /// Render frames A to B of the file's animations, or every STEPth of them; '####' in names of files becomes the frame's number
    #[arg(long, value_name = "A-B[:STEP]", conflicts_with = "partial", help_heading = "Animation")]
    frames: Option<Range>,
    /// Frames in a second: frame N shows the animations after N / FPS seconds
    #[arg(long, value_name = "FPS", default_value_t = 24.0, requires = "frames", help_heading = "Animation")]
    fps: f64,
    /// Render frames whose files are there already
    #[arg(long, requires = "frames", help_heading = "Animation")]
    overwrite: bool,
}

impl FrameOptions {
    /// The frames that are asked for, where any are.
    pub(super) fn range(&self) -> Option<Range> {
        self.frames
    }

    /// Adds what is needed to repeat a frame.
    pub(super) fn record(&self, frame: Option<u32>, map: &mut Map<String, Value>) {
        if let Some(frame) = frame {
            map.insert("frame".to_owned(), frame.into());
            map.insert("fps".to_owned(), self.fps.into());
        }
    }

    fn seconds(&self, frame: u32) -> f64 {
        f64::from(frame) / self.fps
    }

    /// Moments that stand for the whole animation: its frames, or as many evenly spaced ones as are enough. They do not depend on which
    /// frames are to be rendered, so that whatever is decided from them is the same for all, wherever each is rendered.
    fn moments(&self, span: Option<[f64; 2]>) -> Vec<f64> {
        let [start, end] = span.unwrap_or([0.0; 2]);
        let steps = ((end - start) * self.fps).ceil().clamp(0.0, f64::from(MOMENTS - 1)) as u32;
        (0..=steps).map(|i| start + (end - start) * f64::from(i) / f64::from(steps.max(1))).collect()
    }
}

/// Puts a frame's number in place of `####` or `%04d` in a file's name; `None` where there is neither.
fn numbered(path: &Path, frame: u32) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let (before, width, after) = if let Some(start) = name.find('#') {
        let width = name[start..].bytes().take_while(|b| *b == b'#').count();
        (&name[..start], width, &name[start + width..])
    } else {
        let (before, rest) = name.split_once('%')?;
        let (width, after) = rest.split_once('d')?;
        (before, if width.is_empty() { 1 } else { width.parse().ok().filter(|w| *w < 64)? }, after)
    };
    Some(path.with_file_name(format!("{before}{frame:0width$}{after}")))
}

/// A file's animation and what all of its frames have in common.
struct Animation<'a> {
    options: &'a Options,
    motion: Motion,
    /// The scene at the first moment.
    scene: Arc<Scene>,
    moments: Vec<f64>,
}

impl Animation<'_> {
    /// The views of one moment, as the options choose them.
    fn views(&self, seconds: f64) -> Result<Vec<View>> {
        let moved = self.motion.cameras(seconds, self.scene.centre)?;
        // A file without cameras is given one, which stays.
        let cameras = if moved.is_empty() { &self.scene.cameras } else { &moved };
        self.options.views(&self.scene.name, cameras)
    }

    /// The views of a frame, without those that are finished.
    fn unfinished(&self, frame: u32, single: bool) -> Result<Vec<View>> {
        let FrameOptions { overwrite, .. } = self.options.frames;
        let number = |path: PathBuf| match numbered(&path, frame) {
            Some(path) => Ok(path),
            None if single => Ok(path),
            None => Err(Error::Usage(format!(
                "{}: several frames need '####' or '%04d' in the name, where their numbers go",
                path.display()
            ))),
        };
        let mut views = Vec::new();
        for view in self.views(self.options.frames.seconds(frame))? {
            let view = View {
                outputs: view.outputs.into_iter().map(number).collect::<Result<_>>()?,
                stats: view.stats.map(number).transpose()?,
                checkpoint: view.checkpoint.map(number).transpose()?,
                frame: Some(frame),
                ..view
            };
            let cut_short = self.options.long.goes_on(&view.outputs[0], view.checkpoint.as_deref());
            if overwrite || cut_short || !view.outputs.iter().chain(&view.stats).all(|path| path.is_file()) {
                views.push(view);
            }
        }
        Ok(views)
    }

    /// What all moments are seen by.
    fn all_views(&self) -> Result<Vec<(Camera, [u32; 2])>> {
        let mut all = Vec::new();
        for &moment in &self.moments {
            for View { camera, .. } in self.views(moment)? {
                let params = self.options.render_params(&camera)?;
                all.push((camera, [params.width, params.height]));
            }
        }
        Ok(all)
    }

    /// Whether nothing but cameras moves.
    fn is_static(&self) -> Result<bool> {
        let arrangements = self.moments.iter().map(|&m| self.motion.arrangement(m)).collect::<Result<Vec<_>>>()?;
        Ok(arrangements.windows(2).all(|pair| pair[0] == pair[1]))
    }

    /// The scene at a moment, with its origin where the first moment's is.
    fn scene_at(&self, seconds: f64, stats: &mut Stats) -> Result<Arc<Scene>> {
        let what = LoadOptions { seconds: Some(seconds), centre: Some(self.scene.centre), ..LoadOptions::default() };
        let mut scene = load_with(&self.options.scene, &what, stats)?;
        self.options.outside.surround(&mut scene)?;
        Ok(scene)
    }
}

/// Renders the frames that are not finished.
///
/// # Errors
/// As a single image.
pub(super) fn run(options: &Options, range: Range, progress: &Progress) -> Result<ExitCode> {
    let fps = options.frames.fps;
    if !(fps > 0.0 && fps.is_finite()) {
        return Err(Error::Usage("--fps must be a number above 0".to_owned()));
    }
    let start = Stopwatch::start();
    let mut stats = Stats::new();
    let motion = Motion::read(&options.scene.scene)?;
    let span = motion.span();
    if span.is_none() {
        log::warn!("{}: nothing is animated: all frames show the same", options.scene.scene.display());
    }
    let moments = options.frames.moments(span);
    let what = LoadOptions { seconds: moments.first().copied(), ..LoadOptions::default() };
    let mut scene = load_with(&options.scene, &what, &mut stats)?;
    options.outside.surround(&mut scene)?;
    let animation = Animation { options, motion, scene, moments };

    let frames: Vec<u32> = range.frames().collect();
    let mut to_do = Vec::new();
    for &frame in &frames {
        let views = animation.unfinished(frame, frames.len() == 1)?;
        if !views.is_empty() {
            to_do.push((frame, views));
        }
    }
    if to_do.len() < frames.len() {
        let finished = frames.len() - to_do.len();
        options.talk.say(format!("gsii: {finished} of {} frames are there already and skipped", frames.len()));
    }
    if to_do.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }

    let all_views = animation.all_views()?;
    let cameras: Vec<Camera> = all_views.iter().map(|(camera, _)| camera.clone()).collect();
    let settings = automatic(&animation.scene, &cameras, options.settings())?;
    let is_static = animation.is_static()?;
    let mut stage = Stage { animation: &animation, cameras: &cameras, settings, at: None };
    let mut start = Some(start);
    for (frame, views) in to_do {
        let start = start.take().unwrap_or_else(Stopwatch::start);
        let prepared = stage.set(options.frames.seconds(frame), &mut stats, progress, |prepared, stats| {
            if is_static && options.interpolates() {
                prepared.share_between(&all_views, progress, stats)
            } else {
                Ok(())
            }
        })?;
        for view in &views {
            let params = options.render_params(&view.camera)?;
            let params = crate::render::RenderParams { frame: view.frame, ..params };
            let mut of_view = stats.clone();
            let kept = options.keep(&prepared.scene, &cameras, view, &params)?;
            if !options.render_view(prepared, view, &params, kept.as_ref(), start, progress, &mut of_view)? {
                return Ok(ExitCode::FAILURE);
            }
        }
        stats = stats.at_no_cost();
    }
    Ok(ExitCode::SUCCESS)
}

/// The scene as it is prepared at the moment.
struct Stage<'a> {
    animation: &'a Animation<'a>,
    cameras: &'a [Camera],
    /// The same for all frames.
    settings: Settings,
    at: Option<(Arrangement, Prepared)>,
}

impl Stage<'_> {
    /// Prepares the scene at a moment, unless it is prepared as it is then; `finish` does the rest for a new one.
    fn set(
        &mut self,
        seconds: f64,
        stats: &mut Stats,
        progress: &Progress,
        finish: impl FnOnce(&mut Prepared, &mut Stats) -> Result<()>,
    ) -> Result<&Prepared> {
        let animation = self.animation;
        let wanted = animation.motion.arrangement(seconds)?;
        // What was there is given up before its successor needs the memory.
        let fitting = self.at.take().filter(|(arrangement, _)| *arrangement == wanted);
        let at = match fitting {
            Some(fitting) => fitting,
            None => {
                let first = animation.moments.first().map(|&m| animation.motion.arrangement(m)).transpose()?;
                let scene = match first.as_ref() == Some(&wanted) {
                    true => animation.scene.clone(),
                    false => animation.scene_at(seconds, stats)?,
                };
                let mut prepared = Prepared::for_cameras(scene, self.cameras, self.settings.clone(), progress, stats)?;
                finish(&mut prepared, stats)?;
                for warning in std::mem::take(&mut stats.warnings) {
                    log::warn!("{warning}");
                }
                (wanted, prepared)
            }
        };
        Ok(&self.at.insert(at).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges() {
        let frames = |s: &str| s.parse::<Range>().map(|r| r.frames().collect::<Vec<_>>());
        assert_eq!(frames("7"), Ok(vec![7]));
        assert_eq!(frames("1-4"), Ok(vec![1, 2, 3, 4]));
        assert_eq!(frames("0-7:3"), Ok(vec![0, 3, 6]));
        for wrong in ["", "-1", "4-1", "1-4:0", "a", "1-", "1:2:3", "1-99999999999"] {
            assert!(frames(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn names() {
        let name = |pattern: &str| numbered(Path::new(pattern), 7).map(|p| p.to_string_lossy().into_owned());
        assert_eq!(name("out/a-####.exr").as_deref(), Some("out/a-0007.exr"));
        assert_eq!(name("a%03d.exr").as_deref(), Some("a007.exr"));
        assert_eq!(name("a%d.exr").as_deref(), Some("a7.exr"));
        for without in ["a.exr", "50%.exr", "100% done.exr", "##/a.exr"] {
            assert_eq!(name(without), None, "{without}");
        }
    }

    #[test]
    fn moments_do_not_become_too_many() {
        let options = FrameOptions { frames: None, fps: 10.0, overwrite: false };
        assert_eq!(options.moments(None), [0.0]);
        assert_eq!(options.moments(Some([1.0, 1.0])), [1.0]);
        let few = options.moments(Some([0.5, 1.0]));
        assert_eq!((few.len(), few[0], few[5]), (6, 0.5, 1.0));
        assert_eq!(options.moments(Some([0.0, 1e6])).len(), MOMENTS as usize);
    }
}
