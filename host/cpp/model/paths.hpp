// Paths through the scene: how a ray goes on at the object, and what a path shows where it ends.
#pragma once
#include <optional>

#include "environment_march.hpp"
#include "tracer.hpp"

namespace colonnade {

/// What a path shows where its ray ends, as in the RTL: the background or light of the cube, without a surface; a
/// surface in ambient light and in the lights; one of the environment that the camera sees, where a gathered ray may
/// replace the ambient light; or one without ambient light, from which the path goes on with a gathered ray.
enum class PathEnd { background, cube, lit, directView, gathered, gathers };

/// State of a path: throughput (12 fraction bits per channel), accumulated radiance, number of traced reflections and
/// refractions, whether its ray is inside glass, number of gathered rays, and its last ray.
struct Path {
    Colour throughput, radiance;
    int bounces;
    bool isInside;
    int gathered;
    RayRequest ray;

    /// A path that begins with a ray.
    static Path of(const RayRequest& ray, std::int64_t one) { return {{one, one, one}, {0, 0, 0}, 0, false, 0, ray}; }

    /// The ray is the first one.
    bool isFirst() const { return bounces + gathered == 0; }
};

/// Follows the paths of a frame.
class PathTracer : public Tracer {
protected:
    using Tracer::Tracer;

    /// A hit of the object.
    struct ObjectPoint {
        Surface surface;
        const Material& material;
        Colour albedo;

        bool isSpecular() const {
            return material.kind == MaterialKind::mirror || material.kind == MaterialKind::glass;
        }
    };

    /// The colour that a path brings, from the first hit of the object on. `point`: the pixel's sample point.
    Colour follow(Path path, Ray ray, Hit hit, const SamplePoint& point) {
        for (;;) {
            // Find the surface
            const std::optional<ObjectPoint> at = pointOf(ray, hit);
            if (!at) return total(path, path.isFirst() ? frame_.lighting.background : beyond(path, path.ray));

            // End the path there, or go on with another ray
            std::optional<RayKind> next;
            if (at->isSpecular()) {
                next = bounceAt(*at, point, path);
                if (!next) return total(path, leavingRadiance(path, path.ray));
            } else {
                next = lightAt(*at, point, path);
                if (!next) return path.radiance;
            }
            logRay(*next, path.ray);

            // Trace the ray
            ray = prepareRay(path.ray, frame_.bounds, numbers_);
            hit = trace(ray);
            if (!hit.found) return total(path, leavingRadiance(path, path.ray));
            if (mayBeHidden(path)) {
                const EnvironmentHit found = findHit(path.ray);
                if (hides(found, ray, hit, false)) return total(path, radianceOf(path, path.ray, found, true));
            }
        }
    }

    void logRay(RayKind kind, const RayRequest& request) const {
        log.addRay(kind, request, numbers_);
        work.addRay(kind == RayKind::shadow, kind == RayKind::gather);
    }

    /// The attributes of a hit triangle in the world, without colours.
    Face faceAt(const Hit& hit) const {
        const Face face = memory_->faceOf(hit.id);
        return frame_.instances.empty()
                   ? face
                   : instances::toWorld(face, frame_.instances[static_cast<std::size_t>(hit.instance)], numbers_);
    }

    /// The object where a ray hits it; nothing if the colours of its leaf are outside the scene.
    std::optional<ObjectPoint> pointOf(const Ray& ray, const Hit& hit) {
        Face face = faceAt(hit);
        const Material& material = frame_.lighting.materialOf(face);
        work.addSurface(hit.id / leafTriangles, workOf(material.kind),
                        material.hasCornerColours || material.hasTexture);
        if ((material.hasCornerColours || material.hasTexture) && !memory_->readColours(hit.id, face)) {
            errors.illegalRecord = true;
            return std::nullopt;
        }
        return ObjectPoint{surfaceOf(ray, hit, face, numbers_), material, albedoOf(material, hit, face)};
    }

    static PathStep::Material workOf(MaterialKind kind) {
        return kind == MaterialKind::mirror  ? PathStep::Material::mirror
               : kind == MaterialKind::glass ? PathStep::Material::glass
                                             : PathStep::Material::diffuse;
    }

    /// Adds the light of a surface to a path. The path ends there, or goes on with a ray that gathers light.
    std::optional<RayKind> lightAt(const ObjectPoint& at, const SamplePoint& point, Path& path) {
        const PathEnd end = path.gathered < frame_.gather.bounces ? PathEnd::gathers : PathEnd::lit;
        const bool hasLobe =
            at.material.kind == MaterialKind::roughMetal && (end == PathEnd::gathers || frame_.gather.bounces == 0);
        const Lobe* const lobe = hasLobe ? &at.material.lobe : nullptr;
        const WideVector normal = shadingNormal(at.surface, frame_.lighting.flat),
                         axis = lobe ? lobeAxis(normal, at.surface.dir, numbers_) : normal;
        const WideVector origin =
            offSurface(at.surface.point, at.surface.faceForwardNormal, frame_.lighting.offset, numbers_);
        path.radiance =
            total(path, emitted(at.material, reflectedBy(at.albedo, incoming(origin, axis, true, end, lobe).visible)));
        if (end == PathEnd::lit) return std::nullopt;
        for (int channel = 0; channel < 3; ++channel)
            path.throughput[channel] =
                (path.throughput[channel] * tintOf(at.albedo[channel])) >> numbers_.lightFraction;
        gatherFrom(origin, axis, at.surface.faceForwardNormal, lobe, path, point);
        return RayKind::gather;
    }

    /// Sends a path on with a ray that gathers light at a surface, from `origin` off it.
    void gatherFrom(const WideVector& origin, const WideVector& axis, const Vector& faceForwardNormal, const Lobe* lobe,
                    Path& path, const SamplePoint& point) {
        const Vector direction =
            gatherDirection(axis, faceForwardNormal, frame_.gather.points[path.gathered] ^ point, lobe, numbers_);
        ++path.gathered;
        ++counters.raysGather;
        path.ray = {origin, {direction[0], direction[1], direction[2]}, numbers_.unlimited()};
    }

    Wide distanceOf(const Ray& ray, const Hit& hit) const {
        return floorShift<Wide>(ray.tEntry, -numbers_.gridFraction) + hit.t;
    }

    /// The radiance of a path that ends in a colour.
    Colour total(const Path& path, const Colour& colour) const {
        Colour radiance;
        for (int channel = 0; channel < 3; ++channel)
            radiance[channel] =
                std::min(white(), path.radiance[channel] +
                                      ((path.throughput[channel] * colour[channel]) >> numbers_.lightFraction));
        return radiance;
    }

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

    /// What a path's ray sees that meets no surface.
    Colour beyond(const Path& path, const RayRequest& ray) const {
        const PathEnd end = frame_.gather.bounces > 0 ? PathEnd::cube : PathEnd::background;
        return end == PathEnd::cube
                   ? cube_.light(ray.origin, ray.direction, frame_.gather.parallax, path.gathered == 0, numbers_)
                   : frame_.lighting.background;
    }

    /// The colour that a path's ray sees as it leaves the object: of the environment, unless the path has gathered.
    Colour leavingRadiance(const Path& path, const RayRequest& ray, bool shadows = true) {
        return hasEnvironment() && path.gathered == 0 ? radianceOf(path, ray, findHit(ray), shadows)
                                                      : beyond(path, ray);
    }

    /// Incoming light at a surface whose shadow rays start at `origin`: without occlusion, and with it.
    struct Incoming {
        Colour unoccluded, visible;
    };

    Incoming incoming(const WideVector& origin, const WideVector& normal, bool shadows, PathEnd end,
                      const Lobe* lobe = nullptr) {
        const Lighting& lighting = frame_.lighting;
        const Colour ambient = end == PathEnd::gathers ? Colour{} : lighting.ambient;
        Incoming result{ambient, ambient};
        for (const Light& source : lighting.lights) {
            const Illumination illumination =
                illuminate(origin, normal, source, lighting.shadows && shadows, numbers_, lobe);
            Occlusion occluder = Occlusion::none;
            if (illumination.needsShadowRay) {
                ++counters.raysShadow;
                logRay(RayKind::shadow, illumination.shadowRay);
                occluder = occlusion(prepareRay(illumination.shadowRay, frame_.bounds, numbers_));
            }
            for (int channel = 0; channel < 3; ++channel) {
                const std::int64_t direct = illumination.direct[channel];
                result.unoccluded[channel] += direct;
                if (occluder == Occlusion::none) result.visible[channel] += direct;
                if (occluder == Occlusion::transmissive)
                    result.visible[channel] += (direct * lighting.shadowTransmittance) >> numbers_.lightFraction;
            }
        }
        return result;
    }

    Colour reflectedBy(const Colour& albedo, const Colour& light) const {
        Colour colour;
        for (int channel = 0; channel < 3; ++channel)
            colour[channel] = reflected(albedo[channel], light[channel], numbers_);
        return colour;
    }

    /// The reflected light of a diffuse surface and what it emits.
    Colour emitted(const Material& material, Colour colour) const {
        for (int channel = 0; channel < 3; ++channel)
            colour[channel] = std::min(white(), colour[channel] + material.emission[channel]);
        return colour;
    }

    /// Where a ray hits the environment; its direction has components of shadeBits bits.
    struct EnvironmentHit {
        Vector direction;
        EnvironmentPoint point;
        EnvironmentTexel texel;
    };

    /// Counts a lookup, and reads its texel if it hits.
    EnvironmentHit lookedUp(const Vector& direction, const EnvironmentPoint& point, bool isDirect) {
        EnvironmentHit found{direction, point, {}};
        work.addLookup(isDirect, point.work, point.kind != HitKind::miss);
        if (point.kind != HitKind::miss) found.texel = march_->texelOf(point, frame_.environment);
        ++counters.raysEnvironment;
        counters.marchSteps += static_cast<std::uint64_t>(point.steps);
        counters.albedoReads += point.kind == HitKind::map;
        errors.illegalRecord = errors.illegalRecord || point.isIllegal || found.texel.isIllegal;
        return found;
    }

    EnvironmentHit findHit(const RayRequest& ray) {
        Vector direction;
        blockScale(ray.direction, numbers_.shadeBits, direction);
        return lookedUp(direction, march_->findHit(ray.origin, direction, frame_.environment), false);
    }

    EnvironmentHit findDirectView(std::int64_t x, std::int64_t y, const RayRequest& ray) {
        Vector direction;
        blockScale(ray.direction, numbers_.shadeBits, direction);
        const EnvironmentView& view = frame_.environment;
        return lookedUp(direction,
                        view.isMapCamera ? march_->directView(x, y, direction, view)
                                         : march_->cameraView(ray.origin, direction, view),
                        view.isMapCamera);
    }

    bool hasEnvironment() const { return frame_.hasEnvironment && march_.has_value(); }

    /// Whether the environment may hide the hit of a path's ray: there is none of it inside glass, and none for a path
    /// that has gathered.
    bool mayBeHidden(const Path& path) const {
        return hasEnvironment() && frame_.environment.occlusion && !path.isInside && path.gathered == 0;
    }

    /// Whether a point of the environment hides the hit of a ray, which is from the camera or not.
    bool hides(const EnvironmentHit& found, const Ray& ray, const Hit& hit, bool isFromCamera) const {
        const bool isHidden =
            march_->hides(found.point, found.direction, distanceOf(ray, hit), isFromCamera, frame_.environment);
        work.testsHit(isHidden);
        return isHidden;
    }

    /// Where the rays of a point of the environment begin.
    WideVector originAt(const RayRequest& ray, const EnvironmentHit& found) const {
        return offSurface(march_->hitPosition(ray.origin, found.direction, found.point), found.texel.normal,
                          frame_.lighting.offset, numbers_);
    }

    /// Incoming light at a point of the environment; its normal has 11 fraction bits.
    Incoming lightAt(const RayRequest& ray, const EnvironmentHit& found, bool shadows, PathEnd end) {
        const Vector& normal = found.texel.normal;
        return incoming(originAt(ray, found), {normal[0], normal[1], normal[2]}, shadows, end);
    }

    /// The colour of the environment where a path's ray hits it.
    Colour radianceOf(const Path& path, const RayRequest& ray, const EnvironmentHit& found, bool shadows) {
        if (found.point.kind == HitKind::miss) return beyond(path, ray);
        return reflectedBy(found.texel.albedo, lightAt(ray, found, shadows, PathEnd::lit).visible);
    }

    /// Continues a path at a mirror or glass; nothing if the next ray is not traced.
    std::optional<RayKind> bounceAt(const ObjectPoint& at, const SamplePoint& point, Path& path) {
        const Bounce next = bounceOf(at, point, path);
        work.addBounce(next.isRefraction, at.surface.backSide);
        const bool isTinted = !at.surface.backSide || at.material.kind == MaterialKind::mirror;
        if (isTinted)
            for (int channel = 0; channel < 3; ++channel)
                path.throughput[channel] =
                    (path.throughput[channel] * tintOf(at.albedo[channel])) >> numbers_.lightFraction;
        if (path.gathered == 0 && next.fresnelWeight != 0) addReflection(at.surface, next, path);
        path.isInside = next.isRefraction == isTinted;
        path.ray = next.ray;
        if (path.bounces == frame_.lighting.bounces) return std::nullopt;
        ++path.bounces;
        ++(next.isRefraction ? counters.raysRefraction : counters.raysReflection);
        return next.isRefraction ? RayKind::refraction : RayKind::reflection;
    }

    /// The bounce at a mirror or glass, about the normal of a microfacet if it is rough and the frame gathers.
    Bounce bounceOf(const ObjectPoint& at, const SamplePoint& point, const Path& path) const {
        WideVector normal = shadingNormal(at.surface, frame_.lighting.flat);
        const std::int64_t alpha = frame_.gather.bounces > 0 ? at.material.lobe.alpha : 0;
        if (alpha != 0)
            normal = microfacetNormal(normal, at.surface.dir,
                                      frame_.gather.microfacetPoint(path.gathered, at.surface.backSide) ^ point, alpha,
                                      numbers_);
        return bounce(at.surface, at.material, frame_.lighting.flat, frame_.lighting.offset, numbers_,
                      alpha != 0 ? &normal : nullptr);
    }

    /// Adds the Fresnel reflection at the front of glass to a tinted path, and takes its weight from the throughput.
    void addReflection(const Surface& surface, const Bounce& next, Path& path) {
        Colour seen = frame_.lighting.background;
        if (frame_.hasEnvironment) {
            RayRequest reflection = next.ray;
            // It starts on the opposite side of the surface to the refracted ray
            reflection.origin = offSurface(surface.point, surface.faceForwardNormal, frame_.lighting.offset, numbers_);
            for (int a = 0; a < 3; ++a) reflection.direction[a] = next.reflection[a];
            const std::size_t step = work.position();
            seen = leavingRadiance(path, reflection, false);
            work.isReflectionAt(step);
        }
        for (int channel = 0; channel < 3; ++channel) {
            const std::int64_t reflected = (path.throughput[channel] * next.fresnelWeight) >> numbers_.lightFraction;
            path.radiance[channel] =
                std::min(white(), path.radiance[channel] + ((reflected * seen[channel]) >> numbers_.lightFraction));
            path.throughput[channel] -= reflected;
        }
    }

    std::optional<EnvironmentMarch> march_;
    const TextureImage* texture_ = nullptr;
    LightCube cube_;
};

} // namespace colonnade
