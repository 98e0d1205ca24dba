//! Any bytes as the scene of a command: it succeeds, or fails with the code for bad input.

#![no_main]

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tempfile::TempDir;

static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    std::env::set_current_dir(folder.path()).unwrap();
    folder
});

/// A picture of a few pixels and the coarsest radiosity solution: every stage runs, none for long.
const RENDER: &str =
    "render --quiet --threads 1 --width 4 --height 3 --spp 1 --measure-bias 64 --unshot 0.5 --patch-size 1e9 -o image.exr";

/// What takes a thousand times longer than reading the scene, done for one input in 128.
const COMMANDS: [&str; 8] = [
    "--method gsii",
    "--method gsii --r-thresh 0.5",
    "--method pmm --box paper1993",
    "--method mcpt",
    "--method radiosity",
    "info --quiet --threads 1",
    "simplify --quiet -o simple.glb",
    "validate --quiet --threads 1 --rays 64",
];

fuzz_target!(|bytes: &[u8]| {
    LazyLock::force(&FOLDER);
    std::fs::write("scene.gltf", bytes).unwrap();
    let sum = bytes.iter().fold(0, |sum: usize, byte| sum + usize::from(*byte));
    let command = COMMANDS.get(sum % 1024).copied().unwrap_or("info --contents --quiet");
    let render = if command.starts_with('-') { RENDER } else { "" };
    let words = ["gsii", render, command, "scene.gltf"].into_iter().flat_map(str::split_whitespace);
    let code = gsii::cli::run_with(words.map(OsString::from));
    // 1 is for failures that are not the input's: the libraries disagree, the image cannot be written.
    assert!(code != ExitCode::FAILURE, "{command}");
});
