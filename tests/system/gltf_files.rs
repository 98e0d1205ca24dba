//! Real and hostile glTF files, where they are at hand: `../shared/scenes` beside the project.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use crate::common::{self, interpolated, prepare, render, values};
use gsii::pipeline::Settings;
use gsii::scene::{LoadOptions, Scene, load};
use serde::Deserialize;

/// The folder of test scenes; says so on standard output and gives `None` where it is absent.
fn scenes() -> Option<PathBuf> {
    common::shared().map(|folder| folder.join("scenes"))
}

#[derive(Deserialize)]
struct Case {
    file: String,
    expect: String,
    triangles: Option<usize>,
    bounds: Option<[[f64; 3]; 2]>,
}

/// What is wrong with a scene that should have loaded as listed; `None` if nothing.
fn difference(scene: &Scene, case: &Case) -> Option<String> {
    let notes = &scene.notes;
    let dropped = notes.degenerate_triangles + notes.duplicate_triangles + notes.non_finite_triangles;
    let triangles = scene.mesh.triangles.len() + dropped;
    if Some(triangles) != case.triangles {
        return Some(format!("{triangles} triangles instead of {:?}", case.triangles));
    }
    let [min, max] = case.bounds?;
    let ours = [scene.mesh.bounds.min, scene.mesh.bounds.max].map(|p| (p.as_dvec3() + scene.centre).to_array());
    let size = (0..3).map(|i| max[i] - min[i]).fold(0.0, f64::max);
    for (ours, theirs) in ours.into_iter().flatten().zip(min.into_iter().chain(max)) {
        if (ours - theirs).abs() > 1e-3 * size {
            return Some(format!("bounds {ours} instead of {theirs}"));
        }
    }
    None
}

/// Whether every stage from simplification to the film gets through, with numbers in all pixels.
fn can_be_rendered(scene: &Scene) -> bool {
    let (prepared, _) = prepare(&Arc::new(scene.clone()), Settings::default());
    let film = render(&prepared, &interpolated(16, 9, 1, 0)).film;
    values(&film).iter().all(|value| value.is_finite())
}

/// What loading gave, in a few words.
fn happens(scene: &Scene) -> String {
    let notes = &scene.notes;
    let mut text = format!("{} triangles", scene.mesh.triangles.len());
    for (count, what) in [
        (notes.degenerate_triangles, "without area"),
        (notes.duplicate_triangles, "duplicate"),
        (notes.non_finite_triangles, "not finite"),
    ] {
        if count > 0 {
            text += &format!(", {count} {what} dropped");
        }
    }
    notes.warnings.iter().for_each(|w| text += &format!("; {w}"));
    text
}

#[test]
fn edge_cases_behave_as_listed() {
    let Some(folder) = scenes() else { return };
    let table = std::fs::read_to_string(folder.join("edge.json")).unwrap();
    let cases: Vec<Case> = serde_json::from_str(&table).unwrap();
    let mut wrong = Vec::new();
    let mut rows = "\n| file | expected | what happens |\n|---|---|---|\n".to_owned();
    for case in &cases {
        let result = load(&folder.join(&case.file), &LoadOptions::default());
        let verdict = match (&result, case.expect.as_str()) {
            (Ok(scene), "load") => difference(scene, case),
            (Err(error), "load") => Some(format!("refused: {error}")),
            (Ok(_), "refuse") => Some("loaded".into()),
            (Err(error), "refuse") if error.to_string().len() < case.file.len() + 10 => Some("no reason given".into()),
            _ => None,
        };
        match &result {
            Ok(scene) => {
                println!("{}: {} triangles {:?}", case.file, scene.mesh.triangles.len(), scene.notes);
                if scene.mesh.triangles.len() < 1_000_000 {
                    assert!(can_be_rendered(scene), "{}", case.file);
                }
            }
            Err(error) => println!("{} ({}): {error}", case.file, case.expect),
        }
        let happens = match &result {
            Ok(scene) => happens(scene),
            // Without the folder, which differs from machine to machine.
            Err(error) => error.to_string().replace(&format!("{}/", folder.display()), ""),
        };
        rows += &format!("| {} | {} | {} |\n", case.file, case.expect, happens.replace('|', "\\|"));
        wrong.extend(verdict.map(|v| format!("{}: {v}", case.file)));
    }
    let passed = format!("{} of {} edge cases behave as listed", cases.len() - wrong.len(), cases.len());
    println!("{passed}");
    common::write_accuracy("edge files", &format!("\n**{passed}.**\n{rows}\n"));
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn real_scenes_load() {
    let Some(folder) = scenes() else { return };
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "glb"));
    files.sort();
    assert!(!files.is_empty());
    for file in files {
        let start = Instant::now();
        let scene = load(&file, &LoadOptions::default()).unwrap();
        println!(
            "{}: {} triangles, {} objects, {} materials, {} textures, {} cameras, {} lights, parts {:?}, {:.2} s, {:?}",
            file.display(),
            scene.mesh.triangles.len(),
            scene.mesh.objects.len(),
            scene.materials.len(),
            scene.textures.len(),
            scene.cameras.len(),
            scene.lights.len(),
            scene.mesh.parts().iter().map(|p| (p.kind, p.triangles.len())).collect::<Vec<_>>(),
            start.elapsed().as_secs_f64(),
            scene.notes
        );
        assert!(scene.cameras.iter().all(|c| c.name != "overview"), "{} has cameras of its own", file.display());
        assert!(scene.materials.iter().any(|m| m.is_emitter()), "{} has emitters", file.display());
    }
}
