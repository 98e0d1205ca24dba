//! A [`Session`] in a file: a rendering goes on where it was, in another process and to the same bits.
//!
//! The file is a row of frames after a line that says what it is. A frame is its length, what it holds, and a checksum: what a
//! rendering belongs to, the state of its stages, then tile after tile.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::film::{Pixel, Tile};
use super::plan::{Plan, other_tiles};
use super::session::{Session, SharedTiles};
use super::tally::Tally;
use super::{IrradianceCache, RenderParams};
use crate::clock::Spent;
use crate::error::{Error, Result};
use crate::lighting::guide::LightGuide;
use crate::unfinished::Listed;

/// First line of the file; the number changes with the format.
const MAGIC: &[u8] = b"gsii checkpoint 2\n";

/// Longest value that a message quotes, characters.
const QUOTED: usize = 48;

/// What a rendering is of: names and values of all that its pixels depend on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity(pub Vec<(String, String)>);

/// An identity that is found out when it is first asked for: hashing program and scene takes as long as a small image.
#[derive(Clone)]
pub struct LateIdentity(Arc<Late>);

struct Late {
    found: OnceLock<Identity>,
    find: Box<dyn Fn() -> Result<Identity> + Send + Sync>,
}

impl LateIdentity {
    /// The one that `find` finds.
    pub fn new(find: impl Fn() -> Result<Identity> + Send + Sync + 'static) -> Self {
        LateIdentity(Arc::new(Late { found: OnceLock::new(), find: Box::new(find) }))
    }

    /// The identity.
    ///
    /// # Errors
    /// Those of finding it.
    pub fn get(&self) -> Result<&Identity> {
        let Late { found, find } = &*self.0;
        match found.get() {
            Some(identity) => Ok(identity),
            None => find().map(|identity| found.get_or_init(|| identity)),
        }
    }
}

impl Identity {
    /// How `other` differs, as a part of a sentence; `None` when it does not.
    fn difference(&self, other: &Identity) -> Option<String> {
        let value = |all: &Identity, name: &str| all.0.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone());
        let mut names: Vec<&String> = self.0.iter().chain(&other.0).map(|(name, _)| name).collect();
        names.dedup();
        let mut found: Vec<String> = Vec::new();
        for name in names {
            let (there, here) = (value(self, name), value(other, name));
            let short = |v: &Option<String>| v.clone().filter(|v| v.len() <= QUOTED);
            let words = match (short(&there), short(&here)) {
                _ if there == here => continue,
                (Some(there), Some(here)) => format!("{name} is {there} there and {here} here"),
                _ => format!("{name} is another"),
            };
            if !found.contains(&words) {
                found.push(words);
            }
        }
        (!found.is_empty()).then(|| found.join(", "))
    }
}

/// What comes before the tiles.
#[derive(Serialize, Deserialize)]
struct Stages {
    cache: Arc<IrradianceCache>,
    /// Number of tiles beside the film's, which come first.
    others: usize,
    plan: Option<Plan>,
    spent: Spent,
    filling: Spent,
}

/// What is known of a tile; without pixels where there are no trials.
#[derive(Serialize)]
struct TileOut<'a> {
    next: u32,
    dropped: u64,
    tally: Tally,
    pixels: &'a [Pixel],
    guide: &'a LightGuide,
}

/// The same, read.
#[derive(Deserialize)]
struct TileIn {
    next: u32,
    dropped: u64,
    tally: Tally,
    pixels: Vec<Pixel>,
    guide: LightGuide,
}

/// Where the file is written before it gets its name. Always the same name, so that a process which was killed leaves one at most.
pub fn unfinished(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

/// Removes a checkpoint, where there is one.
///
/// # Errors
/// When it is there and cannot be removed.
pub fn remove(path: &Path) -> Result<()> {
    for file in [path.to_owned(), unfinished(path)] {
        match std::fs::remove_file(&file) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(Error::Output { path: file, reason: format!("it cannot be removed: {error}") });
            }
            _ => (),
        }
    }
    Ok(())
}

/// Writes a session, also while threads work on it. The file appears under its name when it is complete and on the disk.
///
/// # Errors
/// When the system refuses; then an older checkpoint is still there.
pub fn write(path: &Path, identity: &Identity, session: &Session) -> Result<()> {
    let part = unfinished(path);
    let _listed = Listed::new(&part);
    let written = write_to(&part, identity, session).and_then(|()| std::fs::rename(&part, path));
    written.map_err(|error| {
        // What is left of it is of no use; that it cannot be written is said anyway.
        let _ = std::fs::remove_file(&part);
        Error::Output { path: path.to_owned(), reason: error.to_string() }
    })
}

fn write_to(path: &Path, identity: &Identity, session: &Session) -> io::Result<()> {
    let mut frames = Writer { file: BufWriter::with_capacity(1 << 20, File::create(path)?), buffer: Vec::new() };
    frames.file.write_all(MAGIC)?;
    frames.put(identity)?;
    frames.put(&Stages {
        cache: Arc::clone(&session.cache),
        others: session.others.len(),
        plan: session.plan.clone(),
        spent: session.spent(),
        filling: session.filling,
    })?;
    for tile in session.others.iter().chain(session.tiles.iter()) {
        let pixels = if tile.next > 0 { tile.pixels.as_slice() } else { &[] };
        let guide = &tile.guide;
        frames.encode(&TileOut { next: tile.next, dropped: tile.dropped, tally: tile.tally, pixels, guide })?;
        // The disk may be slow; whoever works on the tile shall not wait for it.
        drop(tile);
        frames.write()?;
    }
    let file = frames.file.into_inner().map_err(|error| error.into_error())?;
    file.sync_all()
}

struct Writer {
    file: BufWriter<File>,
    buffer: Vec<u8>,
}

impl Writer {
    fn put(&mut self, value: &impl Serialize) -> io::Result<()> {
        self.encode(value)?;
        self.write()
    }

    fn encode(&mut self, value: &impl Serialize) -> io::Result<()> {
        self.buffer.clear();
        self.buffer = postcard::to_extend(value, std::mem::take(&mut self.buffer)).map_err(io::Error::other)?;
        Ok(())
    }

    fn write(&mut self) -> io::Result<()> {
        self.file.write_all(&(self.buffer.len() as u64).to_le_bytes())?;
        self.file.write_all(&self.buffer)?;
        self.file.write_all(&xxh3_64(&self.buffer).to_le_bytes())
    }
}

/// Finds out whether [`read`] would go on with the rendering that `identity` says, as far as that can be told without reading all.
///
/// # Errors
/// As [`read`].
pub fn check(path: &Path, identity: &Identity) -> Result<()> {
    Reader::open(path, identity).map(drop)
}

/// Reads a session of the rendering that `identity` and `params` say.
///
/// # Errors
/// When the file cannot be read, is damaged, or belongs to another rendering; the message says how that differs.
pub fn read(path: &Path, identity: &Identity, params: &RenderParams) -> Result<Session> {
    let mut frames = Reader::open(path, identity)?;
    session(&mut frames, params).map_err(|what| damaged(path, &what))
}

fn refused(path: &Path, reason: String) -> Error {
    Error::Input { path: path.to_owned(), reason }
}

fn damaged(path: &Path, what: &str) -> Error {
    refused(path, format!("the checkpoint is damaged ({what}); render without --resume"))
}

fn session(frames: &mut Reader, params: &RenderParams) -> std::result::Result<Session, String> {
    let stages: Stages = frames.get()?;
    let mut session = Session::new(params);
    let others = if stages.others > 0 { other_tiles(params.region(), params) } else { Vec::new() };
    let planned = stages.plan.as_ref().is_none_or(|plan| {
        let sizes = session.tiles.iter().map(|tile| tile.pixels.len());
        plan.allocations.iter().map(Vec::len).eq(sizes)
    });
    if stages.others != others.len() || !planned {
        return Err("tiles are missing".to_owned());
    }
    session.others = tiles(frames, others)?;
    session.tiles = tiles(frames, std::mem::take(&mut session.tiles).into_tiles())?;
    if frames.left > 0 {
        return Err("it goes on after its end".to_owned());
    }
    session.cache = stages.cache;
    session.plan = stages.plan;
    (session.earlier, session.filling) = (stages.spent, stages.filling);
    Ok(session)
}

fn tiles(frames: &mut Reader, mut empty: Vec<Tile>) -> std::result::Result<SharedTiles, String> {
    for tile in &mut empty {
        let TileIn { next, dropped, tally, pixels, guide } = frames.get()?;
        if (next > 0 && pixels.len() != tile.pixels.len()) || !guide.is_sound() {
            return Err("a tile has another size".to_owned());
        }
        if next > 0 {
            tile.pixels = pixels;
        }
        (tile.next, tile.dropped, tile.tally, tile.guide) = (next, dropped, tally, guide);
    }
    Ok(SharedTiles::new(empty))
}

struct Reader {
    file: BufReader<File>,
    /// Bytes that the file still has, which no length in it may exceed.
    left: u64,
    buffer: Vec<u8>,
}

impl Reader {
    /// Reads as far as the stages.
    fn open(path: &Path, identity: &Identity) -> Result<Reader> {
        let opened = File::open(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (left, file) = opened.map_err(|error| refused(path, error.to_string()))?;
        let mut frames = Reader { file: BufReader::with_capacity(1 << 20, file), left, buffer: Vec::new() };
        let mut magic = [0; MAGIC.len()];
        if frames.fill(&mut magic).is_err() || magic != MAGIC {
            return Err(refused(
                path,
                "this is no checkpoint of this version of gsii; render without --resume".to_owned(),
            ));
        }
        let there: Identity = frames.get().map_err(|what| damaged(path, &what))?;
        match there.difference(identity) {
            None => Ok(frames),
            Some(difference) => Err(refused(
                path,
                format!(
                    "the checkpoint is of another rendering: {difference}; go on with what it was begun with, or render without --resume"
                ),
            )),
        }
    }

    fn fill(&mut self, bytes: &mut [u8]) -> std::result::Result<(), String> {
        self.left = self.left.checked_sub(bytes.len() as u64).ok_or("it ends too early")?;
        self.file.read_exact(bytes).map_err(|error| error.to_string())
    }

    fn number(&mut self) -> std::result::Result<u64, String> {
        let mut bytes = [0; 8];
        self.fill(&mut bytes)?;
        Ok(u64::from_le_bytes(bytes))
    }

    fn get<T: DeserializeOwned>(&mut self) -> std::result::Result<T, String> {
        let length = self.number()?;
        if length > self.left {
            return Err("it ends too early".to_owned());
        }
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.resize(length as usize, 0);
        self.fill(&mut buffer)?;
        if self.number()? != xxh3_64(&buffer) {
            return Err("a checksum is wrong".to_owned());
        }
        let value = postcard::from_bytes(&buffer).map_err(|error| error.to_string())?;
        self.buffer = buffer;
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Region;
    use crate::sampling::unit;

    fn params() -> RenderParams {
        RenderParams {
            width: 34,
            height: 2,
            region: Some(Region { low: [0, 0], high: [32, 2] }),
            min_trials: 4,
            max_trials: 64,
            error: 0.1,
            hires_error: 0.1,
            lores_error: 0.1,
            time_limit: None,
            features: true,
            interpolate: true,
            seed: 0,
            frame: None,
        }
    }

    fn identity(width: u32) -> Identity {
        Identity(vec![("width".to_owned(), width.to_string()), ("scene".to_owned(), "x".repeat(QUOTED + 1))])
    }

    /// A session of a part in its first trials, with odd numbers in one tile beside the film's and none in the film.
    fn session() -> Session {
        let mut session = Session::new(&params());
        let mut others = other_tiles(params().region(), &params());
        others[0].next = 16;
        others[0].dropped = 3;
        others[0].tally.rays.near = 1 << 40;
        for (i, pixel) in others[0].pixels.iter_mut().enumerate() {
            for (t, odd) in [f32::MIN_POSITIVE, 0.1, -0.0, 1e30, f32::from_bits(1)].into_iter().enumerate() {
                pixel.hires.add(glam::Vec3::new(odd, unit(i as u32), 1.0 / 3.0), t % 2 == 0);
                pixel.feature.depth += odd;
            }
        }
        session.others = SharedTiles::new(others);
        session
    }

    fn everything(session: &Session) -> String {
        format!("{:?} {:?} {:?} {:?}", session.others, session.tiles, session.plan, session.cache)
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        let written = session();
        write(&path, &identity(11), &written).unwrap();
        assert_eq!(everything(&read(&path, &identity(11), &params()).unwrap()), everything(&written));
        assert!(!unfinished(&path).exists());
        let refused = read(&path, &identity(12), &params()).unwrap_err().to_string();
        assert!(refused.contains("width is 11 there and 12 here") && !refused.contains("scene"), "{refused}");
        remove(&path).unwrap();
        remove(&path).unwrap();
        assert!(check(&path, &identity(11)).is_err());
    }

    #[test]
    fn every_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        write(&path, &identity(11), &session()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read(&path, &identity(11), &params()).is_err()
        };
        assert!(!refused(&whole));
        for i in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[i] ^= 1 << (i % 8);
            assert!(refused(&bytes), "byte {i} is another");
            assert!(refused(&whole[..i]), "it ends at byte {i}");
        }
        assert!(refused(&[&whole[..], &[0]].concat()), "it goes on");
    }
}
