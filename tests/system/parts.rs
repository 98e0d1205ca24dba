//! A part of an image has the bits of the whole one, and parts make the whole.

use crate::common::{fixed, lit_room, prepare, render, scene};
use gsii::image::{self, Value};
use gsii::pipeline::{Method, Settings};
use gsii::render::film::{Pixel, Region};
use gsii::render::{Film, RenderParams};

/// All that is known of a pixel, as text: numbers are printed so that they can be read back to the same bits.
fn everything(pixel: &Pixel) -> String {
    format!("{pixel:?}")
}

fn agree(whole: &Film, part: &Film, region: Region) {
    let all: Vec<String> = whole.pixels().map(everything).collect();
    assert_eq!([part.width, part.height], region.size());
    for (i, pixel) in part.pixels().enumerate() {
        let (x, y) = (region.low[0] + i as u32 % part.width, region.low[1] + i as u32 / part.width);
        assert_eq!(everything(pixel), all[(y * whole.width + x) as usize], "column {x}, row {y} of {region:?}");
    }
}

/// Trials that follow the error of the whole image, as `--error 0.1` asks for: a pixel's own is left alone up to four times that.
fn shared_out(width: u32, height: u32, least: u32, most: u32) -> RenderParams {
    RenderParams { max_trials: most, error: 0.1, hires_error: 0.4, lores_error: 0.4, ..fixed(width, height, least, 3) }
}

/// Trials are shared out unevenly, and not as they would be by each pixel's own error.
fn follows_the_error(film: &Film, by_pixel: &Film) {
    let trials = |film: &Film| -> Vec<u32> { film.pixels().map(|p| p.lores.trials()).collect() };
    let (all, alone) = (trials(film), trials(by_pixel));
    let range = |all: &[u32]| (all.iter().min().copied(), all.iter().max().copied(), all.iter().sum::<u32>());
    let ranges = (range(&all), range(&alone));
    assert!(ranges.0.0 < ranges.0.1 && all != alone, "{ranges:?}");
}

#[test]
fn crops_have_the_bits_of_the_whole() {
    let room = scene(&lit_room());
    for method in [Method::Gsii, Method::Mcpt] {
        let (prepared, _) = prepare(&room, Settings { method, ..Settings::default() });
        let params = RenderParams { features: true, ..shared_out(45, 30, 4, 256) };
        let whole = render(&prepared, &params).film;
        follows_the_error(&whole, &render(&prepared, &RenderParams { error: f32::INFINITY, ..params.clone() }).film);
        for (low, high) in [([0, 0], [45, 30]), ([5, 3], [30, 29]), ([44, 29], [45, 30])] {
            let region = Region { low, high };
            let part = render(&prepared, &RenderParams { region: Some(region), ..params.clone() }).film;
            agree(&whole, &part, region);
        }
    }
}

/// In an image of many tiles a part needs only a sample of the others.
#[test]
fn crops_of_large_images_have_the_bits_of_the_whole() {
    let (prepared, _) = prepare(&scene(&lit_room()), Settings { method: Method::Mcpt, ..Settings::default() });
    let params = shared_out(528, 264, 2, 32);
    let whole = render(&prepared, &params).film;
    follows_the_error(&whole, &render(&prepared, &RenderParams { error: f32::INFINITY, ..params.clone() }).film);
    for (low, high) in [([100, 50], [131, 70]), ([520, 255], [528, 264])] {
        let region = Region { low, high };
        agree(&whole, &render(&prepared, &RenderParams { region: Some(region), ..params.clone() }).film, region);
    }
}

/// Runs the program in a folder with a small scene.
fn gsii(folder: &std::path::Path, arguments: &[&str]) -> std::process::Output {
    std::process::Command::new(env!("CARGO_BIN_EXE_gsii")).current_dir(folder).args(arguments).output().unwrap()
}

#[test]
fn merged_parts_are_the_whole_image() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("room.gltf"), lit_room()).unwrap();
    let run = |arguments: &[&str]| {
        let output = gsii(folder.path(), arguments);
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let render = |more: &[&str]| {
        let all =
            ["render", "room.gltf", "--width", "45", "--height", "30", "--max-trials", "32", "--measure-bias", "0"];
        let (code, text) = run(&[&all, more].concat());
        assert_eq!(code, Some(0), "{text}");
    };
    render(&["-o", "whole.exr", "-o", "whole.png"]);
    for i in 1..=4 {
        render(&["--tile", &format!("{i}/4"), "-o", &format!("{i}.exr")]);
    }
    let merge = |parts: &[&str]| run(&[&["merge"], parts, &["-o", "merged.exr", "-o", "merged.png"]].concat());
    // In any order.
    assert_eq!(merge(&["3.exr", "1.exr", "4.exr", "2.exr"]).0, Some(0));
    let (whole, _) = image::read_with_metadata(&path("whole.exr")).unwrap();
    let (merged, header) = image::read_with_metadata(&path("merged.exr")).unwrap();
    assert_eq!((whole.width(), whole.height()), (merged.width(), merged.height()));
    assert_eq!(whole.channels().len(), merged.channels().len());
    for (a, b) in whole.channels().iter().zip(merged.channels()) {
        let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert!(a.name == b.name && bits(&a.values) == bits(&b.values), "{} and {}", a.name, b.name);
    }
    let bytes = |name: &str| image::read(&path(name)).unwrap();
    assert_eq!(bytes("whole.png"), bytes("merged.png"), "with automatic exposure and dither");
    assert_eq!(header.get("gsii:width"), Some(&Value::Integer(45)));
    assert_eq!((header.get("gsii:region"), header.get("gsii:error.total")), (None, None));

    for (parts, words) in [
        (&["1.exr", "2.exr", "4.exr"][..], "missing"),
        (&["1.exr", "2.exr", "2.exr", "4.exr"], "given twice"),
        (&["1.exr", "2.exr", "./2.exr", "4.exr"], "overlaps"),
        (&["1.exr", "whole.exr"], "--tile or --crop"),
        (&["1.exr", "nowhere.exr"], "nowhere.exr"),
    ] {
        let (code, text) = merge(parts);
        assert_eq!((code, text.lines().count()), (Some(2), 1), "{text}");
        assert!(text.contains(words), "{words}: {text}");
    }
    for (option, words) in [
        (&["--crop", "0", "0", "46", "30"][..], "--crop"),
        (&["--crop", "5", "5", "5", "9"], "--crop"),
        (&["--tile", "9/99"], "--tile"),
        (&["--tile", "0/4"], "2/4"),
        (&["--tile", "1/4", "--crop", "0", "0", "1", "1"], "--crop"),
    ] {
        let all = ["render", "room.gltf", "--width", "45", "--height", "30", "-o", "x.exr"];
        let (code, text) = run(&[&all, option].concat());
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains(words), "{words}: {text}");
    }
}
