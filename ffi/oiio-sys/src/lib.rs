//! The few OpenImageIO calls that gsii needs, as C functions: `shim/shim.h` declares and explains them.
//!
//! OpenImageIO is C++ whose symbols change with its version, and which throws. The shim is compiled against the
//! installed headers and turns every exception into a return code and a message.
#![allow(missing_docs)]

use std::ffi::{c_char, c_int, c_void};

/// An open image file.
#[repr(C)]
pub struct GsiiReader {
    _opaque: [u8; 0],
}

pub const GSII_U8: c_int = 0;
pub const GSII_HALF: c_int = 1;
pub const GSII_F32: c_int = 2;

pub const GSII_INT: c_int = 0;
pub const GSII_FLOAT: c_int = 1;
pub const GSII_STRING: c_int = 2;

pub const GSII_IMAGE_MEGABYTES: usize = 2048;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct GsiiInfo {
    pub width: i32,
    pub height: i32,
    pub depth: i32,
    pub channels: i32,
    pub alpha_channel: i32,
    pub bytes_per_value: i32,
    pub floating_point: i32,
    pub deep: i32,
    pub attributes: i32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GsiiAttribute {
    pub name: *const c_char,
    pub text: *const c_char,
    pub real: f64,
    pub kind: i32,
    pub integer: i32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GsiiImage {
    pub path: *const c_char,
    pub values: *const c_void,
    pub names: *const *const c_char,
    pub stored_as: *const u8,
    pub attributes: *const GsiiAttribute,
    pub compression: *const c_char,
    pub attribute_count: usize,
    pub width: i32,
    pub height: i32,
    pub channels: i32,
    pub values_are: i32,
    pub tile: i32,
    pub reserved: i32,
}

// The same sizes are asserted in shim.cpp.
#[cfg(target_pointer_width = "64")]
const _: () = assert!(size_of::<GsiiInfo>() == 36 && size_of::<GsiiAttribute>() == 32 && size_of::<GsiiImage>() == 80);

unsafe extern "C" {
    pub fn gsii_oiio_compiled_version() -> c_int;
    pub fn gsii_oiio_library_version() -> c_int;
    pub fn gsii_oiio_set_threads(threads: c_int, error: *mut c_char, error_size: usize) -> c_int;
    pub fn gsii_oiio_writable(list: *mut c_char, list_size: usize, error: *mut c_char, error_size: usize) -> c_int;
    pub fn gsii_oiio_open(
        path: *const c_char,
        memory: *const c_void,
        size: usize,
        info: *mut GsiiInfo,
        error: *mut c_char,
        error_size: usize,
    ) -> *mut GsiiReader;
    pub fn gsii_oiio_channel(reader: *const GsiiReader, index: c_int) -> *const c_char;
    pub fn gsii_oiio_attribute(reader: *const GsiiReader, index: c_int, attribute: *mut GsiiAttribute) -> c_int;
    pub fn gsii_oiio_read(
        reader: *mut GsiiReader,
        channels: c_int,
        sample: c_int,
        values: *mut c_void,
        pixel_stride: usize,
        capacity: usize,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
    pub fn gsii_oiio_close(reader: *mut GsiiReader);
    pub fn gsii_oiio_write(image: *const GsiiImage, error: *mut c_char, error_size: usize) -> c_int;
    pub fn gsii_oiio_named_channels(
        path: *const c_char,
        answer: *mut c_int,
        error: *mut c_char,
        error_size: usize,
    ) -> c_int;
}
