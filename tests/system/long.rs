//! Renderings that are killed, stopped, continued and looked at meanwhile.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use crate::common;
use gsii::image;
use gsii::sampling::{hash_all, unit};

/// Nothing here takes as long, unless it hangs.
const PATIENCE: Duration = Duration::from_secs(120);

/// A folder with a small scene.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("room.gltf"), common::lit_room()).unwrap();
        Bench(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    /// The bytes of an image, but for the time at which it was written.
    fn image(&self, name: &str) -> Vec<u8> {
        let mut bytes = self.bytes(name);
        let attribute = b"capDate\0string\0";
        if let Some(at) = bytes.windows(attribute.len()).position(|window| window == attribute) {
            let length = attribute.len() + 4 + "2026:01:01 00:00:00".len();
            bytes[at..at + length].fill(0);
        }
        bytes
    }

    fn start(&self, arguments: &[&str]) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gsii"));
        command.current_dir(self.0.path()).args(["render", "room.gltf", "--measure-bias", "64"]).args(arguments);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Runs to the end; exit code and messages.
    fn run(&self, arguments: &[&str]) -> (Option<i32>, String) {
        outcome(self.start(arguments).wait_with_output().unwrap())
    }

    fn render(&self, arguments: &[&str]) -> String {
        let (code, text) = self.run(arguments);
        assert_eq!(code, Some(0), "{arguments:?}: {text}");
        text
    }

    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// When a file got its name.
    fn written(&self, name: &str) -> Option<SystemTime> {
        std::fs::metadata(self.path(name)).ok()?.modified().ok()
    }
}

fn outcome(output: Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Waits until something has come about; panics when it takes too long.
fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "{what} does not come about");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

/// Starts a rendering over and over and kills it (SIGKILL) after random numbers of checkpoints and a random while, then lets it
/// finish. Gives how often it was killed in the midst of rendering.
fn kill_and_resume(bench: &Bench, arguments: &[&str], image: &str, kills: u32, seed: u32) -> u32 {
    let checkpoint = format!("{image}.checkpoint");
    let mut in_the_midst = 0;
    for number in 0..kills {
        let random = |what: u32| unit(hash_all(&[seed, number, what]));
        let threads = (1 + (3.0 * random(0)) as u32).to_string();
        let all = [arguments, &["-o", image, "--checkpoint-every", "0.02", "--threads", &threads, "--resume"]].concat();
        let mut child = bench.start(&all);
        // One time is before there is anything.
        for _ in 0..(if number == 0 { 0 } else { 1 + (2.0 * random(1)) as u32 }) {
            let before = bench.written(&checkpoint);
            let ended = wait_for("a checkpoint", || match child.try_wait().unwrap() {
                Some(_) => Some(true),
                None => (bench.written(&checkpoint) != before).then_some(false),
            });
            if ended {
                break;
            }
        }
        std::thread::sleep(Duration::from_secs_f32(0.03 * random(2)));
        child.kill().unwrap();
        let status = child.wait().unwrap();
        in_the_midst += u32::from(status.code().is_none() && bench.path(&checkpoint).exists());
    }
    let text = bench.render(&[arguments, &["-o", image, "--threads", "2", "--resume"]].concat());
    assert!(!text.contains("from the beginning"), "{text}");
    in_the_midst
}

/// Adaptive sampling with an irradiance cache: all the stages that a rendering can have.
const ADAPTIVE: [&str; 8] = ["--width", "60", "--height", "40", "--max-trials", "1024", "--error", "0.01"];

#[test]
fn killed_at_random_moments_and_resumed_gives_the_bytes_of_an_uninterrupted_run() {
    let bench = Bench::new();
    bench.render(&[&ADAPTIVE[..], &["-o", "whole.exr"]].concat());
    let kills = kill_and_resume(&bench, &ADAPTIVE, "killed.exr", 10, 1);
    assert!(kills >= 8, "the rendering ended before it was killed: {kills}");
    assert!(bench.image("whole.exr") == bench.image("killed.exr"));
    assert_eq!(bench.files(), ["killed.exr", "room.gltf", "whole.exr"], "no checkpoint stays");
}

#[test]
fn parts_of_images_and_fixed_sampling_are_resumed_too() {
    let bench = Bench::new();
    let fixed = ["--width", "60", "--height", "40", "--spp", "300", "--per-pixel"];
    for (number, (all, more)) in
        [(&ADAPTIVE[..], &["--tile", "2/4"][..]), (&ADAPTIVE, &["--crop", "11", "5", "47", "31"]), (&fixed, &[])]
            .into_iter()
            .enumerate()
    {
        let arguments = [all, more].concat();
        bench.render(&[&arguments[..], &["-o", "whole.exr"]].concat());
        let kills = kill_and_resume(&bench, &arguments, "killed.exr", 3, 2 + number as u32);
        assert!(kills >= 1, "{arguments:?}");
        assert!(bench.image("whole.exr") == bench.image("killed.exr"), "{arguments:?}");
    }
}

#[test]
fn time_limit_and_ctrl_c_lose_nothing() {
    let bench = Bench::new();
    let arguments = [&ADAPTIVE[..], &["-o", "a.exr", "--stats", "a.json"]].concat();
    bench.render(&arguments);
    let whole = bench.image("a.exr");
    let rays = |name: &str| {
        let stats: serde_json::Value = serde_json::from_slice(&bench.bytes(name)).unwrap();
        (stats["rays"].clone(), stats["counts"].clone(), stats["error"].clone())
    };
    let counted = rays("a.json");

    // Checkpoints at the stops only: a day is longer than this takes.
    let arguments = [&arguments[..], &["--checkpoint-every", "86400", "--resume"]].concat();
    let trials = || {
        let image = image::read(&bench.path("a.exr")).unwrap();
        image.channel("trials.hires").unwrap().iter().map(|&t| f64::from(t)).sum::<f64>()
    };
    let mut before = 0.0_f64;
    let mut stops = 0;
    for _ in 0..3 {
        let (code, text) = bench.run(&[&arguments[..], &["--time-limit", "0.25"]].concat());
        if !bench.path("a.exr.checkpoint").exists() {
            break;
        }
        assert!(text.contains("--resume goes on from a.exr.checkpoint"), "{text}");
        stops += 1;
        assert_eq!(code, Some(0), "there is an image however short the time: {text}");
        assert!(text.contains("stopped early"), "{text}");
        assert!(trials() >= before.max(1.0), "each stop has at least what the one before had");
        before = trials();
    }
    let child = bench.start(&arguments);
    std::thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let (code, text) = outcome(child.wait_with_output().unwrap());
    if code == Some(0) {
        stops += u32::from(text.contains("stopped early"));
        assert!(trials() >= before);
    }
    assert!(stops > 0, "it was stopped");
    bench.render(&arguments);
    assert!(bench.image("a.exr") == whole);
    assert_eq!(rays("a.json"), counted, "rays of all runs together, errors of the image");
    assert_eq!(bench.files(), ["a.exr", "a.json", "room.gltf"]);
}

#[test]
fn checkpoints_of_something_else_are_refused() {
    let bench = Bench::new();
    let size = ["--width", "24", "--height", "16", "-o", "a.exr"];
    let fixed = [&size[..], &["--spp", "1000000"]].concat();
    let text = bench.render(&[&fixed[..], &["--time-limit", "0.1"]].concat());
    assert!(text.contains("--resume"), "{text}");
    let refused = |arguments: &[&str], words: &[&str]| {
        let (code, text) = bench.run(&[arguments, &["--resume"]].concat());
        assert_eq!((code, text.lines().count()), (Some(2), 1), "{text}");
        for word in words {
            assert!(text.contains(word), "{word}: {text}");
        }
    };
    let whole = bench.bytes("a.exr.checkpoint");
    refused(&[&fixed[..], &["--seed", "7"]].concat(), &["a.exr.checkpoint", "seed is 0 there and 7 here"]);
    refused(&[&fixed[..], &["--r-thresh", "0.5"]].concat(), &["r_thresh is null there and 0.5 here"]);
    refused(&[&fixed[..], &["--crop", "0", "0", "8", "8"]].concat(), &["region", "the whole image"]);
    refused(&[&size[..], &["--spp", "16"]].concat(), &["max_trials is 1000000 there and 16 here", "min_trials"]);
    refused(&[&fixed[..], &["--sky"]].concat(), &["light from outside", "is another"]);
    let scene = String::from_utf8(bench.bytes("room.gltf")).unwrap();
    std::fs::write(bench.path("room.gltf"), scene.replace("0.6", "0.61")).unwrap();
    refused(&fixed, &["materials", "is another"]);
    std::fs::write(bench.path("room.gltf"), scene).unwrap();

    let damages: [(&str, Vec<u8>); 4] = [
        ("no checkpoint", b"something else".to_vec()),
        ("no checkpoint", Vec::new()),
        ("ends too early", whole[..whole.len() - 1].to_vec()),
        ("checksum", whole.iter().enumerate().map(|(i, b)| b ^ u8::from(i == whole.len() / 2)).collect()),
    ];
    for (words, bytes) in damages {
        std::fs::write(bench.path("a.exr.checkpoint"), bytes).unwrap();
        refused(&fixed, &["a.exr.checkpoint", words, "without --resume"]);
    }
    // Without --resume it is replaced, with a warning.
    let text = bench.render(&[&fixed[..], &["--time-limit", "0.1"]].concat());
    assert!(text.contains("will be replaced"), "{text}");
    for option in [&["--checkpoint-every", "0"][..], &["--checkpoint-every=-1"]] {
        refused(&[&fixed[..], option].concat(), &["--checkpoint"]);
    }
    let (code, text) = bench.run(&[&fixed[..], &["--checkpoint", "nowhere/c"]].concat());
    assert_eq!((code, text.lines().count()), (Some(1), 1), "{text}");
    assert!(text.contains("no folder nowhere"), "{text}");
}

#[test]
fn partial_images_are_whole_files_and_change_nothing() {
    let bench = Bench::new();
    let arguments = [&ADAPTIVE[..], &["--checkpoint-every", "0"]].concat();
    bench.render(&[&arguments[..], &["-o", "whole.exr", "-o", "whole.png"]].concat());
    let outputs = ["-o", "a.exr", "-o", "a.png", "--partial", "0.02"];
    let mut child = bench.start(&[&arguments[..], &outputs].concat());
    // Every image that is there is complete, and the next one has no less in it.
    let (mut seen, mut last, mut last_lit) = (0, 0.0, 0);
    let mut written = None;
    while child.try_wait().unwrap().is_none() {
        let now = bench.written("a.png").and(bench.written("a.exr"));
        if now == written {
            std::thread::sleep(Duration::from_millis(1));
            continue;
        }
        written = now;
        let image = image::read(&bench.path("a.exr")).unwrap();
        assert_eq!((image.width(), image.height()), (60, 40));
        image::read(&bench.path("a.png")).unwrap();
        let trials = image.channel("trials.hires").unwrap().iter().map(|&t| f64::from(t)).sum::<f64>();
        assert!(trials >= last);
        let lit = image.rgb("").unwrap()[1].iter().filter(|&&v| v > 0.0).count();
        assert!(lit >= last_lit);
        (seen, last, last_lit) = (seen + 1, trials, lit);
    }
    let (code, text) = outcome(child.wait_with_output().unwrap());
    assert_eq!(code, Some(0), "{text}");
    // One before the last at least.
    assert!(seen >= 2, "{seen} images");
    for format in ["exr", "png"] {
        assert!(bench.image(&format!("whole.{format}")) == bench.image(&format!("a.{format}")), "{format}");
    }
}

#[test]
fn a_second_ctrl_c_ends_at_once_and_leaves_nothing_half_written() {
    let bench = Bench::new();
    // An image that takes a while to write.
    let size = ["--width", "700", "--height", "500", "--spp", "1000000", "--method", "mcpt", "--compression", "piz"];
    let mut child = bench.start(&[&size[..], &["-o", "a.exr", "--checkpoint-every", "0.1"]].concat());
    wait_for("a checkpoint", || bench.written("a.exr.checkpoint"));
    interrupt(&child);
    let writes = || bench.files().iter().any(|name| name.ends_with(".part") || name.starts_with(".gsii-"));
    wait_for("a file that is written", || (writes() || child.try_wait().unwrap().is_some()).then_some(()));
    interrupt(&child);
    let start = Instant::now();
    let (code, text) = outcome(child.wait_with_output().unwrap());
    assert_eq!(code, Some(1), "{text}");
    assert!(start.elapsed() < Duration::from_secs(5), "at once");
    let left: Vec<String> = bench.files();
    assert!(left.iter().all(|name| ["room.gltf", "a.exr.checkpoint"].contains(&name.as_str())), "{left:?}");
}

/// What tev would show.
#[derive(Default)]
struct Shown {
    size: [u32; 2],
    pixels: Vec<[f32; 3]>,
    updates: u32,
}

/// Reads the fields of a packet of tev's protocol.
struct Packet<'a>(&'a [u8]);

impl Packet<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_at(N);
        self.0 = rest;
        head.try_into().unwrap()
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&b| b == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }
}

impl Shown {
    fn receive(&mut self, packet: &[u8]) {
        let mut p = Packet(packet);
        let [kind, _focus] = p.take();
        assert_eq!(p.text(), "a.exr");
        match kind {
            4 => {
                self.size = [p.u32(), p.u32()];
                self.pixels = vec![[0.0; 3]; (self.size[0] * self.size[1]) as usize];
                assert_eq!(p.u32(), 3);
                assert_eq!([p.text(), p.text(), p.text()], ["R", "G", "B"]);
            }
            6 => {
                let channels = p.u32();
                let names: Vec<String> = (0..channels).map(|_| p.text()).collect();
                assert_eq!(names, ["R", "G", "B"]);
                let [x, y, width, height] = [p.u32(), p.u32(), p.u32(), p.u32()];
                let offsets: Vec<u64> = (0..channels).map(|_| p.u64()).collect();
                let strides: Vec<u64> = (0..channels).map(|_| p.u64()).collect();
                let data: Vec<f32> = p.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
                for i in 0..width * height {
                    let at = (y + i / width) * self.size[0] + x + i % width;
                    self.pixels[at as usize] =
                        [0, 1, 2].map(|c| data[(offsets[c] + u64::from(i) * strides[c]) as usize]);
                }
                self.updates += 1;
            }
            other => panic!("packet of type {other}"),
        }
    }

    /// Everything that comes until the connection ends.
    fn watch(mut stream: TcpStream) -> Shown {
        let mut shown = Shown::default();
        let mut length = [0; 4];
        while stream.read_exact(&mut length).is_ok() {
            let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
            stream.read_exact(&mut packet).unwrap();
            shown.receive(&packet);
        }
        shown
    }
}

#[test]
fn tev_shows_the_image() {
    let bench = Bench::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let viewer = std::thread::spawn(move || Shown::watch(listener.accept().unwrap().0));
    let arguments = [&ADAPTIVE[..], &["-o", "a.exr", "--checkpoint-every", "0", "--tev"]].concat();
    let text = bench.render(&[&arguments[..], &[&address]].concat());
    assert!(!text.contains("tev"), "{text}");
    let shown = viewer.join().unwrap();
    assert_eq!(shown.size, [60, 40]);
    assert!(shown.updates >= 5, "at least every band of 8 rows once");
    let image = image::read(&bench.path("a.exr")).unwrap();
    let rgb = image.rgb("").unwrap();
    for (i, pixel) in shown.pixels.iter().enumerate() {
        assert_eq!(pixel.map(f32::to_bits), rgb.map(|band| band[i].to_bits()), "pixel {i}");
    }
}

#[test]
fn without_tev_there_is_one_warning_and_an_image() {
    let bench = Bench::new();
    // A port that nobody listens at, and one where the listener goes away.
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let small = ["--width", "24", "--height", "16", "--spp", "4", "-o", "a.exr", "--tev"];
    let text = bench.render(&[&small[..], &[&closed]].concat());
    assert_eq!(text.lines().filter(|line| line.contains("tev")).count(), 1, "{text}");
    assert!(bench.path("a.exr").exists());

    let leaves = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = leaves.local_addr().unwrap().to_string();
    let gone = std::thread::spawn(move || leaves.accept().unwrap().0.flush());
    let arguments = [&ADAPTIVE[..], &["-o", "b.exr", "--checkpoint-every", "0", "--tev", &address]].concat();
    let text = bench.render(&arguments);
    gone.join().unwrap().unwrap();
    assert!(text.lines().filter(|line| line.contains("tev")).count() <= 1, "{text}");

    let (code, text) = bench.run(&[&small[..], &["nonsense"]].concat());
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("127.0.0.1:14158"), "{text}");
}
