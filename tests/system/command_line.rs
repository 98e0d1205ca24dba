//! The program as a user meets it: exit codes, messages, files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common;
use gsii::image::{self, Value};

/// A folder with a small scene.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("room.gltf"), common::lit_room()).unwrap();
        Bench { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gsii"));
        command.current_dir(self.folder.path()).args(arguments).stdin(Stdio::null());
        command
    }

    fn gsii(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// A small rendering; panics with its messages if it fails.
    fn render(&self, arguments: &[&str]) -> Output {
        let small = ["render", "room.gltf", "--width", "24", "--height", "16", "--spp", "4", "--measure-bias", "1024"];
        let output = self.gsii(&[&small, arguments].concat());
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        output
    }

    fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Asserts exit code 2 and one line that holds all of `words`, and gives it.
fn refused(output: &Output, words: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 1, "one line: {text}");
    for word in words {
        assert!(text.contains(word), "'{word}' in: {text}");
    }
}

#[test]
fn files_that_are_no_scenes_are_refused_in_one_line() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("folder.glb")).unwrap();
    std::fs::write(bench.path("empty.glb"), "").unwrap();
    std::fs::write(bench.path("garbage.glb"), [0xa5; 4096]).unwrap();
    std::fs::write(bench.path("garbage.gltf"), "this is not JSON").unwrap();
    let glb = common::lit_room();
    std::fs::write(bench.path("cut.gltf"), &glb[..glb.len() / 2]).unwrap();
    for name in ["missing.glb", "folder.glb", "empty.glb", "garbage.glb", "garbage.gltf", "cut.gltf"] {
        for command in [&["render", name, "-o", "out.exr"][..], &["info", name], &["validate", name]] {
            let before = bench.files();
            refused(&bench.gsii(command), &[name]);
            assert_eq!(bench.files(), before, "{command:?} leaves nothing behind");
        }
    }
}

/// Embree's scheduler must not keep a core busy that it was not given.
#[test]
fn one_thread_takes_one_core() {
    let bench = Bench::new();
    let office = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/office-high.glb");
    let small = ["--width", "96", "--spp", "32", "--method", "mcpt", "--measure-bias", "0"];
    let output =
        bench.gsii(&[&["render", office, "-o", "a.exr", "--threads", "1", "--stats", "a.json"], &small[..]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("a.json")).unwrap()).unwrap();
    let spent = |clock: &str| {
        let of = |stage: &str| stats[clock][stage].as_f64().unwrap();
        of("total") - of("build")
    };
    // A core in vain would make it 2; Embree may build its trees with a second thread.
    assert!(spent("cpu_seconds") < 1.5 * spent("seconds"), "{stats}");
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let bench = Bench::new();
    let before = bench.files();
    let cases: [(&[&str], &str); 15] = [
        (&["--camera", "nobody"], "nobody"),
        (&["--beta", "2"], "--beta"),
        (&["--r-thresh=-1"], "--r-thresh"),
        (&["--r-thresh", "NaN"], "--r-thresh"),
        (&["--patch-size", "0"], "--patch-size"),
        (&["--unshot", "0"], "--unshot"),
        (&["--error", "-1"], "--error"),
        (&["--sky", "--sun", "-5,20"], "--sun"),
        (&["-o", "./out.exr"], "out.exr"),
        (&["--stats", "out.exr"], "out.exr"),
        (&["--threads", "0"], "--threads"),
        (&["--min-trials", "8", "--max-trials", "4"], "--min-trials"),
        (&["--error", "0"], "error"),
        (&["--time-limit", "0"], "--time-limit"),
        (&["-o", "out.xyz"], "out.xyz"),
    ];
    for (arguments, word) in cases {
        refused(&bench.gsii(&[&["render", "room.gltf", "-o", "out.exr"], arguments].concat()), &[word]);
    }
    // What the option parser refuses by itself comes with its usage: more lines, the same exit code.
    for arguments in [
        &["render", "room.gltf"][..],
        &["render", "room.gltf", "-o", "out.exr", "--width", "0"],
        &["render", "room.gltf", "-o", "out.exr", "--width", "-5"],
        &["render", "room.gltf", "-o", "out.exr", "--spp", "0"],
        &["render", "room.gltf", "-o", "out.exr", "--method", "magic"],
        &["render", "room.gltf", "-o", "out.exr", "--r-thresh", "wide"],
        &["render", "room.gltf", "-o", "out.exr", "--layers", "hires,colour"],
        &["render", "room.gltf", "-o", "out.exr", "--spp", "4", "--error", "0.1"],
        &["paint"],
        &[],
    ] {
        let output = bench.gsii(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!stderr(&output).contains("panicked"));
    }
    assert_eq!(bench.files(), before);
    assert!(bench.gsii(&["--help"]).status.success());
    assert!(bench.gsii(&["--version"]).status.success());
}

/// Scripts depend on these options: they stay, with these names and values.
#[test]
fn every_promised_option_works() {
    let bench = Bench::new();
    let size = ["render", "room.gltf", "-o", "a.exr", "--width", "12", "--height", "8", "--measure-bias", "64"];
    for (arguments, key, value) in [
        ("--camera eye --seed 3 --threads 1 --error 0.5 --min-trials 2 --max-trials 4 --verbose", "camera", "eye"),
        ("--camera 0 --hires-error 0.5 --lores-error 0.25 --spp 2 --stats b.json", "", ""),
        ("--camera 0 --hires-error 0.5 --lores-error 0.25 --max-trials 16 --quiet", "lores_error", "0.25"),
        ("--method gsii --r-thresh 0.5 --beta 0.05 --box paper1993 --spp 2", "r_thresh", "0.5"),
        ("--method gsii --r-thresh auto --patch-size auto --box flux --spp 2", "box", "flux"),
        ("--method pmm --unshot 0.1 --patch-size 1.5 --spp 2", "patch_size", "1.5"),
        ("--method mcpt --max-depth 3 --backend obvhs --spp 2", "backend", "obvhs"),
        ("--method radiosity --geometry nc", "geometry", "nc"),
        (
            "--method radiosity --geometry ns --layers hires,lores,hires_dev,lores_dev,albedo,normal,depth,trials",
            "geometry",
            "ns",
        ),
        ("--unbiased --spp 2 --exposure 1.5 --time-limit 600", "method", "gsii"),
    ] {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        let output = bench.gsii(&[&size[..], &["--stats", "a.json"], &arguments].concat());
        if key.is_empty() {
            assert_eq!(output.status.code(), Some(2), "fixed sampling aims for no error: {arguments:?}");
            continue;
        }
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("a.json")).unwrap()).unwrap();
        let used = &stats["parameters"][key];
        let used = used.as_str().map_or_else(|| used.to_string(), str::to_owned);
        assert_eq!(used, value, "{arguments:?}: {key}");
    }
    bench.render(&["-o", "unbiased.exr", "--unbiased"]);
    bench.render(&["-o", "traced.exr", "--method", "mcpt"]);
    assert_eq!(image::read(&bench.path("unbiased.exr")).unwrap(), image::read(&bench.path("traced.exr")).unwrap());
}

#[test]
fn a_scene_without_light_is_noticed() {
    let bench = Bench::new();
    let dark = common::gltf(&common::cluttered_room(0.5, 0.0, 0.5), common::EYE);
    std::fs::write(bench.path("room.gltf"), dark).unwrap();
    assert!(stderr(&bench.render(&["-o", "out.png"])).contains("nothing gives light"));
    assert!(!stderr(&bench.render(&["-o", "out.png", "--sky"])).contains("nothing gives light"));
}

#[test]
fn places_that_cannot_be_written_are_noticed_before_the_work() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("there.exr")).unwrap();
    let before = bench.files();
    for target in ["no/such/folder/out.exr", "there.exr", "/proc/out.exr"] {
        let start = Instant::now();
        let output = bench.gsii(&["render", "room.gltf", "-o", target, "--spp", "100000"]);
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(stderr(&output).contains(target) && stderr(&output).lines().count() == 1, "{}", stderr(&output));
        assert!(start.elapsed() < Duration::from_secs(20), "found out before rendering");
    }
    assert_eq!(bench.files(), before);
}

#[test]
fn common_formats_are_written_and_can_be_read() {
    let bench = Bench::new();
    let names = ["a.exr", "a.hdr", "a.tif", "a.pfm", "a.png", "a.jpg", "a.webp", "a.tga", "a.bmp"];
    let writable = image::writable_extensions().unwrap();
    let names = names.into_iter().filter(|n| {
        let extension = n.trim_start_matches("a.");
        let known = writable.iter().any(|w| w == extension);
        if !known {
            println!("skipped {extension}: this OpenImageIO does not write it");
        }
        known
    });
    let names: Vec<&str> = names.collect();
    assert!(names.contains(&"a.exr") && names.contains(&"a.png"));
    let outputs: Vec<&str> = names.iter().flat_map(|n| ["-o", *n]).collect();
    bench.render(&outputs);
    for name in names {
        let read = image::read(&bench.path(name)).unwrap();
        assert_eq!((read.width(), read.height()), (24, 16), "{name}");
        let bands = read.rgb_or_grey().unwrap();
        assert!(bands[0].iter().any(|&v| v > 0.0), "{name} is not black");
    }
}

#[test]
fn layers_and_header_of_an_exr() {
    let bench = Bench::new();
    bench.render(&["-o", "all.exr", "-o", "few.exr"]);
    let (all, header) = image::read_with_metadata(&bench.path("all.exr")).unwrap();
    let colours = ["hires", "lores", "hires_dev", "lores_dev", "albedo"];
    let mut channels: Vec<String> = colours.iter().flat_map(|l| ["R", "G", "B"].map(|b| format!("{l}.{b}"))).collect();
    channels.extend(
        ["R", "G", "B", "normal.X", "normal.Y", "normal.Z", "depth.Z", "trials.hires", "trials.lores"]
            .map(String::from),
    );
    for channel in &channels {
        assert!(
            all.channel(channel).is_some(),
            "{channel} in {:?}",
            all.channels().iter().map(|c| &c.name).collect::<Vec<_>>()
        );
    }
    let at = |name: &str, i: usize| all.channel(name).unwrap()[i];
    for i in 0..24 * 16 {
        let sum = at("hires.G", i) + at("lores.G", i);
        // Three values rounded to f32.
        assert!((at("G", i) - sum).abs() <= 2.0 * f32::EPSILON * sum, "R,G,B = HIRES + LORES");
        assert_eq!((at("trials.hires", i), at("trials.lores", i)), (4.0, 4.0));
    }
    assert_eq!(header.get("gsii:method"), Some(&Value::Text("gsii".into())));
    for key in
        ["gsii:r_thresh", "gsii:seed", "gsii:error.lores", "gsii:error.bias", "gsii:error.bias_ci", "gsii:camera"]
    {
        assert!(header.get(key).is_some(), "{key}");
    }
    bench.render(&["-o", "few.exr", "--layers", "lores,depth"]);
    let few = image::read(&bench.path("few.exr")).unwrap();
    let mut names: Vec<&str> = few.channels().iter().map(|c| c.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["B", "G", "R", "depth.Z", "lores.B", "lores.G", "lores.R"]);
}

#[test]
fn statistics_hold_every_promised_key() {
    let bench = Bench::new();
    for method in ["gsii", "pmm", "mcpt", "radiosity"] {
        bench.render(&["-o", "a.exr", "--stats", "a.json", "--method", method]);
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("a.json")).unwrap()).unwrap();
        let promised = [
            ("seconds", "load simplify build radiosity hires lores write total"),
            ("rays", "simplify radiosity hires lores"),
            ("counts", "triangles surfaces normal complex simple clusters patches"),
            ("error", "hires lores radiosity fit"),
        ];
        for (group, keys) in promised {
            for key in keys.split(' ') {
                assert!(stats[group][key].is_number(), "{method}: {group}.{key} in {stats}");
            }
        }
        for key in ["bias", "bias_ci"] {
            let measured = stats["error"][key].is_number();
            assert_eq!(measured, matches!(method, "gsii" | "pmm"), "{method}: error.{key}");
            assert!(stats["error"].get(key).is_some(), "the key is always there");
        }
        assert_eq!(stats["parameters"]["method"], method);
        for key in ["scene", "width", "height", "seed", "r_thresh", "beta", "min_trials", "max_trials", "backend"] {
            assert!(stats["parameters"].get(key).is_some(), "parameters.{key}");
        }
        assert!(stats["peak_rss_bytes"].as_u64().unwrap() > 0 || cfg!(not(target_os = "linux")));
        assert!(stats["rays"]["hires"].as_u64().unwrap() >= 24 * 16 * 4, "a view ray for each trial");
        assert!(stats["seconds"]["total"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn quiet_says_nothing_and_otherwise_the_error_is_stated() {
    let bench = Bench::new();
    let quiet = bench.render(&["-o", "a.exr", "--quiet"]);
    assert_eq!((quiet.stdout.len(), stderr(&quiet).as_str()), (0, ""));
    let loud = bench.render(&["-o", "a.exr"]);
    assert!(loud.stdout.is_empty(), "standard output is for what was asked for");
    let text = stderr(&loud);
    for words in ["a.exr", "noise", "bias of the mean"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(!text.contains('\u{1b}') && !text.contains('\r'), "no progress bars where there is no terminal");
}

/// Starts a rendering that would take hours.
fn start_endless(bench: &Bench, target: &str) -> std::process::Child {
    let arguments = ["render", "room.gltf", "-o", target, "--width", "64", "--height", "48", "--spp", "10000000"];
    bench.command(&arguments).stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap()
}

fn interrupt(child: &std::process::Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn ctrl_c_writes_what_is_there_and_says_so() {
    let bench = Bench::new();
    let child = start_endless(&bench, "a.exr");
    std::thread::sleep(Duration::from_secs(8));
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("stopped early"), "{}", stderr(&output));
    let read = image::read(&bench.path("a.exr")).unwrap();
    assert!(read.channel("trials.hires").unwrap().iter().any(|&t| t > 0.0));
    assert_eq!(bench.files(), ["a.exr", "a.exr.checkpoint", "room.gltf"], "nothing half-written stays");
}

#[test]
fn ctrl_c_before_the_first_trial_writes_nothing() {
    let bench = Bench::new();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/office-high.glb");
    let arguments = ["render", path.to_str().unwrap(), "-o", "a.exr"];
    let mut child = bench.command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
    // More than once: before the program has a handler, Ctrl-C kills it, or is lost where whoever started the tests ignores it.
    while child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(300));
        interrupt(&child);
    }
    let output = child.wait_with_output().unwrap();
    let before_handler = output.status.code().is_none();
    assert!(before_handler || output.status.code() == Some(1), "{:?}: {}", output.status, stderr(&output));
    assert_eq!(bench.files(), ["room.gltf"]);
}

#[test]
fn a_time_limit_is_kept() {
    let bench = Bench::new();
    let start = Instant::now();
    let arguments = [
        "render",
        "room.gltf",
        "-o",
        "a.exr",
        "--width",
        "64",
        "--height",
        "48",
        "--spp",
        "10000000",
        "--stats",
        "a.json",
    ];
    let output = bench.gsii(&[&arguments[..], &["--time-limit", "1"]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(start.elapsed() < Duration::from_secs(60));
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("a.json")).unwrap()).unwrap();
    assert_eq!(stats["parameters"]["stopped_early"], true);
    assert!(image::read(&bench.path("a.exr")).is_ok());
}

#[test]
fn threads_and_runs_give_the_same_bytes_of_pixels() {
    let bench = Bench::new();
    let pixels = |name: &str, threads: &str| {
        bench.render(&["-o", name, "--threads", threads]);
        let read = image::read(&bench.path(name)).unwrap();
        let values: Vec<(String, Vec<u32>)> =
            read.channels().iter().map(|c| (c.name.clone(), c.values.iter().map(|v| v.to_bits()).collect())).collect();
        values
    };
    let one = pixels("1.exr", "1");
    assert_eq!(one, pixels("2.exr", "2"));
    assert_eq!(one, pixels("again.exr", "1"));
}

#[test]
fn compare_prints_the_metrics() {
    let bench = Bench::new();
    bench.render(&["-o", "a.exr"]);
    bench.render(&["-o", "b.exr", "--seed", "1"]);
    let output = bench.gsii(&["compare", "a.exr", "b.exr", "--json"]);
    let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(metrics["metrics"]["rel_mse"].as_f64().unwrap() > 0.0);
    let same = bench.gsii(&["compare", "a.exr", "a.exr", "--json"]);
    let metrics: serde_json::Value = serde_json::from_slice(&same.stdout).unwrap();
    assert_eq!(metrics["metrics"]["rel_mse"], 0.0);
    refused(&bench.gsii(&["compare", "a.exr", "missing.exr"]), &["missing.exr"]);
    refused(&bench.gsii(&["compare", "a.exr", "room.gltf"]), &["room.gltf"]);
}

#[test]
fn info_tells_what_would_be_done() {
    let bench = Bench::new();
    let output = bench.gsii(&["info", "room.gltf"]);
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    for words in ["camera 0", "r_thresh", "surfaces", "clusters", "patches"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // 75 blocks, the room and the lamp, twelve triangles each.
    assert!(text.contains("924 in 77 objects"), "{text}");
}

#[test]
fn validate_finds_no_unexplained_difference() {
    let bench = Bench::new();
    let output = bench.gsii(&["validate", "room.gltf", "--rays", "100000"]);
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert!(output.status.success(), "{text}{}", stderr(&output));
    let total = text.lines().find(|l| l.starts_with("total")).unwrap();
    let numbers: Vec<u64> = total.split_whitespace().skip(1).map(|n| n.parse().unwrap()).collect();
    assert_eq!((numbers[0], numbers[5]), (500_000, 0), "{text}");
    assert_eq!(numbers[1..].iter().sum::<u64>(), numbers[0]);
    assert!(numbers[1] > 100_000, "most rays hit something: {text}");
    refused(&bench.gsii(&["validate", "room.gltf", "--rays", "0"]), &["--rays"]);
    refused(&bench.gsii(&["validate", "room.gltf", "--r-thresh", "inf"]), &["--r-thresh"]);
}

/// Names of all files below a folder, and when they were written.
fn written(folder: &Path) -> Vec<(PathBuf, std::time::SystemTime)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.path().is_dir() {
            files.extend(written(&entry.path()));
        } else {
            files.push((entry.path(), entry.metadata().unwrap().modified().unwrap()));
        }
    }
    files.sort();
    files
}

#[test]
fn a_study_goes_on_where_it_was_and_writes_its_report() {
    let bench = Bench::new();
    let small = ["--width", "16", "--reference-trials", "64", "--max-trials", "4", "--other-trials", "2"];
    let arguments = [&["study", "room.gltf", "--scaling", "room.gltf", "-o", "report"], &small[..]].concat();
    let mut child = bench.command(&arguments).stderr(Stdio::null()).spawn().unwrap();
    let runs = bench.path("report/work/runs");
    let deadline = Instant::now() + Duration::from_secs(300);
    let finished =
        || runs.is_dir() && written(&runs).iter().any(|(path, _)| path.extension().is_some_and(|e| e == "json"));
    while !finished() && child.try_wait().unwrap().is_none() {
        assert!(Instant::now() < deadline, "no run was finished");
        std::thread::sleep(Duration::from_millis(5));
    }
    interrupt(&child);
    child.wait().unwrap();
    let json = |files: Vec<(PathBuf, std::time::SystemTime)>| -> Vec<_> {
        files.into_iter().filter(|(path, _)| path.extension().is_some_and(|e| e == "json")).collect()
    };
    let before = json(written(&runs));
    assert!(!before.is_empty());

    let output = bench.gsii(&arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let after = json(written(&runs));
    assert!(before.iter().all(|file| after.contains(file)), "finished runs are kept");

    let page = std::fs::read_to_string(bench.path("report/index.html")).unwrap();
    assert!(page.contains("Table 4") && page.contains("data:image/jpeg") && page.contains("<svg"));
    for reference in ["src=\"http", "href=\"http", "url(http", "@import"] {
        assert!(!page.contains(reference), "the page asks for nothing: {reference}");
    }
    for table in ["table-1", "table-2", "table-3", "table-4", "crossings", "settings", "scaling"] {
        let csv = std::fs::read_to_string(bench.path(&format!("report/tables/{table}.csv"))).unwrap();
        assert!(csv.lines().count() >= 2, "{table} has rows: {csv}");
    }
    let study: serde_json::Value =
        serde_json::from_slice(&std::fs::read(bench.path("report/study.json")).unwrap()).unwrap();
    let runs = study["scenes"][0]["runs"].as_array().unwrap();
    let error = |role: &str| runs.iter().find(|r| r["role"] == role).unwrap()["points"][0]["whole"]["rel_mse"].as_f64();
    assert!(error("mcpt").is_some_and(|e| e > 0.0) && error("radiosity-simple").is_some_and(|e| e > 0.0));
}

#[test]
fn all_cameras_in_one_run() {
    let bench = Bench::new();
    let mut file: serde_json::Value = serde_json::from_str(&common::lit_room()).unwrap();
    let nodes = file["nodes"].as_array_mut().unwrap();
    let mut second = nodes.last().unwrap().clone();
    second["name"] = "by the/door".into();
    second["translation"][0] = 1.0.into();
    nodes.push(second);
    let number = nodes.len() - 1;
    file["scenes"][0]["nodes"].as_array_mut().unwrap().push(number.into());
    std::fs::write(bench.path("room.gltf"), file.to_string()).unwrap();
    bench.render(&["--camera", "all", "-o", "a.exr", "-o", "a.png", "--stats", "a.json"]);
    let files = bench.files();
    let names =
        ["a-by_the_door.exr", "a-by_the_door.json", "a-by_the_door.png", "a-eye.exr", "a-eye.json", "a-eye.png"];
    assert_eq!(files, [&names[..], &["room.gltf"]].concat());
    let [eye, door] =
        ["a-eye.exr", "a-by_the_door.exr"].map(|name| image::read_with_metadata(&bench.path(name)).unwrap());
    assert_ne!(eye.0, door.0, "two views");
    assert_eq!(eye.1.get("gsii:camera"), Some(&Value::from("eye")));
    assert_eq!(eye.1.get("gsii:r_thresh"), door.1.get("gsii:r_thresh"), "prepared once");
    refused(&bench.gsii(&["info", "room.gltf", "--camera", "all"]), &["no camera 'all'"]);
}

#[test]
fn light_from_outside_on_the_command_line() {
    let bench = Bench::new();
    // The room is closed: nothing changes inside but that its surroundings are there.
    bench.render(&["-o", "plain.exr"]);
    bench.render(&["-o", "sky.exr", "--sky", "--sun", "30,90", "--stats", "sky.json"]);
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path("sky.json")).unwrap()).unwrap();
    assert_eq!((&stats["parameters"]["sky"], &stats["parameters"]["turbidity"]), (&true.into(), &3.0.into()));
    assert!(stats["parameters"]["sun"].as_str().unwrap().starts_with("30"), "{stats}");
    // What was rendered is an environment as good as any.
    bench.render(&["-o", "env.png", "--environment", "plain.exr", "--environment-rotation", "-30"]);
    let date = ["--date", "2026-06-21T12:00:00+02:00", "--place", "48.21,16.37"];
    let output = bench.gsii(&[&["info", "room.gltf", "--contents", "--sky"], &date[..]].concat());
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    // Solar noon is an hour later there: before it the sun is in the south-east, not far from its 65.2 degrees.
    assert!(text.contains("clear sky") && text.contains("sun         62."), "{text}{}", stderr(&output));

    let before = bench.files();
    let cases: [(&[&str], &str); 8] = [
        (&["--environment", "missing.exr"], "missing.exr"),
        (&["--environment", "room.gltf"], "room.gltf"),
        (&["--environment", "plain.exr", "--environment-strength=-1"], "--environment-strength"),
        (&["--sky", "--sun", "100,0"], "--sun"),
        (&["--sky", "--turbidity", "0"], "turbidity"),
        (&["--sky", "--ground", "2"], "ground"),
        (&["--sky", "--date", "2026-06-21T00:00:00+02:00", "--place", "48.21,16.37"], "below the horizon"),
        (&["--sky", "--date", "2026-06-21T00:00:00+02:00", "--place", "148.21,16.37"], "position"),
    ];
    for (arguments, word) in cases {
        refused(&bench.gsii(&[&["render", "room.gltf", "-o", "out.exr"], arguments].concat()), &[word]);
    }
    // Refused by the option parser.
    for arguments in [
        &["--sky", "--environment", "plain.exr"][..],
        &["--sun", "30,90"],
        &["--sky", "--sun", "30"],
        &["--sky", "--date", "2026-06-21T00:00:00+02:00"],
        &["--sky", "--date", "noon", "--place", "0,0"],
        &["--environment-rotation", "10"],
    ] {
        let output = bench.gsii(&[&["render", "room.gltf", "-o", "out.exr"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
    }
    assert_eq!(bench.files(), before);
}

/// Images of the tests that interrupt writing: so large that writing takes a while, and with little work before.
const LARGE: [&str; 10] = ["--width", "640", "--height", "480", "--spp", "1", "--method", "mcpt", "--max-depth", "1"];

#[test]
fn a_killed_run_leaves_complete_files_or_none() {
    const KILLS: u32 = 12;
    let bench = Bench::new();
    let arguments = [&["render", "room.gltf", "-o", "a.exr", "-o", "a.png", "--stats", "a.json"], &LARGE[..]].concat();
    let start = Instant::now();
    assert!(bench.gsii(&arguments).status.success());
    let whole = start.elapsed();
    let names = ["a.exr", "a.png", "a.json"];
    let (mut complete, mut absent) = (0, 0);
    for kill in 0..KILLS {
        names.iter().for_each(|name| drop(std::fs::remove_file(bench.path(name))));
        let mut child = bench.command(&arguments).stderr(Stdio::null()).spawn().unwrap();
        // Most of them near the end, where files are written.
        let share = 1.0 - 0.6 * (f64::from(kill) / f64::from(KILLS)).powi(2);
        std::thread::sleep(whole.mul_f64(share));
        child.kill().unwrap();
        child.wait().unwrap();
        for name in names {
            if !bench.path(name).exists() {
                absent += 1;
                continue;
            }
            complete += 1;
            if name == "a.json" {
                let _: serde_json::Value = serde_json::from_slice(&std::fs::read(bench.path(name)).unwrap()).unwrap();
            } else {
                let read = image::read(&bench.path(name)).unwrap();
                assert_eq!((read.width(), read.height()), (640, 480), "{name}");
            }
        }
    }
    println!("{complete} complete files, {absent} absent");
    // What was under way stays under a name of its own.
    let known = |f: &str| f == "room.gltf" || names.contains(&f) || f.starts_with("a.exr.checkpoint");
    assert!(bench.files().iter().all(|f| f.starts_with('.') || known(f)));
}

/// Runs gsii with files limited to `kib` KiB, as on a disk that becomes full.
#[cfg(unix)]
fn with_little_space(bench: &Bench, kib: u32, arguments: &[&str]) -> Output {
    // Without the trap the signal would end the process; dash counts in half KiB.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" \"$@\"", 2 * kib);
    Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_gsii")])
        .args(arguments)
        .current_dir(bench.folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_one_clear_line() {
    let bench = Bench::new();
    let before = bench.files();
    let quiet = ["render", "room.gltf", "--quiet"];
    for name in ["a.exr", "a.png", "a.jpg", "a.tif", "a.hdr"] {
        let output = with_little_space(&bench, 16, &[&quiet[..], &LARGE, &["-o", name]].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{name}: {text}");
        assert!(text.lines().count() == 1 && text.contains(name), "{text}");
        assert_eq!(bench.files(), before, "{name}");
    }
    let output = with_little_space(&bench, 1, &["simplify", "room.gltf", "-o", "a.glb"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).lines().count() == 1 && stderr(&output).contains("a.glb"), "{}", stderr(&output));
    assert_eq!(bench.files(), before);
}

#[test]
fn files_are_stored_as_asked() {
    let bench = Bench::new();
    bench.render(&["-o", "plain.exr", "-o", "plain.png"]);
    bench.render(&["-o", "small.exr", "--half", "--tiled", "--compression", "piz", "--layers", "hires,depth"]);
    let (_, header) = image::read_with_metadata(&bench.path("small.exr")).unwrap();
    assert_eq!(header.get("compression"), Some(&Value::from("piz")));
    // The format's version field says so in its tenth bit.
    let tiled = |name: &str| std::fs::read(bench.path(name)).unwrap()[5] & 2 != 0;
    assert_eq!(["small.exr", "plain.exr"].map(tiled), [true, false]);
    let [plain, small] = ["plain.exr", "small.exr"].map(|name| image::read(&bench.path(name)).unwrap());
    let [exact, half] = [&plain, &small].map(|image| image.channel("G").unwrap().to_vec());
    assert_ne!(exact, half);
    // Half precision keeps eleven bits.
    assert!(exact.iter().zip(&half).all(|(a, b)| (a - b).abs() <= a.abs() / 2048.0 + 1e-7));
    assert_eq!(plain.channel("depth.Z"), small.channel("depth.Z"), "other channels stay in single precision");
    // A screen shows the room otherwise to someone who is adapted to it.
    bench.render(&["-o", "seen.png", "--view", "perceptual"]);
    assert_ne!(image::read(&bench.path("plain.png")).unwrap(), image::read(&bench.path("seen.png")).unwrap());
}

#[test]
fn manual_and_completions_know_every_option() {
    let bench = Bench::new();
    let text = |arguments: &[&str]| {
        let output = bench.gsii(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    let help = text(&["render", "--help"]);
    let options: Vec<&str> = help.split_whitespace().filter(|w| w.starts_with("--") && w.len() > 3).collect();
    let options: Vec<&str> =
        options.iter().map(|o| o.trim_end_matches(|c: char| !c.is_alphanumeric())).filter(|o| o.len() > 3).collect();
    assert!(options.contains(&"--environment") && options.contains(&"--tile"));
    // In troff a hyphen is written \-.
    let page = text(&["man", "render"]).replace("\\-", "-");
    assert!(page.contains(".TH gsii-render 1"), "{}", &page[..page.len().min(400)]);
    let scripts = ["bash", "zsh", "fish"].map(|shell| text(&["completions", shell]));
    for option in options {
        assert!(page.contains(option), "{option} in the manual");
        for script in &scripts {
            assert!(script.contains(option.trim_start_matches('-')), "{option} in completions");
        }
    }
    assert!(text(&["man"]).contains("merge"));
    refused(&bench.gsii(&["man", "paint"]), &["paint", "render"]);
    text(&["man", "--all", "pages"]);
    let pages: Vec<_> = std::fs::read_dir(bench.path("pages")).unwrap().collect();
    assert!(pages.len() >= 8 && bench.path("pages/gsii-render.1").exists(), "{pages:?}");
}

#[test]
fn outputs_of_simplify_are_refused_in_one_line() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("there.glb")).unwrap();
    let before = bench.files();
    for target in ["no/such/folder/a.glb", "there.glb", "/proc/a.glb"] {
        let output = bench.gsii(&["simplify", "room.gltf", "-o", target]);
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(stderr(&output).lines().count() == 1 && stderr(&output).contains(target), "{}", stderr(&output));
    }
    refused(&bench.gsii(&["simplify", "room.gltf", "--report", "a.txt"]), &["a.txt"]);
    refused(&bench.gsii(&["simplify", "room.gltf", "-o", "a.obj"]), &["a.obj", ".glb"]);
    assert_eq!(bench.files(), before);
}
