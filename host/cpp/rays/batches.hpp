// Rays in double through batches of the device, and their hits refined.
#pragma once
#include <algorithm>
#include <exception>
#include <map>
#include <mutex>
#include <tuple>

#include "scene.hpp"

namespace colonnade::rays {

using AppRay = colonnade_rays_ray;
using AppHit = colonnade_rays_hit;

/// Rays through a packed scene, by its model or by a device. Queries by the model may run at the same time.
class Batches {
public:
    /// `device`: where the scene is loaded; null: its model.
    Batches(const PackedScene& scene, const colonnade_rays_backend* device, Sums& sums, bool isRefined)
        : scene_(scene), device_(device), sums_(sums), isRefined_(isRefined) {}

    static AppHit missOf(const AppRay& ray, std::size_t i) {
        return {ray.tfar, 0, 0, UINT32_MAX, UINT32_MAX, 0, static_cast<std::uint32_t>(i)};
    }

    /// Refined, the first of all hits: the device may find a face before tnear that is not, or miss the one in which a
    /// ray begins.
    void closest(const AppRay* rays, std::size_t count, std::uint32_t mode, std::uint32_t mask, AppHit* hits) const {
        inParts(count, [&](std::size_t first, std::size_t last) {
            std::vector<std::size_t> left;
            for (std::size_t i = first; i < last; ++i) hits[i] = missOf(rays[i], i);
            query(
                last - first, mode, mask, COLONNADE_RAYS_HITS,
                [&](std::size_t k) { return localOf(rays[first + k], isRefined_ ? slack : 0); },
                [&](std::size_t k, const Local& local, std::uint32_t id, const auto& responseOf) {
                    if (id >= COLONNADE_RAYS_OUT_OF_RANGE) return;
                    const std::size_t i = first + k, face = faceOf(id);
                    if (isRefined_ || !scene_.masks().isExact()) {
                        const std::optional<PlaneHit> hit =
                            isRefined_ ? refined(face, local, rays[i], mode, mask) : std::nullopt;
                        if (hit) hits[i] = hitOf(i, face, *hit);
                        else left.push_back(i);
                        return;
                    }
                    const colonnade_rays_response response = responseOf();
                    const auto [u, v] = scene_.weightsOf(response);
                    hits[i] = hitOf(
                        i, face,
                        {std::clamp(local.tOf(response.t), rays[i].tnear, rays[i].tfar), u, v, 0, isBack(response)});
                });
            if (left.empty()) return;
            for (const AppHit& hit : following(rays, left, mode, mask, 1)) hits[hit.ray] = hit;
        });
    }

    /// Refined, whether there is a closest hit.
    void occluded(const AppRay* rays, std::size_t count, std::uint32_t mode, std::uint32_t mask,
                  std::uint8_t* isOccluded) const {
        inParts(count, [&](std::size_t first, std::size_t last) {
            std::vector<std::size_t> left;
            query(
                last - first, mode, mask, COLONNADE_RAYS_OCCLUDED,
                [&](std::size_t k) { return localOf(rays[first + k], isRefined_ ? slack : 0); },
                [&](std::size_t k, const Local& local, std::uint32_t id, const auto&) {
                    const std::size_t i = first + k;
                    isOccluded[i] = id < COLONNADE_RAYS_OUT_OF_RANGE;
                    if (!isOccluded[i] || (!isRefined_ && scene_.masks().isExact())) return;
                    // The model names the triangle, a device does not
                    if (!device_ && isRefined_ && refined(faceOf(id), local, rays[i], mode, mask)) return;
                    isOccluded[i] = 0;
                    left.push_back(i);
                });
            if (left.empty()) return;
            for (const AppHit& hit : following(rays, left, mode, mask, 1)) isOccluded[hit.ray] = 1;
        });
    }

    /// All hits, at most `most` a ray, by ray and t.
    std::vector<AppHit> all(const AppRay* rays, std::size_t count, std::uint32_t mode, std::uint32_t mask,
                            std::size_t most) const {
        std::mutex adding;
        std::map<std::size_t, std::vector<AppHit>> parts;
        inParts(count, [&](std::size_t first, std::size_t last) {
            std::vector<std::size_t> each(last - first);
            for (std::size_t k = 0; k < each.size(); ++k) each[k] = first + k;
            std::vector<AppHit> hits = following(rays, each, mode, mask, most);
            const std::lock_guard<std::mutex> lock(adding);
            parts[first] = std::move(hits);
        });
        std::vector<AppHit> hits;
        for (const auto& [first, part] : parts) hits.insert(hits.end(), part.begin(), part.end());
        return hits;
    }

    /// The records that each ray reads in the model, in their order.
    std::vector<std::vector<std::uint32_t>> reads(const AppRay* rays, std::size_t count, std::uint32_t mode,
                                                  std::uint32_t mask, bool isOcclusion) const {
        std::vector<std::vector<std::uint32_t>> reads(count);
        RayRecord record;
        std::vector<RayStep> steps;
        record.log.writeTo(&steps);
        for (std::size_t i = 0; i < count; ++i) {
            steps.clear();
            scene_.model()->trace(localOf(rays[i], isRefined_ ? slack : 0).ray,
                                  deviceMode(mode, mask, isOcclusion ? COLONNADE_RAYS_OCCLUDED : COLONNADE_RAYS_HITS),
                                  record);
            for (const RayStep& step : steps)
                if (step.kind == RayStep::Kind::node || step.kind == RayStep::Kind::record)
                    reads[i].push_back(static_cast<std::uint32_t>(step.value));
        }
        sums_.add(count, record.refused, record.counters);
        return reads;
    }

private:
    /// Rays of a batch, edges of the box from which an origin is advanced, vertex units around a hit in which its
    /// neighbours count, and by which the device's interval is wider than the refined hits'.
    static constexpr std::size_t batchRays = 1 << 16;
    static constexpr double farEdges = 15, neighbourUnits = 16, slack = 4;

    struct alignas(64) Line {
        std::uint8_t bytes[64];
    };

    /// A ray for the device, relative to the scene's corner, and its direction: the application's times 1 / scale.
    struct Local {
        colonnade_rays_record ray;
        double direction[3];
        double start, scale;
        double step; ///< lengths of this direction in a vertex unit

        /// A t of the device along the application's ray.
        double tOf(double t) const { return (start + t) * scale; }
    };

    /// A ray and its hits so far.
    struct Walk {
        std::size_t ray;
        Local left;
        std::vector<std::size_t> met{};
        std::vector<AppHit> found{};

        bool isNew(std::size_t face) {
            const bool isKnown = std::find(met.begin(), met.end(), face) != met.end();
            if (!isKnown) met.push_back(face);
            return !isKnown;
        }
    };

    /// The hits of some rays. The model finds all in one traversal. A device finds one after the other, by tnear: a
    /// quarter unit beyond the last one, where the faces that were met are known.
    std::vector<AppHit> following(const AppRay* rays, const std::vector<std::size_t>& some, std::uint32_t mode,
                                  std::uint32_t mask, std::size_t most) const {
        std::vector<Walk> walks;
        for (const std::size_t ray : some) walks.push_back({ray, localOf(rays[ray], slack)});
        std::vector<std::size_t> live(device_ ? walks.size() : 0);
        for (std::size_t i = 0; i < live.size(); ++i) live[i] = i;
        if (!device_) takeAll(rays, walks, mode, mask, most);
        while (!live.empty()) {
            std::vector<std::size_t> next;
            query(
                live.size(), mode, mask, COLONNADE_RAYS_HITS,
                [&](std::size_t k) -> const Local& { return walks[live[k]].left; },
                [&](std::size_t k, const Local&, std::uint32_t id, const auto& responseOf) {
                    if (id >= COLONNADE_RAYS_OUT_OF_RANGE) return;
                    const colonnade_rays_response response = responseOf();
                    Walk& walk = walks[live[k]];
                    take(rays[walk.ray], walk, response, mode, mask, most);
                    if (walk.found.size() >= most) return;
                    // The next float at least: there the device has come no further than the face, or a quarter unit is
                    // less than a digit
                    float& near = walk.left.ray.tnear;
                    near = std::max(std::nextafter(near, std::numeric_limits<float>::infinity()),
                                    static_cast<float>(std::max(near, response.t) + walk.left.step / 4));
                    next.push_back(live[k]);
                });
            live = std::move(next);
        }
        std::vector<AppHit> hits;
        for (Walk& walk : walks) {
            std::sort(walk.found.begin(), walk.found.end(), [](const AppHit& one, const AppHit& other) {
                return std::tie(one.t, one.mesh, one.face) < std::tie(other.t, other.mesh, other.face);
            });
            hits.insert(hits.end(), walk.found.begin(),
                        walk.found.begin() + static_cast<std::ptrdiff_t>(std::min(walk.found.size(), most)));
        }
        return hits;
    }

    void takeAll(const AppRay* rays, std::vector<Walk>& walks, std::uint32_t mode, std::uint32_t mask,
                 std::size_t most) const {
        RayRecord record;
        for (Walk& walk : walks)
            for (const colonnade_rays_response& response :
                 scene_.model()->traceAll(walk.left.ray, deviceMode(mode, mask, COLONNADE_RAYS_HITS), record)) {
                if (walk.found.size() >= most) break;
                take(rays[walk.ray], walk, response, mode, mask, most);
            }
        count(walks.size(), record);
    }

    /// Adds what rays of the model did.
    void count(std::size_t rays, const RayRecord& record) const {
        sums_.add(rays, record.refused, record.counters);
        if (record.errors.stackOverflow || record.errors.illegalRecord) check(COLONNADE_RAYS_DEVICE);
    }

    /// Adds the hits that a face stands for which the device has met.
    void take(const AppRay& ray, Walk& walk, const colonnade_rays_response& response, std::uint32_t mode,
              std::uint32_t mask, std::size_t most) const {
        const std::size_t face = faceOf(response.id);
        const double t = walk.left.tOf(response.t);
        const auto [u, v] = scene_.weightsOf(response);
        bool isSettled = std::find(walk.met.begin(), walk.met.end(), face) != walk.met.end();
        if (isRefined_ && !isSettled)
            isSettled = settle(ray, walk.left, mode, mask, face, t, most > 1,
                               [&](std::size_t at, const PlaneHit& hit) {
                                   if (walk.isNew(at)) walk.found.push_back(hitOf(walk.ray, at, hit));
                               }) ||
                        most > 1;
        walk.isNew(face);
        if (!isSettled && t >= ray.tnear && t <= ray.tfar && (scene_.maskOf(face) & mask))
            walk.found.push_back(hitOf(walk.ray, face, {t, u, v, 0, isBack(response)}));
    }

    /// 2^−e of a number m · 2^e, m from 1 to below 2; 1 of 0 and of no number.
    static double inverseExponent(double number) {
        std::uint64_t bits;
        std::memcpy(&bits, &number, sizeof bits);
        const std::uint64_t biased = bits >> 52, bias = 1023;
        if (biased == 0 || biased >= 2 * bias)
            return std::isfinite(number) && number > 0 ? std::ldexp(1.0, -std::ilogb(number)) : 1;
        bits = (2 * bias - biased) << 52;
        std::memcpy(&number, &bits, sizeof bits);
        return number;
    }

    /// A direction has its largest component between 1 and 2. An origin far away is advanced to an edge before the box,
    /// one with a negative tnear goes back as far. The interval is wider by `slack` units at both ends.
    Local localOf(const AppRay& ray, double slack) const {
        Local local{{},
                    {},
                    0,
                    inverseExponent(
                        std::max({std::abs(ray.direction[0]), std::abs(ray.direction[1]), std::abs(ray.direction[2])})),
                    0};
        double at[3], square = 0;
        for (int a = 0; a < 3; ++a) {
            at[a] = ray.origin[a] - scene_.corner()[a];
            local.direction[a] = ray.direction[a] * local.scale;
            square += local.direction[a] * local.direction[a];
        }
        local.step = square > 0 ? scene_.unit() / std::sqrt(square) : 0;
        const double tnear = ray.tnear / local.scale - slack * local.step,
                     tfar = ray.tfar / local.scale + slack * local.step;
        // Far behind its origin a ray that begins outside of the box has no hit
        const double most = std::max({std::abs(at[0]), std::abs(at[1]), std::abs(at[2])}),
                     margin = 2 * slack * scene_.unit();
        const bool isAtBox =
            std::min({at[0], at[1], at[2]}) > -margin && std::max({at[0], at[1], at[2]}) < scene_.edge() + margin;
        const bool isMoved = most > farEdges * scene_.edge() || (tnear < 0 && (isAtBox || ray.tnear < 0));
        double enters = std::min(0.0, tnear), leaves = std::numeric_limits<double>::infinity();
        for (int a = 0; a < 3 && isMoved; ++a) {
            const double low = -scene_.edge(), high = 2 * scene_.edge();
            if (local.direction[a] == 0) {
                if (at[a] < low || at[a] > high) leaves = -1;
                continue;
            }
            const double one = (low - at[a]) / local.direction[a], other = (high - at[a]) / local.direction[a];
            enters = std::max(enters, std::min(one, other));
            leaves = std::min(leaves, std::max(one, other));
        }
        const bool misses = isMoved && !(enters <= leaves);
        local.start = isMoved && !misses ? enters : 0;
        for (int a = 0; a < 3; ++a) {
            local.ray.origin[a] = static_cast<float>(misses ? std::numeric_limits<double>::quiet_NaN()
                                                            : at[a] + local.direction[a] * local.start);
            local.ray.direction[a] = static_cast<float>(local.direction[a]);
        }
        local.ray.tnear = static_cast<float>(tnear - local.start);
        local.ray.tfar = static_cast<float>(tfar - local.start);
        return local;
    }

    std::uint32_t deviceMode(std::uint32_t mode, std::uint32_t mask, std::uint32_t response) const {
        return mode | response | COLONNADE_RAYS_LOCAL |
               static_cast<std::uint32_t>(scene_.masks().of(mask)) << COLONNADE_RAYS_MASK_SHIFT;
    }

    /// Calls `call` with parts of a range: by the model in several threads, whose first exception is thrown.
    template <class Call> void inParts(std::size_t count, const Call& call) const {
        if (device_ || count == 1) return call(std::size_t{0}, count);
#ifndef __cpp_exceptions
        call(std::size_t{0}, count);
#else
        std::mutex failing;
        std::exception_ptr failure;
        RayModel::inThreads(count, 1, [&](std::size_t first, std::size_t last) {
            try {
                call(first, last);
                return true;
            } catch (...) {
                const std::lock_guard<std::mutex> lock(failing);
                if (!failure) failure = std::current_exception();
                return false;
            }
        });
        if (failure) std::rethrow_exception(failure);
#endif
    }

    /// Calls `take` with each ray's index, the ray of `localAt`, the id of its response, and what gives the response,
    /// t, u and v of HITS.
    template <class LocalAt, class Take> void query(std::size_t count, std::uint32_t mode, std::uint32_t mask,
                                                    std::uint32_t form, const LocalAt& localAt,
                                                    const Take& take) const {
        const std::uint32_t bits = deviceMode(mode, mask, form);
        if (device_) return queryDevice(count, bits, form, localAt, take);
        RayRecord record;
        for (std::size_t i = 0; i < count; ++i) {
            const Local& local = localAt(i);
            const RayModel::Result result = scene_.model()->trace(local.ray, bits, record);
            take(i, local, result.id, [&] { return scene_.model()->response(result); });
        }
        this->count(count, record);
    }

    template <class LocalAt, class Take> void queryDevice(std::size_t count, std::uint32_t bits, std::uint32_t form,
                                                          const LocalAt& localAt, const Take& take) const {
        const std::size_t most = std::min(count, batchRays);
        std::vector<Line> records(most / 2 + 1), responses(most / 4 + 1);
        std::vector<Local> locals;
        for (std::size_t first = 0; first < count; first += batchRays) {
            const std::size_t end = std::min(count, first + batchRays);
            locals.clear();
            for (std::size_t i = first; i < end; ++i) {
                locals.push_back(localAt(i));
                std::memcpy(&records[(i - first) / 2].bytes[(i - first) % 2 * 32], &locals.back().ray, 32);
            }
            colonnade_rays_batch batch{};
            batch.rays = reinterpret_cast<std::uintptr_t>(records.data());
            batch.hits = reinterpret_cast<std::uintptr_t>(responses.data());
            batch.count = static_cast<std::uint32_t>(end - first);
            batch.mode = bits;
            check(device_->submit(device_->context, &batch));
            check(device_->wait(device_->context));
            const auto* const bytes = responses.data()->bytes;
            for (std::size_t i = first; i < end; ++i) {
                const std::size_t k = i - first;
                colonnade_rays_response response{0, COLONNADE_RAYS_MISS, 0, 0};
                if (form == COLONNADE_RAYS_HITS) std::memcpy(&response, bytes + 16 * k, 16);
                else if (bytes[k / 8] >> k % 8 & 1) response.id = 0;
                take(i, locals[k], response.id, [&] { return response; });
            }
        }
    }

    static void check(int status) {
        if (status == COLONNADE_RAYS_BAD_BATCH) throw Failure(status, "the device refuses the batch");
        if (status != COLONNADE_RAYS_OK)
            throw Failure(status, "the device met an illegal record, or its stack overflowed: the hits are not valid");
    }

    std::size_t faceOf(std::uint32_t id) const {
        const std::size_t face = scene_.faceOfId(id & ~(COLONNADE_RAYS_BACK_SIDE | COLONNADE_RAYS_NON_OPAQUE));
        if (face == ~std::size_t{0})
            throw Failure(COLONNADE_RAYS_DEVICE, "the device met a triangle that the scene does not have");
        return face;
    }

    AppHit hitOf(std::size_t ray, std::size_t face, const PlaneHit& hit) const {
        const std::uint32_t flags =
            (hit.backSide ? COLONNADE_RAYS_BACK_SIDE : 0) | (scene_.isOpaque(face) ? 0 : COLONNADE_RAYS_NON_OPAQUE);
        return {hit.t, hit.u, hit.v, scene_.meshOf(face), scene_.faceOf(face), flags, static_cast<std::uint32_t>(ray)};
    }

    static bool isBack(const colonnade_rays_response& response) {
        return (response.id & COLONNADE_RAYS_BACK_SIDE) != 0;
    }

    /// The hit of a ray with a face's plane, by the vertices as they are.
    std::optional<PlaneHit> planeHit(std::size_t face, const Local& local, const AppRay& ray) const {
        std::optional<PlaneHit> hit = scene_.faces().hit(face, ray.origin, local.direction);
        if (hit) hit->t *= local.scale;
        return hit;
    }

    /// The hit of the face that the device found, if its vertices agree and the ray accepts it.
    std::optional<PlaneHit> refined(std::size_t face, const Local& local, const AppRay& ray, std::uint32_t mode,
                                    std::uint32_t mask) const {
        const std::optional<PlaneHit> hit = planeHit(face, local, ray);
        return hit && hit->least >= 0 && accepts(ray, mode, mask, face, *hit) ? hit : std::nullopt;
    }

    bool accepts(const AppRay& ray, std::uint32_t mode, std::uint32_t mask, std::size_t face,
                 const PlaneHit& hit) const {
        return hit.t >= ray.tnear && hit.t <= ray.tfar &&
               !(mode & (hit.backSide ? COLONNADE_RAYS_CULL_BACK : COLONNADE_RAYS_CULL_FRONT)) &&
               (scene_.isOpaque(face) || !(mode & COLONNADE_RAYS_OPAQUE_ONLY)) && (scene_.maskOf(face) & mask);
    }

    /// Calls `take` with the hit of a face that the device found at t. Where its vertices say no, or with `takesAll`,
    /// also with those of its neighbours near t: a face beside it, or in the same place. False if all say no: then the
    /// first hit stays the device's, as an edge has no gap.
    template <class Take> bool settle(const AppRay& ray, const Local& local, std::uint32_t mode, std::uint32_t mask,
                                      std::size_t face, double t, bool takesAll, const Take& take) const {
        bool isOn = false;
        const auto offer = [&](std::size_t at) {
            const std::optional<PlaneHit> hit = planeHit(at, local, ray);
            if (!hit || hit->least < 0 ||
                (at != face && std::abs(hit->t - t) > neighbourUnits * local.step * local.scale))
                return false;
            isOn = true;
            if (!accepts(ray, mode, mask, at, *hit)) return false;
            take(at, *hit);
            return true;
        };
        if (!offer(face) || takesAll) scene_.faces().around(face, offer);
        return isOn;
    }

    const PackedScene& scene_;
    const colonnade_rays_backend* device_;
    Sums& sums_;
    bool isRefined_;
};

} // namespace colonnade::rays
