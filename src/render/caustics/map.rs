//! Photons where they landed, and how dense they are around a point.

use std::f32::consts::PI;
use std::num::NonZero;

use glam::Vec3;
use kiddo::immutable::float::kdtree::ImmutableKdTree;
use kiddo::{NearestNeighbour, SquaredEuclidean};
use rayon::prelude::*;

use super::grid::{Near, ReachGrid};

/// Photons that an estimate is made from, where there are enough.
const NEAREST: usize = 64;

/// One of so many photons knows the irradiance of its place.
const KNOWN: usize = 4;

/// Photons on surfaces that are turned by more than 45 degrees (cosine) are not counted ...
const LEAST_COSINE: f32 = 0.707;
/// ... nor those farther off the tangent plane than this share of the radius.
const OFF_PLANE: f32 = 0.3;

/// The irradiance that is known at a photon is used on surfaces that are turned by less than this (cosine).
const SAME_SURFACE: f32 = 0.98;

/// Least cosine that flux is divided by.
const GRAZING: f32 = 1e-3;

/// Flux that landed on a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Photon {
    pub position: Vec3,
    /// Unit geometric normal on the side where it landed.
    pub normal: Vec3,
    /// Unit direction to where it came from.
    pub toward: Vec3,
    /// W per band.
    pub flux: Vec3,
}

/// Photons, sorted by place.
#[derive(Clone, Debug, Default)]
pub(super) struct PhotonMap {
    pub(super) photons: Vec<Photon>,
    reach: f32,
    /// Answers where few photons reach.
    grid: ReachGrid,
    /// Answers elsewhere; `None` without photons.
    tree: Option<ImmutableKdTree<f32, u32, 3, 32>>,
    /// Every so many photons: places where the irradiance by all others is known, if they are dense.
    places: Option<ImmutableKdTree<f32, u32, 3, 32>>,
    irradiance: Vec<Option<Vec3>>,
}

impl PhotonMap {
    /// Sorts photons. `reach`: largest distance over which they are averaged.
    pub fn new(photons: Vec<Photon>, reach: f32) -> PhotonMap {
        let tree = |every: usize| {
            let positions: Vec<[f32; 3]> = photons.iter().step_by(every).map(|p| p.position.to_array()).collect();
            (!positions.is_empty()).then(|| ImmutableKdTree::new_from_slice(&positions))
        };
        let (tree, places) = (tree(1), tree(KNOWN));
        let grid = ReachGrid::new(photons.iter().map(|p| p.position), reach);
        let mut map = PhotonMap { photons, reach, grid, tree, places, irradiance: Vec::new() };
        let at = |number: usize| {
            let photon = &map.photons[number];
            let itself = Some(number as u32);
            let around = map.around(map.grid.near(photon.position), photon.position, itself);
            let dense = around.found.len() == NEAREST;
            dense.then(|| map.sum(&around, photon.position, photon.normal, &|_| Vec3::ONE))
        };
        map.irradiance = (0..map.photons.len()).into_par_iter().step_by(KNOWN).map(at).collect();
        map
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// Radiance that photons make leave a point on a surface with unit geometric normal `normal` on the side that is seen; `scatter`
    /// is `f cos` for light from a unit direction, and `diffuse` the same over the cosine where it is the same for all. Where photons are
    /// dense, diffuse light is that of the nearest place where it is known beforehand (Christensen 1999).
    pub fn radiance(
        &self,
        position: Vec3,
        normal: Vec3,
        diffuse: Option<Vec3>,
        scatter: &dyn Fn(Vec3) -> Vec3,
    ) -> Vec3 {
        let near = self.grid.near(position);
        if near == Near::Few(&[]) {
            return Vec3::ZERO;
        }
        if let Some(diffuse) = diffuse
            && let Some(irradiance) = self.known(near, position, normal)
        {
            return diffuse * irradiance;
        }
        let per_flux = |toward: Vec3| scatter(toward) / normal.dot(toward).max(GRAZING);
        self.sum(&self.around(near, position, None), position, normal, &per_flux)
    }

    /// The irradiance at the nearest place, where it is known and on the same surface.
    fn known(&self, near: Near<'_>, position: Vec3, normal: Vec3) -> Option<Vec3> {
        let (place, distance2) = match near {
            Near::Few(few) => {
                let places = few.iter().filter(|&&number| (number as usize).is_multiple_of(KNOWN));
                let (number, distance2) = places
                    .map(|&number| (number, self.distance2(number, position)))
                    .min_by(|a, b| a.1.total_cmp(&b.1))?;
                (number as usize / KNOWN, distance2)
            }
            Near::Many => {
                let nearest = self.places.as_ref()?.nearest_one::<SquaredEuclidean>(&position.to_array());
                (nearest.item as usize, nearest.distance)
            }
        };
        let photon = &self.photons[KNOWN * place];
        let off_plane = normal.dot(photon.position - position).abs() > OFF_PLANE * distance2.sqrt();
        let same = normal.dot(photon.normal) > SAME_SURFACE && !off_plane && distance2 < self.reach * self.reach;
        self.irradiance[place].filter(|_| same)
    }

    fn distance2(&self, number: u32, position: Vec3) -> f32 {
        self.photons[number as usize].position.distance_squared(position)
    }

    /// The nearest photons within reach, but for one, among those that are `near`.
    fn around(&self, near: Near<'_>, position: Vec3, but: Option<u32>) -> Around {
        let reach2 = self.reach * self.reach;
        let mut found: Vec<NearestNeighbour<f32, u32>> = match (near, &self.tree) {
            (Near::Few(few), _) => {
                let all = few.iter().map(|&item| NearestNeighbour { distance: self.distance2(item, position), item });
                all.filter(|f| f.distance < reach2).collect()
            }
            (Near::Many, Some(tree)) => {
                let most = NonZero::<usize>::MIN.saturating_add(NEAREST + usize::from(but.is_some()));
                tree.nearest_n_within::<SquaredEuclidean>(&position.to_array(), reach2, most, true)
            }
            (Near::Many, None) => Vec::new(),
        };
        found.retain(|f| Some(f.item) != but);
        let mut radius2 = reach2;
        if found.len() > NEAREST {
            found.select_nth_unstable_by(NEAREST, |a, b| a.distance.total_cmp(&b.distance).then(a.item.cmp(&b.item)));
            radius2 = found[NEAREST].distance;
            found.truncate(NEAREST);
        }
        Around { found, radius2 }
    }

    /// Sum over photons of flux per area times `per_flux` of the direction that it comes from.
    ///
    /// The nearest photons are weighted with Epanechnikov's kernel, whose radius is the distance of the next one, at most the reach. Where
    /// they land evenly the expectation is exact: the mean of k over the area out to photon k + 1 is the density, and so is the mean of
    /// the number within a fixed radius.
    fn sum(&self, around: &Around, position: Vec3, normal: Vec3, per_flux: &dyn Fn(Vec3) -> Vec3) -> Vec3 {
        let radius2 = around.radius2;
        if radius2 == 0.0 {
            return Vec3::ZERO;
        }
        let off_plane = OFF_PLANE * radius2.sqrt();
        let mut sum = Vec3::ZERO;
        for found in &around.found {
            let photon = &self.photons[found.item as usize];
            let offset = normal.dot(photon.position - position);
            if normal.dot(photon.toward) > 0.0 && normal.dot(photon.normal) >= LEAST_COSINE && offset.abs() <= off_plane
            {
                sum += photon.flux * per_flux(photon.toward) * (1.0 - found.distance / radius2);
            }
        }
        // The kernel's integral over its disk is half of the disk's area
        sum * (2.0 / (PI * radius2))
    }
}

/// Photons around a point.
struct Around {
    found: Vec<NearestNeighbour<f32, u32>>,
    /// Square of the radius over which they are averaged.
    radius2: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash_all, unit};

    /// Photons that land evenly and independently on a square: the mean of many estimates inside is their density, for densities that
    /// fill the reach with many more and many fewer photons than are asked for, and close to the change from one to the other.
    #[test]
    fn density_has_no_bias() {
        const MAPS: u32 = 400;
        for expected in [4.0, 60.0, 64.0, 70.0, 1000.0] {
            let reach = 0.25;
            let density = expected / (std::f64::consts::PI * reach * reach);
            let estimates: Vec<[f64; 2]> = (0..MAPS)
                .map(|map| {
                    let random = |i: u32, d: u32| unit(hash_all(&[map, i, d, expected as u32]));
                    // A Poisson number on a square of side 1, by exponential gaps
                    let (mut photons, mut sum) = (Vec::new(), 0.0);
                    for i in 0.. {
                        sum -= f64::from(1.0 - random(i, 0)).ln();
                        if sum > density {
                            break;
                        }
                        let position = Vec3::new(random(i, 1) - 0.5, random(i, 2) - 0.5, 0.0);
                        photons.push(Photon { position, normal: Vec3::Z, toward: Vec3::Z, flux: Vec3::ONE });
                    }
                    let map = PhotonMap::new(photons, reach as f32);
                    [None, Some(Vec3::ONE)]
                        .map(|diffuse| map.radiance(Vec3::ZERO, Vec3::Z, diffuse, &|d| Vec3::splat(d.z)))
                        .map(|radiance| f64::from(radiance.x) / density)
                })
                .collect();
            let n = f64::from(MAPS);
            for way in 0..2 {
                let mean = estimates.iter().map(|e| e[way]).sum::<f64>() / n;
                let error = (estimates.iter().map(|e| (e[way] - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
                // One false alarm in 10^5
                assert!((mean - 1.0).abs() < 4.4 * error, "{expected}, way {way}: {mean} +- {error}");
                assert!(error < 0.05, "{expected}: the test is sharp: {error}");
            }
        }
    }

    #[test]
    fn other_surfaces_and_other_sides_do_not_count() {
        let photon = |position, normal, toward| Photon { position, normal, toward, flux: Vec3::ONE };
        let map = PhotonMap::new(
            vec![
                photon(Vec3::ZERO, -Vec3::Z, -Vec3::Z),
                photon(Vec3::ZERO, Vec3::X, Vec3::new(0.6, 0.0, 0.8)),
                photon(Vec3::new(0.0, 0.0, 0.09), Vec3::Z, Vec3::Z),
            ],
            0.1,
        );
        let white = |d: Vec3| Vec3::splat(d.z.max(0.0));
        assert_eq!(map.radiance(Vec3::ZERO, Vec3::Z, None, &white), Vec3::ZERO);
        assert!(map.radiance(Vec3::ZERO, -Vec3::Z, None, &|d| Vec3::splat(-d.z)).x > 0.0);
    }
}
