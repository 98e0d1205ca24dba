//! Finds Embree 4, binds the headers of what was found and compiles the batch shim.
//!
//! Dependents read `DEP_EMBREE4_INCLUDE`, and `DEP_EMBREE4_RPATH` where the loader would not find the library alone.

use std::env;
use std::path::{Path, PathBuf};

struct Embree {
    include: PathBuf,
    lib: PathBuf,
    /// Whether the loader searches `lib` without being told.
    in_system: bool,
}

/// `EMBREE_DIR`, then `.deps/embree` of the workspace (see scripts/setup.sh), then the system.
fn find() -> Result<Embree, String> {
    let at = |root: &Path, lib: &str| {
        let found = Embree { include: root.join("include"), lib: root.join(lib), in_system: false };
        let complete = found.include.join("embree4/rtcore.h").is_file() && found.lib.join("libembree4.so").exists();
        complete.then_some(found)
    };
    if let Some(root) = env::var_os("EMBREE_DIR").map(PathBuf::from) {
        return ["lib", "lib64"].iter().find_map(|lib| at(&root, lib)).ok_or_else(|| {
            format!("EMBREE_DIR={} has no include/embree4/rtcore.h and lib/libembree4.so", root.display())
        });
    }
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let workspace = workspace.canonicalize().unwrap_or(workspace);
    if let Some(found) = at(&workspace.join(".deps/embree"), "lib") {
        return Ok(found);
    }
    let multiarch = format!("lib/{}-linux-gnu", env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default());
    for root in ["/usr", "/usr/local"] {
        for lib in [multiarch.as_str(), "lib64", "lib"] {
            if let Some(found) = at(Path::new(root), lib) {
                return Ok(Embree { in_system: true, ..found });
            }
        }
    }
    Err(format!(
        "Embree 4 not found (looked at EMBREE_DIR, {}/.deps/embree, /usr, /usr/local): run scripts/setup.sh",
        workspace.display()
    ))
}

fn main() {
    println!("cargo:rerun-if-env-changed=EMBREE_DIR");
    for path in ["build.rs", "shim.cpp", "shim.h"] {
        println!("cargo:rerun-if-changed={path}");
    }
    let embree = find().unwrap_or_else(|reason| {
        println!("cargo::error={reason}");
        std::process::exit(1);
    });
    println!("cargo:rerun-if-changed={}", embree.include.join("embree4").display());

    // The shim comes before the library it uses on the linker's command line.
    cc::Build::new()
        .cpp(true)
        .cpp_link_stdlib(None)
        .std("c++17")
        .flag("-fno-exceptions")
        .flag("-fno-rtti")
        .file("shim.cpp")
        .include(&embree.include)
        .opt_level(3)
        .compile("gsii_embree");
    println!("cargo:rustc-link-search=native={}", embree.lib.display());
    println!("cargo:rustc-link-lib=dylib=embree4");
    println!("cargo:include={}", embree.include.display());
    if !embree.in_system {
        println!("cargo:rpath={}", embree.lib.display());
        // For this package's own tests; a dependent's binaries need the same from its build script.
        println!("cargo:rustc-link-arg=-Wl,-rpath,{}", embree.lib.display());
    }

    let bindings = bindgen::Builder::default()
        .header("shim.h")
        .clang_arg(format!("-I{}", embree.include.display()))
        .allowlist_item("(rtc|RTC|gsii_embree_|GSII_).*")
        .default_enum_style(bindgen::EnumVariation::NewType { is_bitfield: false, is_global: false })
        .bitfield_enum("RTC.*Flags?")
        .prepend_enum_name(false)
        .derive_default(true)
        .layout_tests(true)
        .generate()
        .unwrap_or_else(|reason| {
            println!("cargo::error=cannot bind Embree's headers, run scripts/setup.sh: {reason}");
            std::process::exit(1);
        });
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join("bindings.rs");
    if let Err(reason) = bindings.write_to_file(&out) {
        println!("cargo::error=cannot write {}: {reason}", out.display());
        std::process::exit(1);
    }
}
