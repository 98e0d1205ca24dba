//! placeholder
use glam::Vec3;
use crate::backend::{Ray, RayScene};
use crate::scene::Scene;
/// x
pub fn transmittance(_s: &Scene, _r: &dyn RayScene, _rays: &[Ray], _out: &mut [Vec3]) { todo!() }
