//! Bytes behind buffers, buffer views and images.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use gltf::json::{Root, buffer};

use super::container::{Uri, read_uri};

/// Reads buffers when they are first needed: what no accessor uses may be missing.
pub(super) struct Buffers<'a> {
    root: &'a Root,
    folder: PathBuf,
    bin: Option<&'a [u8]>,
    loaded: Vec<OnceLock<Result<Cow<'a, [u8]>, String>>>,
}

impl<'a> Buffers<'a> {
    /// Buffers of the glTF file at `path`.
    pub(super) fn new(root: &'a Root, path: &Path, bin: Option<&'a [u8]>) -> Self {
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        Buffers { root, folder, bin, loaded: root.buffers.iter().map(|_| OnceLock::new()).collect() }
    }

    /// The bytes of a buffer, exactly as many as it declares.
    fn buffer(&self, index: usize) -> Result<&[u8], String> {
        let (Some(cell), Some(buffer)) = (self.loaded.get(index), self.root.buffers.get(index)) else {
            return Err(format!("buffer {index} does not exist"));
        };
        match cell.get_or_init(|| self.load(index, buffer)) {
            Ok(bytes) => Ok(bytes),
            Err(reason) => Err(reason.clone()),
        }
    }

    fn load(&self, index: usize, buffer: &buffer::Buffer) -> Result<Cow<'a, [u8]>, String> {
        let declared = usize::try_from(buffer.byte_length.0).map_err(|_| format!("buffer {index} is too large"))?;
        let bytes = match (&buffer.uri, self.bin) {
            (Some(uri), _) => Cow::Owned(self.resource(uri).map_err(|e| format!("buffer {index}: {e}"))?),
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(format!("buffer {index} has no data: no URI, and no binary chunk in this file")),
        };
        if bytes.len() < declared {
            let have = bytes.len();
            return Err(format!(
                "buffer {index} declares {declared} bytes but only {have} are there; it is incomplete"
            ));
        }
        Ok(bytes)
    }

    /// The bytes that a URI refers to.
    pub(super) fn resource(&self, uri: &str) -> Result<Vec<u8>, String> {
        let (decoded, written) = match read_uri(uri)? {
            Uri::Data(bytes) => return Ok(bytes),
            Uri::Relative(decoded, written) => (decoded, written),
        };
        // A file may really be called "a%20b.bin".
        let path = [decoded.as_ref(), written].map(|name| self.folder.join(name)).into_iter().find(|p| p.is_file());
        let Some(path) = path else {
            let wanted = self.folder.join(decoded.as_ref());
            return Err(format!("'{}' does not exist; it must lie beside the glTF file", wanted.display()));
        };
        std::fs::read(&path).map_err(|e| format!("cannot read '{}': {e}", path.display()))
    }

    /// The bytes of a buffer view, and its stride where it has one.
    pub(super) fn view(&self, index: usize) -> Result<(&[u8], Option<usize>), String> {
        let view = self.root.buffer_views.get(index).ok_or_else(|| format!("bufferView {index} does not exist"))?;
        let bytes = self.buffer(view.buffer.value())?;
        let declared = self.root.buffers[view.buffer.value()].byte_length.0;
        let start = view.byte_offset.map_or(0, |o| o.0);
        let range = start
            .checked_add(view.byte_length.0)
            .filter(|&end| end <= declared)
            .and_then(|end| Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        let bytes = range.and_then(|r| bytes.get(r)).ok_or_else(|| {
            format!("bufferView {index} reaches past the {declared} bytes of buffer {}", view.buffer.value())
        })?;
        Ok((bytes, view.byte_stride.map(|s| s.0)))
    }
}
