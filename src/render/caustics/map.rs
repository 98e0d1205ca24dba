//! Photons where they landed, and how dense they are around a point.

use std::f32::consts::PI;
use std::num::NonZero;

use glam::Vec3;
use kiddo::SquaredEuclidean;
use kiddo::immutable::float::kdtree::ImmutableKdTree;

/// Photons that an estimate is made from, where there are enough.
const NEAREST: usize = 64;

/// Photons on surfaces that are turned by more than 45 degrees (cosine) are not counted ...
const LEAST_COSINE: f32 = 0.707;
/// ... nor those farther off the tangent plane than this share of the radius.
const OFF_PLANE: f32 = 0.3;

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
    /// `None` without photons.
    tree: Option<ImmutableKdTree<f32, u32, 3, 32>>,
    reach: f32,
}

impl PhotonMap {
    /// Sorts photons. `reach`: largest distance over which they are averaged.
    pub fn new(photons: Vec<Photon>, reach: f32) -> PhotonMap {
        let positions: Vec<[f32; 3]> = photons.iter().map(|p| p.position.to_array()).collect();
        let tree = (!photons.is_empty()).then(|| ImmutableKdTree::new_from_slice(&positions));
        PhotonMap { photons, tree, reach }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// Radiance that photons make leave a point on a surface with unit geometric normal `normal` on the side that is seen; `scatter`
    /// is `f cos` for light from a unit direction.
    ///
    /// The nearest photons within reach are weighted with Epanechnikov's kernel, whose radius is the distance of the next one. Where they
    /// land evenly the expectation is exact: the mean of k over the area out to photon k + 1 is the density, and so is the mean of
    /// the number within a fixed radius.
    pub fn radiance(&self, position: Vec3, normal: Vec3, scatter: &dyn Fn(Vec3) -> Vec3) -> Vec3 {
        let Some(tree) = &self.tree else { return Vec3::ZERO };
        let most = NonZero::<usize>::MIN.saturating_add(NEAREST);
        let reach2 = self.reach * self.reach;
        let nearest = tree.nearest_n_within::<SquaredEuclidean>(&position.to_array(), reach2, most, true);
        let radius2 = match nearest.get(NEAREST) {
            Some(beyond) => beyond.distance,
            None => reach2,
        };
        if radius2 == 0.0 {
            return Vec3::ZERO;
        }
        let off_plane = OFF_PLANE * radius2.sqrt();
        let mut sum = Vec3::ZERO;
        for found in nearest.iter().take(NEAREST) {
            let photon = &self.photons[found.item as usize];
            let cos = normal.dot(photon.toward);
            let offset = normal.dot(photon.position - position);
            if cos <= 0.0 || normal.dot(photon.normal) < LEAST_COSINE || offset.abs() > off_plane {
                continue;
            }
            let kernel = 1.0 - found.distance / radius2;
            sum += photon.flux * scatter(photon.toward) * (kernel / cos.max(GRAZING));
        }
        // The kernel's integral over its disk is half of the disk's area
        sum * (2.0 / (PI * radius2))
    }
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
            let estimates: Vec<f64> = (0..MAPS)
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
                    f64::from(map.radiance(Vec3::ZERO, Vec3::Z, &|d| Vec3::splat(d.z)).x) / density
                })
                .collect();
            let n = f64::from(MAPS);
            let mean = estimates.iter().sum::<f64>() / n;
            let error = (estimates.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
            // One false alarm in 10^5
            assert!((mean - 1.0).abs() < 4.4 * error, "{expected}: {mean} +- {error}");
            assert!(error < 0.05, "{expected}: the test is sharp: {error}");
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
        assert_eq!(map.radiance(Vec3::ZERO, Vec3::Z, &white), Vec3::ZERO);
        assert!(map.radiance(Vec3::ZERO, -Vec3::Z, &|d| Vec3::splat(-d.z)).x > 0.0);
    }
}
