//! Surfaces with holes: alpha-masked and blended materials.

use std::sync::Arc;

use super::{Alpha, Scene};
use crate::backend::HitFilter;
use crate::sampling;

/// Lets rays through where a surface is transparent.
#[derive(Clone, Debug)]
pub struct AlphaFilter {
    scene: Arc<Scene>,
}

impl AlphaFilter {
    /// A filter for hits on the triangles of `scene`.
    pub fn new(scene: Arc<Scene>) -> Self {
        AlphaFilter { scene }
    }
}

impl HitFilter for AlphaFilter {
    fn accepts(&self, triangle: u32, u: f32, v: f32) -> bool {
        self.scene.is_present(triangle, u, v)
    }
}

impl Scene {
    /// Whether the surface is there at a point. Blended surfaces are there with probability alpha; the choice is a hash
    /// of the point, so that the same ray always gets the same answer.
    pub fn is_present(&self, triangle: u32, u: f32, v: f32) -> bool {
        let material = &self.materials[self.mesh.object(triangle).material as usize];
        match material.alpha {
            Alpha::Opaque => true,
            Alpha::Mask { cutoff } => self.alpha(triangle, u, v) >= cutoff,
            Alpha::Blend => {
                let chance = sampling::unit(sampling::hash_all(&[triangle, u.to_bits(), v.to_bits()]));
                chance < self.alpha(triangle, u, v)
            }
        }
    }
}
