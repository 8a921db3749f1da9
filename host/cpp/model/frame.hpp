// The device without time: memories and registers are loaded, pixels come out, bit for bit as from the RTL.
#pragma once
#include <optional>

#include "environment.hpp"
#include "column_memory.hpp"
#include "registers.hpp"

namespace colonnade {

/// Counters that do not depend on timing, named as in the register map.
struct Counters {
    std::uint64_t raysPrimary, raysShadow, raysReflection, raysRefraction, raysInBox, nodeReads, boxTests, triangleTests, hits, deepestStack;
    /// Of the room: rays that look for a point of it, tiles and cells that they pass, points whose pixel is looked up.
    std::uint64_t raysEnvironment, marchSteps, albedoReads;
};

struct Errors {
    bool stackOverflow, illegalRecord, watchdog;
};

/// One pixel of the stream. `triangle` (packed id) and `distance` (t from the camera, grid steps) hold for object pixels; `ratio`, what is left of the
/// light with the object there, 12 fraction bits, for those of the room.
struct Pixel {
    Colour colour, ratio;
    bool isObject;
    std::uint32_t triangle;
    Wide distance;
};

/// What a shadow ray has met on its way to the light; the later the less light.
enum class Occlusion { none, transmissive, opaque };

/// What a path has gathered so far: the weight of what is still to come, 12 fraction bits a channel; the colour already certain; secondary rays traced.
struct Path {
    Colour throughput, radiance;
    int bounces;
};

class Device {
public:
    /// `limits`: the greatest value that the device takes of a register, by its name.
    Device(const Numbers& numbers, const std::map<std::string, Layout>& layouts, Registers limits = {})
        : numbers_(numbers), memory_(layouts, numbers), limits_(std::move(limits)) {}

    /// Loads the column memory: `count` records of `bytes` bytes.
    void load(const std::uint8_t* records, std::size_t count, std::size_t bytes) { memory_.load(records, count, bytes); }

    /// What the physical-attribute memory holds; it outlives the device.
    void load(const AttributeImage& image) { background_.emplace(numbers_, image); }

    /// Takes the registers over and clears counters and errors, as a start of a frame does.
    void start(const Registers& registers) {
        Registers legal = registers;
        for (const auto& [name, limit] : limits_)
            if (const auto found = legal.find(name); found != legal.end()) found->second = std::min(found->second, limit);
        frame_ = Frame(legal, numbers_);
        memory_.divide(frame_.recordCount, frame_.triangleBase, frame_.attributeBase);
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
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        Pixel pixel{frame_.lighting.background, {one, one, one}, false, 0, 0};
        ++counters.raysPrimary;
        RayRequest request = primaryRay(x, y);
        if (!frame_.maySeeObject(x, y)) return seen(pixel, x, y, request);
        Path path{{one, one, one}, {0, 0, 0}, 0};
        for (bool isPrimary = true;; isPrimary = false) {
            const Ray ray = prepareRay(request, frame_.bounds, numbers_);
            const Hit hit = trace(ray);
            if (!hit.found && isPrimary) return seen(pixel, x, y, request);
            if (!hit.found) return finish(pixel, path, missRadiance(request));
            if (isPrimary) {
                ++counters.hits;
                pixel.isObject = true;
                pixel.triangle = static_cast<std::uint32_t>(hit.id);
                pixel.distance = floorShift<Wide>(ray.entry, -numbers_.gridFraction) + hit.t;
            }
            const Face* const face = memory_.faceOf(hit.id);
            if (!face) {
                errors.illegalRecord = true;
                return finish(pixel, path, frame_.lighting.background);
            }
            const Surface surface = surfaceOf(ray, hit, *face, numbers_);
            const Material& material = frame_.lighting.materialOf(*face);
            if (material.kind == MaterialKind::diffuse) return finish(pixel, path, light(surface, material));
            if (!continuePath(surface, material, path, request)) return finish(pixel, path, missRadiance(request));
        }
    }

    /// The closest hit of a set-up ray.
    Hit trace(const Ray& ray) {
        Hit best{false, ray.limit, ray.limitId, {}, false};
        if (!ray.enters) return best;
        ++counters.raysInBox;
        Search search{ray, best, false, Occlusion::none};
        run(search);
        return search.best;
    }

    /// What lies on a set-up ray's way: ends with the first opaque triangle.
    Occlusion occlusion(const Ray& ray) {
        if (!ray.enters) return Occlusion::none;
        ++counters.raysInBox;
        Search search{ray, {false, ray.limit, ray.limitId, {}, false}, true, Occlusion::none};
        run(search);
        return search.occlusion;
    }

    Counters counters{};
    Errors errors{};

private:
    struct Entry {
        bool isLeaf;
        std::uint32_t address;
        std::int64_t near;
    };

    /// A ray on its way through the records. A shadow ray keeps its limit: clear triangles do not shorten it.
    struct Search {
        const Ray& ray;
        Hit best;
        bool isShadow;
        Occlusion occlusion;

        bool isOver() const { return occlusion == Occlusion::opaque; }
    };

    Pixel finish(Pixel pixel, const Path& path, const Colour& colour) const {
        for (int channel = 0; channel < 3; ++channel)
            pixel.colour[channel] = std::min(white(), path.radiance[channel] + ((path.throughput[channel] * colour[channel]) >> numbers_.lightFraction));
        return pixel;
    }

    std::int64_t white() const { return (std::int64_t(1) << numbers_.colourBits) - 1; }

    /// Light that falls onto a surface off which shadow rays start at `origin`: all of it, and what the object lets through.
    struct Incoming {
        Colour all, visible;
    };

    Incoming incoming(const WideVector& origin, const WideVector& normal, bool shadows) {
        const Lighting& lighting = frame_.lighting;
        Incoming result{lighting.ambient, lighting.ambient};
        for (const Light& source : lighting.lights) {
            const Illumination illumination = illuminate(origin, normal, source, lighting.shadows && shadows, numbers_);
            Occlusion occluder = Occlusion::none;
            if (illumination.needsShadowRay) {
                ++counters.raysShadow;
                occluder = occlusion(prepareRay(illumination.shadowRay, frame_.bounds, numbers_));
            }
            for (int channel = 0; channel < 3; ++channel) {
                const std::int64_t direct = illumination.direct[channel];
                result.all[channel] += direct;
                if (occluder == Occlusion::none) result.visible[channel] += direct;
                if (occluder == Occlusion::transmissive) result.visible[channel] += (direct * lighting.shadowTransmittance) >> numbers_.lightFraction;
            }
        }
        return result;
    }

    Colour reflectedBy(const Colour& albedo, const Colour& light) const {
        Colour colour;
        for (int channel = 0; channel < 3; ++channel) colour[channel] = reflected(albedo[channel], light[channel], numbers_);
        return colour;
    }

    Colour light(const Surface& surface, const Material& material) {
        const WideVector origin = offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_);
        return reflectedBy(material.albedo, incoming(origin, shadingNormal(surface, frame_.lighting.flat), true).visible);
    }

    /// The room's light at a point of it; `normal` has 11 fraction bits.
    Incoming environmentLight(const WideVector& point, const Vector& normal, bool shadows) {
        return incoming(offSurface(point, normal, frame_.lighting.offset, numbers_), {normal[0], normal[1], normal[2]}, shadows);
    }

    const EnvironmentPoint& count(const EnvironmentPoint& point) {
        ++counters.raysEnvironment;
        counters.marchSteps += static_cast<std::uint64_t>(point.steps);
        counters.albedoReads += point.kind == EnvironmentPoint::Kind::map;
        errors.illegalRecord = errors.illegalRecord || point.isIllegal;
        return point;
    }

    EnvironmentTexel texelOf(const EnvironmentPoint& point) {
        const EnvironmentTexel texel = background_->texelOf(point, frame_.environment);
        errors.illegalRecord = errors.illegalRecord || texel.isIllegal;
        return texel;
    }

    /// The colour of what a ray meets that meets nothing of the object.
    Colour missRadiance(const RayRequest& ray, bool shadows = true) {
        if (!frame_.hasEnvironment || !background_) return frame_.lighting.background;
        Vector direction;
        blockScale(ray.direction, numbers_.shadeBits, direction);
        const EnvironmentPoint point = count(background_->meet(ray.origin, direction, frame_.environment));
        if (point.kind == EnvironmentPoint::Kind::nothing) return frame_.lighting.background;
        const EnvironmentTexel texel = texelOf(point);
        return reflectedBy(texel.albedo, environmentLight(background_->reached(ray.origin, direction, point), texel.normal, shadows).visible);
    }

    /// A pixel that shows the room itself.
    Pixel seen(Pixel pixel, std::int64_t x, std::int64_t y, const RayRequest& ray) {
        if (!frame_.hasEnvironment || !background_ || (!frame_.maySeeObject(x, y) && !frame_.environment.shows(x, y))) return pixel;
        Vector direction;
        blockScale(ray.direction, numbers_.shadeBits, direction);
        const EnvironmentPoint point = count(background_->seen(x, y, direction, frame_.environment));
        if (point.kind == EnvironmentPoint::Kind::nothing) return pixel;
        const EnvironmentTexel texel = texelOf(point);
        const Incoming light = environmentLight(background_->reached(ray.origin, direction, point), texel.normal, true);
        pixel.colour = reflectedBy(texel.albedo, light.visible);
        for (int channel = 0; channel < 3; ++channel) pixel.ratio[channel] = ratioOf(light.visible[channel], light.all[channel]);
        return pixel;
    }

    /// part / whole, 12 fraction bits, 1 for 0 / 0; part is not the larger one.
    std::int64_t ratioOf(std::int64_t part, std::int64_t whole) const { return part == whole ? std::int64_t(1) << numbers_.lightFraction : (part << numbers_.lightFraction) / whole; }

    /// Sends the path on from a mirror or glass; false if the next ray meets the background only.
    bool continuePath(const Surface& surface, const Material& material, Path& path, RayRequest& request) {
        const Bounce next = bounce(surface, material, frame_.lighting.flat, frame_.lighting.offset, numbers_);
        Colour behind = frame_.lighting.background;
        if (frame_.hasEnvironment && next.share != 0) {
            RayRequest reflection = next.ray;
            // Schlick's part starts on the other side of the surface than the refracted ray
            reflection.origin = offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_);
            for (int a = 0; a < 3; ++a) reflection.direction[a] = next.reflection[a];
            behind = missRadiance(reflection, false);
        }
        for (int channel = 0; channel < 3; ++channel) {
            std::int64_t& throughput = path.throughput[channel];
            // All ones is 1.0
            const std::int64_t albedo = material.albedo[channel] + (material.albedo[channel] >> (numbers_.colourBits - 1));
            if (!surface.backSide || material.kind == MaterialKind::mirror) throughput = (throughput * albedo) >> numbers_.lightFraction;
            const std::int64_t share = (throughput * next.share) >> numbers_.lightFraction;
            path.radiance[channel] = std::min(white(), path.radiance[channel] + ((share * behind[channel]) >> numbers_.lightFraction));
            throughput -= share;
        }
        request = next.ray;
        if (path.bounces == frame_.lighting.bounces) return false;
        ++path.bounces;
        ++(next.isRefraction ? counters.raysRefraction : counters.raysReflection);
        return true;
    }

    void run(Search& search) {
        if (numbers_.bvh) descend(search);
        else
            for (std::size_t i = 0; (i == 0 || i < frame_.triangleRecords) && !search.isOver(); ++i) testRecord(search, frame_.triangleBase + i);
    }

    void testRecord(Search& search, std::size_t address) {
        const Triangles* const found = memory_.trianglesAt(address);
        if (!found) {
            errors.illegalRecord = true;
            return;
        }
        const Triangles& record = *found;
        if (!record.isLegal) {
            errors.illegalRecord = true;
            ++counters.triangleTests; // an empty record takes as long as one triangle
            return;
        }
        for (int i = 0; i < record.count; ++i) {
            ++counters.triangleTests;
            Hit hit = search.best;
            if (!testTriangle(search.ray, record.vertices[i], memory_.idOf(record, i), numbers_, hit)) continue;
            if (search.isShadow) search.occlusion = std::max(search.occlusion, record.isClear[i] && frame_.lighting.hasTransmittance ? Occlusion::transmissive : Occlusion::opaque);
            else search.best = hit;
        }
    }

    void descend(Search& search) {
        const Hit& best = search.best;
        std::array<Entry, 256> stack;
        std::size_t depth = 0;
        std::uint64_t visits = 0;
        Entry next{false, 0, 0};
        for (bool busy = !errors.watchdog; busy;) {
            busy = false;
            if (next.isLeaf) {
                testRecord(search, next.address);
                if (search.isOver()) return;
            } else if (const Node* const found = memory_.nodeAt(next.address); !found) {
                errors.illegalRecord = true;
            } else {
                // A visit takes a cycle or more
                if (frame_.watchdogCycles != 0 && ++visits > frame_.watchdogCycles) {
                    errors.watchdog = true;
                    return;
                }
                ++counters.nodeReads;
                const Node& node = *found;
                std::array<Entered, 4> entered;
                int count = 0;
                if (node.isLegal) count = testBoxes(search.ray, node, best.t, numbers_, entered, counters.boxTests);
                else errors.illegalRecord = true;
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
    Entry entryOf(const Node& node, const Entered& child) const {
        std::uint32_t before = 0;
        for (int slot = 0; slot < child.slot; ++slot) before += node.kinds[slot] == node.kinds[child.slot];
        const bool isLeaf = node.kinds[child.slot] == Child::leaf;
        return {isLeaf, ((isLeaf ? node.firstTriangles : node.firstChild) + before) & memory_.addressMask(), child.near};
    }

    Numbers numbers_;
    ColumnMemory memory_;
    Registers limits_;
    std::optional<Background> background_;
    Frame frame_;
};

} // namespace colonnade
