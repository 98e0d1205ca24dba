/* C++ only because Embree's accessors for packets of any size (RTCRayN_dir_x ...) are; no exceptions, no library. */
#include "shim.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace {

/* Embree wants denormals flushed to zero on every thread that traces. Rust may not change this state itself, so it is
 * changed here around each batch, and put back around calls to Rust's filter. */
#if defined(__SSE2__)
using fp_state = unsigned int;
fp_state fp_get(void) { return _mm_getcsr(); }
void fp_set(fp_state state) { _mm_setcsr(state); }
fp_state fp_flushing(fp_state state) { return state | 0x8040u; /* FTZ, DAZ */ }
#elif defined(__aarch64__)
using fp_state = uint64_t;
fp_state fp_get(void) {
    fp_state state;
    __asm__ volatile("mrs %0, fpcr" : "=r"(state));
    return state;
}
void fp_set(fp_state state) { __asm__ volatile("msr fpcr, %0" : : "r"(state)); }
fp_state fp_flushing(fp_state state) { return state | (1u << 24); /* FZ */ }
#else
#error "unknown processor"
#endif

/* Reached by the filter through Embree's context pointer, hence first member. */
struct context {
    RTCRayQueryContext embree;
    const gsii_embree_query* query;
    fp_state caller;
};

void filter(const RTCFilterFunctionNArguments* args) {
    const context* ctx = (const context*)args->context;
    const gsii_embree_query* query = ctx->query;
    const unsigned int n = args->N;
    for (unsigned int i = 0; i < n; ++i) {
        if (!args->valid[i]) continue;
        const gsii_embree_part part = query->parts[RTCHitN_geomID(args->hit, n, i)];
        bool accept = true;
        if (part.kind == GSII_EMBREE_ONE_SIDED) {
            const float facing = RTCRayN_dir_x(args->ray, n, i) * RTCHitN_Ng_x(args->hit, n, i) +
                                 RTCRayN_dir_y(args->ray, n, i) * RTCHitN_Ng_y(args->hit, n, i) +
                                 RTCRayN_dir_z(args->ray, n, i) * RTCHitN_Ng_z(args->hit, n, i);
            accept = !(facing > 0.0f);
        } else if (part.kind == GSII_EMBREE_FILTERED) {
            const fp_state flushing = fp_get();
            fp_set(ctx->caller);
            accept = query->filter(query->user, part.first_triangle + RTCHitN_primID(args->hit, n, i),
                                   RTCHitN_u(args->hit, n, i), RTCHitN_v(args->hit, n, i));
            fp_set(flushing);
        }
        if (!accept) args->valid[i] = 0;
    }
}

/* x * 0 is NaN for infinite x and for NaN: one sum tells whether all are finite. Embree answers invalid rays by
 * walking the whole tree. */
bool usable(const gsii_embree_ray* ray) {
    const float zero = ray->origin[0] * 0.0f + ray->origin[1] * 0.0f + ray->origin[2] * 0.0f +
                       ray->direction[0] * 0.0f + ray->direction[1] * 0.0f + ray->direction[2] * 0.0f +
                       ray->t_near * 0.0f;
    const bool directed = ray->direction[0] != 0.0f || ray->direction[1] != 0.0f || ray->direction[2] != 0.0f;
    return zero == 0.0f && directed && ray->t_far >= ray->t_near;
}

/* A hit at t = 0 does not count: that is where the ray starts. Embree's interval is closed. */
float positive(float t_near) { return t_near > FLT_MIN ? t_near : FLT_MIN; }

/* t is a rounded quotient and can leave the interval by a unit in the last place. */
float within(float t, const gsii_embree_ray* ray) {
    return t < ray->t_near ? ray->t_near : t > ray->t_far ? ray->t_far : t;
}

const gsii_embree_hit MISS = {INFINITY, 0.0f, 0.0f, GSII_EMBREE_MISS};

void load(RTCRay* out, const gsii_embree_ray* ray, unsigned int mask) {
    out->org_x = ray->origin[0];
    out->org_y = ray->origin[1];
    out->org_z = ray->origin[2];
    out->tnear = positive(ray->t_near);
    out->dir_x = ray->direction[0];
    out->dir_y = ray->direction[1];
    out->dir_z = ray->direction[2];
    out->time = 0.0f;
    out->tfar = ray->t_far;
    out->mask = mask;
    out->id = 0;
    out->flags = 0;
}

void closest_one_by_one(RTCScene scene, RTCIntersectArguments* args, const gsii_embree_query* query,
                               const gsii_embree_ray* rays, gsii_embree_hit* hits, size_t n) {
    RTCRayHit rh;
    memset(&rh, 0, sizeof rh);
    for (size_t i = 0; i < n; ++i) {
        if (!usable(&rays[i])) {
            hits[i] = MISS;
            continue;
        }
        load(&rh.ray, &rays[i], query->mask);
        rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &rh, args);
        if (rh.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
            hits[i] = MISS;
        } else {
            hits[i].t = within(rh.ray.tfar, &rays[i]);
            hits[i].u = rh.hit.u;
            hits[i].v = rh.hit.v;
            hits[i].triangle = query->parts[rh.hit.geomID].first_triangle + rh.hit.primID;
        }
    }
}

void occluded_one_by_one(RTCScene scene, RTCOccludedArguments* args, const gsii_embree_query* query,
                                const gsii_embree_ray* rays, bool* occluded, size_t n) {
    RTCRay ray;
    for (size_t i = 0; i < n; ++i) {
        if (!usable(&rays[i])) {
            occluded[i] = false;
            continue;
        }
        load(&ray, &rays[i], query->mask);
        rtcOccluded1(scene, &ray, args);
        occluded[i] = ray.tfar < 0.0f; /* -infinity when something was hit */
    }
}

#define PACKET GSII_EMBREE_PACKET

/* Fills one packet of up to PACKET rays; lanes without a usable ray are switched off. */
void load8(RTCRay8* out, int* valid, const gsii_embree_ray* rays, size_t n, unsigned int mask) {
    for (size_t k = 0; k < PACKET; ++k) {
        const gsii_embree_ray* ray = &rays[k < n ? k : 0];
        valid[k] = k < n && usable(ray) ? -1 : 0;
        out->org_x[k] = ray->origin[0];
        out->org_y[k] = ray->origin[1];
        out->org_z[k] = ray->origin[2];
        out->tnear[k] = positive(ray->t_near);
        out->dir_x[k] = ray->direction[0];
        out->dir_y[k] = ray->direction[1];
        out->dir_z[k] = ray->direction[2];
        out->time[k] = 0.0f;
        out->tfar[k] = ray->t_far;
        out->mask[k] = mask;
        out->id[k] = 0;
        out->flags[k] = 0;
    }
}

void closest_packets(RTCScene scene, RTCIntersectArguments* args, const gsii_embree_query* query,
                            const gsii_embree_ray* rays, gsii_embree_hit* hits, size_t n) {
    RTCRayHit8 rh;
    alignas(32) int valid[PACKET];
    memset(&rh, 0, sizeof rh);
    for (size_t i = 0; i < n; i += PACKET) {
        const size_t m = n - i < PACKET ? n - i : PACKET;
        load8(&rh.ray, valid, rays + i, m, query->mask);
        for (size_t k = 0; k < PACKET; ++k) rh.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect8(valid, scene, &rh, args);
        for (size_t k = 0; k < m; ++k) {
            if (rh.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) {
                hits[i + k] = MISS;
            } else {
                hits[i + k].t = within(rh.ray.tfar[k], &rays[i + k]);
                hits[i + k].u = rh.hit.u[k];
                hits[i + k].v = rh.hit.v[k];
                hits[i + k].triangle = query->parts[rh.hit.geomID[k]].first_triangle + rh.hit.primID[k];
            }
        }
    }
}

void occluded_packets(RTCScene scene, RTCOccludedArguments* args, const gsii_embree_query* query,
                             const gsii_embree_ray* rays, bool* occluded, size_t n) {
    RTCRay8 ray;
    alignas(32) int valid[PACKET];
    for (size_t i = 0; i < n; i += PACKET) {
        const size_t m = n - i < PACKET ? n - i : PACKET;
        load8(&ray, valid, rays + i, m, query->mask);
        rtcOccluded8(valid, scene, &ray, args);
        for (size_t k = 0; k < m; ++k) occluded[i + k] = valid[k] && ray.tfar[k] < 0.0f;
    }
}

RTCRayQueryFlags flags(const gsii_embree_query* query) {
    return query->coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
}

context begin(const gsii_embree_query* query) {
    context ctx;
    rtcInitRayQueryContext(&ctx.embree);
    ctx.query = query;
    ctx.caller = fp_get();
    fp_set(fp_flushing(ctx.caller));
    return ctx;
}

}  // namespace

void gsii_embree_closest(const gsii_embree_query* query, const gsii_embree_ray* rays,
                         gsii_embree_hit* hits, size_t n) {
    context ctx = begin(query);
    RTCIntersectArguments args;
    rtcInitIntersectArguments(&args);
    args.context = &ctx.embree;
    args.flags = flags(query);
    if (query->filters) args.filter = filter;
    if (query->coherent && query->packets) {
        closest_packets(query->scene, &args, query, rays, hits, n);
    } else {
        closest_one_by_one(query->scene, &args, query, rays, hits, n);
    }
    fp_set(ctx.caller);
}

void gsii_embree_occluded(const gsii_embree_query* query, const gsii_embree_ray* rays, bool* occluded,
                          size_t n) {
    context ctx = begin(query);
    RTCOccludedArguments args;
    rtcInitOccludedArguments(&args);
    args.context = &ctx.embree;
    args.flags = flags(query);
    if (query->filters) args.filter = filter;
    if (query->coherent && query->packets) {
        occluded_packets(query->scene, &args, query, rays, occluded, n);
    } else {
        occluded_one_by_one(query->scene, &args, query, rays, occluded, n);
    }
    fp_set(ctx.caller);
}
