// The untimed model of the device: it renders pixels that equal the RTL's bit for bit.
#pragma once
#include <optional>

#include "environment_march.hpp"
#include "tracer.hpp"

namespace colonnade {

/// One pixel of the stream. `triangle` (packed id) and `distance` (t from the camera, grid steps) are for object pixels. `ratio` is for pixels of
/// the environment: light with the object over light without it, 12 fraction bits.
struct Pixel {
    Colour colour, ratio;
    bool isObject;
    std::uint32_t triangle;
    Wide distance;
};

/// State of a path: throughput (12 fraction bits per channel), accumulated radiance, number of traced reflections and refractions, whether its ray is
/// inside glass, number of gathered rays, and origin and direction of its last ray.
struct Path {
    Colour throughput, radiance;
    int bounces;
    bool isInside;
    int gathered;
    WideVector origin, direction;
};

class Device : public Tracer {
public:
    /// `limits`: the largest value of each register that the device accepts, by name.
    Device(const Numbers& numbers, const std::map<std::string, Layout>& layouts, Registers limits = {})
        : Tracer(numbers, layouts), limits_(std::move(limits)) {}

    /// Loads the column memory: `count` records of `bytes` bytes.
    void load(const std::uint8_t* records, std::size_t count, std::size_t bytes) { memory_.load(records, count, bytes); }

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
            if (const auto found = legal.find(name); found != legal.end()) found->second = std::min(found->second, limit);
        frame_ = Frame(legal, numbers_);
        memory_.divide(frame_.recordCount, frame_.triangleBase, frame_.attributeBase);
        counters = {};
        errors = {};
    }

    const Frame& frame() const { return frame_; }

    RayRequest primaryRay(std::int64_t x, std::int64_t y) const {
        RayRequest request{frame_.cameraPosition, {}, numbers_.unlimited()};
        for (int a = 0; a < 3; ++a)
            request.direction[a] = floorShift<Wide>(frame_.cameraDirection[a], -frame_.stepShift) + Wide(x) * frame_.stepX[a] + Wide(y) * frame_.stepY[a];
        return request;
    }

    Pixel render(std::int64_t x, std::int64_t y) {
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        Pixel pixel{frame_.lighting.background, {one, one, one}, false, 0, 0};
        ++counters.raysPrimary;
        const RayRequest request = primaryRay(x, y);
        if (!frame_.maySeeObject(x, y)) return directView(pixel, x, y, request);
        log.addRay(RayKind::primary, request, numbers_);
        const Ray ray = prepareRay(request, frame_.bounds, numbers_);
        const Hit hit = trace(ray);
        if (!hit.found) return directView(pixel, x, y, request);
        const Path path{{one, one, one}, {0, 0, 0}, 0, false, 0, request.origin, request.direction};
        const Wide distance = distanceOf(ray, hit);
        if (mayBeHidden(path)) {
            const EnvironmentHit found = findDirectView(x, y, request);
            if (march_->hides(found.point, found.direction, distance, true, frame_.environment)) return showDirectView(pixel, x, y, request, found);
        }
        ++counters.hits;
        pixel.isObject = true;
        pixel.triangle = static_cast<std::uint32_t>(hit.id);
        pixel.distance = distance;
        pixel.colour = follow(path, request, ray, hit, pixelPoint(x, y));
        return pixel;
    }

private:
    /// The colour that a path brings, from the first hit of the object on. `point`: the pixel's sample point.
    Colour follow(Path path, RayRequest request, Ray ray, Hit hit, const SamplePoint& point) {
        for (;;) {
            RayKind kind = RayKind::gather;
            const Face* const face = memory_.faceOf(hit.id);
            if (!face) {
                errors.illegalRecord = true;
                return total(path, path.bounces + path.gathered > 0 ? lightBehind(path) : frame_.lighting.background);
            }
            const Surface surface = surfaceOf(ray, hit, *face, numbers_);
            const Material& material = frame_.lighting.materialOf(*face);
            const Colour albedo = albedoOf(material, hit, *face);
            if (material.kind == MaterialKind::mirror || material.kind == MaterialKind::glass) {
                if (!continuePath(surface, material, albedo, point, path, request, kind)) return total(path, leavingRadiance(path, request));
            } else {
                const bool gathers = path.gathered < frame_.gather.bounces;
                const bool hasLobe = material.kind == MaterialKind::roughMetal && (gathers || frame_.gather.bounces == 0);
                const Lobe* const lobe = hasLobe ? &material.lobe : nullptr;
                const WideVector normal = shadingNormal(surface, frame_.lighting.flat), axis = lobe ? lobeAxis(normal, surface.dir, numbers_) : normal;
                const Colour colour = emitted(material, light(surface, axis, lobe, albedo, !gathers));
                if (!gathers) return total(path, colour);
                path.radiance = total(path, colour);
                for (int channel = 0; channel < 3; ++channel) path.throughput[channel] = (path.throughput[channel] * tintOf(albedo[channel])) >> numbers_.lightFraction;
                request = gatheredRay(offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_), axis, surface.faceForwardNormal, lobe, path, point);
            }
            log.addRay(kind, request, numbers_);
            ray = prepareRay(request, frame_.bounds, numbers_);
            hit = trace(ray);
            if (!hit.found) return total(path, leavingRadiance(path, request));
            if (mayBeHidden(path)) {
                const EnvironmentHit found = findHit(request);
                if (march_->hides(found.point, found.direction, distanceOf(ray, hit), false, frame_.environment)) return total(path, radianceOf(path, request, found, true));
            }
        }
    }

    /// The ray that gathers light at a surface, from `origin` off it.
    RayRequest gatheredRay(const WideVector& origin, const WideVector& axis, const Vector& faceForwardNormal, const Lobe* lobe, Path& path, const SamplePoint& point) {
        const Vector direction = gatherDirection(axis, faceForwardNormal, frame_.gather.points[path.gathered] ^ point, lobe, numbers_);
        ++path.gathered;
        ++counters.raysGather;
        path.origin = origin;
        path.direction = {direction[0], direction[1], direction[2]};
        return {origin, path.direction, numbers_.unlimited()};
    }

    Wide distanceOf(const Ray& ray, const Hit& hit) const { return floorShift<Wide>(ray.tEntry, -numbers_.gridFraction) + hit.t; }

    /// The radiance of a path that ends in a colour.
    Colour total(const Path& path, const Colour& colour) const {
        Colour radiance;
        for (int channel = 0; channel < 3; ++channel)
            radiance[channel] = std::min(white(), path.radiance[channel] + ((path.throughput[channel] * colour[channel]) >> numbers_.lightFraction));
        return radiance;
    }
private:

    /// The albedo of the object at a hit.
    Colour albedoOf(const Material& material, const Hit& hit, const Face& face) {
        if (material.hasTexture && texture_) {
            const Colour position = cornerColour(hit, face, numbers_);
            const Rgb12 texel = texture_->texelAt(position[0], position[1]);
            errors.illegalRecord = errors.illegalRecord || texel.isIllegal;
            return {texel.r, texel.g, texel.b};
        }
        return material.hasCornerColours ? cornerColour(hit, face, numbers_) : material.albedo;
    }

    std::int64_t white() const { return (std::int64_t(1) << numbers_.colourBits) - 1; }

    /// A value of all ones is 1.0.
    std::int64_t tintOf(std::int64_t albedo) const { return albedo + (albedo >> (numbers_.colourBits - 1)); }

    /// The light that a path meets where no surface is known: in a frame that gathers the light cube's, else the background.
    Colour lightBehind(const Path& path) const {
        return frame_.gather.bounces > 0 ? cube_.light(path.origin, path.direction, frame_.gather.parallax, path.gathered == 0, numbers_) : frame_.lighting.background;
    }

    /// The colour that a path's ray sees as it leaves the object: of the environment, unless the path has gathered.
    Colour leavingRadiance(const Path& path, const RayRequest& ray, bool shadows = true) {
        return hasEnvironment() && path.gathered == 0 ? radianceOf(path, ray, findHit(ray), shadows) : lightBehind(path);
    }

    /// Incoming light at a surface whose shadow rays start at `origin`: without occlusion, and with it.
    struct Incoming {
        Colour unoccluded, visible;
    };

    Incoming incoming(const WideVector& origin, const WideVector& normal, bool shadows, bool isAmbient = true, const Lobe* lobe = nullptr) {
        const Lighting& lighting = frame_.lighting;
        const Colour ambient = isAmbient ? lighting.ambient : Colour{};
        Incoming result{ambient, ambient};
        for (const Light& source : lighting.lights) {
            const Illumination illumination = illuminate(origin, normal, source, lighting.shadows && shadows, numbers_, lobe);
            Occlusion occluder = Occlusion::none;
            if (illumination.needsShadowRay) {
                ++counters.raysShadow;
                log.addRay(RayKind::shadow, illumination.shadowRay, numbers_);
                occluder = occlusion(prepareRay(illumination.shadowRay, frame_.bounds, numbers_));
            }
            for (int channel = 0; channel < 3; ++channel) {
                const std::int64_t direct = illumination.direct[channel];
                result.unoccluded[channel] += direct;
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

    /// The reflected light of a diffuse surface and what it emits.
    Colour emitted(const Material& material, Colour colour) const {
        for (int channel = 0; channel < 3; ++channel) colour[channel] = std::min(white(), colour[channel] + material.emission[channel]);
        return colour;
    }

    /// The light that a surface reflects: a diffuse one about its normal, a rough metal about the axis of its lobe.
    Colour light(const Surface& surface, const WideVector& axis, const Lobe* lobe, const Colour& albedo, bool isAmbient) {
        const WideVector origin = offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_);
        return reflectedBy(albedo, incoming(origin, axis, true, isAmbient, lobe).visible);
    }

    /// Incoming light at a point of the environment; `normal` has 11 fraction bits.
    Incoming environmentLight(const WideVector& point, const Vector& normal, bool shadows) {
        return incoming(offSurface(point, normal, frame_.lighting.offset, numbers_), {normal[0], normal[1], normal[2]}, shadows);
    }

    /// Where a ray hits the environment; its direction has components of shadeBits bits.
    struct EnvironmentHit {
        Vector direction;
        EnvironmentPoint point;
        EnvironmentTexel texel;
    };

    /// Counts a lookup, and reads its texel if it hits.
    EnvironmentHit lookedUp(const Vector& direction, const EnvironmentPoint& point) {
        EnvironmentHit found{direction, point, {}};
        if (point.kind != EnvironmentPoint::Kind::miss) found.texel = march_->texelOf(point, frame_.environment);
        ++counters.raysEnvironment;
        counters.marchSteps += static_cast<std::uint64_t>(point.steps);
        counters.albedoReads += point.kind == EnvironmentPoint::Kind::map;
        errors.illegalRecord = errors.illegalRecord || point.isIllegal || found.texel.isIllegal;
        return found;
    }

    EnvironmentHit findHit(const RayRequest& ray) {
        Vector direction;
        blockScale(ray.direction, numbers_.shadeBits, direction);
        return lookedUp(direction, march_->findHit(ray.origin, direction, frame_.environment));
    }

    EnvironmentHit findDirectView(std::int64_t x, std::int64_t y, const RayRequest& ray) {
        Vector direction;
        blockScale(ray.direction, numbers_.shadeBits, direction);
        const EnvironmentView& view = frame_.environment;
        return lookedUp(direction, view.isMapCamera ? march_->directView(x, y, direction, view) : march_->cameraView(ray.origin, direction, view));
    }

    bool hasEnvironment() const { return frame_.hasEnvironment && march_.has_value(); }

    /// Whether the environment may hide the hit of a path's ray: there is none of it inside glass, and none for a path that has gathered.
    bool mayBeHidden(const Path& path) const { return hasEnvironment() && frame_.environment.occlusion && !path.isInside && path.gathered == 0; }

    Incoming lightAt(const RayRequest& ray, const EnvironmentHit& found, bool shadows) {
        return environmentLight(march_->hitPosition(ray.origin, found.direction, found.point), found.texel.normal, shadows);
    }

    /// The colour of the environment where a path's ray hits it.
    Colour radianceOf(const Path& path, const RayRequest& ray, const EnvironmentHit& found, bool shadows) {
        if (found.point.kind == EnvironmentPoint::Kind::miss) return lightBehind(path);
        return reflectedBy(found.texel.albedo, lightAt(ray, found, shadows).visible);
    }

    /// Completes a pixel whose ray misses the object.
    Pixel directView(const Pixel& pixel, std::int64_t x, std::int64_t y, const RayRequest& ray) {
        if (!hasEnvironment() || (!frame_.maySeeObject(x, y) && !frame_.environment.shows(x, y))) return pixel;
        return showDirectView(pixel, x, y, ray, findDirectView(x, y, ray));
    }

    /// Completes a pixel that shows the environment itself.
    Pixel showDirectView(Pixel pixel, std::int64_t x, std::int64_t y, const RayRequest& ray, const EnvironmentHit& found) {
        if (found.point.kind == EnvironmentPoint::Kind::miss) return pixel;
        Incoming light = lightAt(ray, found, true);
        if (const auto gathered = gatherFromObject(x, y, ray, found))
            for (int channel = 0; channel < 3; ++channel) light.visible[channel] += (*gathered)[channel] - frame_.lighting.ambient[channel];
        pixel.colour = reflectedBy(found.texel.albedo, light.visible);
        for (int channel = 0; channel < 3; ++channel) pixel.ratio[channel] = ratioOf(light.visible[channel], light.unoccluded[channel]);
        return pixel;
    }

    /// The light of the ray that a point of the environment gathers, if it meets the object.
    std::optional<Colour> gatherFromObject(std::int64_t x, std::int64_t y, const RayRequest& view, const EnvironmentHit& found) {
        if (frame_.gather.bounces == 0) return std::nullopt;
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        const Vector& normal = found.texel.normal;
        const WideVector origin = offSurface(march_->hitPosition(view.origin, found.direction, found.point), normal, frame_.lighting.offset, numbers_);
        Path path{{one, one, one}, {0, 0, 0}, 0, false, 0, {}, {}};
        const RayRequest request = gatheredRay(origin, {normal[0], normal[1], normal[2]}, normal, nullptr, path, pixelPoint(x, y));
        log.addRay(RayKind::gather, request, numbers_);
        const Ray ray = prepareRay(request, frame_.bounds, numbers_);
        const Hit hit = trace(ray);
        if (!hit.found) return std::nullopt;
        return follow(path, request, ray, hit, pixelPoint(x, y));
    }

    /// part / whole with 12 fraction bits, less than 2; 1 for 0 / 0.
    std::int64_t ratioOf(std::int64_t part, std::int64_t whole) const {
        const std::int64_t one = std::int64_t(1) << numbers_.lightFraction;
        if (part == whole) return one;
        return part < 2 * whole ? (part << numbers_.lightFraction) / whole : 2 * one - 1;
    }

    /// Continues a path at a mirror or glass; false if the next ray sees only the background.
    bool continuePath(const Surface& surface, const Material& material, const Colour& albedo, const SamplePoint& point, Path& path, RayRequest& request, RayKind& kind) {
        WideVector normal = shadingNormal(surface, frame_.lighting.flat);
        const bool isRough = frame_.gather.bounces > 0 && material.lobe.alpha != 0;
        if (isRough) normal = microfacetNormal(normal, surface.dir, frame_.gather.microfacetPoint(path.gathered, surface.backSide) ^ point, material.lobe.alpha, numbers_);
        const Bounce next = bounce(surface, material, frame_.lighting.flat, frame_.lighting.offset, numbers_, isRough ? &normal : nullptr);
        Colour reflectionColour = frame_.lighting.background;
        const std::int64_t fresnelWeight = path.gathered == 0 ? next.fresnelWeight : 0;
        if (frame_.hasEnvironment && fresnelWeight != 0) {
            RayRequest reflection = next.ray;
            // The Fresnel reflection starts on the opposite side of the surface to the refracted ray
            reflection.origin = offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_);
            for (int a = 0; a < 3; ++a) reflection.direction[a] = next.reflection[a];
            path.origin = reflection.origin;
            path.direction = reflection.direction;
            reflectionColour = leavingRadiance(path, reflection, false);
        }
        const bool isTinted = !surface.backSide || material.kind == MaterialKind::mirror;
        path.isInside = next.isRefraction == isTinted;
        for (int channel = 0; channel < 3; ++channel) {
            std::int64_t& throughput = path.throughput[channel];
            if (isTinted) throughput = (throughput * tintOf(albedo[channel])) >> numbers_.lightFraction;
            const std::int64_t reflected = (throughput * fresnelWeight) >> numbers_.lightFraction;
            path.radiance[channel] = std::min(white(), path.radiance[channel] + ((reflected * reflectionColour[channel]) >> numbers_.lightFraction));
            throughput -= reflected;
        }
        request = next.ray;
        path.origin = request.origin;
        path.direction = request.direction;
        if (path.bounces == frame_.lighting.bounces) return false;
        ++path.bounces;
        ++(next.isRefraction ? counters.raysRefraction : counters.raysReflection);
        kind = next.isRefraction ? RayKind::refraction : RayKind::reflection;
        return true;
    }

    Registers limits_;
    std::optional<EnvironmentMarch> march_;
    const TextureImage* texture_ = nullptr;
    LightCube cube_;
};

} // namespace colonnade
