//! `gsii validate`: Embree against obvhs, ray by ray.

use std::process::ExitCode;
use std::sync::Arc;

use clap::Args;
use glam::{Vec2, Vec3};

use super::options::{MethodOptions, SceneOptions, Talk, load};
use crate::backend::compare::{Comparison, compare};
use crate::backend::{Coherence, Hit, Ray, RayScene, TriangleSet, Visible};
use crate::error::Result;
use crate::pipeline::{BackendKind, Prepared, SimplifiedFilter, Stats, choose_camera};
use crate::sampling::{basis, cosine_hemisphere, hash_all, sobol, unit};
use crate::scene::alpha::AlphaFilter;
use crate::scene::{Camera, Mesh};
use crate::shading::SurfacePoint;

/// Options of `gsii validate`.
#[derive(Args, Debug)]
pub struct Options {
    #[command(flatten)]
    scene: SceneOptions,
    #[command(flatten)]
    method: MethodOptions,
    /// Rays of each kind
    #[arg(long, value_name = "N", default_value_t = 1 << 19)]
    rays: u32,
    #[command(flatten)]
    talk: Talk,
}

/// Rays that are made and compared at a time.
const BATCH: u32 = 1 << 14;
