//! A folder that keeps what was prepared: later runs, and other processes at the same time, read it instead of making it again.
//!
//! A file is named after everything that its contents follow from, so nothing in the folder is ever out of date, and what is
//! not needed any more can be deleted at any time. No file is believed: one that is cut short, altered or of another program is
//! made again.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use blake3::{Hash, Hasher};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::identity::program;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::unfinished;

/// First bytes of every file; the number goes up with the arrangement of what follows: the hash of the contents, and the contents.
const HEAD: &[u8; 16] = b"gsii cache  v1\r\n";

/// How often someone looks whether another process has finished what both need.
const WAIT: Duration = Duration::from_millis(100);

/// Where a result came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Fetched {
    /// It was in the folder.
    Hit,
    /// It was made, and is in the folder from now on.
    Miss,
}

/// Names a result by what it follows from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    what: &'static str,
    hash: Hash,
}

impl Key {
    /// Of a `what` that follows from `causes`, given by digests or in a form that holds every digit, and from this program.
    pub fn new(what: &'static str, causes: &[&str]) -> Key {
        let mut hasher = Hasher::new();
        hasher.update(PROGRAM.as_bytes());
        for cause in std::iter::once(&what).chain(causes) {
            hasher.update(&(cause.len() as u64).to_le_bytes());
            hasher.update(cause.as_bytes());
        }
        Key { what, hash: hasher.finalize() }
    }

    /// The key as a cause of something else.
    pub fn as_cause(&self) -> String {
        self.hash.to_hex().to_string()
    }
}

/// Any other build of the program may compute something else.
static PROGRAM: LazyLock<String> = LazyLock::new(program);

/// Such a folder.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// Uses `folder`, which is made where there is none.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(folder: &Path) -> Result<Cache> {
        let failed = |e: std::io::Error| Error::Output { path: folder.to_owned(), reason: e.to_string() };
        std::fs::create_dir_all(folder).map_err(failed)?;
        Ok(Cache { folder: folder.to_owned() })
    }

    /// The result with this key: read, if `accept` takes what is in the file; else made by `make` and kept, unless `progress` was
    /// stopped meanwhile. Of several processes that need the same one makes it, and the others wait.
    ///
    /// # Errors
    /// Those of `make`. A folder that cannot be written to is only warned about.
    pub fn fetch<T: Serialize + DeserializeOwned>(
        &self,
        key: Key,
        progress: &Progress,
        accept: impl Fn(T) -> Option<T>,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<(T, Fetched)> {
        let path = self.folder.join(format!("{}-{}", key.what, &key.hash.to_hex()[..32]));
        if let Some(found) = read(&path).and_then(&accept) {
            return Ok((found, Fetched::Hit));
        }
        let lock = Lock::wait(path.with_extension("lock"), progress);
        if let Some(found) = lock.as_ref().filter(|lock| lock.waited).and_then(|_| read(&path)).and_then(&accept) {
            return Ok((found, Fetched::Hit));
        }
        if path.exists() {
            log::warn!("{}: damaged, or not a file of this program; it is made again", path.display());
        }
        let made = make()?;
        if !progress.stopped()
            && let Err(error) = write(&path, &made)
        {
            log::warn!("{error}");
        }
        Ok((made, Fetched::Miss))
    }
}

/// What a file holds; `None` when there is none, or not a whole one.
fn read<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let bytes = std::fs::read(path).ok()?;
    let (sum, contents) = bytes.strip_prefix(HEAD)?.split_first_chunk::<{ blake3::OUT_LEN }>()?;
    if Hasher::new().update_rayon(contents).finalize() != *sum {
        return None;
    }
    // All bytes must be used up.
    postcard::take_from_bytes(contents).ok().filter(|(_, rest)| rest.is_empty()).map(|(value, _)| value)
}

fn write(path: &Path, value: &impl Serialize) -> Result<()> {
    let failed = |e: postcard::Error| Error::Output { path: path.to_owned(), reason: e.to_string() };
    let contents = postcard::to_stdvec(value).map_err(failed)?;
    let sum = Hasher::new().update_rayon(&contents).finalize();
    unfinished::write(path, |out| {
        out.write_all(HEAD)?;
        out.write_all(sum.as_bytes())?;
        out.write_all(&contents)
    })
}

/// The right to make one file. The system takes it from processes that end, in whatever way.
struct Lock {
    path: PathBuf,
    /// Held open: closing it gives the right away.
    _file: File,
    /// Whether another process had it before.
    waited: bool,
}

impl Lock {
    /// Waits for the right, until `progress` is stopped. `None` also where the file system knows no locks: then several processes do
    /// the same work, and the last one's file stays.
    fn wait(path: PathBuf, progress: &Progress) -> Option<Lock> {
        let file = File::create(&path).ok()?;
        let mut waited = false;
        loop {
            match file.try_lock() {
                Ok(()) => return Some(Lock { path, _file: file, waited }),
                Err(std::fs::TryLockError::WouldBlock) if !progress.stopped() => {
                    if !std::mem::replace(&mut waited, true) {
                        log::info!("{}: waiting for another process", path.display());
                    }
                    std::thread::sleep(WAIT);
                }
                Err(_) => return None,
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Whoever waits has the file open and looks for the result first, so that a new lock of that name does no harm.
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    fn fetch(cache: &Cache, key: Key, made: &AtomicU32) -> (Vec<u32>, Fetched) {
        let make = || {
            made.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(20));
            Ok(vec![1, 2, 3])
        };
        cache.fetch(key, &Progress::silent(), Some, make).unwrap()
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn made_once_and_again_after_any_damage() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(&folder.path().join("a/b")).unwrap();
        let (key, made) = (Key::new("numbers", &["x"]), AtomicU32::new(0));
        assert_eq!(fetch(&cache, key, &made), (vec![1, 2, 3], Fetched::Miss));
        assert_eq!(fetch(&cache, key, &made), (vec![1, 2, 3], Fetched::Hit));
        let [path] = &files(&cache.folder)[..] else { panic!("one file, no lock") };
        let whole = std::fs::read(path).unwrap();
        let mut expected = 1;
        for length in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[length] ^= 1;
            for bad in [&whole[..length], &flipped, &[&whole[..], &[0]].concat()] {
                std::fs::write(path, bad).unwrap();
                assert_eq!(fetch(&cache, key, &made), (vec![1, 2, 3], Fetched::Miss), "{length}");
                expected += 1;
            }
        }
        assert_eq!(made.into_inner(), expected);
        assert_eq!(std::fs::read(path).unwrap(), whole);
    }

    #[test]
    fn causes_are_kept_apart() {
        let keys = [
            Key::new("a", &["b", "c"]),
            Key::new("a", &["bc"]),
            Key::new("ab", &["c"]),
            Key::new("a", &["b", ""]),
            Key::new("a", &["b"]),
        ];
        for (i, a) in keys.iter().enumerate() {
            assert!(keys[..i].iter().all(|b| a.hash != b.hash));
        }
    }

    #[test]
    fn others_wait_for_the_one_who_makes_it() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(folder.path()).unwrap();
        let (key, made) = (Key::new("numbers", &[]), AtomicU32::new(0));
        let start = std::sync::Barrier::new(4);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    start.wait();
                    fetch(&cache, key, &made);
                });
            }
        });
        assert_eq!(made.into_inner(), 1);
        assert_eq!(files(folder.path()).len(), 1);
    }

    #[test]
    fn what_does_not_fit_or_was_stopped_is_not_taken_for_a_result() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(folder.path()).unwrap();
        let (key, progress) = (Key::new("numbers", &[]), Progress::silent());
        let fetch = |accept: &dyn Fn(u32) -> Option<u32>, progress: &Progress, value| {
            cache.fetch(key, progress, accept, || Ok(value)).unwrap()
        };
        let stopped = Progress::silent();
        stopped.stop();
        assert_eq!(fetch(&Some, &stopped, 1), (1, Fetched::Miss));
        assert_eq!(fetch(&Some, &progress, 2), (2, Fetched::Miss), "nothing was kept");
        assert_eq!(fetch(&|_| None, &progress, 3), (3, Fetched::Miss));
        assert_eq!(fetch(&Some, &progress, 4), (3, Fetched::Hit));
    }
}
