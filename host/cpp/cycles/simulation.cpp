#include "simulation.hpp"

#include "frame.hpp"

namespace colonnade::cycles {

namespace {

/// Whether a square of pixels meets a rectangle, low and high corners without the last row and column.
template <class Rectangle> bool meets(const Rectangle& rectangle, std::int64_t x, std::int64_t y, std::int64_t size) {
    return x < rectangle[2] && x + size > rectangle[0] && y < rectangle[3] && y + size > rectangle[1];
}

/// frame/OutlineTest.scala: whether a pixel of a square may show the object.
bool meetsObject(const Frame& frame, std::int64_t x, std::int64_t y, std::int64_t size) {
    if (!meets(frame.objectRectangle, x, y, size)) return false;
    return std::all_of(frame.objectOutline.begin(), frame.objectOutline.end(), [&](const HalfPlane& edge) {
        return edge.x * (edge.x > 0 ? x + size - 1 : x) + edge.y * (edge.y > 0 ? y + size - 1 : y) + edge.offset >= 0;
    });
}

PixelKind kindOf(const Frame& frame, std::int64_t x, std::int64_t y, std::int64_t size) {
    if (meetsObject(frame, x, y, size)) return PixelKind::object;
    return frame.hasEnvironment && meets(frame.environment.window, x, y, size) ? PixelKind::environment
                                                                               : PixelKind::background;
}

} // namespace

CycleCounters simulate(const Design& design, const DramDesign& dram, const FrameWork& work, const Frame& frame,
                       unsigned height) {
    const unsigned width = static_cast<unsigned>(frame.width), size = static_cast<unsigned>(design.tileSize);
    if (work.pixels.size() != std::size_t(width) * height + 1)
        throw std::invalid_argument("the work is not that of all pixels of a frame");
    std::vector<PixelKind> pixels, tiles;
    for (unsigned y = 0; y < height; ++y)
        for (unsigned x = 0; x < width; ++x) pixels.push_back(kindOf(frame, x, y, 1));
    for (unsigned y = 0; y < height; y += size)
        for (unsigned x = 0; x < width; x += size) tiles.push_back(kindOf(frame, x, y, size));
    // Without an environment its registers have no value
    const bool isMapCamera = frame.hasEnvironment && frame.environment.isMapCamera;
    const FrameSettings settings{static_cast<int>(frame.lighting.lights.size()), frame.gather.bounces,
                                 frame.hasEnvironment, isMapCamera};
    return FrameSimulation(design, dram, work, settings, width, height, std::move(pixels), std::move(tiles)).run();
}

} // namespace colonnade::cycles
