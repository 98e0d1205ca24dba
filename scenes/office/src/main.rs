//! Generates the paper's test environment as a `.glb` file: an office of 10,948 surfaces.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, ValueEnum};

mod flight;
mod glb;
mod level;
mod office;
mod paint;
mod primitives;
mod reflectance;
mod rng;
mod scene;
mod shape;
mod surfaces;
#[cfg(test)]
mod tests;
mod things;

/// The paper's two cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Reflectance {
    /// Average reflectance 0.41: indirect light matters little.
    Low,
    /// Average reflectance 0.56: indirect light matters more.
    High,
}

impl Reflectance {
    /// Average reflectance (paper, "Results").
    fn rho(self) -> f64 {
        match self {
            Reflectance::Low => 0.41,
            Reflectance::High => 0.56,
        }
    }
}

/// Generates the paper's test environment: a furnished, cluttered office.
#[derive(Debug, Parser)]
struct Args {
    /// Average reflectance of the environment; only walls and ceiling differ.
    #[arg(long, value_enum, default_value = "high")]
    reflectance: Reflectance,
    /// Number of triangles to come close to, 1000 to 10000000, by finer tessellation and more small things
    /// [default: the paper's 10,948 surfaces]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1000..=10_000_000))]
    detail: Option<u64>,
    /// Amount of small things, 1 as usual: keeps --detail from changing it
    #[arg(long, value_name = "X", requires = "detail", value_parser = amount)]
    clutter: Option<f32>,
    /// Seed of everything irregular.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// File to write.
    #[arg(short, long, default_value = "office.glb")]
    output: PathBuf,
}

fn amount(text: &str) -> Result<f32, String> {
    let amount = text.parse().ok().filter(|x| (0.01..=100.0).contains(x));
    amount.ok_or_else(|| "must be a number between 0.01 and 100".to_owned())
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), String> {
    let detail = match args.detail {
        None => level::for_surfaces(level::PAPER_SURFACES, args.seed),
        Some(triangles) => level::for_triangles(triangles, args.clutter, args.seed),
    };
    let mut scene = office::Office::build(detail, args.seed);
    let wanted = args.reflectance.rho();
    let average = reflectance::paint_walls(&mut scene, wanted);
    if (average.rho() - wanted).abs() > reflectance::TOLERANCE {
        // With other amounts of clutter the walls may be unable to make up for it; that is the user's choice.
        let message = format!(
            "the walls can bring the average reflectance to {:.3} only, not to {wanted}: they are {:.1} of {:.1} m2",
            average.rho(),
            average.wall_area,
            average.wall_area + average.other_area
        );
        if args.detail.is_none() {
            return Err(message);
        }
        eprintln!("note: {message}");
    }
    save(&scene, &args.output).map_err(|error| format!("cannot write {}: {error}", args.output.display()))?;
    println!("surfaces             {}", scene.surface_count());
    println!("triangles            {}", scene.triangle_count());
    println!("meshes, nodes        {}, {}", scene.meshes.len(), scene.nodes.len());
    println!("average reflectance  {:.4}", average.rho());
    println!(
        "wall reflectance     {:.4} on {:.1} of {:.1} m2",
        average.wall,
        average.wall_area,
        average.wall_area + average.other_area
    );
    Ok(())
}

fn save(scene: &scene::Scene, path: &Path) -> std::io::Result<()> {
    glb::write(scene, &mut BufWriter::new(File::create(path)?))
}
