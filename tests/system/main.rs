//! The program as a user meets it, whole images, real and hostile files, hard scenes: everything that is larger than a module and has no
//! number of its own among the reference cases (`tests/cases`). One binary: every further one would compile and link the library's
//! generic code again, and wait for its last test with one core idle.

mod command_line;
#[path = "../common/mod.rs"]
mod common;
mod environment;
mod gltf_files;
mod hard_cases;
#[allow(dead_code, reason = "the reference cases use all of it")]
#[path = "../cases/kit.rs"]
mod kit;
mod long;
mod materials;
mod parts;
mod references;
mod rendering;
#[allow(dead_code, reason = "the reference cases use all of it")]
#[path = "../cases/report.rs"]
mod report;
mod views;
