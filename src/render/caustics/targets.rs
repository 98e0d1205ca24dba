//! What photons are aimed at: spheres around the surfaces that bend light.

use glam::Vec3;

use crate::scene::{Aabb, Material, Scene};
use crate::shading::fresnel;

/// Most spheres.
const MOST: usize = 32;

/// Weight of what reflects next to nothing, as a share of a mirror's.
const LEAST: f32 = 0.02;

/// A sphere around surfaces that bend light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub centre: Vec3,
    pub radius: f32,
    /// How much of the light that meets the surfaces they bend, about: 0..=1.
    pub weight: f32,
}

/// Triangles, by number and centre.
type Group = Vec<(u32, Vec3)>;

/// Spheres that together hold all triangles of the materials that bend light. Groups of triangles are halved along their longest axis, the
/// largest first.
pub(super) fn targets(scene: &Scene, bends: &[bool]) -> Vec<Target> {
    let mesh = &scene.mesh;
    let bending = mesh.objects.iter().filter(|o| bends[o.material as usize]).flat_map(|o| o.triangles.clone());
    let all: Group = bending.map(|t| (t, Aabb::of(mesh.corners(t)).centre())).collect();
    let mut groups: Vec<(Target, Group)> = Vec::new();
    if !all.is_empty() {
        groups.push((target(scene, &all), all));
    }
    while groups.len() < MOST {
        let divisible = groups.iter().enumerate().filter(|(_, (_, group))| group.len() > 1);
        let Some((largest, _)) = divisible.max_by(|a, b| a.1.0.radius.total_cmp(&b.1.0.radius)) else { break };
        let (_, mut group) = groups.swap_remove(largest);
        let size = Aabb::of(group.iter().map(|g| g.1)).size();
        let axis = size.max_position();
        group.sort_unstable_by(|a, b| a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0)));
        let upper = group.split_off(group.len() / 2);
        groups.extend([group, upper].map(|half| (target(scene, &half), half)));
    }
    groups.into_iter().map(|(target, _)| target).collect()
}

fn target(scene: &Scene, group: &Group) -> Target {
    let mesh = &scene.mesh;
    let bounds = Aabb::of(group.iter().flat_map(|g| mesh.corners(g.0)));
    let (mut bent, mut area) = (0.0, 0.0);
    for &(triangle, _) in group {
        let share = mesh.area(triangle);
        bent += share * f64::from(bent_share(&scene.materials[mesh.object(triangle).material as usize]));
        area += share;
    }
    let weight = if area > 0.0 { (bent / area) as f32 } else { LEAST };
    // Rounding must not leave a corner outside
    Target { centre: bounds.centre(), radius: 0.5 * bounds.diagonal() * 1.0001, weight }
}

/// Share of light at normal incidence that a material bends, about.
fn bent_share(material: &Material) -> f32 {
    let transmission = (1.0 - material.metallic) * material.transmission;
    let coat = (1.0 - material.metallic - transmission) * fresnel::at_normal(material.ior) * material.specular;
    let glass =
        if material.refracts { transmission } else { transmission * fresnel::slab(fresnel::at_normal(material.ior)) };
    (material.metallic * material.base_color.max_element() + coat + glass).clamp(LEAST, 1.0)
}
