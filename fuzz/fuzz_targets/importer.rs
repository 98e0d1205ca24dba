//! Any bytes as a glTF file: the importer loads them or says why not.

#![no_main]

use std::sync::LazyLock;

use gsii::scene::{LoadOptions, load};
use libfuzzer_sys::fuzz_target;
use tempfile::TempDir;

static FOLDER: LazyLock<TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());

fuzz_target!(|bytes: &[u8]| {
    let path = FOLDER.path().join("scene.gltf");
    std::fs::write(&path, bytes).unwrap();
    match load(&path, &LoadOptions::default()) {
        Ok(scene) => {
            assert!(!scene.mesh.triangles.is_empty() && !scene.cameras.is_empty());
            assert!(scene.mesh.positions.iter().all(|p| p.is_finite()));
            let vertices = scene.mesh.positions.len();
            assert!(scene.mesh.triangles.iter().flatten().all(|&i| (i as usize) < vertices));
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "one line"),
    }
});
