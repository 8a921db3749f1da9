// Rays in double through batches of the device, and their hits refined.
#pragma once
#include <algorithm>
#include <tuple>

#include "scene.hpp"

namespace colonnade::rays {

using AppRay = colonnade_rays_ray;
using AppHit = colonnade_rays_hit;

class Batches {
public:
    Batches(PackedScene& scene, const colonnade_rays_backend& backend, const Numbers& numbers, bool isRefined)
        : scene_(scene), backend_(backend), edge_(std::ldexp(scene.unit(), numbers.vertexBits)), isRefined_(isRefined) {}

    /// Refined, the first of all hits: the device may find a face before tnear that is not, or miss the one in which a ray begins.
    void closest(const AppRay* rays, std::size_t count, std::uint32_t mode, AppHit* hits) {
        for (std::size_t i = 0; i < count; ++i) hits[i] = {rays[i].tfar, 0, 0, UINT32_MAX, UINT32_MAX, 0, static_cast<std::uint32_t>(i)};
        if (isRefined_) {
            for (const AppHit& hit : all(rays, count, mode, 1)) hits[hit.ray] = hit;
            return;
        }
        query(rays, count, mode | COLONNADE_RAYS_HITS, [&](std::size_t i, const colonnade_rays_response& response, double t) {
            if (response.id >= COLONNADE_RAYS_OUT_OF_RANGE) return;
            const std::size_t face = faceOf(response);
            const auto [u, v] = scene_.weightsOf(response);
            hits[i] = hitOf(i, face, {std::clamp(t, rays[i].tnear, rays[i].tfar), u, v, 0, (response.id & COLONNADE_RAYS_BACK_SIDE) != 0});
        });
    }

    void occluded(const AppRay* rays, std::size_t count, std::uint32_t mode, std::uint8_t* isOccluded) {
        query(rays, count, mode | COLONNADE_RAYS_OCCLUDED, [&](std::size_t i, const colonnade_rays_response& response, double) { isOccluded[i] = response.id == 0; });
    }

    /// Hits one after the other, by tnear: a quarter unit beyond the last one, where the faces that were met are known.
    std::vector<AppHit> all(const AppRay* rays, std::size_t count, std::uint32_t mode, std::size_t most) {
        std::vector<std::vector<AppHit>> found(count);
        std::vector<std::vector<std::size_t>> met(count);
        std::vector<std::size_t> live;
        std::vector<AppRay> left;
        for (std::size_t i = 0; i < count; ++i) {
            live.push_back(i);
            left.push_back(rays[i]);
            left[i].tnear -= slack * step(rays[i]);
            left[i].tfar += slack * step(rays[i]);
        }
        while (!live.empty()) {
            std::vector<std::size_t> nextLive;
            std::vector<AppRay> nextLeft;
            query(left.data(), live.size(), mode | COLONNADE_RAYS_HITS, [&](std::size_t k, const colonnade_rays_response& response, double t) {
                if (response.id >= COLONNADE_RAYS_OUT_OF_RANGE) return;
                const std::size_t i = live[k], face = faceOf(response);
                std::vector<std::size_t>& known = met[i];
                const auto isNew = [&](std::size_t at) {
                    const bool isKnown = std::find(known.begin(), known.end(), at) != known.end();
                    if (!isKnown) known.push_back(at);
                    return !isKnown;
                };
                const auto [u, v] = scene_.weightsOf(response);
                bool isSettled = std::find(known.begin(), known.end(), face) != known.end();
                if (isRefined_ && !isSettled)
                    isSettled = settle(rays[i], mode, face, t, most > 1,
                                       [&](std::size_t at, const PlaneHit& hit) {
                                           if (isNew(at)) found[i].push_back(hitOf(i, at, hit));
                                       }) ||
                                most > 1;
                isNew(face);
                if (!isSettled && t >= rays[i].tnear && t <= rays[i].tfar)
                    found[i].push_back(hitOf(i, face, {t, u, v, 0, (response.id & COLONNADE_RAYS_BACK_SIDE) != 0}));
                if (found[i].size() >= most) return;
                nextLive.push_back(i);
                nextLeft.push_back(left[k]);
                nextLeft.back().tnear = std::max(left[k].tnear, t) + step(rays[i]) / 4;
            });
            live = std::move(nextLive);
            left = std::move(nextLeft);
        }
        std::vector<AppHit> hits;
        for (std::vector<AppHit>& each : found) {
            std::sort(each.begin(), each.end(),
                      [](const AppHit& one, const AppHit& other) { return std::tie(one.t, one.mesh, one.face) < std::tie(other.t, other.mesh, other.face); });
            hits.insert(hits.end(), each.begin(), each.begin() + std::min(each.size(), most));
        }
        return hits;
    }

private:
    /// Rays of a batch, edges of the box from which an origin is advanced, vertex units around a hit in which its neighbours count.
    static constexpr std::size_t batchRays = 1 << 16;
    static constexpr double farEdges = 15, neighbourUnits = 16, slack = 4;

    struct alignas(64) Line {
        std::uint8_t bytes[64];
    };

    /// A ray for the device, relative to the scene's corner: t = start + t of the device · scale.
    struct Local {
        colonnade_rays_record ray;
        double start, scale;
    };

    /// Lengths of a ray's direction in a vertex unit.
    double step(const AppRay& ray) const {
        const double length = std::sqrt(ray.direction[0] * ray.direction[0] + ray.direction[1] * ray.direction[1] + ray.direction[2] * ray.direction[2]);
        return length > 0 ? scene_.unit() / length : 0;
    }

    /// A direction has its largest component between 1 and 2. An origin far away is advanced to an edge before the box, one with a
    /// negative tnear goes back as far.
    Local localOf(const AppRay& ray) const {
        const double largest = std::max({std::abs(ray.direction[0]), std::abs(ray.direction[1]), std::abs(ray.direction[2])});
        Local local{{}, 0, std::isfinite(largest) && largest > 0 ? std::ldexp(1.0, -std::ilogb(largest)) : 1};
        double at[3], direction[3], enters = std::min(0.0, ray.tnear / local.scale), leaves = std::numeric_limits<double>::infinity();
        bool isMoved = ray.tnear < 0;
        for (int a = 0; a < 3; ++a) {
            at[a] = ray.origin[a] - scene_.corner()[a];
            direction[a] = ray.direction[a] * local.scale;
            isMoved = isMoved || std::abs(at[a]) > farEdges * edge_;
        }
        for (int a = 0; a < 3 && isMoved; ++a) {
            const double low = -edge_, high = 2 * edge_;
            if (direction[a] == 0) {
                if (at[a] < low || at[a] > high) leaves = -1;
                continue;
            }
            const double one = (low - at[a]) / direction[a], other = (high - at[a]) / direction[a];
            enters = std::max(enters, std::min(one, other));
            leaves = std::min(leaves, std::max(one, other));
        }
        const bool misses = isMoved && !(enters <= leaves);
        local.start = isMoved && !misses ? enters : 0;
        for (int a = 0; a < 3; ++a) {
            local.ray.origin[a] = static_cast<float>(misses ? std::numeric_limits<double>::quiet_NaN() : at[a] + direction[a] * local.start);
            local.ray.direction[a] = static_cast<float>(direction[a]);
        }
        local.ray.tnear = static_cast<float>(ray.tnear / local.scale - local.start);
        local.ray.tfar = static_cast<float>(ray.tfar / local.scale - local.start);
        return local;
    }

    /// Calls `take` with each ray's index, its response, and the response's t along the ray.
    template <class Take> void query(const AppRay* rays, std::size_t count, std::uint32_t mode, const Take& take) {
        const std::size_t most = std::min(count, batchRays);
        std::vector<Line> records(most / 2 + 1), responses(most / 4 + 1);
        std::vector<Local> locals;
        for (std::size_t first = 0; first < count; first += batchRays) {
            const std::size_t end = std::min(count, first + batchRays);
            locals.clear();
            for (std::size_t i = first; i < end; ++i) {
                locals.push_back(localOf(rays[i]));
                std::memcpy(&records[(i - first) / 2].bytes[(i - first) % 2 * 32], &locals.back().ray, 32);
            }
            colonnade_rays_batch batch{};
            batch.rays = reinterpret_cast<std::uintptr_t>(records.data());
            batch.hits = reinterpret_cast<std::uintptr_t>(responses.data());
            batch.count = static_cast<std::uint32_t>(end - first);
            batch.mode = mode | COLONNADE_RAYS_LOCAL;
            check(backend_.submit(backend_.context, &batch));
            check(backend_.wait(backend_.context));
            const auto* const bytes = responses.data()->bytes;
            for (std::size_t i = first; i < end; ++i) {
                const std::size_t k = i - first;
                colonnade_rays_response response{0, COLONNADE_RAYS_MISS, 0, 0};
                if ((mode & COLONNADE_RAYS_RESPONSE) == COLONNADE_RAYS_HITS) std::memcpy(&response, bytes + 16 * k, 16);
                else if (bytes[k / 8] >> k % 8 & 1) response.id = 0;
                take(i, response, (locals[k].start + response.t) * locals[k].scale);
            }
        }
    }

    static void check(int status) {
        if (status == COLONNADE_RAYS_BAD_BATCH) throw Failure(status, "the device refuses the batch");
        if (status != COLONNADE_RAYS_OK) throw Failure(status, "the device met an illegal record, or its stack overflowed: the hits are not valid");
    }

    std::size_t faceOf(const colonnade_rays_response& response) const {
        const std::size_t face = scene_.faceOfId(response.id & ~(COLONNADE_RAYS_BACK_SIDE | COLONNADE_RAYS_NON_OPAQUE));
        if (face == ~std::size_t{0}) throw Failure(COLONNADE_RAYS_DEVICE, "the device met a triangle that the scene does not have");
        return face;
    }

    AppHit hitOf(std::size_t ray, std::size_t face, const PlaneHit& hit) const {
        const std::uint32_t flags = (hit.backSide ? COLONNADE_RAYS_BACK_SIDE : 0) | (scene_.isOpaque(face) ? 0 : COLONNADE_RAYS_NON_OPAQUE);
        return {hit.t, hit.u, hit.v, scene_.meshOf(face), scene_.faceOf(face), flags, static_cast<std::uint32_t>(ray)};
    }

    bool accepts(const AppRay& ray, std::uint32_t mode, std::size_t face, const PlaneHit& hit) const {
        return hit.t >= ray.tnear && hit.t <= ray.tfar && !(mode & (hit.backSide ? COLONNADE_RAYS_CULL_BACK : COLONNADE_RAYS_CULL_FRONT)) &&
               (scene_.isOpaque(face) || !(mode & COLONNADE_RAYS_OPAQUE_ONLY)) && (scene_.maskOf(face) & mode >> COLONNADE_RAYS_MASK_SHIFT);
    }

    /// Calls `take` with the hit of a face that the device found at t. Where its vertices say no, or with `takesAll`, also with those
    /// of its neighbours near t: a face beside it, or in the same place. False if all say no: then the first hit stays the device's,
    /// as an edge has no gap.
    template <class Take> bool settle(const AppRay& ray, std::uint32_t mode, std::size_t face, double t, bool takesAll, const Take& take) {
        Faces& faces = scene_.faces();
        bool isOn = false;
        const auto offer = [&](std::size_t at) {
            const std::optional<PlaneHit> hit = faces.hit(at, ray.origin, ray.direction);
            if (!hit || hit->least < 0 || (at != face && std::abs(hit->t - t) > neighbourUnits * step(ray))) return false;
            isOn = true;
            if (!accepts(ray, mode, at, *hit)) return false;
            take(at, *hit);
            return true;
        };
        if (!offer(face) || takesAll) faces.around(face, offer);
        return isOn;
    }

    PackedScene& scene_;
    const colonnade_rays_backend& backend_;
    double edge_;
    bool isRefined_;
};

} // namespace colonnade::rays
