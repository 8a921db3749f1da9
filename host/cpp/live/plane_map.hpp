/// Encodes the plane map and the bounding planes from frame to frame.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "blocks.hpp"
#include "palette.hpp"
#include "plane_tiles.hpp"
#include "planes.hpp"
#include "regions.hpp"

namespace colonnade::live {

/// The memories of the planes, and what a frame's registers need of each tile.
struct PlaneOutput {
    std::uint16_t* descriptors;
    std::uint64_t* planes;
    std::uint16_t* heap;
    std::uint64_t* bounding;
    /// Of each tile, metres: 90th percentile of the errors along the view rays, of 8×8 pixels; least and largest depth.
    float *errors, *nearest, *furthest;
    double depthUnit;
};

class PlaneMap {
public:
    PlaneMap(int width, int height, int columns, int rows, int planes, int heapWords, int boundingPlanes)
        : planes_(planes), boundingPlanes_(boundingPlanes), blocks_(width, height, columns, rows),
          regions_(std::min(planes - 1, maxPlanes - 1), columns, rows), tiles_(columns, rows, heapWords),
          near_(static_cast<std::size_t>(columns) * rows) {}

    /// Encodes a frame: depth in steps of 2^-16 m, colours of three bytes a pixel in sRGB.
    void encode(const std::uint32_t* depth, const std::uint8_t* colours, const ColourFields& fields,
                const Camera& camera, double toleranceMetres, PlaneOutput& output) {
        const std::int64_t tolerance =
            std::max<std::int64_t>(1, static_cast<std::int64_t>(toleranceMetres * (1 << errorBits)));
        const double unitBefore = blocks_.unit();
        blocks_.read(depth, camera);
        if (isWarm_) move(camera, unitBefore);
        regions_.find(blocks_, tolerance, near_, table_);
        // From here on, the planes are the words'
        std::fill(output.planes, output.planes + planes_, std::uint64_t{0});
        for (int id = 0; id < planes_ - 1; ++id) {
            if (table_.area[id] > 0) output.planes[id] = planeWord(table_.planes[id]);
            else table_.planes[id] = Plane{};
        }
        tiles_.choose(blocks_, regions_.labels(), table_, tolerance, output.descriptors, output.heap);
        remember();
        measure(output);
        bound(colours, fields, camera, output);
        output.depthUnit = blocks_.unit();
        camera_ = camera;
        isWarm_ = true;
    }

    const Camera& camera() const { return camera_; }

private:
    /// The planes of the frame before in this camera's view.
    void move(const Camera& camera, double unitBefore) {
        const Motion motion = Motion::between(camera_, camera);
        for (int id = 0; id < maxPlanes; ++id) {
            if (table_.area[id] == 0) continue;
            DualVector dual = dualOf(table_.planes[id], camera_, blocks_.width(), blocks_.height(), unitBefore);
            if (motion.apply(dual))
                table_.planes[id] = planeOf(dual, camera, blocks_.width(), blocks_.height(), blocks_.unit());
            else table_.area[id] = 0;
        }
    }

    /// The ids that the next frame tries in each tile: the tile's own, and its blocks'.
    void remember() {
        const int across = blocks_.blockColumns();
        for (std::size_t tile = 0; tile < near_.size(); ++tile) {
            std::vector<std::uint8_t>& ids = near_[tile];
            ids.clear();
            const auto add = [&](int id) {
                if (id >= 0 && std::find(ids.begin(), ids.end(), id) == ids.end())
                    ids.push_back(static_cast<std::uint8_t>(id));
            };
            for (int k = 0; k < tiles_.count(static_cast<int>(tile)); ++k) add(tiles_.id(static_cast<int>(tile), k));
            const int first =
                static_cast<int>(tile) / tiles_.columns() * 4 * across + static_cast<int>(tile) % tiles_.columns() * 4;
            for (int j = 0; j < 4; ++j)
                for (int i = 0; i < 4; ++i) add(regions_.labels()[first + j * across + i]);
        }
    }

    /// Errors and depths of the tiles, as the device sees them.
    void measure(PlaneOutput& output) const {
        for (int tile = 0; tile < tiles_.columns() * tiles_.rows(); ++tile) {
            const int left = tile % tiles_.columns() * 16, top = tile / tiles_.columns() * 16;
            std::uint8_t ids[256];
            tiles_.owners(tile, ids);
            const auto seen = [&](int x, int y) { // w, at most 16
                const std::int64_t w = table_.planes[ids[16 * y + x]].at(2 * (left + x) + 1 - blocks_.width(),
                                                                         2 * (top + y) + 1 - blocks_.height());
                return static_cast<std::int32_t>(std::clamp<std::int64_t>(w >> (planeBits - wBits), 0, 1 << 26));
            };
            std::int32_t errors[64], most = 0, least = 1 << 26;
            for (int i = 0; i < 64; ++i) { // a checkerboard that meets every row and column
                const int x = i % 8 * 2 + (i / 8 & 1), y = i / 8 * 2 + (i & 1);
                errors[i] = blocks_.rayError(left + x, top + y, seen(x, y));
            }
            // The extremes of one plane are at the corners
            const int step = tiles_.count(tile) == 1 ? 15 : 1;
            for (int y = 0; y < 16; y += step)
                for (int x = 0; x < 16; x += step) {
                    const std::int32_t w = seen(x, y);
                    most = std::max(most, w);
                    least = std::min(least, w);
                }
            std::nth_element(errors, errors + 57, errors + 64);
            output.errors[tile] = static_cast<float>(errors[57]) / (1 << errorBits);
            const double scale = std::ldexp(blocks_.unit(), wBits);
            output.nearest[tile] = static_cast<float>(scale / most); // infinite where w is 0
            output.furthest[tile] = static_cast<float>(scale / least);
        }
    }

    /// The bounding planes: a wall behind the camera, then the largest planes that nearly nothing lies beyond.
    void bound(const std::uint8_t* colours, const ColourFields& fields, const Camera& camera,
               PlaneOutput& output) const {
        std::fill(output.bounding, output.bounding + 3 * boundingPlanes_, std::uint64_t{0});
        const int across = blocks_.blockColumns(), stride = 4 * across;
        std::vector<std::int64_t> sums(4 *
                                       (maxPlanes + 1)); // linear fields of the blocks of each plane; the last: of all
        for (int row = 0; row < blocks_.blockRows(); row += 2)
            for (int column = 0; column < across; column += 2) {
                const std::uint8_t* code =
                    colours + 3 * (static_cast<std::size_t>(4 * row + 2) * stride + 4 * column + 2);
                Point point{{code[0] * 16, code[1] * 16, code[2] * 16}};
                const std::uint64_t word = fields.word(point);
                const int label = regions_.labels()[row * across + column];
                for (const int owner : {label, maxPlanes}) {
                    if (owner < 0) continue;
                    for (int a = 0; a < 3; ++a) sums[4 * owner + a] += word >> fieldBits * a & fieldMask;
                    ++sums[4 * owner + 3];
                }
            }
        int entries = 0;
        const auto put = [&](Plane plane, const double* normal, int owner) {
            std::uint64_t* words = output.bounding + 3 * entries++;
            std::uint64_t albedo = 0, direction = 0;
            for (int a = 0; a < 3; ++a) {
                albedo |= static_cast<std::uint64_t>(
                              divideRounded(sums[4 * owner + a], std::max<std::int64_t>(1, sums[4 * owner + 3])))
                          << fieldBits * a;
                direction |= (static_cast<std::uint64_t>(Plane::whole(normal[a] * NormalFields::one)) & fieldMask)
                             << fieldBits * a;
            }
            words[0] = planeWord(plane);
            words[1] = albedo | direction << 36;
            words[2] = direction >> 28;
        };
        constexpr double behind = 0.5, forward[3] = {0, 0, 1};
        put(Plane{0, 0, -Plane::whole(std::ldexp(blocks_.unit() / behind, planeBits))}, forward, maxPlanes);
        double directions[maxPlanes][3];
        int count = 0;
        for (const std::uint8_t id : table_.bySize()) {
            if (entries == boundingPlanes_ || table_.area[id] * 100 < blocks_.count()) break;
            const Plane& plane = table_.planes[id];
            const DualVector dual = dualOf(plane, camera, blocks_.width(), blocks_.height(), blocks_.unit());
            double square = dual.q[0] * dual.q[0];
            square = square + dual.q[1] * dual.q[1];
            square = square + dual.q[2] * dual.q[2];
            const double length = std::sqrt(square);
            if (!(length > 0) || sums[4 * id + 3] == 0) continue;
            // A block lies beyond by more than 5 cm if (q · P - 1) / |q| does; q · P is w on the plane by w of the
            // block
            const std::int64_t reach = static_cast<std::int64_t>((1 + std::min(0.05 * length, 1000.0)) * 65536);
            int beyond = 0, seen = 0;
            for (int row = 0; row < blocks_.blockRows(); row += 2)
                for (int column = 0; column < across; column += 2) {
                    const int block = row * across + column;
                    // both with 26 fraction bits
                    const std::int64_t on = plane.at(blocks_.xOf(block), blocks_.yOf(block)) >> (planeBits - wBits - 4);
                    beyond += on * 65536 > blocks_[block].sum * reach;
                    ++seen;
                }
            if (beyond * 100 > 3 * seen) continue;
            double* own = directions[count];
            for (int a = 0; a < 3; ++a) own[a] = -dual.q[a] / length;
            bool isKnown = false;
            for (int other = 0; other < count; ++other) {
                double cosine = own[0] * directions[other][0];
                cosine = cosine + own[1] * directions[other][1];
                cosine = cosine + own[2] * directions[other][2];
                isKnown = isKnown || cosine > 0.94;
            }
            if (isKnown) continue;
            ++count;
            put(plane, own, id);
        }
    }

    int planes_, boundingPlanes_;
    DepthBlocks blocks_;
    RegionFinder regions_;
    PlaneTiles tiles_;
    PlaneTable table_;
    std::vector<std::vector<std::uint8_t>> near_;
    Camera camera_{};
    bool isWarm_ = false;
};

} // namespace colonnade::live
