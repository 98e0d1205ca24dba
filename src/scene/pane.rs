//! Flat slabs of glass: parallel faces send a ray on in the direction from which it came, moved sideways by less than
//! the thickness, so that shadow rays may go straight through.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};

use super::builder::MeshData;

/// Sine of the largest angle between a face of a slab and its axis.
const MAX_TILT: f64 = 1e-3;
/// Share of a component's area that must belong to the two faces; the rest is the rim.
const MIN_FACE_SHARE: f64 = 0.95;

/// Whether every connected part of the geometry is a flat slab or sheet.
pub(super) fn is_pane(data: &MeshData, transform: &DAffine3) -> bool {
    let positions: Vec<DVec3> = data.positions.iter().map(|p| transform.transform_point3(p.as_dvec3())).collect();
    // Twice the area times the unit normal.
    let areas: Vec<DVec3> = data
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            (b - a).cross(c - a)
        })
        .collect();
    components(data).iter().all(|component| {
        let Some(largest) = component.iter().map(|&t| areas[t]).max_by(|a, b| a.length().total_cmp(&b.length())) else {
            return true;
        };
        let axis = largest.normalize_or_zero();
        let total: f64 = component.iter().map(|&t| areas[t].length()).sum();
        let faces = component.iter().map(|&t| areas[t]).filter(|a| a.cross(axis).length() <= MAX_TILT * a.length());
        let faces: f64 = faces.map(DVec3::length).sum();
        total > 0.0 && faces > MIN_FACE_SHARE * total
    })
}

/// Triangles by connected component; vertices at the same place connect.
fn components(data: &MeshData) -> Vec<Vec<usize>> {
    let mut parent: Vec<u32> = (0..data.positions.len() as u32).collect();
    fn find(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let mut at: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for (i, p) in data.positions.iter().enumerate() {
        let same = *at.entry((*p + glam::Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(i as u32);
        parent[i] = same;
    }
    for t in &data.triangles {
        let root = find(&mut parent, t[0]);
        for &i in &t[1..] {
            let other = find(&mut parent, i);
            parent[other as usize] = root;
        }
    }
    let mut components: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (t, triangle) in data.triangles.iter().enumerate() {
        components.entry(find(&mut parent, triangle[0])).or_default().push(t);
    }
    components.into_values().collect()
}
