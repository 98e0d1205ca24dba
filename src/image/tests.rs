//! Round trips through files, and files that are not images.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::*;
use crate::error::Error;
use crate::sampling::{hash_all, unit};

/// Half has 11 significant bits: what rounding to nearest can change, relatively.
const HALF_ROUNDING: f32 = 1.0 / 2048.0;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder for temporary files")
}

/// Values over six decades, no two alike.
fn sample(width: u32, height: u32) -> Image {
    let mut image = Image::new(width, height);
    let random = |pixel: usize, salt: u32| 10f32.powf(6.0 * unit(hash_all(&[pixel as u32, salt])) - 3.0);
    for (salt, name) in ["lores.R", "depth.Z", "R", "G", "B", "lores.G", "lores.B"].into_iter().enumerate() {
        image.push(name, (0..image.pixels()).map(|pixel| random(pixel, salt as u32)).collect());
    }
    image
}

fn grey(width: u32, height: u32, value: f32) -> Image {
    let mut image = Image::new(width, height);
    for name in ["R", "G", "B"] {
        image.push(name, vec![value; image.pixels()]);
    }
    image
}

fn reason(result: crate::error::Result<impl std::fmt::Debug>) -> String {
    result.expect_err("this must fail").to_string()
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("entry").path()).collect()
}

#[test]
fn exr_keeps_every_channel_and_the_metadata() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let image = sample(37, 23);
    let mut metadata = Metadata::new();
    metadata.set("gsii:commandLine", "gsii render a.glb -o \"a.exr\" \u{e9}");
    metadata.set("gsii:seed", 7u32);
    metadata.set("gsii:rays", 5_000_000_000i64);
    metadata.set("gsii:relativeError", 0.25);
    for compression in Compression::ALL {
        let lossy = matches!(compression, Compression::Pxr24 | Compression::Dwaa | Compression::Dwab);
        let options = WriteOptions { compression: Some(compression), ..Default::default() };
        write(&path, &image, &metadata, &options).unwrap();
        let (read, header) = read_with_metadata(&path).unwrap();
        assert_eq!(header.get("compression"), Some(&Value::from(compression.name())));
        assert_eq!(header.get("gsii:commandLine"), metadata.get("gsii:commandLine"));
        assert_eq!(header.get("gsii:seed"), Some(&Value::Integer(7)));
        assert_eq!(header.get("gsii:rays"), Some(&Value::from("5000000000")));
        assert_eq!(header.get("gsii:relativeError"), Some(&Value::Real(0.25)));
        assert_eq!(read.channels().len(), 7);
        let first: Vec<_> = read.channels().iter().take(3).map(|channel| channel.name.as_str()).collect();
        assert_eq!(first, ["R", "G", "B"]);
        for channel in image.channels() {
            let values = read.channel(&channel.name).expect(&channel.name);
            assert!(lossy || values == channel.values, "{compression:?} {}", channel.name);
        }
    }
}

#[test]
fn exr_half_is_for_colours_in_its_range() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let mut image = sample(16, 16);
    let mut bright = vec![1.0; image.pixels()];
    bright[5] = 70_000.0;
    image.push("sun.R", bright.clone());
    write(&path, &image, &Metadata::new(), &WriteOptions { half: true, ..Default::default() }).unwrap();
    let half = read(&path).unwrap();
    for name in ["R", "lores.G"] {
        let (exact, rounded) = (image.channel(name).unwrap(), half.channel(name).unwrap());
        assert_ne!(exact, rounded, "{name} is in half precision");
        assert!(exact.iter().zip(rounded).all(|(e, r)| (e - r).abs() <= e * HALF_ROUNDING), "{name}");
    }
    assert_eq!(image.channel("depth.Z"), half.channel("depth.Z"));
    assert_eq!(half.channel("sun.R"), Some(bright.as_slice()));
}

#[test]
fn oiiotool_reads_what_we_write() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let mut metadata = Metadata::new();
    metadata.set("gsii:seed", 7u32);
    write(&path, &sample(8, 8), &metadata, &WriteOptions { half: true, ..Default::default() }).unwrap();
    let Ok(output) = Command::new("oiiotool").args(["--info", "-v"]).arg(&path).output() else {
        eprintln!("skipped: oiiotool is not installed");
        return;
    };
    let text = String::from_utf8_lossy(&output.stdout);
    for wanted in ["8 x    8, 7 channel", "R (half), G (half), B (half)", "depth.Z (float)", "gsii:seed: 7"] {
        assert!(text.contains(wanted), "{wanted:?} is missing in\n{text}");
    }
}

#[test]
fn linear_formats_keep_radiance() {
    let folder = folder();
    let image = sample(21, 9);
    for (extension, exact) in [("tif", true), ("hdr", false), ("pfm", true)] {
        let path = folder.path().join(format!("a.{extension}"));
        if !writable_extensions().unwrap().iter().any(|known| known == extension) {
            eprintln!("skipped: this OpenImageIO does not write {extension}");
            continue;
        }
        // The view transform is for screens only.
        let options = WriteOptions { exposure_stops: 3.0, ..Default::default() };
        write(&path, &image, &Metadata::new(), &options).unwrap();
        let copy = read(&path).unwrap();
        assert_eq!(copy.channels().len(), 3);
        let (a, b) = (image.rgb("").unwrap(), copy.rgb("").unwrap());
        for pixel in 0..image.pixels() {
            // RGBE (Ward 1991): 8 bits below the exponent of the largest band, truncated.
            let largest = (0..3).map(|band| a[band][pixel]).fold(0.0, f32::max);
            let bound = if exact { 0.0 } else { largest / 128.0 };
            for band in 0..3 {
                let (a, b) = (a[band][pixel], b[band][pixel]);
                assert!((a - b).abs() <= bound, "{extension} pixel {pixel} band {band}: {a} became {b}");
            }
        }
    }
}

#[test]
fn screen_formats_get_exposure_and_srgb() {
    let folder = folder();
    let mut image = Image::new(4, 1);
    image.push_rgb("", &[0.0, 0.09, 0.5, 3.0].map(glam::Vec3::splat));
    let options = WriteOptions { view: ViewTransform::Srgb, exposure_stops: 1.0, ..Default::default() };
    for extension in ["png", "bmp", "tga"] {
        let path = folder.path().join(format!("a.{extension}"));
        write(&path, &image, &Metadata::new(), &options).unwrap();
        let pixels = decode_texture(extension, &std::fs::read(&path).unwrap()).unwrap();
        // sRGB of 0.18 is 0.4614: 117.65 of 255.
        let expected: Vec<u8> = [0, 118, 255, 255].into_iter().flat_map(|v| [v, v, v, 255]).collect();
        assert_eq!(pixels.data, Data::U8(expected), "{extension}");
        // Back to linear within half a step of eight bits, 0.5 / 255 times the slope of the sRGB curve (at most 2.28).
        let read = read(&path).unwrap();
        assert!((read.channel("R").unwrap()[1] - 0.18).abs() < 0.5 / 255.0 * 2.28, "{extension}");
    }
    for extension in ["jpg", "webp"] {
        let path = folder.path().join(format!("b.{extension}"));
        write(&path, &grey(32, 16, 0.18), &Metadata::new(), &WriteOptions::default()).unwrap();
        let pixels = decode_texture(extension, &std::fs::read(&path).unwrap()).unwrap();
        let expected = (ViewTransform::Filmic.encode([0.18; 3])[0] * 255.0).round();
        let Data::U8(bytes) = pixels.data else { panic!("{extension} has eight bits") };
        // A uniform block is its DC coefficient, quantised in steps of at most 2 of 255 levels at high quality.
        let off = bytes.chunks(4).flat_map(|p| &p[..3]).map(|&v| (f32::from(v) - expected).abs()).fold(0.0, f32::max);
        assert!(off <= 2.0, "{extension} is off by {off}");
    }
}

#[test]
fn dither_is_unbiased_and_repeatable() {
    let folder = folder();
    let path = folder.path().join("a.png");
    let options = WriteOptions { view: ViewTransform::Srgb, dither: true, ..Default::default() };
    let image = grey(128, 128, 0.1801);
    let bytes = || {
        write(&path, &image, &Metadata::new(), &options).unwrap();
        match decode_texture("png", &std::fs::read(&path).unwrap()).unwrap().data {
            Data::U8(bytes) => bytes,
            Data::F32(_) => panic!("eight bits"),
        }
    };
    let first = bytes();
    assert_eq!(first, bytes());
    let wanted = crate::srgb::srgb_encode(0.1801) * 255.0;
    let values: Vec<f32> = first.chunks(4).flat_map(|p| &p[..3]).map(|&v| f32::from(v)).collect();
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    // Bernoulli rounding, standard deviation at most 1/2 per value; 5 sigma fail falsely once in 1.7 million.
    assert!((mean - wanted).abs() < 5.0 * 0.5 / (values.len() as f32).sqrt(), "{mean} instead of {wanted}");
}

#[test]
fn textures_become_rgba() {
    let folder = folder();
    let raw = |name: &str, bytes: &[u8]| decode_texture(name, bytes);
    let expect = |values: &[u8]| Data::U8(values.to_vec());
    // Two pixels each, from the formats of Netpbm, whose bytes are known.
    assert_eq!(raw("a.pgm", b"P5 2 1 255\n\x10\xc0").unwrap().data, expect(&[16, 16, 16, 255, 192, 192, 192, 255]));
    assert_eq!(
        raw("a.ppm", b"P6 1 2 255\n\x01\x02\x03\x04\x05\x06").unwrap().data,
        expect(&[1, 2, 3, 255, 4, 5, 6, 255])
    );
    // A 1x1 PNG with half-transparent red: the colour must not be multiplied by opacity.
    let png = std::fs::read(transparent_png(folder.path())).unwrap();
    for name in ["a.png", "image/png", "wrong.jpg", "noname"] {
        assert_eq!(raw(name, &png).unwrap().data, expect(&[200, 100, 50, 128]), "{name}");
    }
    let path = folder.path().join("a.exr");
    write(&path, &sample(3, 2), &Metadata::new(), &WriteOptions::default()).unwrap();
    let exr = raw("a.exr", &std::fs::read(&path).unwrap()).unwrap();
    let Data::F32(values) = exr.data else { panic!("floats") };
    assert!(exr.floating_point);
    assert_eq!((values[4], values[7]), (sample(3, 2).channel("R").unwrap()[1], 1.0));
}

/// PNG, written by hand: one RGBA pixel (200, 100, 50, 128) in a stored deflate block.
fn transparent_png(folder: &Path) -> PathBuf {
    let scanline = [0u8, 200, 100, 50, 128];
    let mut zlib = vec![0x78, 0x01, 1, 5, 0, 250, 255];
    zlib.extend(scanline);
    zlib.extend(adler32(&scanline).to_be_bytes());
    let path = folder.join("t.png");
    std::fs::write(&path, png(1, 1, 6, &zlib)).unwrap();
    path
}

fn png(width: u32, height: u32, colour_type: u8, data: &[u8]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8; 4], body: &[u8]| {
        file.extend((body.len() as u32).to_be_bytes());
        let checked = [kind.as_slice(), body].concat();
        file.extend(&checked);
        file.extend(crc32(&checked).to_be_bytes());
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, colour_type, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    chunk(b"IDAT", data);
    chunk(b"IEND", &[]);
    file
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}

fn adler32(bytes: &[u8]) -> u32 {
    let (a, b) = bytes.iter().fold((1, 0), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % 65521;
        (a, (b + a) % 65521)
    });
    b << 16 | a
}

#[test]
fn what_is_no_image_is_refused_with_a_reason() {
    let folder = folder();
    let good = folder.path().join("good.exr");
    write(&good, &sample(64, 64), &Metadata::new(), &WriteOptions::default()).unwrap();
    let good = std::fs::read(good).unwrap();
    let garbage: Vec<u8> = (0..4096).map(|i| hash_all(&[i]) as u8).collect();
    let cases = [
        ("empty.exr", Vec::new()),
        ("empty.png", Vec::new()),
        ("garbage.exr", garbage.clone()),
        ("garbage.png", garbage.clone()),
        ("garbage", garbage),
        ("truncated.exr", good[..good.len() / 2].to_vec()),
        ("header.exr", good[..40].to_vec()),
    ];
    for (name, bytes) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let error = read(&path).expect_err(name);
        assert!(matches!(&error, Error::Input { path: file, .. } if *file == path), "{error}");
        assert!(!decode_texture(name, &bytes).expect_err(name).is_empty());
    }
    assert!(reason(read(&folder.path().join("none.exr"))).contains("No such file"));
    assert!(reason(read(folder.path())).contains("folder"));
}

/// Memory is not touched for these: the largest would take 10 GB.
#[test]
fn headers_that_claim_too_much_are_refused() {
    let folder = folder();
    let cases = [
        ("a.ppm", b"P6\n60000 60000\n255\nxx".to_vec()),
        ("b.png", png(60_000, 60_000, 2, &[0x78, 0x01, 3, 0, 0, 0, 0, 1])),
        ("c.ppm", b"P6\n2147483647 2147483647\n255\nxx".to_vec()),
        ("d.ppm", b"P6\n-4 4\n255\nxx".to_vec()),
        ("e.ppm", b"P6\n0 4\n255\nxx".to_vec()),
        ("f.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999 +X 99999\nxx".to_vec()),
    ];
    for (name, bytes) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let (file, memory) = (reason(read(&path)), decode_texture(name, &bytes).expect_err(name));
        assert!(file.ends_with(&memory), "{file} is not {memory}");
    }
    let reader = |bytes: &[u8]| decode_texture("a.ppm", bytes).expect_err("too large");
    assert!(reader(b"P6\n60000 60000\n255\nxx").contains("60000 x 60000"), "the header is quoted");
}

#[test]
fn what_cannot_be_written_is_known_before() {
    let folder = folder();
    let image = grey(4, 4, 0.5);
    let both = |path: &Path| {
        let (before, after) =
            (reason(check_writable(path)), reason(write(path, &image, &Metadata::new(), &WriteOptions::default())));
        assert_eq!(before, after);
        before
    };
    for name in ["a.xyz", "a", "a.psd", "a.null"] {
        let error = both(&folder.path().join(name));
        assert!(error.contains("exr") && error.contains("png"), "{error}");
    }
    assert!(both(&folder.path().join("none/a.exr")).contains("no folder"));
    std::fs::create_dir(folder.path().join("dir.exr")).unwrap();
    assert!(both(&folder.path().join("dir.exr")).contains("not a regular file"));
    let protected = folder.path().join("old.png");
    std::fs::write(&protected, "old").unwrap();
    let mut permissions = std::fs::metadata(&protected).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&protected, permissions).unwrap();
    assert!(both(&protected).contains("write-protected"));
    assert_eq!(std::fs::read(&protected).unwrap(), b"old");
    // Nobody can make files there, not even root.
    if Path::new("/proc/self").is_dir() {
        assert!(reason(check_writable(Path::new("/proc/a.exr"))).contains("not writable"));
    }
    assert_eq!(files_in(folder.path()).len(), 2, "nothing is left behind: {:?}", files_in(folder.path()));
}

#[test]
fn checking_leaves_the_old_file_alone() {
    let folder = folder();
    for name in ["a.exr", "a.png", "A.JPG", "\u{e9} #.tif", "a.webp", "a.hdr"] {
        let path = folder.path().join(name);
        std::fs::write(&path, "old").unwrap();
        check_writable(&path).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        write(&path, &grey(4, 4, 0.5), &Metadata::new(), &WriteOptions::default()).unwrap();
        assert_eq!(read(&path).unwrap().width(), 4);
    }
    assert_eq!(files_in(folder.path()).len(), 6);
}

#[cfg(unix)]
#[test]
fn written_files_are_as_readable_as_others() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder();
    let (plain, path) = (folder.path().join("plain"), folder.path().join("a.png"));
    std::fs::write(&plain, "").unwrap();
    write(&path, &grey(4, 4, 0.5), &Metadata::new(), &WriteOptions::default()).unwrap();
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&path), mode(&plain));
}

/// A full disk must not go unnoticed, even where only the last bytes did not fit. (The formats that are not made in
/// memory are read back instead, which /dev/full with its endless zeros cannot stand in for.)
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let folder = folder();
    for extension in ["exr", "png", "jpg", "tif", "hdr", "webp", "bmp", "tga", "ppm"] {
        let path = folder.path().join(format!("full.{extension}"));
        std::os::unix::fs::symlink("/dev/full", &path).unwrap();
        let (names, values) = (["R", "G", "B"], vec![100u8; 3 * 8 * 8]);
        let samples = oiio::Samples::U8(values);
        let result = oiio::write(&path, (8, 8), &names, &samples, &Metadata::new(), oiio::Layout::default());
        assert!(result.expect_err(extension).contains("No space left"), "{extension}");
    }
}

#[test]
fn defective_requests_are_refused() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let mut metadata = Metadata::new();
    metadata.set("gsii:a\0b", 1u32);
    assert!(reason(write(&path, &grey(2, 2, 0.0), &metadata, &WriteOptions::default())).contains("NUL"));
    let nothing = Image::new(0, 0);
    assert!(!reason(write(&path, &nothing, &Metadata::new(), &WriteOptions::default())).is_empty());
    let mut depth = Image::new(2, 2);
    depth.push("depth.Z", vec![1.0; 4]);
    depth.push("N.X", vec![1.0; 4]);
    let png = folder.path().join("a.png");
    assert!(reason(write(&png, &depth, &Metadata::new(), &WriteOptions::default())).contains("R, G and B"));
    assert_eq!(files_in(folder.path()).len(), 0);
}
