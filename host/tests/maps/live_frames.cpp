// Encodes the frames of standard input with the live encoder, and writes all that it returns to standard output. Input:
// the sizes as int32, then for each frame its maps, and lens, pose and tolerance as float64.
#include <cstdint>
#include <cstdio>
#include <vector>

#include "live/live.h"

namespace {

template <class T> bool get(std::vector<T>& values) {
    return std::fread(values.data(), sizeof(T), values.size(), stdin) == values.size();
}
template <class T> void put(const std::vector<T>& values) {
    std::fwrite(values.data(), sizeof(T), values.size(), stdout);
}

} // namespace

int main() {
    std::vector<std::int32_t> s(7);
    if (!get(s)) return 1;
    const colonnade_live_sizes sizes{s[0], s[1], s[2], s[3], s[4], s[5], s[6]};
    colonnade_live* live = colonnade_live_create(&sizes);
    if (live == nullptr) return 1;
    const std::size_t tiles = static_cast<std::size_t>((s[0] + 15) / 16) * ((s[1] + 15) / 16), pixels = 256 * tiles;
    std::vector<std::uint8_t> albedo(3 * pixels), normals(3 * pixels);
    std::vector<std::uint32_t> depth(pixels);
    std::vector<double> camera(4 + 12 + 1);
    while (get(albedo) && get(normals) && get(depth) && get(camera)) {
        colonnade_live_frame frame{albedo.data(), normals.data(), depth.data(), camera[0], camera[1],
                                   camera[2],     camera[3],      {},           camera[16]};
        for (int i = 0; i < 12; ++i) frame.to_world[i] = camera[4 + i];
        std::vector<std::uint32_t> descriptors[2] = {std::vector<std::uint32_t>(tiles),
                                                     std::vector<std::uint32_t>(tiles)};
        std::vector<std::uint64_t> palettes[2] = {std::vector<std::uint64_t>(s[2]), std::vector<std::uint64_t>(s[2])};
        std::vector<std::uint16_t> heaps[2] = {std::vector<std::uint16_t>(s[3]), std::vector<std::uint16_t>(s[3])};
        std::vector<std::uint16_t> planeDescriptors(tiles), planeHeap(s[5]);
        std::vector<std::uint64_t> planes(s[4]), bounding(3 * s[6]);
        std::vector<float> error(tiles), nearest(tiles), furthest(tiles);
        colonnade_live_maps maps{{descriptors[0].data(), palettes[0].data(), heaps[0].data()},
                                 {descriptors[1].data(), palettes[1].data(), heaps[1].data()},
                                 planeDescriptors.data(),
                                 planes.data(),
                                 planeHeap.data(),
                                 bounding.data(),
                                 error.data(),
                                 nearest.data(),
                                 furthest.data(),
                                 0};
        colonnade_live_encode(live, &frame, &maps);
        for (int map = 0; map < 2; ++map) {
            put(descriptors[map]);
            put(palettes[map]);
            put(heaps[map]);
        }
        put(planeDescriptors);
        put(planes);
        put(planeHeap);
        put(bounding);
        put(error);
        put(nearest);
        put(furthest);
        put(std::vector<double>{maps.depth_unit});
    }
    colonnade_live_destroy(live);
}
