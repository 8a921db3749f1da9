// Rays through the bit-exact model of a scene.
#pragma once
#include <atomic>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "batch_bytes.hpp"
#include "conversion.hpp"
#include "model/tracer.hpp"

namespace colonnade::rays {

static_assert(sizeof(colonnade_rays_batch) == 64 && sizeof(colonnade_rays_record) == 32 &&
                  sizeof(colonnade_rays_sensor) == 64 && sizeof(colonnade_rays_response) == 16,
              "formats in memory");

/// Sums of what rays did. A thread adds to its own ones, so that it needs no lock and shares no line of a cache.
class Sums {
public:
    void add(std::uint64_t rays, std::uint64_t refused, const Counters& c) {
        static thread_local std::pair<std::uint64_t, Part*> last{};
        if (last.first != number_) last = {number_, &partOfThread()};
        const std::uint64_t values[] = {rays, refused, c.raysInBox, c.nodeReads, c.boxTests, c.triangleTests};
        Part& part = *last.second;
        for (std::size_t i = 0; i < part.sums.size(); ++i)
            part.sums[i].store(part.sums[i].load(std::memory_order_relaxed) + values[i], std::memory_order_relaxed);
        if (c.deepestStack > part.deepest.load(std::memory_order_relaxed))
            part.deepest.store(c.deepestStack, std::memory_order_relaxed);
    }

    colonnade_rays_sums total() const {
        std::array<std::uint64_t, 6> sums{};
        std::uint64_t deepest = 0;
        const std::lock_guard<std::mutex> lock(adding_);
        for (const auto& [thread, part] : parts_) {
            for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += part.sums[i];
            deepest = std::max<std::uint64_t>(deepest, part.deepest);
        }
        return {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], deepest};
    }

private:
    struct alignas(64) Part {
        std::array<std::atomic<std::uint64_t>, 6> sums{};
        std::atomic<std::uint64_t> deepest{0};
    };

    /// Unlike an address, never equal to earlier sums'.
    static std::uint64_t newNumber() {
        static std::atomic<std::uint64_t> numbers{0};
        return ++numbers;
    }

    Part& partOfThread() {
        const std::lock_guard<std::mutex> lock(adding_);
        return parts_[std::this_thread::get_id()];
    }

    const std::uint64_t number_ = newNumber();
    mutable std::mutex adding_;
    std::map<decltype(std::this_thread::get_id()), Part>
        parts_; ///< a thread that has ended leaves its own to one of the same id
};

/// What the rays of a thread do until their sums are added.
struct RayRecord : TraceRecord {
    std::uint64_t refused = 0;
};

/// A loaded scene. It does not change: any number of threads may trace at the same time.
class RayModel {
public:
    RayModel(const Numbers& numbers, int directionBits, const std::map<std::string, Layout>& layouts,
             const colonnade_rays_image& image, FaceTable faces = {})
        : numbers_(whole(numbers)), memory_(layouts, numbers_),
          converter_(numbers_, directionBits,
                     {image.scale_mantissa, image.scale_exponent, {image.base[0], image.base[1], image.base[2]}}),
          faces_(faces) {
        memory_.load(image.records, image.record_count, image.record_bytes);
        frame_ = {};
        frame_.recordCount = image.record_count;
        memory_.divide(frame_.recordCount, frame_.roots, numbers_.bvh, frame_.leafRecords());
        for (int a = 0; a < 3; ++a) {
            frame_.bounds.low[a] = image.bounds_low[a];
            frame_.bounds.high[a] = image.bounds_high[a];
        }
    }

    /// What a ray hits: the id of a response, and what `response` makes the rest of.
    struct Result {
        std::uint32_t id;
        float tfar;
        ConvertedRay converted;
        Ray prepared;
        Hit hit;
    };

    /// The result of a ray of the mode HITS or OCCLUDED; in the latter any triangle on the way.
    Result trace(const colonnade_rays_record& ray, std::uint32_t mode, RayRecord& record) const {
        Result result;
        if (!prepare(ray, mode, record, result)) return result;
        const RayFilter filter = filterOf(mode);
        const SceneSearch search(numbers_, memory_, frame_, record, faces_);
        const bool isOcclusion = (mode & COLONNADE_RAYS_RESPONSE) == COLONNADE_RAYS_OCCLUDED;
        result.hit = isOcclusion ? search.anyHit(result.prepared, filter) : search.trace(result.prepared, &filter);
        if (result.hit.found) result.id = converter_.idOf(result.hit);
        return result;
    }

    /// The responses to all triangles that a ray of the mode HITS hits, in the order of (t, id).
    std::vector<colonnade_rays_response> traceAll(const colonnade_rays_record& ray, std::uint32_t mode,
                                                  RayRecord& record) const {
        Result result;
        std::vector<colonnade_rays_response> responses;
        if (!prepare(ray, mode, record, result)) return responses;
        for (const Hit& hit : SceneSearch(numbers_, memory_, frame_, record).allHits(result.prepared, filterOf(mode)))
            responses.push_back(converter_.hitOf(result.converted, result.prepared, hit));
        return responses;
    }

    /// A result in the application's numbers.
    colonnade_rays_response response(const Result& result) const {
        if (!result.hit.found) return {result.tfar, result.id, 0, 0};
        return converter_.hitOf(result.converted, result.prepared, result.hit);
    }

    /// Runs a batch in several threads; a status.
    int run(const colonnade_rays_batch& batch, Sums& sums) const {
        if (!isLegal(batch)) return COLONNADE_RAYS_BAD_BATCH;
        // Runs of whole words of occluded rays
        const bool isValid = inThreads(
            batch.count, 64, [&](std::size_t first, std::size_t last) { return runPart(batch, first, last, sums); });
        if (batch.done != 0) *reinterpret_cast<std::uint32_t*>(batch.done) = batch.tag;
        return isValid ? COLONNADE_RAYS_OK : COLONNADE_RAYS_DEVICE;
    }

    /// Calls `part` with parts of a range, multiples of `multiple` but for the last, in several threads if it is long;
    /// whether all return true. A part whose thread does not start is run by the caller.
    template <class Part> static bool inThreads(std::size_t count, std::size_t multiple, const Part& part) {
        static const std::size_t processors = std::max(1u, std::thread::hardware_concurrency());
        const std::size_t most = std::min(processors, count / raysOfAThread);
        if (most <= 1) return part(std::size_t{0}, count);
        const std::size_t run = (count / most + multiple) / multiple * multiple;
        std::vector<std::thread> threads;
        std::atomic<bool> isValid{true};
        std::size_t first = 0;
        for (; first + run < count; first += run) {
            const auto each = [&isValid, &part, first, last = first + run] {
                if (!part(first, last)) isValid = false;
            };
            if (!started(threads, each)) break;
        }
        const bool isLastValid = part(first, count);
        for (std::thread& thread : threads) thread.join();
        return isLastValid && isValid;
    }

private:
    /// Sets up a ray as a miss; false if it is one without a look at the scene.
    bool prepare(const colonnade_rays_record& ray, std::uint32_t mode, RayRecord& record, Result& result) const {
        result.id = COLONNADE_RAYS_MISS;
        result.tfar = ray.tfar;
        result.hit.found = false;
        converter_.convert(ray, (mode & COLONNADE_RAYS_LOCAL) != 0, result.converted);
        const ConvertedRay& converted = result.converted;
        if (converted.kind == ConvertedRay::Kind::outOfRange) result.id = COLONNADE_RAYS_OUT_OF_RANGE;
        record.refused += converted.kind == ConvertedRay::Kind::refused;
        if (converted.kind != ConvertedRay::Kind::legal) return false;
        prepareRay(converted.request, frame_.bounds, numbers_, result.prepared);
        return true;
    }

    static RayFilter filterOf(std::uint32_t mode) {
        return {(mode & COLONNADE_RAYS_CULL_FRONT) != 0, (mode & COLONNADE_RAYS_CULL_BACK) != 0,
                (mode & COLONNADE_RAYS_OPAQUE_ONLY) != 0, static_cast<int>(mode >> COLONNADE_RAYS_MASK_SHIFT)};
    }

    static constexpr std::size_t raysOfAThread = 512;
    static constexpr std::uint32_t forms = COLONNADE_RAYS_FAN | COLONNADE_RAYS_SENSOR;

    /// Weights are whole, as `RayConverter::hitOf` reads them.
    static Numbers whole(Numbers numbers) {
        numbers.barycentricBits = numbers.weightBits;
        return numbers;
    }

    template <class Call> static bool started(std::vector<std::thread>& threads, const Call& call) {
#ifdef __cpp_exceptions
        try {
            threads.emplace_back(call);
        } catch (const std::system_error&) { return false; }
        return true;
#else
        (void)threads, (void)call;
        return false;
#endif
    }

    static bool isLegal(const colonnade_rays_batch& batch) {
        constexpr std::uint32_t known = COLONNADE_RAYS_RESPONSE | forms | COLONNADE_RAYS_CULL_FRONT |
                                        COLONNADE_RAYS_CULL_BACK | COLONNADE_RAYS_OPAQUE_ONLY | COLONNADE_RAYS_LOCAL |
                                        0xffu << COLONNADE_RAYS_MASK_SHIFT;
        if ((batch.rays | batch.hits) % 64 != 0 || batch.done % 4 != 0 || batch.count == 0 || batch.count > 1u << 24 ||
            (batch.mode & ~known) != 0 || (batch.mode & COLONNADE_RAYS_RESPONSE) == COLONNADE_RAYS_RESPONSE ||
            (batch.mode & forms) == forms)
            return false;
        if (!(batch.mode & COLONNADE_RAYS_SENSOR)) return true;
        const std::uint32_t width = reinterpret_cast<const colonnade_rays_sensor*>(batch.rays)->width;
        return width % 64 == 0 && width != 0 && width <= 1u << 24;
    }

    bool runPart(const colonnade_rays_batch& batch, std::size_t first, std::size_t last, Sums& sums) const {
        const auto* const rays = reinterpret_cast<const std::uint8_t*>(batch.rays);
        auto* const hits = reinterpret_cast<std::uint8_t*>(batch.hits);
        const std::uint32_t form = batch.mode & COLONNADE_RAYS_RESPONSE;
        RayRecord record;
        std::uint64_t word = 0;
        for (std::size_t i = first; i < last; ++i) {
            colonnade_rays_record ray;
            if (batch.mode & forms) {
                std::memcpy(ray.origin, batch.origin, sizeof ray.origin);
                ray.tnear = batch.tnear;
                if (batch.mode & COLONNADE_RAYS_FAN) std::memcpy(ray.direction, rays + 16 * i, 16);
                else
                    setSensorRay(ray, *reinterpret_cast<const colonnade_rays_sensor*>(rays),
                                 static_cast<std::uint32_t>(i), batch.tfar);
            } else std::memcpy(&ray, rays + sizeof ray * i, sizeof ray);
            const Result found = trace(ray, batch.mode, record);
            if (form == COLONNADE_RAYS_OCCLUDED) {
                word |= static_cast<std::uint64_t>(found.hit.found) << i % 64;
                if (i % 64 != 63 && i + 1 != last) continue;
                std::memcpy(hits + i / 64 * 8, &word, 8);
                word = 0;
                continue;
            }
            const colonnade_rays_response whole = response(found);
            if (form == COLONNADE_RAYS_HITS) std::memcpy(hits + 16 * i, &whole, 16);
            else std::memcpy(hits + 8 * i, &whole, 8);
        }
        sums.add(last - first, record.refused, record.counters);
        return !record.errors.stackOverflow && !record.errors.illegalRecord;
    }

    static void setSensorRay(colonnade_rays_record& ray, const colonnade_rays_sensor& sensor, std::uint32_t i,
                             float tfar) {
        for (int a = 0; a < 3; ++a) {
            const std::uint32_t sum =
                sensor.corner[a] + i % sensor.width * sensor.right[a] + i / sensor.width * sensor.down[a];
            ray.direction[a] = std::ldexp(static_cast<float>(static_cast<std::int32_t>(sum)), -30);
        }
        ray.tfar = tfar;
    }

    Numbers numbers_;
    ColumnMemory memory_;
    RayConverter converter_;
    Frame frame_;
    FaceTable faces_;
};

} // namespace colonnade::rays
