//! From a film to an image with named channels.

use std::str::FromStr;

use glam::Vec3;

use super::film::{Film, Pixel};
use crate::image::Image;

/// What can be written beside the image itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// HIRES radiance.
    Hires,
    /// LORES radiance.
    Lores,
    /// Standard error of HIRES.
    HiresDev,
    /// Standard error of LORES.
    LoresDev,
    /// Reflectance of the first visible surface.
    Albedo,
    /// Its shading normal, world space.
    Normal,
    /// Its distance.
    Depth,
    /// Trials of both passes.
    Trials,
    /// Shares of the pixel that are normal, clustered and dropped surfaces.
    Class,
    /// False colour by cluster.
    Cluster,
    /// Mean length of the gather rays that looked radiosities up.
    LookupDistance,
    /// Share of gather rays that ended in the detailed scene, within reach.
    NearShare,
}

impl Layer {
    /// All of them, in the order in which they are written.
    pub const ALL: [Layer; 12] = [
        Layer::Hires,
        Layer::Lores,
        Layer::HiresDev,
        Layer::LoresDev,
        Layer::Albedo,
        Layer::Normal,
        Layer::Depth,
        Layer::Trials,
        Layer::Class,
        Layer::Cluster,
        Layer::LookupDistance,
        Layer::NearShare,
    ];

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Layer::Hires => "hires",
            Layer::Lores => "lores",
            Layer::HiresDev => "hires_dev",
            Layer::LoresDev => "lores_dev",
            Layer::Albedo => "albedo",
            Layer::Normal => "normal",
            Layer::Depth => "depth",
            Layer::Trials => "trials",
            Layer::Class => "class",
            Layer::Cluster => "cluster",
            Layer::LookupDistance => "lookup_distance",
            Layer::NearShare => "near_share",
        }
    }

    /// Whether the renderer must record features for it.
    pub fn is_feature(self) -> bool {
        !matches!(self, Layer::Hires | Layer::Lores | Layer::HiresDev | Layer::LoresDev | Layer::Trials)
    }
}

impl FromStr for Layer {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        Layer::ALL.into_iter().find(|l| l.name() == s).ok_or_else(|| {
            let names: Vec<_> = Layer::ALL.iter().map(|l| l.name()).collect();
            format!("no layer '{s}'; there are {}", names.join(", "))
        })
    }
}

/// The image `HIRES + LORES` in `R,G,B`, and layers beside it.
pub fn develop(film: &Film, layers: &[Layer]) -> Image {
    let mut image = Image::new(film.width, film.height);
    let rgb = |value: &dyn Fn(&Pixel) -> Vec3| film.pixels().map(value).collect::<Vec<_>>();
    let scalar = |value: &dyn Fn(&Pixel) -> f32| film.pixels().map(value).collect::<Vec<_>>();
    image.push_rgb("", &rgb(&Pixel::radiance));
    for layer in layers {
        let name = layer.name();
        match layer {
            Layer::Hires => image.push_rgb(name, &rgb(&|p| vec3(p.hires.mean()))),
            Layer::Lores => image.push_rgb(name, &rgb(&|p| vec3(p.lores.mean()))),
            Layer::HiresDev => image.push_rgb(name, &rgb(&|p| vec3(p.hires.dev()))),
            Layer::LoresDev => image.push_rgb(name, &rgb(&|p| vec3(p.lores.dev()))),
            Layer::Albedo => image.push_rgb(name, &rgb(&|p| p.feature.albedo / p.hires.trials().max(1) as f32)),
            Layer::Normal => {
                let normals = rgb(&|p| p.feature.normal.normalize_or_zero());
                for (axis, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
                    image.push(format!("{name}.{letter}"), normals.iter().map(|n| n[axis]).collect());
                }
            }
            // Depth of the background is infinite, as compositing tools expect.
            Layer::Depth => image.push(
                "depth.Z",
                scalar(&|p| match p.feature.hits {
                    0 => f32::INFINITY,
                    hits => p.feature.depth / hits as f32,
                }),
            ),
            Layer::Class => {
                let share = |x: f32, p: &Pixel| x / p.hires.trials().max(1) as f32;
                let shares = rgb(&|p| {
                    let f = &p.feature;
                    Vec3::new(
                        share(f.hits as f32 - f.clustered - f.dropped, p),
                        share(f.clustered, p),
                        share(f.dropped, p),
                    )
                });
                for (i, class) in ["normal", "clustered", "dropped"].into_iter().enumerate() {
                    image.push(format!("{name}.{class}"), shares.iter().map(|s| s[i]).collect());
                }
            }
            Layer::Cluster => image.push_rgb(name, &rgb(&|p| p.feature.cluster / p.hires.trials().max(1) as f32)),
            Layer::LookupDistance => image.push(
                name,
                scalar(&|p| match p.feature.lookups {
                    0 => f32::INFINITY,
                    n => p.feature.lookup_distance / n as f32,
                }),
            ),
            Layer::NearShare => image.push(
                name,
                scalar(&|p| {
                    let gathers = p.feature.near + p.feature.lookups;
                    p.feature.near as f32 / gathers.max(1) as f32
                }),
            ),
            Layer::Trials => {
                image.push("trials.hires", scalar(&|p| p.hires.trials() as f32));
                image.push("trials.lores", scalar(&|p| p.lores.trials() as f32));
            }
        }
    }
    image
}

fn vec3(v: [f64; 3]) -> Vec3 {
    Vec3::from_array(v.map(|x| x as f32))
}
