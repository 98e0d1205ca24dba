/* Traces batches of rays through Embree 4: one call over the FFI border for thousands of rays. */
#ifndef GSII_EMBREE_SHIM_H
#define GSII_EMBREE_SHIM_H

#include <embree4/rtcore.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Same layout as backend::Ray and backend::Hit; checked at compile time on the Rust side. */
struct gsii_embree_ray {
    float origin[3];
    float t_near;
    float direction[3];
    float t_far;
};

struct gsii_embree_hit {
    float t;
    float u;
    float v;
    unsigned int triangle;
};

#define GSII_EMBREE_MISS 0xffffffffu

/* Rays that go through the tree together when they are coherent. */
#define GSII_EMBREE_PACKET 8

/* What the filter does with a hit on a geometry. */
enum gsii_embree_kind { GSII_EMBREE_OPAQUE = 0, GSII_EMBREE_ONE_SIDED = 1, GSII_EMBREE_FILTERED = 2 };

struct gsii_embree_part {
    unsigned int first_triangle; /* index of the geometry's first triangle in the whole set */
    unsigned int kind;           /* enum gsii_embree_kind */
};

/* Decides on a hit of a GSII_EMBREE_FILTERED geometry. Called with the caller's floating-point state. */
typedef bool (*gsii_embree_filter)(void* user, unsigned int triangle, float u, float v);

struct gsii_embree_query {
    RTCScene scene;                      /* committed */
    const struct gsii_embree_part* parts; /* by geomID */
    unsigned int mask;                   /* geometries with a bit of this in their mask are seen */
    bool coherent;                       /* neighbouring rays start close together and run nearly parallel */
    bool packets;                        /* whether the device has packets of GSII_EMBREE_PACKET rays natively */
    bool filters;                        /* whether any part is not GSII_EMBREE_OPAQUE */
    gsii_embree_filter filter;           /* not null when a part is GSII_EMBREE_FILTERED */
    void* user;                          /* first argument of filter */
};

/* Nearest hit of each of n rays. Rays with NaN or infinite parts (t_far may be infinite), without a direction or with
 * t_far < t_near miss. */
void gsii_embree_closest(const struct gsii_embree_query* query, const struct gsii_embree_ray* rays,
                         struct gsii_embree_hit* hits, size_t n);

/* Whether anything lies between t_near and t_far of each of n rays; same rules. */
void gsii_embree_occluded(const struct gsii_embree_query* query, const struct gsii_embree_ray* rays, bool* occluded,
                          size_t n);

#ifdef __cplusplus
}
#endif

#endif
