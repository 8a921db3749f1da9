// The calls of colonnade_rays.h.
#include <new>
#include <utility>

#include "batches.hpp"
#include "builtin_designs.hpp"
#include "order.hpp"
#include "traffic.hpp"

using namespace colonnade;
using namespace colonnade::rays;

struct colonnade_rays_device {
    std::vector<std::unique_ptr<Design>> designs; ///< from coarse to fine
    std::optional<colonnade_rays_backend> backend; ///< none: the model
    std::mutex calls;                              ///< of the backend
    const colonnade_rays_scene* loaded = nullptr;  ///< in the backend
    Sums sums;                                     ///< of the model
    bool hasFailed = false;                        ///< a batch of the model, until it is waited for
};

struct colonnade_rays_scene {
    colonnade_rays_device* device;
    std::vector<std::unique_ptr<MeshPart>> meshes;
    std::unique_ptr<PackedScene> packed;
    bool isCommitted = false, isRefined = true;
};

namespace {

/// What the thread's last call failed of.
thread_local std::string errorText;

/// The status of a call, whose failures become the thread's error. Without exceptions a failure ends the module.
template <class Call> int guarded(const Call& call) {
    errorText.clear();
#ifndef __cpp_exceptions
    call();
    return COLONNADE_RAYS_OK;
#else
    try {
        call();
        return COLONNADE_RAYS_OK;
    } catch (const Failure& failure) {
        errorText = failure.what();
        return failure.status;
    } catch (const std::invalid_argument& error) {
        errorText = error.what();
        return COLONNADE_RAYS_BAD_DESIGN;
    } catch (const std::exception&) {
        errorText = "there is not enough memory";
        return COLONNADE_RAYS_NO_MEMORY;
    }
#endif
}

MeshPart& meshOf(colonnade_rays_scene& scene, std::uint32_t mesh) {
    if (mesh >= scene.meshes.size() || !scene.meshes[mesh])
        throw Failure(COLONNADE_RAYS_NO_MESH, "the scene has no mesh " + std::to_string(mesh));
    return *scene.meshes[mesh];
}

std::vector<mesh::Vector> verticesOf(const double* vertices, std::size_t count) {
    for (std::size_t i = 0; i < 3 * count; ++i)
        if (!std::isfinite(vertices[i]))
            throw Failure(COLONNADE_RAYS_BAD_MESH, "vertex " + std::to_string(i / 3) + " is not finite");
    std::vector<mesh::Vector> result(count);
    if (count != 0) std::memcpy(result.data(), vertices, count * sizeof(mesh::Vector));
    return result;
}

void checkCount(const char* what, std::size_t given, std::size_t has) {
    if (given != has)
        throw Failure(COLONNADE_RAYS_BAD_MESH,
                      "the mesh has " + std::to_string(has) + " " + what + ", " + std::to_string(given) + " are given");
}

void checkMode(std::uint32_t mode) {
    if (mode & ~(COLONNADE_RAYS_CULL_FRONT | COLONNADE_RAYS_CULL_BACK | COLONNADE_RAYS_OPAQUE_ONLY))
        throw Failure(COLONNADE_RAYS_BAD_BATCH,
                      "a mode has other bits than those of CULL_FRONT, CULL_BACK and OPAQUE_ONLY");
}

/// A change of a scene, which takes effect at the next commit.
template <class Change> int changed(colonnade_rays_scene* scene, const Change& change) {
    return guarded([&] {
        change();
        scene->isCommitted = false;
    });
}

/// Loads a scene into the device's memory, unless it is there.
void load(const colonnade_rays_scene& scene) {
    colonnade_rays_device& device = *scene.device;
    if (device.loaded == &scene) return;
    if (const int status = device.backend->load(device.backend->context, &scene.packed->image()))
        throw Failure(status, "the device did not load the scene");
    device.loaded = &scene;
}

/// Forgets what the device's memory has of a scene.
void unload(const colonnade_rays_scene& scene) {
    const std::lock_guard<std::mutex> lock(scene.device->calls);
    if (scene.device->loaded == &scene) scene.device->loaded = nullptr;
}

void checkCommitted(const colonnade_rays_scene& scene) {
    if (!scene.isCommitted) throw Failure(COLONNADE_RAYS_NOT_COMMITTED, "the scene has changed: commit it");
}

/// Calls `call` with the rays of a scene; not without faces. On a device, whose memory has the scene then, one thread's
/// at a time.
template <class Call> void withBatches(colonnade_rays_scene& scene, const Call& call) {
    checkCommitted(scene);
    if (scene.packed->isEmpty()) return;
    colonnade_rays_device& device = *scene.device;
    if (!device.backend) return call(Batches(*scene.packed, nullptr, device.sums, scene.isRefined));
    const std::lock_guard<std::mutex> lock(device.calls);
    load(scene);
    call(Batches(*scene.packed, &*device.backend, device.sums, scene.isRefined));
}

/// The box of the vertices.
void boxOf(const colonnade_rays_scene& scene, mesh::Vector& low, mesh::Vector& high) {
    if (!scene.isCommitted || scene.packed->isEmpty())
        throw Failure(COLONNADE_RAYS_NOT_COMMITTED, "the scene has no box: commit it with a face");
    low = high = scene.packed->faces().vertices().front();
    for (const mesh::Vector& vertex : scene.packed->faces().vertices())
        for (int a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], vertex[a]);
            high[a] = std::max(high[a], vertex[a]);
        }
}

} // namespace

std::vector<std::vector<std::uint32_t>> colonnade::rays::readsOf(const colonnade_rays_scene& scene,
                                                                 const colonnade_rays_ray* rays, std::size_t count,
                                                                 std::uint32_t mode, std::uint32_t mask,
                                                                 bool isOcclusion) {
    checkCommitted(scene);
    if (scene.device->backend) throw std::invalid_argument("the traffic is that of the model");
    if (scene.packed->isEmpty()) return std::vector<std::vector<std::uint32_t>>(count);
    return Batches(*scene.packed, nullptr, scene.device->sums, scene.isRefined)
        .reads(rays, count, mode, mask, isOcclusion);
}

int colonnade_rays_open(const char* design, const colonnade_rays_backend* backend, colonnade_rays_device** device) {
    *device = new (std::nothrow) colonnade_rays_device;
    if (!*device) return COLONNADE_RAYS_NO_MEMORY;
    return guarded([&] {
        // A device has one design: its hardware's
        std::vector<const char*> texts{design ? design : edgeDesign};
        if (!design && !backend) texts.push_back(fineDesign);
        for (const char* const text : texts) {
            (*device)->designs.push_back(std::make_unique<Design>(text));
            const Numbers numbers((*device)->designs.back()->numbers); // It has all of them
        }
        if (backend) (*device)->backend = *backend;
    });
}

void colonnade_rays_close(colonnade_rays_device* device) {
    if (device && device->backend && device->backend->close) device->backend->close(device->backend->context);
    delete device;
}

const char* colonnade_rays_error(const colonnade_rays_device*) { return errorText.c_str(); }

std::int64_t colonnade_rays_design(const colonnade_rays_device* device, const char* name) {
    const auto& numbers = device->designs.front()->numbers;
    const auto found = numbers.find(name);
    return found == numbers.end() ? -1 : found->second;
}

void colonnade_rays_counters(const colonnade_rays_device* device, struct colonnade_rays_sums* counters) {
    if (device->backend) device->backend->counters(device->backend->context, counters);
    else *counters = device->sums.total();
}

int colonnade_rays_scene_new(colonnade_rays_device* device, colonnade_rays_scene** scene) {
    return guarded([&] { *scene = new colonnade_rays_scene{device, {}, nullptr}; });
}

void colonnade_rays_scene_free(colonnade_rays_scene* scene) {
    if (scene) unload(*scene);
    delete scene;
}

int colonnade_rays_mesh_add(colonnade_rays_scene* scene, const double* vertices, std::size_t vertexCount,
                            const std::uint32_t* faces, std::size_t faceCount, std::uint32_t* mesh) {
    return changed(scene, [&] {
        auto part = std::make_unique<MeshPart>();
        part->vertices = verticesOf(vertices, vertexCount);
        bool hasArea = false;
        for (std::size_t i = 0; i < faceCount; ++i) {
            mesh::Face face;
            for (int corner = 0; corner < 3; ++corner) {
                if (faces[3 * i + corner] >= vertexCount)
                    throw Failure(COLONNADE_RAYS_BAD_MESH, "face " + std::to_string(i) + " names vertex " +
                                                               std::to_string(faces[3 * i + corner]) + " of " +
                                                               std::to_string(vertexCount));
                face[corner] = static_cast<std::int32_t>(faces[3 * i + corner]);
            }
            const mesh::Vector& at = part->vertices[face[0]];
            const mesh::Vector area = mesh::cross(mesh::difference(part->vertices[face[1]], at),
                                                  mesh::difference(part->vertices[face[2]], at));
            hasArea = hasArea || area[0] != 0 || area[1] != 0 || area[2] != 0;
            part->faces.push_back(face);
        }
        if (!hasArea) throw Failure(COLONNADE_RAYS_BAD_MESH, "no face of the mesh has an area");
        scene->meshes.push_back(std::move(part));
        *mesh = static_cast<std::uint32_t>(scene->meshes.size() - 1);
    });
}

int colonnade_rays_mesh_update(colonnade_rays_scene* scene, std::uint32_t mesh, const double* vertices,
                               std::size_t vertexCount) {
    return changed(scene, [&] {
        MeshPart& part = meshOf(*scene, mesh);
        checkCount("vertices", vertexCount, part.vertices.size());
        part.vertices = verticesOf(vertices, vertexCount);
    });
}

int colonnade_rays_mesh_remove(colonnade_rays_scene* scene, std::uint32_t mesh) {
    return changed(scene, [&] {
        meshOf(*scene, mesh);
        scene->meshes[mesh].reset();
    });
}

int colonnade_rays_mesh_enable(colonnade_rays_scene* scene, std::uint32_t mesh, int isEnabled) {
    return changed(scene, [&] { meshOf(*scene, mesh).isEnabled = isEnabled != 0; });
}

int colonnade_rays_mesh_mask(colonnade_rays_scene* scene, std::uint32_t mesh, std::uint32_t mask) {
    return changed(scene, [&] { meshOf(*scene, mesh).mask = mask; });
}

int colonnade_rays_mesh_opacity(colonnade_rays_scene* scene, std::uint32_t mesh, const std::uint8_t* isOpaque,
                                std::size_t faceCount) {
    return changed(scene, [&] {
        MeshPart& part = meshOf(*scene, mesh);
        if (isOpaque) checkCount("faces", faceCount, part.faces.size());
        part.isOpaque.assign(isOpaque, isOpaque + (isOpaque ? faceCount : 0));
    });
}

int colonnade_rays_commit(colonnade_rays_scene* scene) {
    return guarded([&] {
        colonnade_rays_device& device = *scene->device;
        std::unique_ptr<PackedScene> packed;
        std::string tooCoarse;
        for (const auto& design : device.designs) {
            packed = std::make_unique<PackedScene>(*design, scene->meshes);
            tooCoarse = packed->whyTooCoarse(&design != &device.designs.back());
            if (tooCoarse.empty()) break;
        }
        if (!tooCoarse.empty()) throw Failure(COLONNADE_RAYS_BAD_MESH, tooCoarse);
        packed->pack(!device.backend);
        unload(*scene);
        scene->packed = std::move(packed);
        scene->isCommitted = true;
        if (!device.backend || scene->packed->isEmpty()) return;
        const std::lock_guard<std::mutex> lock(device.calls);
        load(*scene);
    });
}

int colonnade_rays_dropped(const colonnade_rays_scene* scene, std::size_t* faces) {
    return guarded([&] {
        checkCommitted(*scene);
        *faces = scene->packed->dropped();
    });
}

int colonnade_rays_bounds(const colonnade_rays_scene* scene, double low[3], double high[3]) {
    return guarded([&] {
        mesh::Vector least, most;
        boxOf(*scene, least, most);
        std::copy(least.begin(), least.end(), low);
        std::copy(most.begin(), most.end(), high);
    });
}

int colonnade_rays_grid(const colonnade_rays_scene* scene, double* unit, double corner[3]) {
    return guarded([&] {
        mesh::Vector low, high;
        boxOf(*scene, low, high);
        *unit = scene->packed->unit();
        std::copy(scene->packed->corner().begin(), scene->packed->corner().end(), corner);
    });
}

int colonnade_rays_closest(colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count,
                           std::uint32_t mode, std::uint32_t mask, colonnade_rays_hit* hits) {
    return guarded([&] {
        checkMode(mode);
        bool isEmpty = true;
        withBatches(*scene, [&](const Batches& batches) {
            isEmpty = false;
            batches.closest(rays, count, mode, mask, hits);
        });
        for (std::size_t i = 0; isEmpty && i < count; ++i) hits[i] = Batches::missOf(rays[i], i);
    });
}

int colonnade_rays_occluded(colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count,
                            std::uint32_t mode, std::uint32_t mask, std::uint8_t* isOccluded) {
    return guarded([&] {
        checkMode(mode);
        std::fill(isOccluded, isOccluded + count, 0);
        withBatches(*scene, [&](const Batches& batches) { batches.occluded(rays, count, mode, mask, isOccluded); });
    });
}

int colonnade_rays_all(colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count,
                       std::uint32_t mode, std::uint32_t mask, std::size_t most, colonnade_rays_hit* hits,
                       std::size_t capacity, std::size_t* found) {
    return guarded([&] {
        checkMode(mode);
        std::vector<AppHit> all;
        withBatches(*scene, [&](const Batches& batches) { all = batches.all(rays, count, mode, mask, most); });
        std::copy(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(all.size(), capacity)), hits);
        *found = all.size();
    });
}

void colonnade_rays_refine(colonnade_rays_scene* scene, int isRefined) { scene->isRefined = isRefined != 0; }

int colonnade_rays_order(const colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count,
                         std::uint32_t* order) {
    return guarded([&] {
        mesh::Vector low, high;
        boxOf(*scene, low, high);
        orderOf(low, high, rays, count, order);
    });
}

int colonnade_rays_submit(colonnade_rays_scene* scene, const colonnade_rays_batch* batch) {
    return guarded([&] {
        checkCommitted(*scene);
        if (scene->packed->isEmpty()) throw Failure(COLONNADE_RAYS_NOT_COMMITTED, "the scene has no face");
        colonnade_rays_device& device = *scene->device;
        const std::lock_guard<std::mutex> lock(device.calls);
        if (device.backend) load(*scene);
        const int status = device.backend ? device.backend->submit(device.backend->context, batch)
                                          : scene->packed->model()->run(*batch, device.sums);
        // Of the model a batch ends before the call
        if (!device.backend && status == COLONNADE_RAYS_DEVICE) device.hasFailed = true;
        else if (status != COLONNADE_RAYS_OK)
            throw Failure(status, "the batch is misaligned, empty, too long, or of an unknown mode");
    });
}

int colonnade_rays_wait(colonnade_rays_scene* scene) {
    return guarded([&] {
        colonnade_rays_device& device = *scene->device;
        const std::lock_guard<std::mutex> lock(device.calls);
        const bool hasFailed = std::exchange(device.hasFailed, false);
        const int status = device.backend ? device.backend->wait(device.backend->context)
                           : hasFailed    ? COLONNADE_RAYS_DEVICE
                                          : COLONNADE_RAYS_OK;
        if (status != COLONNADE_RAYS_OK)
            throw Failure(status, "the device met an illegal record, or its stack overflowed: the hits are not valid");
    });
}

int colonnade_rays_face(const colonnade_rays_scene* scene, std::uint32_t id, std::uint32_t* mesh, std::uint32_t* face) {
    return guarded([&] {
        const std::size_t at =
            scene->isCommitted ? scene->packed->faceOfId(id & ~(COLONNADE_RAYS_BACK_SIDE | COLONNADE_RAYS_NON_OPAQUE))
                               : ~std::size_t{0};
        if (at == ~std::size_t{0}) throw Failure(COLONNADE_RAYS_NO_MESH, "this id is that of no triangle");
        *mesh = scene->packed->meshOf(at);
        *face = scene->packed->faceOf(at);
    });
}
