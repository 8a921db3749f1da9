// The device without time: memories and registers are loaded, pixels come out, bit for bit as from the RTL.
#pragma once
#include "shading.hpp"

namespace colonnade {

/// Counters that do not depend on timing, named as in the register map.
struct Counters {
    std::uint64_t raysPrimary, raysShadow, raysInBox, nodeReads, boxTests, triangleTests, hits, deepestStack;
};

struct Errors {
    bool stackOverflow, illegalRecord, watchdog;
};

/// One pixel of the stream. `triangle` (packed id) and `distance` (t from the camera, grid steps) hold for object pixels.
struct Pixel {
    Colour colour;
    bool isObject;
    std::uint32_t triangle;
    Wide distance;
};

/// Register values by their flattened names.
using Registers = std::map<std::string, std::int64_t>;

/// The pixels with x · px + y · py + offset ≥ 0.
struct HalfPlane {
    std::int64_t x, y, offset;
};

/// The frame registers, decoded.
struct Frame {
    std::int64_t width, height;
    std::array<std::int64_t, 4> objectRectangle;
    std::vector<HalfPlane> objectOutline;
    WideVector cameraPosition;
    Vector cameraDirection, stepX, stepY;
    int stepShift;
    Bounds bounds;
    Lighting lighting;
    std::size_t recordCount, triangleBase, triangleRecords, attributeBase;

    Frame() = default;
    explicit Frame(const Registers& registers) {
        const auto take = [&](const std::string& name) { return lookUp(registers, name); };
        const auto vector = [&](const std::string& name, const char* components = "xyz") {
            Vector result;
            for (int i = 0; i < 3; ++i) result[i] = take(name + "." + components[i]);
            return result;
        };
        const int unitShift = static_cast<int>(take("frame.unitShift"));
        const auto position = [&](const std::string& name) {
            const Vector raw = vector(name);
            return WideVector{floorShift<Wide>(raw[0], -unitShift), floorShift<Wide>(raw[1], -unitShift), floorShift<Wide>(raw[2], -unitShift)};
        };
        width = take("frame.width");
        height = take("frame.height");
        objectRectangle = {take("frame.objectRect.x0"), take("frame.objectRect.y0"), take("frame.objectRect.x1"), take("frame.objectRect.y1")};
        for (int i = 0; registers.count("frame.objectOutline[" + std::to_string(i) + "].x"); ++i) {
            const std::string edge = "frame.objectOutline[" + std::to_string(i) + "].";
            objectOutline.push_back({take(edge + "x"), take(edge + "y"), take(edge + "offset")});
        }
        cameraPosition = position("camera.position");
        cameraDirection = vector("camera.direction");
        stepX = vector("camera.stepX");
        stepY = vector("camera.stepY");
        stepShift = static_cast<int>(take("camera.stepShift"));
        bounds = {vector("bounds.low"), vector("bounds.high")};
        lighting.lightPosition = position("light.position");
        lighting.lightColour = vector("light.colour", "rgb");
        lighting.ambient = vector("ambient", "rgb");
        lighting.background = vector("background", "rgb");
        lighting.shadowOffset = take("light.shadowOffset");
        lighting.flat = take("shading.flat") != 0;
        lighting.shadows = take("shading.shadows") != 0;
        for (int i = 0; registers.count("materials[" + std::to_string(i) + "].albedo.r"); ++i)
            lighting.albedo.push_back(vector("materials[" + std::to_string(i) + "].albedo", "rgb"));
        recordCount = static_cast<std::size_t>(take("scene.recordCount"));
        triangleBase = static_cast<std::size_t>(take("scene.triangleBase"));
        triangleRecords = static_cast<std::size_t>(take("scene.triangleRecords"));
        attributeBase = static_cast<std::size_t>(take("scene.attributeBase"));
    }

    bool maySeeObject(std::int64_t px, std::int64_t py) const {
        const auto& rectangle = objectRectangle;
        if (px < rectangle[0] || px >= rectangle[2] || py < rectangle[1] || py >= rectangle[3]) return false;
        return std::all_of(objectOutline.begin(), objectOutline.end(), [&](const HalfPlane& edge) { return edge.x * px + edge.y * py + edge.offset >= 0; });
    }
};

class Device {
public:
    Device(const Numbers& numbers, const std::map<std::string, Layout>& layouts) : numbers_(numbers), decoder_(layouts, numbers) {}

    /// Loads the column memory: `count` records of `bytes` bytes, whose sections begin where the header says.
    void load(const std::uint8_t* records, std::size_t count, std::size_t bytes, std::size_t triangleBase, std::size_t attributeBase) {
        nodes_.clear();
        triangles_.clear();
        faces_.clear();
        for (std::size_t i = 0; i < count; ++i) {
            const std::uint8_t* record = records + i * bytes;
            if (i < triangleBase) nodes_.push_back(decoder_.node(record));
            else if (i < attributeBase) triangles_.push_back(decoder_.triangles(record));
            else
                for (int slot = 0; slot < decoder_.facesPerRecord(); ++slot) faces_.push_back(decoder_.face(record, slot));
        }
    }

    /// Takes the registers over and clears counters and errors, as a start of a frame does.
    void start(const Registers& registers) {
        frame_ = Frame(registers);
        counters = {};
        errors = {};
    }

    const Frame& frame() const { return frame_; }

    RayRequest primaryRay(std::int64_t x, std::int64_t y) const {
        RayRequest request{frame_.cameraPosition, {}, numbers_.unlimited(), ~std::uint64_t(0)};
        for (int a = 0; a < 3; ++a)
            request.direction[a] = floorShift<Wide>(frame_.cameraDirection[a], -frame_.stepShift) + Wide(x) * frame_.stepX[a] + Wide(y) * frame_.stepY[a];
        return request;
    }

    Pixel render(std::int64_t x, std::int64_t y) {
        Pixel pixel{frame_.lighting.background, false, 0, 0};
        ++counters.raysPrimary;
        if (!frame_.maySeeObject(x, y)) return pixel;
        const Ray ray = setUp(primaryRay(x, y), frame_.bounds, numbers_);
        const Hit hit = trace(ray, false);
        if (!hit.found) return pixel;

        ++counters.hits;
        pixel.isObject = true;
        pixel.triangle = static_cast<std::uint32_t>(hit.id);
        pixel.distance = floorShift<Wide>(ray.entry, -numbers_.gridFraction) + hit.t;
        Face face{};
        if (hit.id < faces_.size()) face = faces_[hit.id];
        else errors.illegalRecord = true;
        const Shading shading = shade(ray, hit, face, frame_.lighting, numbers_);
        pixel.colour = shading.lit;
        if (shading.needsShadowRay) {
            ++counters.raysShadow;
            if (trace(setUp(shading.shadowRay, frame_.bounds, numbers_), true).found) pixel.colour = shading.ambient;
        }
        return pixel;
    }

    /// The closest hit of a set-up ray, or with `anyHit` the first one found.
    Hit trace(const Ray& ray, bool anyHit) {
        Hit best{false, ray.limit, ray.limitId, {}, false};
        if (!ray.enters) return best;
        ++counters.raysInBox;
        if (numbers_.bvh) descend(ray, anyHit, best);
        else
            for (std::size_t i = 0; i < frame_.triangleRecords && !(anyHit && best.found); ++i) testRecord(ray, frame_.triangleBase + i, best);
        return best;
    }

    Counters counters{};
    Errors errors{};

private:
    struct Entry {
        bool isLeaf;
        std::uint32_t address;
        std::int64_t near;
    };

    void testRecord(const Ray& ray, std::size_t address, Hit& best) {
        const std::size_t index = address - nodes_.size();
        if (address < nodes_.size() || index >= triangles_.size() || address >= frame_.recordCount) {
            errors.illegalRecord = true;
            return;
        }
        const Triangles& record = triangles_[index];
        for (int i = 0; i < record.count; ++i) {
            ++counters.triangleTests;
            testTriangle(ray, record.vertices[i], record.firstTriangle + i, numbers_, best);
        }
    }

    void descend(const Ray& ray, bool anyHit, Hit& best) {
        std::array<Entry, 256> stack;
        std::size_t depth = 0;
        std::size_t visits = 0;
        Entry next{false, 0, 0};
        for (bool busy = true; busy;) {
            busy = false;
            if (next.isLeaf) {
                testRecord(ray, next.address, best);
                if (anyHit && best.found) return;
            } else if (next.address >= nodes_.size() || next.address >= frame_.recordCount) {
                errors.illegalRecord = true;
            } else {
                if (++visits > 4 * nodes_.size() + 4) {
                    errors.watchdog = true; // a tree that bites its tail
                    return;
                }
                ++counters.nodeReads;
                const Node& node = nodes_[next.address];
                std::array<Entered, 4> entered;
                const int count = testBoxes(ray, node, best.t, numbers_, entered, counters.boxTests);
                for (int i = count - 1; i > 0; --i) {
                    if (depth < static_cast<std::size_t>(numbers_.stackDepth)) stack[depth++] = entryOf(node, entered[i]);
                    else errors.stackOverflow = true;
                }
                counters.deepestStack = std::max<std::uint64_t>(counters.deepestStack, depth);
                if (count > 0) {
                    next = entryOf(node, entered[0]);
                    busy = true;
                }
            }
            while (!busy && depth > 0) {
                next = stack[--depth];
                busy = next.near <= limitUnits(best.t, numbers_);
            }
        }
    }

    /// Where a child lies: nodes and leaves are each consecutive, in slot order.
    static Entry entryOf(const Node& node, const Entered& child) {
        std::uint32_t before = 0;
        for (int slot = 0; slot < child.slot; ++slot) before += node.kinds[slot] == node.kinds[child.slot];
        const bool isLeaf = node.kinds[child.slot] == Child::leaf;
        return {isLeaf, (isLeaf ? node.firstTriangles : node.firstChild) + before, child.near};
    }

    Numbers numbers_;
    RecordDecoder decoder_;
    std::vector<Node> nodes_;
    std::vector<Triangles> triangles_;
    std::vector<Face> faces_;
    Frame frame_;
};

} // namespace colonnade
