// The calls of Embree 4 for triangles: a shared library in place of libembree4, on the device that the environment
// names. All of its calls are here; those for other geometries, instances and motion set an error, and do nothing.
#include "embree.hpp"

using namespace colonnade::rays::embree;

namespace {

/// Words of a ray and its hit, 4 bytes each.
enum Word {
    origin = 0,
    nearEnd = 3,
    direction = 4,
    farEnd = 8,
    rayMask = 9,
    hitNormal = 12,
    hitU = 15,
    hitV,
    hitPrimitive,
    hitGeometry,
    hitInstance
};
constexpr int rayWords = 12;
constexpr float occludedEnd = -std::numeric_limits<float>::infinity();

/// Rays in memory, which have each word `width` times, one after the other. A single ray is a packet of one.
template <int width> struct Packet {
    char* bytes;

    template <class T = float> T get(int word, int lane) const {
        T value;
        std::memcpy(&value, bytes + 4 * (word * width + lane), 4);
        return value;
    }
    template <class T> void set(int word, int lane, T value) const {
        std::memcpy(bytes + 4 * (word * width + lane), &value, 4);
    }

    /// A ray without an interval is not active, and keeps its bytes.
    bool isActive(int lane) const { return get(nearEnd, lane) <= get(farEnd, lane) && get(farEnd, lane) >= 0; }
    colonnade_rays_ray ray(int lane) const {
        const auto at = [&](int word) { return double{get(word, lane)}; };
        return {{at(origin), at(origin + 1), at(origin + 2)},
                at(nearEnd),
                {at(direction), at(direction + 1), at(direction + 2)},
                at(farEnd)};
    }
    /// Writes a hit, whose words begin at `first`.
    void take(const Part& part, const colonnade_rays_hit& hit, int lane, int first) const {
        for (int a = 0; a < 3; ++a) set(first + a, lane, part.normals[hit.face][a]);
        const auto word = [&](int of) { return first + of - hitNormal; };
        set(word(hitU), lane, static_cast<float>(hit.u));
        set(word(hitV), lane, static_cast<float>(hit.v));
        set(word(hitPrimitive), lane, hit.face);
        set(word(hitGeometry), lane, part.id);
        set(word(hitInstance), lane, noId);
    }
};

/// Whether the filters accept a hit, and may change it.
bool isAccepted(const Geometry& geometry, bool isOcclusion, const QueryArguments* arguments, char* ray, char* hit) {
    const bool takesArgument = arguments && (geometry.takesArgumentFilter || (arguments->flags & invokeArgumentFilter));
    int valid = -1;
    unsigned noInstances[2] = {noId, noId};
    const FilterArguments call{
        &valid, geometry.user, arguments && arguments->context ? arguments->context : noInstances, ray, hit, 1};
    for (const Filter filter : {geometry.filters[isOcclusion], takesArgument ? arguments->filter : nullptr})
        if (filter && valid) filter(&call);
    return valid != 0;
}

/// Takes the first hit that filters accept, from near to far.
template <int width> void traceFiltered(Scene& scene, const Packet<width>& packet, int lane, bool isOcclusion,
                                        const QueryArguments* arguments) {
    const colonnade_rays_ray ray = packet.ray(lane);
    const float end = packet.get(farEnd, lane);
    // Filters see the caller's own single ray, which may be a part of something larger
    char copy[4 * rayWords], *seen = packet.bytes;
    if (width != 1) {
        for (int word = 0; word < rayWords; ++word)
            std::memcpy(copy + 4 * word, packet.bytes + 4 * (word * width + lane), 4);
        seen = copy;
    }
    std::vector<colonnade_rays_hit> hits(16);
    for (std::size_t count = 0;; hits.resize(count)) {
        scene.device->check(colonnade_rays_all(scene.committed.rays, &ray, 1, 0,
                                               packet.template get<unsigned>(rayMask, lane), SIZE_MAX, hits.data(),
                                               hits.size(), &count));
        if (count > hits.size()) continue;
        hits.resize(count);
        break;
    }
    for (const colonnade_rays_hit& hit : hits) {
        const Part& part = scene.committed.parts[hit.mesh];
        alignas(16) char bytes[48];
        std::memset(bytes, 0xff, sizeof bytes); // The last word is for an instance in an array
        const Packet<1> found{bytes};
        found.take(part, hit, 0, 0);
        Packet<1>{seen}.set(farEnd, 0, static_cast<float>(hit.t));
        if (!isAccepted(*part.geometry.get(), isOcclusion, arguments, seen, bytes)) continue;
        packet.set(farEnd, lane, isOcclusion ? occludedEnd : Packet<1>{seen}.get(farEnd, 0));
        for (int word = hitNormal; !isOcclusion && word <= hitInstance; ++word)
            packet.set(word, lane, found.get(word - hitNormal, 0));
        return;
    }
    packet.set(farEnd, lane, end);
}

/// Traces the active rays of a packet. Consecutive rays with one mask are a batch.
template <int width, bool isOcclusion>
void trace(const int* valid, Scene* scene, char* bytes, const QueryArguments* arguments) noexcept {
    called(scene, [&] {
        const Packet<width> packet{static_cast<char*>(needed(bytes))};
        const Committed& committed = scene->committed;
        const bool hasFilters =
            committed.hasFilters || (arguments && arguments->filter && (arguments->flags & invokeArgumentFilter));
        for (int lane = 0; lane < width;) {
            colonnade_rays_ray rays[width];
            int lanes[width];
            std::size_t count = 0;
            unsigned mask = 0;
            for (; lane < width; ++lane) {
                if ((width > 1 && valid[lane] == 0) || !packet.isActive(lane)) continue;
                const unsigned ofLane = packet.template get<unsigned>(rayMask, lane);
                if (count != 0 && ofLane != mask) break;
                if (hasFilters) {
                    traceFiltered(*scene, packet, lane, isOcclusion, arguments);
                    continue;
                }
                mask = ofLane;
                rays[count] = packet.ray(lane);
                lanes[count++] = lane;
            }
            if (count == 0) break;
            if constexpr (isOcclusion) {
                std::uint8_t isOccluded[width];
                scene->device->check(colonnade_rays_occluded(committed.rays, rays, count, 0, mask, isOccluded));
                for (std::size_t i = 0; i < count; ++i)
                    if (isOccluded[i]) packet.set(farEnd, lanes[i], occludedEnd);
            } else {
                colonnade_rays_hit hits[width];
                scene->device->check(colonnade_rays_closest(committed.rays, rays, count, 0, mask, hits));
                for (std::size_t i = 0; i < count; ++i) {
                    if (hits[i].face == UINT32_MAX) continue;
                    packet.set(farEnd, lanes[i], static_cast<float>(hits[i].t));
                    packet.take(committed.parts[hits[i].mesh], hits[i], lanes[i], hitNormal);
                }
            }
        }
    });
}

#define REFUSAL ": only triangles at rest, without instances"
/// Refuses a call: an error of the handle's device.
void refuse(Object* handle, const char* text) noexcept {
    called(handle, [&] { throw Error(invalidOperation, text); });
}
/// Refuses a call without a handle.
void refuse(std::nullptr_t, const char* text) noexcept { Device::fail(nullptr, invalidOperation, text); }

} // namespace

extern "C" {

// Objects
#define REFERENCES(KIND) \
    void rtcRetain##KIND(KIND* handle) { \
        called(handle, [&] { handle->retain(); }); \
    } \
    void rtcRelease##KIND(KIND* handle) { \
        called(handle, [&] { handle->release(); }); \
    }
REFERENCES(Device)
REFERENCES(Buffer)
REFERENCES(Geometry)
REFERENCES(Scene)

// Devices
Device* rtcNewDevice(const char*) {
    try {
        return new Device;
    } catch (const std::exception& error) {
        const auto* const known = dynamic_cast<const Error*>(&error);
        Device::fail(nullptr, known ? known->code : outOfMemory, error.what());
        return nullptr;
    }
}
int rtcGetDeviceError(Device* device) { return std::exchange(Device::error(device).code, none); }
const char* rtcGetDeviceLastErrorMessage(Device* device) { return Device::error(device).text.c_str(); }
const char* rtcGetErrorString(int error) {
    constexpr const char* texts[] = {
        "No Error",      "Unknown error",   "Invalid argument", "Invalid operation",
        "Out of Memory", "Unsupported CPU", "Build cancelled",  "Level Zero raytracing support missing"};
    return error >= 0 && error < static_cast<int>(std::size(texts)) ? texts[error] : "Invalid error code";
}
void rtcSetDeviceErrorFunction(Device* device, void (*report)(void*, int, const char*), void* user) {
    called(device, [&] {
        device->report = report;
        device->user = user;
    });
}
ssize_t rtcGetDeviceProperty(Device* device, int property) {
    return called(device, [&]() -> ssize_t {
        switch (property) {
        case 0: return 40400; // The version, and its parts
        case 1:
        case 2: return 4;
        case 64: // Ray masks, filters, triangles
        case 66:
        case 96:
        case 67:  // Rays that are not finite miss
        case 129: // Commits that are joined, and several at a time, on a processor
        case 130:
        case 140: return 1;
        }
        const auto isBetween = [&](int first, int last) { return first <= property && property <= last; };
        if (property != 3 && !isBetween(32, 34) && !isBetween(62, 68) && !isBetween(96, 101) && property != 128 &&
            property != 141)
            throw Error(invalidArgument, "unknown readable property");
        return 0;
    });
}
void rtcSetDeviceProperty(Device* device, int, ssize_t) {
    called(device, [&] { throw Error(invalidArgument, "unknown writable property"); });
}

// Buffers
Buffer* rtcNewSharedBuffer(Device* device, char* data, std::size_t bytes) {
    return called(device, [&] { return new Buffer(device, data, bytes); });
}
Buffer* rtcNewBuffer(Device* device, std::size_t bytes) { return rtcNewSharedBuffer(device, nullptr, bytes); }
Buffer* rtcNewSharedBufferHostDevice(Device* device, char* data, std::size_t bytes) {
    return rtcNewSharedBuffer(device, data, bytes);
}
Buffer* rtcNewBufferHostDevice(Device* device, std::size_t bytes) { return rtcNewBuffer(device, bytes); }
void* rtcGetBufferData(Buffer* buffer) {
    return called(buffer, [&] { return static_cast<void*>(buffer->data); });
}
void* rtcGetBufferDataDevice(Buffer* buffer) { return rtcGetBufferData(buffer); }
void rtcCommitBuffer(Buffer* buffer) {
    called(buffer, [] {});
}

// Geometries
Geometry* rtcNewGeometry(Device* device, int type) {
    return called(device, [&] {
        if (type != 0) throw Error(invalidOperation, "only triangles");
        return new Geometry(device);
    });
}
void rtcCommitGeometry(Geometry* geometry) {
    called(geometry, [&] {
        geometry->change();
        geometry->isCommitted = true;
    });
}
void rtcSetGeometryBuffer(Geometry* geometry, int type, unsigned slot, int format, Buffer* buffer, std::size_t offset,
                          std::size_t stride, std::size_t count) {
    called(geometry, [&] {
        needed(buffer);
        if (buffer->device != geometry->device) throw Error(invalidArgument, "the buffer is another device's");
        geometry->set(type, slot, format, offset, stride, count,
                      [&](std::size_t) { return Reference<Buffer>(buffer); });
    });
}
void rtcSetSharedGeometryBuffer(Geometry* geometry, int type, unsigned slot, int format, char* data, std::size_t offset,
                                std::size_t stride, std::size_t count) {
    called(geometry, [&] {
        char* const from = data ? data + offset : nullptr;
        geometry->set(type, slot, format, 0, stride, count, [&](std::size_t bytes) {
            return Reference<Buffer>::of(new Buffer(geometry->device, from, bytes));
        });
    });
}
void rtcSetSharedGeometryBufferHostDevice(Geometry* geometry, int type, unsigned slot, int format, char* data,
                                          const void* onDevice, std::size_t offset, std::size_t stride,
                                          std::size_t count) {
    called(geometry, [&] {
        if (onDevice) throw Error(invalidArgument, "the device's memory is the host's: pass NULL");
    });
    if (!onDevice) rtcSetSharedGeometryBuffer(geometry, type, slot, format, data, offset, stride, count);
}
void* rtcSetNewGeometryBuffer(Geometry* geometry, int type, unsigned slot, int format, std::size_t stride,
                              std::size_t count) {
    return called(geometry, [&]() -> void* {
        // Room for reads of 16 bytes
        return geometry
            ->set(type, slot, format, 0, stride, count,
                  [&](std::size_t bytes) {
                      return Reference<Buffer>::of(new Buffer(geometry->device, nullptr, bytes + 16));
                  })
            .data;
    });
}
void rtcSetNewGeometryBufferHostDevice(Geometry* geometry, int type, unsigned slot, int format, std::size_t stride,
                                       std::size_t count, void** data, void** onDevice) {
    void* const made = rtcSetNewGeometryBuffer(geometry, type, slot, format, stride, count);
    for (void** const to : {data, onDevice})
        if (to) *to = made;
}
void* rtcGetGeometryBufferData(Geometry* geometry, int type, unsigned slot) {
    return called(geometry, [&]() -> void* { return geometry->view(type, slot).data; });
}
void* rtcGetGeometryBufferDataDevice(Geometry* geometry, int type, unsigned slot) {
    return rtcGetGeometryBufferData(geometry, type, slot);
}
void rtcUpdateGeometryBuffer(Geometry* geometry, int type, unsigned slot) {
    called(geometry, [&] {
        geometry->view(type, slot);
        geometry->change();
    });
}
void rtcSetGeometryVertexAttributeCount(Geometry* geometry, unsigned count) {
    called(geometry, [&] {
        geometry->attributes.resize(count);
        geometry->change();
    });
}
void rtcSetGeometryTimeStepCount(Geometry* geometry, unsigned count) {
    called(geometry, [&] {
        if (count != 1) throw Error(count > 129 ? invalidArgument : invalidOperation, "only geometries without motion");
    });
}
void rtcSetGeometryTimeRange(Geometry* geometry, float start, float end) {
    called(geometry, [&] {
        if (start > end) throw Error(invalidArgument, "the range of time ends before its start");
    });
}
void rtcSetGeometryBuildQuality(Geometry* geometry, int quality) {
    called(geometry, [&] {
        if (quality < 0 || quality > 3) throw Error(unknown, "invalid build quality");
    });
}
void rtcSetGeometryMask(Geometry* geometry, unsigned mask) {
    called(geometry, [&] {
        geometry->mask = mask;
        geometry->change();
    });
}
/// A call that sets one thing of a geometry.
#define SETTER(NAME, TYPE, STATEMENT) \
    void NAME(Geometry* geometry TYPE) { \
        called(geometry, [&] { STATEMENT; }); \
    }
#define OF , // before a parameter
SETTER(rtcEnableGeometry, , geometry->enable(true))
SETTER(rtcDisableGeometry, , geometry->enable(false))
SETTER(rtcSetGeometryUserData, OF void* value, geometry->user = value)
SETTER(rtcSetGeometryIntersectFilterFunction, OF Filter value, geometry->filters[0] = value)
SETTER(rtcSetGeometryOccludedFilterFunction, OF Filter value, geometry->filters[1] = value)
SETTER(rtcSetGeometryEnableFilterFunctionFromArguments, OF bool value, geometry->takesArgumentFilter = value)
void* rtcGetGeometryUserData(Geometry* geometry) {
    return called(geometry, [&] { return geometry->user; });
}

// Scenes
Scene* rtcNewScene(Device* device) {
    return called(device, [&] { return new Scene(device); });
}
Device* rtcGetSceneDevice(Scene* scene) {
    return called(scene, [&] {
        scene->device->retain();
        return scene->device;
    });
}
Scene* rtcGetSceneTraversable(Scene* scene) {
    return called(scene, [&] { return scene; });
}
unsigned rtcAttachGeometry(Scene* scene, Geometry* geometry) {
    unsigned id = noId;
    called(scene, [&] { id = scene->attach(geometry, noId); });
    return id;
}
void rtcAttachGeometryByID(Scene* scene, Geometry* geometry, unsigned id) {
    called(scene, [&] {
        if (id == noId) throw Error(invalidArgument, "invalid argument");
        scene->attach(geometry, id);
    });
}
void rtcDetachGeometry(Scene* scene, unsigned id) {
    called(scene, [&] { scene->detach(id); });
}
Geometry* rtcGetGeometry(Scene* scene, unsigned id) {
    return called(scene, [&] { return scene->geometry(id); });
}
Geometry* rtcGetGeometryThreadSafe(Scene* scene, unsigned id) { return rtcGetGeometry(scene, id); }
void* rtcGetGeometryUserDataFromScene(Scene* scene, unsigned id) {
    return called(scene, [&]() -> void* {
        const Geometry* const found = scene->geometry(id);
        return found ? found->user : nullptr;
    });
}
void* rtcGetGeometryUserDataFromTraversable(Scene* scene, unsigned id) {
    return rtcGetGeometryUserDataFromScene(scene, id);
}
void rtcCommitScene(Scene* scene) {
    called(scene, [&] { scene->commit(); });
}
void rtcJoinCommitScene(Scene* scene) { rtcCommitScene(scene); }
void rtcSetSceneProgressMonitorFunction(Scene* scene, bool (*progress)(void*, double), void* user) {
    called(scene, [&] {
        scene->progress = progress;
        scene->progressUser = user;
    });
}
void rtcSetSceneFlags(Scene* scene, int flags) {
    called(scene, [&] {
        scene->isModified = scene->isModified || scene->flags != flags;
        scene->flags = flags;
    });
}
int rtcGetSceneFlags(Scene* scene) {
    return called(scene, [&] { return scene->flags; });
}
void rtcSetSceneBuildQuality(Scene* scene, int quality) {
    called(scene, [&] {
        if (quality < 0 || quality > 2) throw Error(unknown, "invalid build quality");
    });
}
void rtcGetSceneBounds(Scene* scene, float* bounds) {
    called(scene, [&] {
        needed(bounds);
        if (scene->isModified) throw Error(invalidOperation, "scene not committed");
        double low[3], high[3];
        const bool isEmpty = colonnade_rays_bounds(scene->committed.rays, low, high) != COLONNADE_RAYS_OK;
        for (int a = 0; a < 3; ++a) {
            bounds[a] = isEmpty ? -occludedEnd : static_cast<float>(low[a]);
            bounds[4 + a] = isEmpty ? occludedEnd : static_cast<float>(high[a]);
        }
        bounds[3] = bounds[7] = 0;
    });
}
void rtcGetSceneLinearBounds(Scene* scene, float* bounds) {
    rtcGetSceneBounds(scene, bounds);
    if (bounds) std::memcpy(bounds + 8, bounds, 8 * sizeof *bounds);
}

// Rays
#define SINGLE(PREFIX) \
    void PREFIX##Intersect1(Scene* scene, char* ray, const QueryArguments* arguments) { \
        trace<1, false>(nullptr, scene, ray, arguments); \
    } \
    void PREFIX##Occluded1(Scene* scene, char* ray, const QueryArguments* arguments) { \
        trace<1, true>(nullptr, scene, ray, arguments); \
    }
#define PACKET(PREFIX, WIDTH) \
    void PREFIX##Intersect##WIDTH(const int* valid, Scene* scene, char* packet, const QueryArguments* arguments) { \
        trace<WIDTH, false>(valid, scene, packet, arguments); \
    } \
    void PREFIX##Occluded##WIDTH(const int* valid, Scene* scene, char* packet, const QueryArguments* arguments) { \
        trace<WIDTH, true>(valid, scene, packet, arguments); \
    }
#define RAYS(PREFIX) SINGLE(PREFIX) PACKET(PREFIX, 4) PACKET(PREFIX, 8) PACKET(PREFIX, 16)
RAYS(rtc)
RAYS(rtcTraversable)

// What is refused, by the argument that is the handle: `first`, `second` or `third`, or null for none. Arguments behind
// it are not read.
#define REFUSED(HANDLE, RESULT, NAME) \
    ssize_t NAME([[maybe_unused]] Object* first, [[maybe_unused]] Object* second, [[maybe_unused]] Object* third) { \
        refuse(HANDLE, #NAME REFUSAL); \
        return RESULT; \
    }
#define REFUSED_FORWARDS(PREFIX, CALL) \
    REFUSED(second, 0, PREFIX##CALL##1) \
    REFUSED(second, 0, PREFIX##CALL##1Ex) \
    REFUSED(third, 0, PREFIX##CALL##4) \
    REFUSED(third, 0, PREFIX##CALL##4Ex) \
    REFUSED(third, 0, PREFIX##CALL##8) \
    REFUSED(third, 0, PREFIX##CALL##8Ex) \
    REFUSED(third, 0, PREFIX##CALL##16) \
    REFUSED(third, 0, PREFIX##CALL##16Ex)
#define REFUSED_RAYS(PREFIX) \
    REFUSED_FORWARDS(PREFIX, ForwardIntersect) \
    REFUSED_FORWARDS(PREFIX, ForwardOccluded) \
    REFUSED(first, 0, PREFIX##PointQuery) \
    REFUSED(second, 0, PREFIX##PointQuery4) \
    REFUSED(second, 0, PREFIX##PointQuery8) \
    REFUSED(second, 0, PREFIX##PointQuery16)
REFUSED_RAYS(rtc)
REFUSED_RAYS(rtcTraversable)
REFUSED(first, 0, rtcCollide)
REFUSED(first, 0, rtcGetGeometryTransform)
REFUSED(first, 0, rtcGetGeometryTransformEx)
REFUSED(first, 0, rtcGetGeometryTransformFromScene)
REFUSED(first, 0, rtcGetGeometryTransformFromTraversable)
REFUSED(first, 0, rtcNewBVH)
REFUSED(first, 0, rtcSetDeviceMemoryMonitorFunction)
REFUSED(first, 0, rtcSetGeometryBoundsFunction)
REFUSED(first, 0, rtcSetGeometryDisplacementFunction)
REFUSED(first, 0, rtcSetGeometryInstancedScene)
REFUSED(first, 0, rtcSetGeometryInstancedScenes)
REFUSED(first, 0, rtcSetGeometryIntersectFunction)
REFUSED(first, 0, rtcSetGeometryMaxRadiusScale)
REFUSED(first, 0, rtcSetGeometryOccludedFunction)
REFUSED(first, 0, rtcSetGeometryPointQueryFunction)
REFUSED(first, 0, rtcSetGeometrySubdivisionMode)
REFUSED(first, 0, rtcSetGeometryTessellationRate)
REFUSED(first, 0, rtcSetGeometryTopologyCount)
REFUSED(first, 0, rtcSetGeometryTransform)
REFUSED(first, 0, rtcSetGeometryTransformQuaternion)
REFUSED(first, 0, rtcSetGeometryUserPrimitiveCount)
REFUSED(first, 0, rtcSetGeometryVertexAttributeTopology)
REFUSED(first, -1, rtcGetGeometryFace)
REFUSED(first, -1, rtcGetGeometryFirstHalfEdge)
REFUSED(first, -1, rtcGetGeometryNextHalfEdge)
REFUSED(first, -1, rtcGetGeometryOppositeHalfEdge)
REFUSED(first, -1, rtcGetGeometryPreviousHalfEdge)
REFUSED(nullptr, 0, rtcBuildBVH)
REFUSED(nullptr, 0, rtcInvokeIntersectFilterFromGeometry)
REFUSED(nullptr, 0, rtcInvokeOccludedFilterFromGeometry)
REFUSED(nullptr, 0, rtcReleaseBVH)
REFUSED(nullptr, 0, rtcRetainBVH)
REFUSED(nullptr, 0, rtcThreadLocalAlloc)
// Their arguments begin with the geometry
ssize_t rtcInterpolate(Object* const* arguments) {
    refuse(arguments ? *arguments : nullptr, "rtcInterpolate" REFUSAL);
    return 0;
}
ssize_t rtcInterpolateN(Object* const* arguments) {
    refuse(arguments ? *arguments : nullptr, "rtcInterpolateN" REFUSAL);
    return 0;
}
}
