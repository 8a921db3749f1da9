// The calls of Embree 4 for triangles: a shared library in place of libembree4, on the device that the environment names. Other geometries,
// instances and motion are refused.
#include <memory>
#include <string>

#include "embree.hpp"

using namespace colonnade::rays::embree;

namespace {

/// Runs a call on the active rays of a packet, whose fields are arrays of `width`: those of a ray, and with `hasHit` of a hit.
template <class Call> void ofPacket(const int* valid, char* packet, int width, bool hasHit, const Call& call) {
    const std::size_t words = hasHit ? 20 : 12;
    RTCRayHit queries[packetRays]{};
    int lanes[packetRays];
    std::size_t count = 0;
    const auto at = [&](int lane, std::size_t word) { return packet + (word * static_cast<std::size_t>(width) + static_cast<std::size_t>(lane)) * 4; };
    const auto bytes = [&](std::size_t i) { return reinterpret_cast<char*>(&queries[i]); };
    for (int lane = 0; lane < width; ++lane) {
        if (valid[lane] == 0) continue;
        for (std::size_t word = 0; word < words; ++word) std::memcpy(bytes(count) + 4 * word, at(lane, word), 4);
        lanes[count++] = lane;
    }
    call(queries, count);
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t word = 0; word < words; ++word) std::memcpy(at(lanes[i], word), bytes(i) + 4 * word, 4);
}

} // namespace

extern "C" {

void* rtcNewDevice(const char*) {
    auto device = std::make_unique<Device>();
    return colonnade_rays_open_environment(&device->rays) == COLONNADE_RAYS_OK ? device.release() : nullptr;
}
void rtcRetainDevice(void* handle) { ++device(handle).references; }
void rtcReleaseDevice(void* handle) {
    if (--device(handle).references != 0) return;
    colonnade_rays_close(device(handle).rays);
    delete &device(handle);
}
void rtcSetDeviceErrorFunction(void* handle, void (*report)(void*, int, const char*), void* user) {
    device(handle).report = report;
    device(handle).user = user;
}
int rtcGetDeviceError(void* handle) {
    if (!handle) return none;
    const int error = device(handle).error;
    device(handle).error = none;
    return error;
}
ssize_t rtcGetDeviceProperty(void*, int property) {
    // Ray masks, filters, rays that are not finite, triangles
    return property == 64 || property == 66 || property == 67 || property == 96;
}
void rtcSetDeviceProperty(void*, int, ssize_t) {}

void* rtcNewScene(void* handle) {
    ++device(handle).references;
    return new Scene(&device(handle));
}
void rtcRetainScene(void* handle) { ++scene(handle).references; }
void rtcReleaseScene(void* handle) {
    Scene& from = scene(handle);
    if (--from.references != 0) return;
    for (const auto& [id, each] : from.geometries) release(each);
    colonnade_rays_scene_free(from.rays);
    rtcReleaseDevice(from.device);
    delete &from;
}
void rtcSetSceneFlags(void*, int) {}
int rtcGetSceneFlags(void*) { return 0; }
void rtcSetSceneBuildQuality(void*, int) {}

void* rtcNewGeometry(void* handle, int type) {
    if (type == 0) return new Geometry(&device(handle));
    device(handle).fail(invalidOperation, "only triangles");
    return nullptr;
}
void rtcRetainGeometry(void* handle) { ++geometry(handle).references; }
void rtcReleaseGeometry(void* handle) { release(&geometry(handle)); }
void rtcCommitGeometry(void*) {}
void rtcSetGeometryBuildQuality(void*, int) {}
void rtcUpdateGeometryBuffer(void*, int, unsigned) {}
void rtcEnableGeometry(void* handle) { geometry(handle).isEnabled = true; }
void rtcDisableGeometry(void* handle) { geometry(handle).isEnabled = false; }
void rtcSetGeometryUserData(void* handle, void* user) { geometry(handle).user = user; }
void* rtcGetGeometryUserData(void* handle) { return geometry(handle).user; }
void rtcSetGeometryMask(void* handle, unsigned mask) {
    geometry(handle).mask = mask;
}
void rtcSetSharedGeometryBuffer(void* handle, int type, unsigned slot, int format, void* data, std::size_t offset, std::size_t stride, std::size_t count) {
    Device& device = *geometry(handle).device;
    if ((type != indexBuffer && type != vertexBuffer) || format != formats[type]) return device.fail(invalidArgument, "only indices, uint3, and vertices, float3");
    if (slot != 0 || offset % 4 != 0 || stride % 4 != 0) return device.fail(invalidOperation, "only slot 0, and offset and stride in whole words");
    geometry(handle).buffers[type] = {{}, static_cast<char*>(data) + offset, stride, count};
}
void* rtcSetNewGeometryBuffer(void* handle, int type, unsigned slot, int format, std::size_t stride, std::size_t count) {
    std::vector<char> owned(stride * count + 16);
    char* const data = owned.data();
    rtcSetSharedGeometryBuffer(handle, type, slot, format, data, 0, stride, count);
    if ((type != indexBuffer && type != vertexBuffer) || geometry(handle).buffers[type].data != data) return nullptr;
    geometry(handle).buffers[type].owned = std::move(owned);
    return data;
}
void* rtcGetGeometryBufferData(void* handle, int type, unsigned slot) {
    return slot == 0 && (type == indexBuffer || type == vertexBuffer) ? geometry(handle).buffers[type].data : nullptr;
}
void rtcSetGeometryTimeStepCount(void* handle, unsigned count) {
    if (count != 1) geometry(handle).device->fail(invalidOperation, "only geometries without motion");
}
void rtcSetGeometryIntersectFilterFunction(void* handle, Filter filter) { geometry(handle).filters[0] = filter; }
void rtcSetGeometryOccludedFilterFunction(void* handle, Filter filter) { geometry(handle).filters[1] = filter; }
void rtcSetGeometryEnableFilterFunctionFromArguments(void* handle, bool isEnabled) { geometry(handle).takesArgumentFilter = isEnabled; }

unsigned rtcAttachGeometry(void* handle, void* attached) {
    unsigned id = 0;
    while (scene(handle).geometries.count(id)) ++id;
    ++geometry(attached).references;
    scene(handle).geometries[id] = &geometry(attached);
    return id;
}
void rtcDetachGeometry(void* handle, unsigned id) {
    const auto found = scene(handle).geometries.find(id);
    if (found == scene(handle).geometries.end()) return scene(handle).device->fail(invalidArgument, "the scene has no such geometry");
    release(found->second);
    scene(handle).geometries.erase(found);
}
void* rtcGetGeometry(void* handle, unsigned id) {
    const auto found = scene(handle).geometries.find(id);
    return found == scene(handle).geometries.end() ? nullptr : found->second;
}

void rtcCommitScene(void* handle) {
    Scene& to = scene(handle);
    colonnade_rays_scene_free(to.rays);
    to.device->check(colonnade_rays_scene_new(to.device->rays, &to.rays));
    to.ids.clear();
    to.vertices.clear();
    to.faces.clear();
    for (const auto& [id, each] : to.geometries) {
        if (!each->isEnabled || each->buffers[indexBuffer].count == 0) continue;
        const std::vector<float> vertices = each->rows<float>(vertexBuffer);
        to.vertices.emplace_back(vertices.begin(), vertices.end());
        to.faces.push_back(each->rows<std::uint32_t>(indexBuffer));
        std::uint32_t mesh;
        const int status = colonnade_rays_mesh_add(to.rays, to.vertices.back().data(), vertices.size() / 3, to.faces.back().data(), to.faces.back().size() / 3, &mesh);
        if (status == COLONNADE_RAYS_OK) {
            to.ids.push_back(id);
            to.device->check(colonnade_rays_mesh_mask(to.rays, mesh, each->mask));
            continue;
        }
        to.device->check(status);
        to.vertices.pop_back();
        to.faces.pop_back();
    }
    to.device->check(colonnade_rays_commit(to.rays));
}
void rtcJoinCommitScene(void* handle) { rtcCommitScene(handle); }
void rtcGetSceneBounds(void* handle, float* bounds) {
    double low[3], high[3];
    const bool isEmpty = colonnade_rays_bounds(scene(handle).rays, low, high) != COLONNADE_RAYS_OK;
    const float infinity = std::numeric_limits<float>::infinity();
    for (int a = 0; a < 3; ++a) {
        bounds[a] = isEmpty ? infinity : static_cast<float>(low[a]);
        bounds[4 + a] = isEmpty ? -infinity : static_cast<float>(high[a]);
    }
}

void rtcGetSceneLinearBounds(void* handle, float* bounds) {
    rtcGetSceneBounds(handle, bounds);
    std::memcpy(bounds + 8, bounds, 8 * sizeof(float));
}

void rtcIntersect1(void* handle, RTCRayHit* query, const QueryArguments* arguments) { intersect(scene(handle), query, 1, arguments); }
void rtcOccluded1(void* handle, RTCRay* ray, const QueryArguments* arguments) {
    RTCRayHit query{*ray, {}};
    occlude(scene(handle), &query, 1, arguments);
    *ray = query.ray;
}
#define PACKET(WIDTH) \
    void rtcIntersect##WIDTH(const int* valid, void* handle, char* packet, const QueryArguments* arguments) { \
        ofPacket(valid, packet, WIDTH, true, [&](RTCRayHit* queries, std::size_t count) { intersect(scene(handle), queries, count, arguments); }); \
    } \
    void rtcOccluded##WIDTH(const int* valid, void* handle, char* packet, const QueryArguments* arguments) { \
        ofPacket(valid, packet, WIDTH, false, [&](RTCRayHit* queries, std::size_t count) { occlude(scene(handle), queries, count, arguments); }); \
    }
PACKET(4)
PACKET(8)
PACKET(16)
}
