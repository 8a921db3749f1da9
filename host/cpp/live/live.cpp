#include "live.h"

#include <cmath>

#include "plane_map.hpp"
#include "vector_map.hpp"

using namespace colonnade::live;

struct colonnade_live {
    colonnade_live(const VectorSizes& sizes, const colonnade_live_sizes& all)
        : albedo(sizes), normals(sizes), planes(all.width, all.height, sizes.columns, sizes.rows, all.planes,
                                                all.plane_heap_words, all.bounding_planes) {}
    VectorMap<ColourFields> albedo;
    VectorMap<NormalFields> normals;
    PlaneMap planes;
    ColourFields fields;
    bool isWarm = false;
};

colonnade_live* colonnade_live_create(const colonnade_live_sizes* sizes) {
    const auto isWithin = [](std::int32_t value, std::int32_t low, std::int32_t high) {
        return value >= low && value <= high;
    };
    if (!isWithin(sizes->width, 1, 4096) || !isWithin(sizes->height, 1, 4096) ||
        !isWithin(sizes->palette_size, 4, 256) || !isWithin(sizes->heap_words, 0, 8192) ||
        !isWithin(sizes->planes, 2, 128) || !isWithin(sizes->plane_heap_words, 0, 8192) ||
        !isWithin(sizes->bounding_planes, 1, 16))
        return nullptr;
    return new colonnade_live(
        {(sizes->width + 15) / 16, (sizes->height + 15) / 16, 16, sizes->palette_size, sizes->heap_words}, *sizes);
}

void colonnade_live_destroy(colonnade_live* live) { delete live; }

void colonnade_live_encode(colonnade_live* live, const colonnade_live_frame* frame, colonnade_live_maps* maps) {
    Camera camera{frame->fx, frame->fy, frame->cx, frame->cy, {}};
    std::copy(frame->to_world, frame->to_world + 12, camera.toWorld);
    if (live->isWarm) {
        const Motion motion = Motion::between(live->planes.camera(), camera);
        std::int32_t rotation[9];
        for (int i = 0; i < 9; ++i)
            rotation[i] = static_cast<std::int32_t>(std::floor(motion.rotation[i] * 16384 + 0.5));
        live->normals.rotate(rotation);
    }
    live->albedo.encode(frame->albedo, maps->albedo.descriptors, maps->albedo.palette, maps->albedo.heap);
    live->normals.encode(frame->normals, maps->normals.descriptors, maps->normals.palette, maps->normals.heap);
    PlaneOutput output{maps->plane_descriptors, maps->planes,       maps->plane_heap,    maps->bounding,
                       maps->tile_error,        maps->tile_nearest, maps->tile_furthest, 0};
    live->planes.encode(frame->depth, frame->albedo, live->fields, camera, frame->tolerance, output);
    maps->depth_unit = output.depthUnit;
    live->isWarm = true;
}
