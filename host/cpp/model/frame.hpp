// The untimed model of the device: it renders pixels that equal the RTL's bit for bit.
#pragma once
#include "paths.hpp"

namespace colonnade {

/// One pixel of the stream. `triangle` (packed id), `instance` and `distance` (t from the camera, grid steps) are for
/// object pixels. `ratio` is for pixels of the environment: light with the object over light without it, 12 fraction
/// bits.
struct Pixel {
    Colour colour, ratio;
    bool isObject = false;
    std::uint32_t triangle = 0;
    int instance = 0;
    Wide distance = 0;
};

/// The closest hit of a ray: packed id and instance, -1 for a miss; distance along the dominant axis; where rays from
/// there begin, grid steps; geometric normal against the ray.
struct NearestHit {
    std::int64_t triangle = -1, instance = -1, distance = 0;
    WideVector start{};
    Vector normal{};
};

class Device : public PathTracer {
public:
    /// `limits`: the largest value of each register that the device accepts, by name.
    Device(const Numbers& numbers, const std::map<std::string, Layout>& layouts, Registers limits = {})
        : PathTracer(numbers, layouts), limits_(std::move(limits)) {}

    /// Loads the column memory: `count` records of `bytes` bytes.
    void load(const std::uint8_t* records, std::size_t count, std::size_t bytes) {
        memory_->load(records, count, bytes);
    }

    /// Uses the contents of the physical-attribute memory, which must outlive the device.
    void load(const AttributeImage& image) { march_.emplace(numbers_, image); }

    /// Uses the contents of the texture memory, which must outlive the device.
    void load(const TextureImage& image) { texture_ = &image; }

    /// Loads the light cube: `count` words of `LightCube::wordBytes` bytes.
    void loadCube(const std::uint8_t* words, std::size_t count) { cube_.load(words, count); }

    /// Starts a frame: loads the registers, and clears counters and errors.
    void start(const Registers& registers) {
        Registers legal = registers;
        for (const auto& [name, limit] : limits_)
            if (const auto found = legal.find(name); found != legal.end())
                found->second = std::min(found->second, limit);
        frame_ = Frame(legal, numbers_);
        memory_->divide(frame_.recordCount, frame_.roots, numbers_.bvh, frame_.leafRecords());
        counters = {};
        errors = {};
    }

    const Frame& frame() const { return frame_; }

    RayRequest primaryRay(std::int64_t x, std::int64_t y) const {
        RayRequest request{frame_.cameraPosition, {}, numbers_.unlimited()};
        for (int a = 0; a < 3; ++a)
            request.direction[a] = floorShift<Wide>(frame_.cameraDirection[a], -frame_.stepShift) +
                                   Wide(x) * frame_.stepX[a] + Wide(y) * frame_.stepY[a];
        return request;
    }

    /// The closest hit of a ray that is no pixel's.
    NearestHit nearest(const RayRequest& request) {
        const Ray ray = prepareRay(request, frame_.bounds, numbers_);
        const Hit hit = trace(ray);
        if (!hit.found) return {};
        const Surface surface = surfaceOf(ray, hit, faceAt(hit), numbers_);
        return {static_cast<std::int64_t>(hit.id), hit.instance, static_cast<std::int64_t>(distanceOf(ray, hit)),
                offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_),
                surface.faceForwardNormal};
    }

    Pixel render(std::int64_t x, std::int64_t y) {
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        Pixel pixel{frame_.lighting.background, {one, one, one}};
        ++counters.raysPrimary;
        work.beginPixel();
        const RayRequest request = primaryRay(x, y);
        if (!frame_.maySeeObject(x, y)) return directView(pixel, x, y, request);
        logRay(RayKind::primary, request);
        const Ray ray = prepareRay(request, frame_.bounds, numbers_);
        const Hit hit = trace(ray);
        if (!hit.found) return directView(pixel, x, y, request);
        const Path path = Path::of(request, one);
        const Wide distance = distanceOf(ray, hit);
        if (mayBeHidden(path)) {
            const EnvironmentHit found = findDirectView(x, y, request);
            if (hides(found, ray, hit, true)) return showDirectView(pixel, x, y, request, found);
        }
        ++counters.hits;
        pixel.isObject = true;
        pixel.triangle = static_cast<std::uint32_t>(hit.id);
        pixel.instance = hit.instance;
        pixel.distance = distance;
        pixel.colour = follow(path, ray, hit, pixelPoint(x, y));
        return pixel;
    }

private:
    /// Completes a pixel whose ray misses the object.
    Pixel directView(const Pixel& pixel, std::int64_t x, std::int64_t y, const RayRequest& ray) {
        if (!hasEnvironment() || (!frame_.maySeeObject(x, y) && !frame_.environment.shows(x, y))) return pixel;
        return showDirectView(pixel, x, y, ray, findDirectView(x, y, ray));
    }

    /// Completes a pixel that shows the environment itself.
    Pixel showDirectView(Pixel pixel, std::int64_t x, std::int64_t y, const RayRequest& ray,
                         const EnvironmentHit& found) {
        if (found.point.kind == HitKind::miss) return pixel;
        Incoming light = lightAt(ray, found, true, PathEnd::directView);
        // At the end `gathered` the light of the object replaces the ambient light
        if (const auto gathered = gatherFromObject(x, y, ray, found))
            for (int channel = 0; channel < 3; ++channel)
                light.visible[channel] += (*gathered)[channel] - frame_.lighting.ambient[channel];
        pixel.colour = reflectedBy(found.texel.albedo, light.visible);
        for (int channel = 0; channel < 3; ++channel)
            pixel.ratio[channel] = ratioOf(light.visible[channel], light.unoccluded[channel]);
        return pixel;
    }

    /// The light of the ray that a point of the environment gathers, if it meets the object.
    std::optional<Colour> gatherFromObject(std::int64_t x, std::int64_t y, const RayRequest& view,
                                           const EnvironmentHit& found) {
        if (frame_.gather.bounces == 0) return std::nullopt;
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        const Vector& normal = found.texel.normal;
        Path path = Path::of(view, one);
        gatherFrom(originAt(view, found), {normal[0], normal[1], normal[2]}, normal, nullptr, path, pixelPoint(x, y));
        logRay(RayKind::gather, path.ray);
        const Ray ray = prepareRay(path.ray, frame_.bounds, numbers_);
        const Hit hit = trace(ray);
        if (!hit.found) return std::nullopt;
        return follow(path, ray, hit, pixelPoint(x, y));
    }

    /// part / whole with 12 fraction bits, less than 2; 1 for 0 / 0.
    std::int64_t ratioOf(std::int64_t part, std::int64_t whole) const {
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        if (part == whole) return one;
        return part < 2 * whole ? (part << numbers_.lightFraction) / whole : 2 * one - 1;
    }

    Registers limits_;
};

} // namespace colonnade
