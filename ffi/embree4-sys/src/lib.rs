//! Raw bindings to the *installed* Embree 4 and to the shim that traces batches of rays (`shim.h`).
//!
//! Made by bindgen when this crate is built, because the layout of `RTCHit` differs between versions of Embree 4:
//! bindings made from other headers than the library's let it write past the end of the struct.
#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, clippy::all)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));
