//! Lets the binaries, tests and benches find Embree wherever `ffi/embree4-sys` found it.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // A library's build script cannot pass link arguments on to dependents, only this metadata.
    if let Ok(folder) = env::var("DEP_EMBREE4_RPATH") {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{folder}");
    }
    // Embree's own TBB and the older one of the system, which OpenImageIO brings, export the same symbols, and the one
    // that the loader meets first serves both. Only a newer TBB promises to serve what was built with an older one. The
    // loader goes breadth first, so what the program itself names comes before all that its libraries name, in
    // whatever order those are linked.
    if let Ok(tbb) = env::var("DEP_EMBREE4_TBB") {
        println!("cargo:rustc-link-arg=-Wl,--push-state,--no-as-needed,{tbb},--pop-state");
    }
}
