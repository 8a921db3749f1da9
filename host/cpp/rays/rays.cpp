// The calls of colonnade_rays.h.
#include <new>

#include "batches.hpp"
#include "order.hpp"

using namespace colonnade;
using namespace colonnade::rays;

struct colonnade_rays_device {
    std::string error;
    std::unique_ptr<Design> design;
    std::unique_ptr<Numbers> numbers;
    colonnade_rays_backend backend{};
    const colonnade_rays_scene* loaded = nullptr;
};

struct colonnade_rays_scene {
    colonnade_rays_device* device;
    std::vector<std::unique_ptr<MeshPart>> meshes;
    std::unique_ptr<PackedScene> packed;
    bool isCommitted = false, isRefined = true;
};

namespace {

/// The status of a call, whose failures become the device's error. Without exceptions a failure ends the module.
template <class Call> int guarded(colonnade_rays_device& device, const Call& call) {
    device.error.clear();
#ifndef __cpp_exceptions
    call();
    return COLONNADE_RAYS_OK;
#else
    try {
        call();
        return COLONNADE_RAYS_OK;
    } catch (const Failure& failure) {
        device.error = failure.what();
        return failure.status;
    } catch (const std::invalid_argument& error) {
        device.error = error.what();
        return COLONNADE_RAYS_BAD_DESIGN;
    } catch (const std::exception&) {
        device.error = "there is not enough memory";
        return COLONNADE_RAYS_NO_MEMORY;
    }
#endif
}

MeshPart& meshOf(colonnade_rays_scene& scene, std::uint32_t mesh) {
    if (mesh >= scene.meshes.size() || !scene.meshes[mesh]) throw Failure(COLONNADE_RAYS_NO_MESH, "the scene has no mesh " + std::to_string(mesh));
    return *scene.meshes[mesh];
}

std::vector<mesh::Vector> verticesOf(const double* vertices, std::size_t count) {
    for (std::size_t i = 0; i < 3 * count; ++i)
        if (!std::isfinite(vertices[i])) throw Failure(COLONNADE_RAYS_BAD_MESH, "vertex " + std::to_string(i / 3) + " is not finite");
    std::vector<mesh::Vector> result(count);
    if (count != 0) std::memcpy(result.data(), vertices, count * sizeof(mesh::Vector));
    return result;
}

/// A change of a scene, which takes effect at the next commit.
template <class Change> int changed(colonnade_rays_scene* scene, const Change& change) {
    return guarded(*scene->device, [&] {
        change();
        scene->isCommitted = false;
    });
}

/// The scene, in the device's memory; null without faces.
PackedScene* loaded(colonnade_rays_scene& scene) {
    if (!scene.isCommitted) throw Failure(COLONNADE_RAYS_NOT_COMMITTED, "the scene has changed: commit it");
    if (scene.packed->isEmpty()) return nullptr;
    if (scene.device->loaded != &scene) {
        const colonnade_rays_backend& backend = scene.device->backend;
        if (const int status = backend.load(backend.context, &scene.packed->image())) throw Failure(status, "the device did not load the scene");
        scene.device->loaded = &scene;
    }
    return scene.packed.get();
}

Batches batchesOf(colonnade_rays_scene& scene, PackedScene& packed) { return {packed, scene.device->backend, *scene.device->numbers, scene.isRefined}; }

void boxOf(const colonnade_rays_scene& scene, mesh::Vector& low, mesh::Vector& high) {
    if (!scene.isCommitted || scene.packed->isEmpty()) throw Failure(COLONNADE_RAYS_NOT_COMMITTED, "the scene has no box: commit it with a face");
    low = high = scene.packed->faces().vertices().front();
    for (const mesh::Vector& vertex : scene.packed->faces().vertices())
        for (int a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], vertex[a]);
            high[a] = std::max(high[a], vertex[a]);
        }
}

} // namespace

int colonnade_rays_open(const char* design, const colonnade_rays_backend* backend, colonnade_rays_device** device) {
    *device = new (std::nothrow) colonnade_rays_device;
    if (!*device) return COLONNADE_RAYS_NO_MEMORY;
    return guarded(**device, [&] {
        (*device)->design = std::make_unique<Design>(design);
        (*device)->numbers = std::make_unique<Numbers>((*device)->design->numbers);
        const Design& from = *(*device)->design;
        (*device)->backend = backend ? *backend : (new Model(*(*device)->numbers, from.number("directionBits"), from.format.layouts))->backend();
    });
}

void colonnade_rays_close(colonnade_rays_device* device) {
    if (device && device->backend.close) device->backend.close(device->backend.context);
    delete device;
}

const char* colonnade_rays_error(const colonnade_rays_device* device) { return device->error.c_str(); }

std::int64_t colonnade_rays_design(const colonnade_rays_device* device, const char* name) {
    const auto found = device->design->numbers.find(name);
    return found == device->design->numbers.end() ? -1 : found->second;
}

void colonnade_rays_counters(const colonnade_rays_device* device, struct colonnade_rays_sums* counters) { device->backend.counters(device->backend.context, counters); }

int colonnade_rays_scene_new(colonnade_rays_device* device, colonnade_rays_scene** scene) {
    return guarded(*device, [&] { *scene = new colonnade_rays_scene{device, {}, nullptr}; });
}

void colonnade_rays_scene_free(colonnade_rays_scene* scene) {
    if (scene && scene->device->loaded == scene) scene->device->loaded = nullptr;
    delete scene;
}

int colonnade_rays_mesh_add(colonnade_rays_scene* scene, const double* vertices, std::size_t vertexCount, const std::uint32_t* faces, std::size_t faceCount,
                            std::uint32_t* mesh) {
    return changed(scene, [&] {
        auto part = std::make_unique<MeshPart>();
        part->vertices = verticesOf(vertices, vertexCount);
        bool hasArea = false;
        for (std::size_t i = 0; i < faceCount; ++i) {
            mesh::Face face;
            for (int corner = 0; corner < 3; ++corner) {
                if (faces[3 * i + corner] >= vertexCount)
                    throw Failure(COLONNADE_RAYS_BAD_MESH,
                                  "face " + std::to_string(i) + " names vertex " + std::to_string(faces[3 * i + corner]) + " of " + std::to_string(vertexCount));
                face[corner] = static_cast<std::int32_t>(faces[3 * i + corner]);
            }
            const mesh::Vector& at = part->vertices[face[0]];
            const mesh::Vector area = mesh::cross(mesh::difference(part->vertices[face[1]], at), mesh::difference(part->vertices[face[2]], at));
            hasArea = hasArea || area[0] != 0 || area[1] != 0 || area[2] != 0;
            part->faces.push_back(face);
        }
        if (!hasArea) throw Failure(COLONNADE_RAYS_BAD_MESH, "no face of the mesh has an area");
        scene->meshes.push_back(std::move(part));
        *mesh = static_cast<std::uint32_t>(scene->meshes.size() - 1);
    });
}

int colonnade_rays_mesh_update(colonnade_rays_scene* scene, std::uint32_t mesh, const double* vertices) {
    return changed(scene, [&] {
        MeshPart& part = meshOf(*scene, mesh);
        part.vertices = verticesOf(vertices, part.vertices.size());
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

int colonnade_rays_mesh_mask(colonnade_rays_scene* scene, std::uint32_t mesh, std::uint8_t mask) {
    return changed(scene, [&] { meshOf(*scene, mesh).mask = mask; });
}

int colonnade_rays_mesh_opacity(colonnade_rays_scene* scene, std::uint32_t mesh, const std::uint8_t* isOpaque) {
    return changed(scene, [&] {
        MeshPart& part = meshOf(*scene, mesh);
        part.isOpaque.clear();
        if (isOpaque) part.isOpaque.assign(isOpaque, isOpaque + part.faces.size());
    });
}

int colonnade_rays_commit(colonnade_rays_scene* scene) {
    return guarded(*scene->device, [&] {
        auto packed = std::make_unique<PackedScene>(*scene->device->design, scene->meshes);
        if (scene->device->loaded == scene) scene->device->loaded = nullptr;
        scene->packed = std::move(packed);
        scene->isCommitted = true;
        loaded(*scene);
    });
}

int colonnade_rays_bounds(const colonnade_rays_scene* scene, double low[3], double high[3]) {
    return guarded(*scene->device, [&] {
        mesh::Vector least, most;
        boxOf(*scene, least, most);
        std::copy(least.begin(), least.end(), low);
        std::copy(most.begin(), most.end(), high);
    });
}

int colonnade_rays_grid(const colonnade_rays_scene* scene, double* unit, double corner[3]) {
    return guarded(*scene->device, [&] {
        mesh::Vector low, high;
        boxOf(*scene, low, high);
        *unit = scene->packed->unit();
        std::copy(scene->packed->corner().begin(), scene->packed->corner().end(), corner);
    });
}

int colonnade_rays_closest(colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count, std::uint32_t mode, colonnade_rays_hit* hits) {
    return guarded(*scene->device, [&] {
        if (PackedScene* const packed = loaded(*scene)) batchesOf(*scene, *packed).closest(rays, count, mode, hits);
        else
            for (std::size_t i = 0; i < count; ++i) hits[i] = {rays[i].tfar, 0, 0, UINT32_MAX, UINT32_MAX, 0, static_cast<std::uint32_t>(i)};
    });
}

int colonnade_rays_occluded(colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count, std::uint32_t mode, std::uint8_t* isOccluded) {
    return guarded(*scene->device, [&] {
        if (PackedScene* const packed = loaded(*scene)) batchesOf(*scene, *packed).occluded(rays, count, mode, isOccluded);
        else std::fill(isOccluded, isOccluded + count, 0);
    });
}

int colonnade_rays_all(colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count, std::uint32_t mode, std::size_t most, colonnade_rays_hit* hits,
                       std::size_t capacity, std::size_t* found) {
    return guarded(*scene->device, [&] {
        PackedScene* const packed = loaded(*scene);
        const std::vector<AppHit> all = packed ? batchesOf(*scene, *packed).all(rays, count, mode, most) : std::vector<AppHit>();
        std::copy(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(all.size(), capacity)), hits);
        *found = all.size();
    });
}

void colonnade_rays_refine(colonnade_rays_scene* scene, int isRefined) { scene->isRefined = isRefined != 0; }

int colonnade_rays_order(const colonnade_rays_scene* scene, const colonnade_rays_ray* rays, std::size_t count, std::uint32_t* order) {
    return guarded(*scene->device, [&] {
        mesh::Vector low, high;
        boxOf(*scene, low, high);
        orderOf(low, high, rays, count, order);
    });
}

int colonnade_rays_submit(colonnade_rays_scene* scene, const colonnade_rays_batch* batch) {
    return guarded(*scene->device, [&] {
        const colonnade_rays_backend& backend = scene->device->backend;
        if (!loaded(*scene)) throw Failure(COLONNADE_RAYS_NOT_COMMITTED, "the scene has no face");
        if (const int status = backend.submit(backend.context, batch)) throw Failure(status, "the batch is misaligned, empty, too long, or of an unknown mode");
    });
}

int colonnade_rays_wait(colonnade_rays_scene* scene) {
    return guarded(*scene->device, [&] {
        const colonnade_rays_backend& backend = scene->device->backend;
        if (const int status = backend.wait(backend.context)) throw Failure(status, "the device met an illegal record, or its stack overflowed: the hits are not valid");
    });
}

int colonnade_rays_face(const colonnade_rays_scene* scene, std::uint32_t id, std::uint32_t* mesh, std::uint32_t* face) {
    return guarded(*scene->device, [&] {
        const std::size_t at = scene->isCommitted ? scene->packed->faceOfId(id & ~(COLONNADE_RAYS_BACK_SIDE | COLONNADE_RAYS_NON_OPAQUE)) : ~std::size_t{0};
        if (at == ~std::size_t{0}) throw Failure(COLONNADE_RAYS_NO_MESH, "this id is that of no triangle");
        *mesh = scene->packed->meshOf(at);
        *face = scene->packed->faceOf(at);
    });
}
