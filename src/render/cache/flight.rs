//! One cache for many views of a scene in which nothing moves.
//!
//! Frames that each had their own would interpolate between other places every time: the error, small as it is, would change from
//! frame to frame in patches as large as the reach of records, which the eye sees as flicker where it does not see it as noise.
//! With one cache for all, the error stays on the surfaces like paint.

use rayon::prelude::*;

use super::{IrradianceCache, PASSES, Record, STREAM, Strata, gather};
use crate::render::view::ViewRays;
use crate::render::workspace::Workspace;
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
        for (pass, (spacing, rays)) in (0u32..).zip(PASSES) {
            let strata = Strata::of(rays * cache.rays_for_noise());
            for (number, (camera, size)) in (0u32..).zip(views) {
                let view = ViewRays::new(camera, *size, hash_all(&[seed, STREAM, number]));
                let places = cache.places(world, &view, *size, spacing, pass);
                let fresh: Vec<Option<Record>> = (0..places.len())
                    .into_par_iter()
                    .map_init(Workspace::default, |ws, place| {
                        let stream = hash_all(&[seed, STREAM, pass, number, place as u32]);
                        if over() { None } else { gather(world, far, ws, &places[place], strata, stream, pass == 0) }
                    })
                    .collect();
                if fresh.iter().any(Option::is_some) {
                    cache.records.extend(fresh.into_iter().flatten());
                    cache.settle(far.r_thresh);
                }
            }
        }
        cache.check();
        log::debug!("irradiance cache of {} views: {} records", views.len(), cache.len());
        cache
    }

    /// Whether all numbers in it are possible: a cache from a file is not believed.
    pub(crate) fn is_sound(&self) -> bool {
        self.records.iter().all(Record::is_sound)
    }
}
