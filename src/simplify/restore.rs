//! A simplified scene that was in a file.

use super::{Class, Cluster, Simplified, SimplifiedGeometry};
use crate::scene::Scene;

impl Simplified {
    /// Makes anew what is not in files; `None` if this cannot be what became of `scene`. No rays were traced for it.
    pub(crate) fn restored(mut self, scene: &Scene) -> Option<Simplified> {
        if !self.fits(scene) {
            return None;
        }
        self.geometry = SimplifiedGeometry::normal(scene, &self.surfaces, &self.surface_of_triangle);
        self.geometry.add_boxes(&self.clusters);
        self.rays = 0;
        Some(self)
    }

    /// Whether all numbers in it refer to something.
    fn fits(&self, scene: &Scene) -> bool {
        let is_surface = |&s: &u32| (s as usize) < self.surfaces.len();
        let is_whole = |c: &Cluster| {
            let n = c.equivalent_box.resolution as usize;
            !c.surfaces.is_empty()
                && c.surfaces.iter().all(is_surface)
                && n > 0
                && c.equivalent_box.reflectance.iter().all(|face| Some(face.len()) == n.checked_mul(n))
        };
        self.surface_of_triangle.len() == scene.mesh.triangles.len()
            && self.surface_of_triangle.iter().all(is_surface)
            && self.surfaces.iter().all(|s| {
                (s.object as usize) < scene.mesh.objects.len()
                    && !matches!(s.class, Class::Complex { cluster: Some(c) } if c as usize >= self.clusters.len())
            })
            && self.clusters.iter().all(is_whole)
    }
}
