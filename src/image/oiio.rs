//! The only user of `oiio-sys`: its calls without pointers, with every size checked.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_int};
use std::marker::PhantomData;
use std::path::Path;
use std::ptr::{self, NonNull};

use oiio_sys as sys;

use super::metadata::{Metadata, Value};
use crate::error::{Error, Result};

/// Reason of a failure in OpenImageIO's words; callers add the file.
pub(super) type Attempt<T> = std::result::Result<T, String>;

/// Decoded images above 2 GiB are refused: the header of a hostile file may claim anything.
const MAX_BYTES: usize = sys::GSII_IMAGE_MEGABYTES << 20;

/// Runs a call of the shim that takes a buffer for the reason and returns 0 for success.
fn checked(call: impl FnOnce(*mut c_char, usize) -> c_int) -> Attempt<()> {
    let mut reason = [0u8; 1024];
    match call(reason.as_mut_ptr().cast(), reason.len()) {
        0 => Ok(()),
        _ => Err(text_until_nul(&reason)),
    }
}

fn text_until_nul(buffer: &[u8]) -> String {
    let text = CStr::from_bytes_until_nul(buffer).unwrap_or_default().to_string_lossy();
    // Reasons may have several lines; one line of ours is one problem.
    text.split('\n').map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}

/// # Safety
/// `text` is null or points to a NUL-terminated string.
unsafe fn owned_text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and NUL-terminated by this function's own condition.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

fn c_text(text: &str) -> Attempt<CString> {
    CString::new(text).map_err(|_| format!("{text:?} contains a NUL character"))
}

fn c_path(path: &Path) -> Attempt<CString> {
    #[cfg(unix)]
    let bytes = std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str());
    #[cfg(not(unix))]
    let bytes = path.to_str().ok_or("the file name is not Unicode")?.as_bytes();
    CString::new(bytes).map_err(|_| "the file name contains a NUL character".to_owned())
}

/// Version of OpenImageIO that the program runs with: 10000 major + 100 minor + patch.
pub fn library_version() -> u32 {
    // SAFETY: no arguments, no state.
    unsafe { sys::gsii_oiio_library_version() }.unsigned_abs()
}

/// Number of threads that OpenImageIO and OpenEXR may use; 0: as many as the machine has.
pub fn set_threads(threads: usize) -> Result<()> {
    let threads = c_int::try_from(threads).map_err(|_| Error::Usage(format!("{threads} threads are too many")))?;
    // SAFETY: the buffer is valid for its length during the call.
    checked(|error, size| unsafe { sys::gsii_oiio_set_threads(threads, error, size) }).map_err(Error::Usage)
}

/// Extensions of the formats that can be written to, sorted.
pub fn writable_extensions() -> Result<Vec<String>> {
    let mut list = [0u8; 8192];
    let buffer: *mut c_char = list.as_mut_ptr().cast();
    let size = list.len();
    // SAFETY: both buffers are valid for their lengths during the call.
    checked(|error, error_size| unsafe { sys::gsii_oiio_writable(buffer, size, error, error_size) })
        .map_err(|reason| Error::Usage(format!("OpenImageIO does not list its formats: {reason}")))?;
    let mut extensions: Vec<String> = text_until_nul(&list).split(',').map(str::to_owned).collect();
    extensions.sort();
    Ok(extensions)
}

/// Whether the format of this path stores any number of named channels, each in a type of its own.
pub(super) fn has_named_channels(path: &Path) -> Attempt<bool> {
    let path = c_path(path)?;
    let mut answer: c_int = 0;
    let answer_pointer = &raw mut answer;
    // SAFETY: the path is NUL-terminated, the answer and the buffer are valid during the call.
    checked(|error, size| unsafe { sys::gsii_oiio_named_channels(path.as_ptr(), answer_pointer, error, size) })?;
    Ok(answer != 0)
}

/// An open image file whose header has been checked.
pub(super) struct Reader<'memory> {
    raw: NonNull<sys::GsiiReader>,
    info: sys::GsiiInfo,
    memory: PhantomData<&'memory [u8]>,
}

impl Drop for Reader<'_> {
    fn drop(&mut self) {
        // SAFETY: `raw` came from gsii_oiio_open and is closed once, here.
        unsafe { sys::gsii_oiio_close(self.raw.as_ptr()) }
    }
}

impl<'memory> Reader<'memory> {
    /// Opens a file.
    pub(super) fn open(path: &Path) -> Attempt<Reader<'static>> {
        Reader::new(c_path(path)?, None)
    }

    /// Opens a file that lies in memory. `name` says by its extension which format to try first.
    pub(super) fn from_memory(name: &str, bytes: &'memory [u8]) -> Attempt<Self> {
        Reader::new(c_text(name)?, Some(bytes))
    }

    fn new(path: CString, bytes: Option<&'memory [u8]>) -> Attempt<Self> {
        let mut info = sys::GsiiInfo::default();
        let info_pointer = &raw mut info;
        let (memory, length) = bytes.map_or((ptr::null(), 0), |bytes| (bytes.as_ptr().cast(), bytes.len()));
        let mut raw = ptr::null_mut();
        checked(|error, size| {
            // SAFETY: the path is NUL-terminated; `memory` is null or `length` bytes that outlive the reader, which
            // carries their lifetime; info and the buffer are valid during the call.
            raw = unsafe { sys::gsii_oiio_open(path.as_ptr(), memory, length, info_pointer, error, size) };
            c_int::from(raw.is_null())
        })?;
        let raw = NonNull::new(raw).ok_or("the file could not be opened")?;
        let reader = Self { raw, info, memory: PhantomData };
        reader.check_header()?;
        Ok(reader)
    }

    fn check_header(&self) -> Attempt<()> {
        let info = &self.info;
        if info.deep != 0 {
            return Err("deep images (lists of samples per pixel) are not supported: flatten it first".to_owned());
        }
        if info.width < 1 || info.height < 1 || info.channels < 1 || info.depth > 1 {
            return Err(format!(
                "not a flat image: {} x {} x {} pixels, {} channels",
                info.width, info.height, info.depth, info.channels
            ));
        }
        self.bytes(self.channels(), info.bytes_per_value.unsigned_abs() as usize).map(|_| ())
    }

    /// Size of all pixels with this many values each.
    fn bytes(&self, values: usize, bytes_per_value: usize) -> Attempt<usize> {
        (self.width() as usize)
            .checked_mul(self.height() as usize)
            .and_then(|pixels| pixels.checked_mul(values))
            .and_then(|values| values.checked_mul(bytes_per_value))
            .filter(|&bytes| bytes <= MAX_BYTES)
            .ok_or_else(|| {
                format!(
                    "its header claims {} x {} pixels of {} channels, more than the {} MB that are read at most",
                    self.width(),
                    self.height(),
                    self.channels(),
                    sys::GSII_IMAGE_MEGABYTES
                )
            })
    }

    pub(super) fn width(&self) -> u32 {
        self.info.width.unsigned_abs()
    }

    pub(super) fn height(&self) -> u32 {
        self.info.height.unsigned_abs()
    }

    pub(super) fn channels(&self) -> usize {
        self.info.channels.unsigned_abs() as usize
    }

    /// Index of the channel that holds opacity.
    pub(super) fn alpha_channel(&self) -> Option<usize> {
        usize::try_from(self.info.alpha_channel).ok()
    }

    /// Whether the file stores floating-point numbers.
    pub(super) fn is_floating(&self) -> bool {
        self.info.floating_point != 0
    }

    /// Whether no channel has more than eight bits.
    pub(super) fn is_8_bit(&self) -> bool {
        self.info.bytes_per_value == 1
    }

    pub(super) fn channel_names(&self) -> Vec<String> {
        // SAFETY: the reader is open; the text is null or NUL-terminated and lives as long as the reader.
        (0..self.info.channels)
            .map(|index| unsafe { owned_text(sys::gsii_oiio_channel(self.raw.as_ptr(), index)) })
            .collect()
    }

    pub(super) fn metadata(&self) -> Metadata {
        let mut metadata = Metadata::new();
        for index in 0..self.info.attributes {
            let mut entry = NO_ATTRIBUTE;
            // SAFETY: the reader is open and the entry is valid during the call.
            if unsafe { sys::gsii_oiio_attribute(self.raw.as_ptr(), index, &raw mut entry) } != 0 {
                continue;
            }
            // SAFETY: both texts are null or NUL-terminated and live as long as the reader.
            let (name, text) = unsafe { (owned_text(entry.name), owned_text(entry.text)) };
            let value = match entry.kind as c_int {
                sys::GSII_INT => Value::Integer(entry.integer.into()),
                sys::GSII_FLOAT => Value::Real(entry.real),
                _ => Value::Text(text),
            };
            metadata.set(name, value);
        }
        metadata
    }

    /// The first `channels` channels as floats (integers scaled to 0..1), `stride` values from pixel to pixel; values
    /// that no channel goes to are 0.
    pub(super) fn read_f32(&mut self, channels: usize, stride: usize) -> Attempt<Vec<f32>> {
        let mut values = vec![0f32; self.bytes(stride, size_of::<f32>())? / size_of::<f32>()];
        self.read(channels, stride, sys::GSII_F32, &mut values)?;
        Ok(values)
    }

    /// The same as bytes.
    pub(super) fn read_u8(&mut self, channels: usize, stride: usize) -> Attempt<Vec<u8>> {
        let mut values = vec![0u8; self.bytes(stride, 1)?];
        self.read(channels, stride, sys::GSII_U8, &mut values)?;
        Ok(values)
    }

    fn read<T>(&mut self, channels: usize, stride: usize, sample: c_int, values: &mut [T]) -> Attempt<()> {
        let channels = c_int::try_from(channels).map_err(|_| "too many channels")?;
        let (pixel_stride, capacity) = (stride * size_of::<T>(), size_of_val(values));
        let target = values.as_mut_ptr().cast();
        let raw = self.raw.as_ptr();
        // SAFETY: the reader is open, `target` is valid for `capacity` bytes, and the shim checks that the pixels fit;
        // T is u8 or f32, as `sample` says, for which all bit patterns are values.
        checked(|error, size| unsafe {
            sys::gsii_oiio_read(raw, channels, sample, target, pixel_stride, capacity, error, size)
        })
    }
}

const NO_ATTRIBUTE: sys::GsiiAttribute =
    sys::GsiiAttribute { name: ptr::null(), text: ptr::null(), real: 0.0, kind: 0, integer: 0 };

/// Interleaved pixels to be written.
pub(super) enum Samples {
    /// Stored as eight bits.
    U8(Vec<u8>),
    /// Stored as half or float, channel by channel.
    F32 {
        /// The values.
        values: Vec<f32>,
        /// Per channel: half precision instead of single.
        half: Vec<bool>,
    },
}

/// How a file holds its pixels, where the format leaves a choice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Layout<'a> {
    /// OpenImageIO's name.
    pub compression: Option<&'a str>,
    /// Edge of square tiles, 0 for rows.
    pub tile: u32,
}

/// Writes an image to exactly this path, in the format of its extension. A failure may leave half a file.
pub(super) fn write(
    path: &Path,
    (width, height): (u32, u32),
    names: &[&str],
    samples: &Samples,
    metadata: &Metadata,
    layout: Layout,
) -> Attempt<()> {
    let (values, length, values_are, stored_as) = match samples {
        Samples::U8(values) => {
            (values.as_ptr().cast(), values.len(), sys::GSII_U8, vec![sys::GSII_U8 as u8; names.len()])
        }
        Samples::F32 { values, half } => {
            let stored = |&half: &bool| if half { sys::GSII_HALF as u8 } else { sys::GSII_F32 as u8 };
            (values.as_ptr().cast(), values.len(), sys::GSII_F32, half.iter().map(stored).collect())
        }
    };
    let expected = (width as usize).checked_mul(height as usize).and_then(|pixels| pixels.checked_mul(names.len()));
    if expected != Some(length) || length == 0 || stored_as.len() != names.len() {
        return Err(format!("{width} x {height} pixels of {} channels are not {length} values", names.len()));
    }
    let size = |value: usize| c_int::try_from(value).map_err(|_| "the image is too large".to_owned());

    let path = c_path(path)?;
    let compression = layout.compression.map(c_text).transpose()?;
    let names = names.iter().map(|name| c_text(name)).collect::<Attempt<Vec<_>>>()?;
    let name_pointers: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
    let entries = metadata.iter().map(|(name, value)| Entry::new(name, value)).collect::<Attempt<Vec<_>>>()?;
    let attributes: Vec<_> = entries.iter().map(Entry::attribute).collect();
    let image = sys::GsiiImage {
        path: path.as_ptr(),
        values,
        names: name_pointers.as_ptr(),
        stored_as: stored_as.as_ptr(),
        attributes: attributes.as_ptr(),
        compression: compression.as_ref().map_or(ptr::null(), |name| name.as_ptr()),
        attribute_count: attributes.len(),
        width: size(width as usize)?,
        height: size(height as usize)?,
        channels: size(names.len())?,
        values_are,
        tile: size(layout.tile as usize)?,
        reserved: 0,
    };
    // SAFETY: every pointer in `image` belongs to a value that lives until the end of this function; the number of
    // values is width * height * channels, and there are `channels` names and types, as checked above.
    checked(|error, size| unsafe { sys::gsii_oiio_write(&raw const image, error, size) })
}

/// Owns what a [`sys::GsiiAttribute`] points to.
struct Entry {
    name: CString,
    value: EntryValue,
}

enum EntryValue {
    Text(CString),
    Integer(i32),
    Real(f64),
}

impl Entry {
    fn new(name: &str, value: &Value) -> Attempt<Self> {
        let value = match value {
            Value::Text(text) => EntryValue::Text(c_text(text)?),
            Value::Real(number) => EntryValue::Real(*number),
            Value::Integer(number) => match i32::try_from(*number) {
                Ok(number) => EntryValue::Integer(number),
                Err(_) => EntryValue::Text(c_text(&number.to_string())?),
            },
        };
        Ok(Self { name: c_text(name)?, value })
    }

    fn attribute(&self) -> sys::GsiiAttribute {
        let none = sys::GsiiAttribute { name: self.name.as_ptr(), ..NO_ATTRIBUTE };
        match &self.value {
            EntryValue::Text(text) => sys::GsiiAttribute { kind: sys::GSII_STRING, text: text.as_ptr(), ..none },
            EntryValue::Integer(number) => sys::GsiiAttribute { kind: sys::GSII_INT, integer: *number, ..none },
            EntryValue::Real(number) => sys::GsiiAttribute { kind: sys::GSII_FLOAT, real: *number, ..none },
        }
    }
}
