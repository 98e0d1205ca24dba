//! Lets the binaries, tests and benches find Embree wherever `ffi/embree4-sys` found it.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // A library's build script cannot pass link arguments on to dependents, only this metadata.
    if let Ok(folder) = std::env::var("DEP_EMBREE4_RPATH") {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{folder}");
    }
}
