//! One cache for many views of a scene in which nothing moves.
//!
//! Frames that each had their own would interpolate between other places every time: the error, small as it is, would change from
//! frame to frame in patches as large as the reach of records, which the eye sees as flicker where it does not see it as noise.
//! With one cache for all, the error stays on the surfaces like paint.

use super::{Fineness, IrradianceCache, PASSES, Record, STREAM, Strata, gather_all};
use crate::render::view::ViewRays;
use crate::render::world::World;
use crate::sampling::hash_all;
use crate::scene::Camera;

impl IrradianceCache {
    /// A full cache for all `views`, each a camera with the size of its image in pixels. The same on any number of threads, unless
    /// `over` says that it must end.
    pub fn for_views(
        world: &World<'_>,
        views: &[(Camera, [u32; 2])],
        seed: u32,
        over: &(dyn Fn() -> bool + Sync),
    ) -> Self {
        let mut cache = IrradianceCache { passes: PASSES.len(), ..IrradianceCache::default() };
        let Some(far) = &world.far else { return cache };
        let fineness = Fineness::of(f32::INFINITY);
        for (pass, (spacing, rays)) in (0u32..).zip(PASSES) {
            let strata = Strata::of(rays * fineness.rays * cache.rays_for_noise());
            for (number, (camera, size)) in (0u32..).zip(views) {
                let view = ViewRays::new(camera, *size, hash_all(&[seed, STREAM, number]));
                let places = cache.places(world, &view, *size, spacing, pass);
                let stream = |place: usize| hash_all(&[seed, STREAM, pass, number, place as u32]);
                let fresh = gather_all(world, far, (&places, 0..places.len()), strata, pass, &stream, over);
                if !fresh.is_empty() {
                    cache.records.extend(fresh);
                    cache.settle(far.r_thresh);
                }
            }
        }
        cache.check(fineness.tolerance);
        log::debug!("irradiance cache of {} views: {} records", views.len(), cache.len());
        cache
    }

    /// Whether all numbers in it are possible: a cache from a file is not believed.
    pub(crate) fn is_sound(&self) -> bool {
        self.records.iter().all(Record::is_sound)
    }
}
