//! Finds OpenImageIO 2.4 or newer and compiles the shim against its headers.
//!
//! `OIIO_ROOT` (an installation prefix) comes first, then pkg-config. The library folder is handed on as
//! `DEP_OPENIMAGEIO_LIBDIR`, for the rpath of programs when it is not a system folder.

use std::path::{Path, PathBuf};
use std::process::exit;

const HELP: &str = "run scripts/setup.sh, or set OIIO_ROOT to the prefix it is installed under";

fn main() {
    println!("cargo:rerun-if-changed=shim/shim.cpp");
    println!("cargo:rerun-if-changed=shim/shim.h");
    println!("cargo:rerun-if-env-changed=OIIO_ROOT");

    let (include, lib) = match std::env::var_os("OIIO_ROOT") {
        Some(root) => from_root(Path::new(&root)),
        None => from_pkg_config(),
    };
    let mut build = cc::Build::new();
    build.cpp(true).std("c++17").includes(include).file("shim/shim.cpp").warnings(false);
    if let Err(error) = build.try_compile("gsii_oiio_shim") {
        fail(&format!("the shim does not compile against the OpenImageIO headers ({error})"));
    }
    // After the shim: a static library's symbols are looked up in what follows it.
    for dir in &lib {
        println!("cargo:rustc-link-search=native={}", dir.display());
        println!("cargo:libdir={}", dir.display());
    }
    println!("cargo:rustc-link-lib=OpenImageIO");
    println!("cargo:rustc-link-lib=OpenImageIO_Util");
}

fn from_root(root: &Path) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let include = root.join("include");
    if !include.join("OpenImageIO/oiioversion.h").is_file() {
        fail(&format!("OIIO_ROOT is {} but has no include/OpenImageIO/oiioversion.h", root.display()));
    }
    let arch = std::env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let candidates = ["lib", "lib64", &format!("lib/{arch}-linux-gnu")].map(|dir| root.join(dir));
    let holds_library = |dir: &PathBuf| {
        ["libOpenImageIO.so", "libOpenImageIO.dylib", "libOpenImageIO.a"].iter().any(|name| dir.join(name).is_file())
    };
    match candidates.iter().find(|dir| holds_library(dir)) {
        Some(dir) => (vec![include], vec![dir.clone()]),
        None => fail(&format!("OIIO_ROOT is {} but no libOpenImageIO lies in its lib folder", root.display())),
    }
}

fn from_pkg_config() -> (Vec<PathBuf>, Vec<PathBuf>) {
    match pkg_config::Config::new().atleast_version("2.4").cargo_metadata(false).probe("OpenImageIO") {
        Ok(library) => (library.include_paths, library.link_paths),
        Err(_) => fail("OpenImageIO 2.4 or newer (libopenimageio-dev) was not found by pkg-config"),
    }
}

/// One line and no backtrace: the reader is somebody who is setting up a build.
fn fail(reason: &str) -> ! {
    eprintln!("error: {reason}; {HELP}");
    exit(1)
}
