// Embree's devices, scenes and queries for triangles, on colonnade_rays.h. Structures are those of Embree 4's documented binary interface.
#pragma once
#include <algorithm>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>
#include <vector>

#include "colonnade_rays.h"

namespace colonnade::rays::embree {

enum Error { none = 0, invalidArgument = 2, invalidOperation = 3 };
enum BufferType { indexBuffer = 0, vertexBuffer = 1 };
/// Formats of the two buffers: three 32-bit words.
constexpr int formats[] = {0x5003, 0x9003};
constexpr unsigned invokeArgumentFilter = 1 << 1;
/// Rays of the largest packet.
constexpr std::size_t packetRays = 16;

struct Device {
    int references = 1;
    int error = none;
    void (*report)(void*, int, const char*) = nullptr;
    void* user = nullptr;
    colonnade_rays_device* rays = nullptr;
    std::mutex calls; ///< Rays come from any thread; the library runs one call at a time

    void fail(int code, const char* text) {
        if (error == none) error = code;
        if (report) report(user, code, text);
    }
    void check(int status) {
        if (status != COLONNADE_RAYS_OK) fail(invalidArgument, colonnade_rays_error(rays));
    }
};

struct RTCRay {
    float org[3], tnear, dir[3], time, tfar;
    unsigned mask, id, flags;
};
struct RTCHit {
    float normal[3], u, v;
    unsigned primitive, geometry, instance;
};
struct RTCRayHit {
    alignas(16) RTCRay ray;
    alignas(16) RTCHit hit;
};

/// What a filter gets: a ray with the t of its hit, and the hit. It clears `*valid` to refuse the hit.
struct FilterArguments {
    int* valid;
    void *user, *context;
    RTCRay* ray;
    RTCHit* hit;
    unsigned count;
};
using Filter = void (*)(const FilterArguments*);
struct QueryArguments {
    unsigned flags, features;
    void* context;
    Filter filter;
};

struct Buffer {
    std::vector<char> owned;
    char* data = nullptr;
    std::size_t stride = 0, count = 0;
};

struct Geometry {
    explicit Geometry(Device* of) : device(of) {}
    Device* device;
    int references = 1;
    Buffer buffers[2];
    bool isEnabled = true;
    unsigned mask = 0xffffffff;
    void* user = nullptr;
    Filter filters[2] = {}; ///< of closest hits, of occlusion
    bool takesArgumentFilter = false;

    template <class T> std::vector<T> rows(BufferType type) const {
        const Buffer& buffer = buffers[type];
        std::vector<T> values(3 * buffer.count);
        for (std::size_t i = 0; i < buffer.count; ++i) std::memcpy(&values[3 * i], buffer.data + i * buffer.stride, 3 * sizeof(T));
        return values;
    }
};

struct Scene {
    explicit Scene(Device* of) : device(of) {}
    Device* device;
    int references = 1;
    std::map<unsigned, Geometry*> geometries;
    std::vector<unsigned> ids; ///< of each mesh
    std::vector<std::vector<double>> vertices;
    std::vector<std::vector<std::uint32_t>> faces;
    colonnade_rays_scene* rays = nullptr;

    bool hasFilters(const QueryArguments* arguments) const {
        if (arguments && arguments->filter) return true;
        for (const auto& [id, each] : geometries)
            if (each->filters[0] || each->filters[1]) return true;
        return false;
    }
};

inline Device& device(void* handle) { return *static_cast<Device*>(handle); }
inline Scene& scene(void* handle) { return *static_cast<Scene*>(handle); }
inline Geometry& geometry(void* handle) { return *static_cast<Geometry*>(handle); }

inline void release(Geometry* geometry) {
    if (--geometry->references == 0) delete geometry;
}

inline colonnade_rays_ray rayOf(const RTCRay& r) { return {{r.org[0], r.org[1], r.org[2]}, r.tnear, {r.dir[0], r.dir[1], r.dir[2]}, r.tfar}; }

/// A ray without an interval is not active, and keeps its bytes.
inline bool isActive(const RTCRay& ray) { return ray.tnear <= ray.tfar && ray.tfar >= 0; }

inline void take(const Scene& scene, const colonnade_rays_hit& hit, RTCRayHit& query) {
    const std::vector<double>& at = scene.vertices[hit.mesh];
    const std::uint32_t* const face = &scene.faces[hit.mesh][3 * hit.face];
    double edges[2][3];
    for (int i = 0; i < 2; ++i)
        for (int a = 0; a < 3; ++a) edges[i][a] = at[3 * face[i + 1] + a] - at[3 * face[0] + a];
    for (int a = 0; a < 3; ++a) query.hit.normal[a] = static_cast<float>(edges[0][(a + 1) % 3] * edges[1][(a + 2) % 3] - edges[0][(a + 2) % 3] * edges[1][(a + 1) % 3]);
    query.ray.tfar = static_cast<float>(hit.t);
    query.hit.u = static_cast<float>(hit.u);
    query.hit.v = static_cast<float>(hit.v);
    query.hit.primitive = hit.face;
    query.hit.geometry = scene.ids[hit.mesh];
    query.hit.instance = ~0u;
}

/// Whether the filters of the geometry and of the call accept a hit.
inline bool isAccepted(const Scene& scene, bool isOcclusion, const QueryArguments* arguments, RTCRayHit& query) {
    const Geometry& geometry = *scene.geometries.at(query.hit.geometry);
    const bool takesArgument = arguments && (geometry.takesArgumentFilter || (arguments->flags & invokeArgumentFilter));
    int valid = -1;
    const FilterArguments call{&valid, geometry.user, arguments ? arguments->context : nullptr, &query.ray, &query.hit, 1};
    for (const Filter filter : {geometry.filters[isOcclusion], takesArgument ? arguments->filter : nullptr})
        if (filter && valid) filter(&call);
    return valid != 0;
}

/// Takes the closest hit that filters accept. Filters run outside of the lock: they may trace rays.
inline bool takeFiltered(Scene& scene, RTCRayHit& query, bool isOcclusion, const QueryArguments* arguments) {
    const colonnade_rays_ray ray = rayOf(query.ray);
    std::vector<colonnade_rays_hit> hits(16);
    for (std::size_t count = 0;; hits.resize(count)) {
        const std::lock_guard lock(scene.device->calls);
        scene.device->check(colonnade_rays_all(scene.rays, &ray, 1, 0, query.ray.mask, SIZE_MAX, hits.data(), hits.size(), &count));
        if (count > hits.size()) continue;
        hits.resize(count);
        break;
    }
    for (const colonnade_rays_hit& hit : hits) {
        RTCRayHit candidate = query;
        take(scene, hit, candidate);
        if (!isAccepted(scene, isOcclusion, arguments, candidate)) continue;
        query = candidate;
        return true;
    }
    return false;
}

/// Calls `trace` with the active rays of a packet that follow each other and have the same mask: rays, their queries, count and mask.
template <class Trace> void eachBatch(RTCRayHit* queries, std::size_t count, const Trace& trace) {
    for (std::size_t next = 0; next < count;) {
        colonnade_rays_ray rays[packetRays];
        RTCRayHit* of[packetRays];
        std::size_t active = 0;
        unsigned mask = 0;
        for (; next < count; ++next) {
            const RTCRay& ray = queries[next].ray;
            if (!isActive(ray)) continue;
            if (active != 0 && ray.mask != mask) break;
            mask = ray.mask;
            rays[active] = rayOf(ray);
            of[active++] = &queries[next];
        }
        if (active != 0) trace(rays, of, active, mask);
    }
}

/// The closest hits of a packet, at most `packetRays` rays.
inline void intersect(Scene& scene, RTCRayHit* queries, std::size_t count, const QueryArguments* arguments) {
    const bool hasFilters = scene.hasFilters(arguments);
    for (std::size_t i = 0; hasFilters && i < count; ++i)
        if (isActive(queries[i].ray)) takeFiltered(scene, queries[i], false, arguments);
    if (hasFilters) return;
    eachBatch(queries, count, [&](const colonnade_rays_ray* rays, RTCRayHit* const* of, std::size_t active, unsigned mask) {
        colonnade_rays_hit hits[packetRays];
        std::fill_n(hits, active, colonnade_rays_hit{0, 0, 0, UINT32_MAX, UINT32_MAX, 0, 0});
        {
            const std::lock_guard lock(scene.device->calls);
            scene.device->check(colonnade_rays_closest(scene.rays, rays, active, 0, mask, hits));
        }
        for (std::size_t i = 0; i < active; ++i)
            if (hits[i].face != UINT32_MAX) take(scene, hits[i], *of[i]);
    });
}

/// Which rays of a packet, at most `packetRays`, hit anything: their tfar becomes negative infinity.
inline void occlude(Scene& scene, RTCRayHit* queries, std::size_t count, const QueryArguments* arguments) {
    const auto end = [](RTCRayHit& query) { query.ray.tfar = -std::numeric_limits<float>::infinity(); };
    const bool hasFilters = scene.hasFilters(arguments);
    for (std::size_t i = 0; hasFilters && i < count; ++i) {
        RTCRayHit candidate = queries[i];
        if (isActive(candidate.ray) && takeFiltered(scene, candidate, true, arguments)) end(queries[i]);
    }
    if (hasFilters) return;
    eachBatch(queries, count, [&](const colonnade_rays_ray* rays, RTCRayHit* const* of, std::size_t active, unsigned mask) {
        std::uint8_t isOccluded[packetRays] = {};
        {
            const std::lock_guard lock(scene.device->calls);
            scene.device->check(colonnade_rays_occluded(scene.rays, rays, active, 0, mask, isOccluded));
        }
        for (std::size_t i = 0; i < active; ++i)
            if (isOccluded[i]) end(*of[i]);
    });
}

} // namespace colonnade::rays::embree
