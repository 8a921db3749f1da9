// The calls of Embree 4 for triangles, on colonnade_rays.h: a shared library in place of libembree4. COLONNADE_RAYS_DESIGN names
// the design's file. Structures are those of Embree's documented binary interface; other geometries are refused.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "colonnade_rays.h"

namespace {

enum Error { none = 0, invalidArgument = 2, invalidOperation = 3 };
enum BufferType { indexBuffer = 0, vertexBuffer = 1 };

struct Device {
    int references = 1;
    int error = none;
    void (*report)(void*, int, const char*) = nullptr;
    void* user = nullptr;
    colonnade_rays_device* rays = nullptr;

    void fail(int code, const char* text) {
        if (error == none) error = code;
        if (report) report(user, code, text);
    }
    void check(int status) {
        if (status != COLONNADE_RAYS_OK) fail(invalidArgument, colonnade_rays_error(rays));
    }
};

struct Buffer {
    std::vector<char> owned;
    const char* data = nullptr;
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

Device& device(void* handle) { return *static_cast<Device*>(handle); }
Scene& scene(void* handle) { return *static_cast<Scene*>(handle); }
Geometry& geometry(void* handle) { return *static_cast<Geometry*>(handle); }

void release(Geometry* geometry) {
    if (--geometry->references == 0) delete geometry;
}

colonnade_rays_ray rayOf(const RTCRay& r) { return {{r.org[0], r.org[1], r.org[2]}, r.tnear, {r.dir[0], r.dir[1], r.dir[2]}, r.tfar}; }
unsigned modeOf(const RTCRay& ray) { return ray.mask << COLONNADE_RAYS_MASK_SHIFT; }

/// A ray without an interval is not active, and keeps its bytes.
bool isActive(const RTCRay& ray) { return ray.tnear <= ray.tfar && ray.tfar >= 0; }

void intersect(Scene& scene, RTCRayHit& query) {
    if (!isActive(query.ray)) return;
    const colonnade_rays_ray ray = rayOf(query.ray);
    colonnade_rays_hit hit;
    scene.device->check(colonnade_rays_closest(scene.rays, &ray, 1, modeOf(query.ray), &hit));
    if (hit.face == UINT32_MAX) return;
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

void occlude(Scene& scene, RTCRay& query) {
    if (!isActive(query)) return;
    const colonnade_rays_ray ray = rayOf(query);
    std::uint8_t isOccluded = 0;
    scene.device->check(colonnade_rays_occluded(scene.rays, &ray, 1, modeOf(query), &isOccluded));
    if (isOccluded) query.tfar = -std::numeric_limits<float>::infinity();
}

/// Runs a call on the active rays of a packet, whose fields are arrays of `width`: those of a ray, and with `hasHit` of a hit.
template <class Call> void eachOf(const int* valid, char* packet, int width, bool hasHit, const Call& call) {
    for (int lane = 0; lane < width; ++lane) {
        if (valid[lane] == 0) continue;
        RTCRayHit one{};
        const std::size_t words = hasHit ? 20 : 12;
        const auto at = [&](std::size_t word) { return packet + (word * static_cast<std::size_t>(width) + static_cast<std::size_t>(lane)) * 4; };
        auto* const bytes = reinterpret_cast<char*>(&one);
        for (std::size_t word = 0; word < words; ++word) std::memcpy(bytes + 4 * word, at(word), 4);
        call(one);
        for (std::size_t word = 0; word < words; ++word) std::memcpy(at(word), bytes + 4 * word, 4);
    }
}

} // namespace

extern "C" {

void* rtcNewDevice(const char*) {
    const char* const name = std::getenv("COLONNADE_RAYS_DESIGN");
    std::ifstream file(name ? name : "");
    const std::string design((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    auto* const device = new Device;
    if (colonnade_rays_open(design.c_str(), nullptr, &device->rays) == COLONNADE_RAYS_OK) return device;
    std::fprintf(stderr, "colonnade: error: COLONNADE_RAYS_DESIGN: %s\n", colonnade_rays_error(device->rays));
    colonnade_rays_close(device->rays);
    delete device;
    return nullptr;
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
ssize_t rtcGetDeviceProperty(void*, int) { return 0; }
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
    // Masks of the device have 8 bits
    if (mask != 0xffffffff && mask > 0xff) geometry(handle).device->fail(invalidArgument, "a mask has more than 8 bits");
    else geometry(handle).mask = mask;
}
void rtcSetSharedGeometryBuffer(void* handle, int type, unsigned, int, const void* data, std::size_t offset, std::size_t stride, std::size_t count) {
    if (type != indexBuffer && type != vertexBuffer) return geometry(handle).device->fail(invalidArgument, "only indices and vertices");
    geometry(handle).buffers[type] = {{}, static_cast<const char*>(data) + offset, stride, count};
}
void* rtcSetNewGeometryBuffer(void* handle, int type, unsigned slot, int format, std::size_t stride, std::size_t count) {
    std::vector<char> owned(stride * count + 16);
    rtcSetSharedGeometryBuffer(handle, type, slot, format, owned.data(), 0, stride, count);
    if (type != indexBuffer && type != vertexBuffer) return nullptr;
    geometry(handle).buffers[type].owned = std::move(owned);
    return geometry(handle).buffers[type].owned.data();
}

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
void* rtcGetGeometry(void* handle, unsigned id) { return scene(handle).geometries.at(id); }

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
            to.device->check(colonnade_rays_mesh_mask(to.rays, mesh, static_cast<std::uint8_t>(each->mask)));
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

void rtcIntersect1(void* handle, RTCRayHit* query, void*) { intersect(scene(handle), *query); }
void rtcOccluded1(void* handle, RTCRay* query, void*) { occlude(scene(handle), *query); }
#define PACKET(WIDTH) \
    void rtcIntersect##WIDTH(const int* valid, void* handle, char* packet, void*) { \
        eachOf(valid, packet, WIDTH, true, [&](RTCRayHit& one) { intersect(scene(handle), one); }); \
    } \
    void rtcOccluded##WIDTH(const int* valid, void* handle, char* packet, void*) { \
        eachOf(valid, packet, WIDTH, false, [&](RTCRayHit& one) { occlude(scene(handle), one.ray); }); \
    }
PACKET(4)
PACKET(8)
PACKET(16)
}
