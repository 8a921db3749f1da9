// Batches of rays through the bit-exact model.
#pragma once
#include <thread>

#include "colonnade_rays.h"
#include "conversion.hpp"
#include "model/tracer.hpp"

namespace colonnade::rays {

static_assert(sizeof(colonnade_rays_batch) == 64 && sizeof(colonnade_rays_record) == 32 && sizeof(colonnade_rays_sensor) == 64 && sizeof(colonnade_rays_response) == 16,
              "formats in memory");

/// Traces single rays. Copies share the scene, and may run at the same time.
class RayTracer : public Tracer {
public:
    /// Weights are whole, as `HitConverter` reads them.
    RayTracer(Numbers numbers, int directionBits, const std::map<std::string, Layout>& layouts) : Tracer(whole(numbers), layouts), directionBits_(directionBits) {
        frame_ = {};
    }

    void load(const colonnade_rays_image& image) {
        memory_->load(image.records, image.record_count, image.record_bytes);
        frame_.recordCount = image.record_count;
        memory_->divide(frame_.recordCount, frame_.roots, numbers_.bvh, frame_.leafRecords());
        placement_ = {image.scale_mantissa, image.scale_exponent, {}};
        for (int a = 0; a < 3; ++a) {
            frame_.bounds.low[a] = image.bounds_low[a];
            frame_.bounds.high[a] = image.bounds_high[a];
            placement_.base[a] = image.base[a];
        }
    }

    bool isEmpty() const { return frame_.recordCount == 0; }

    /// A ray in the device's integers.
    ConvertedRay converted(const colonnade_rays_record& ray, bool isLocal) const { return RayConverter(numbers_, directionBits_, placement_).convert(ray, isLocal); }

    /// The response to a ray. With `COLONNADE_RAYS_OCCLUDED` only whether it is a miss.
    colonnade_rays_response response(const colonnade_rays_record& ray, std::uint32_t mode) {
        const RayConverter converter(numbers_, directionBits_, placement_);
        const ConvertedRay converted = converter.convert(ray, (mode & COLONNADE_RAYS_LOCAL) != 0);
        colonnade_rays_response miss{ray.tfar, COLONNADE_RAYS_MISS, 0, 0};
        if (converted.kind == ConvertedRay::Kind::outOfRange) miss.id = COLONNADE_RAYS_OUT_OF_RANGE;
        refused += converted.kind == ConvertedRay::Kind::refused;
        if (converted.kind != ConvertedRay::Kind::legal || isEmpty()) return miss;
        const RayFilter filter{(mode & COLONNADE_RAYS_CULL_FRONT) != 0, (mode & COLONNADE_RAYS_CULL_BACK) != 0, (mode & COLONNADE_RAYS_OPAQUE_ONLY) != 0,
                               static_cast<int>(mode >> COLONNADE_RAYS_MASK_SHIFT)};
        const Ray prepared = prepareRay(converted.request, frame_.bounds, numbers_);
        if ((mode & COLONNADE_RAYS_RESPONSE) == COLONNADE_RAYS_OCCLUDED) {
            if (occlusion(prepared, &filter) != Occlusion::none) miss.id = 0;
            return miss;
        }
        const Hit hit = trace(prepared, &filter);
        return hit.found ? converter.hitOf(converted, prepared, hit) : miss;
    }

    /// Rays that miss because they are none.
    std::uint64_t refused = 0;

private:
    static Numbers whole(Numbers numbers) {
        numbers.barycentricBits = numbers.weightBits;
        return numbers;
    }

    int directionBits_;
    Placement placement_{};
};

/// The model as a backend: it traces a batch in several threads, before `submit` returns.
class Model {
public:
    Model(const Numbers& numbers, int directionBits, const std::map<std::string, Layout>& layouts) : tracer_(numbers, directionBits, layouts) {}

    colonnade_rays_backend backend() {
        return {this,
                [](void* model, const colonnade_rays_image* image) { return static_cast<Model*>(model)->load(*image); },
                [](void* model, const colonnade_rays_batch* batch) { return static_cast<Model*>(model)->submit(*batch); },
                [](void* model) { return static_cast<Model*>(model)->wait(); },
                [](void* model, colonnade_rays_sums* counters) { *counters = static_cast<Model*>(model)->counters_; },
                [](void* model) { delete static_cast<Model*>(model); }};
    }

    const RayTracer& tracer() const { return tracer_; }

private:
    static constexpr std::size_t raysOfAThread = 512;
    static constexpr std::uint32_t forms = COLONNADE_RAYS_FAN | COLONNADE_RAYS_SENSOR;

    int load(const colonnade_rays_image& image) {
        tracer_.load(image);
        return COLONNADE_RAYS_OK;
    }

    int submit(const colonnade_rays_batch& batch) {
        constexpr std::uint32_t known = COLONNADE_RAYS_RESPONSE | forms | COLONNADE_RAYS_CULL_FRONT | COLONNADE_RAYS_CULL_BACK | COLONNADE_RAYS_OPAQUE_ONLY |
                                        COLONNADE_RAYS_LOCAL | 0xffu << COLONNADE_RAYS_MASK_SHIFT;
        if ((batch.rays | batch.hits) % 64 != 0 || batch.done % 4 != 0 || batch.count == 0 || batch.count > 1u << 24 || (batch.mode & ~known) != 0 ||
            (batch.mode & COLONNADE_RAYS_RESPONSE) == COLONNADE_RAYS_RESPONSE || (batch.mode & forms) == forms)
            return COLONNADE_RAYS_BAD_BATCH;
        if (batch.mode & COLONNADE_RAYS_SENSOR) {
            const std::uint32_t width = reinterpret_cast<const colonnade_rays_sensor*>(batch.rays)->width;
            if (width % 64 != 0 || width == 0 || width > 1u << 24) return COLONNADE_RAYS_BAD_BATCH;
        }
        // Runs of whole words of occluded rays
        const std::size_t most = std::max<std::size_t>(1, std::min<std::size_t>(std::thread::hardware_concurrency(), batch.count / raysOfAThread));
        const std::size_t run = (batch.count / most + 64) / 64 * 64;
        std::vector<RayTracer> tracers(most, tracer_);
        std::vector<std::thread> threads;
        const auto trace = [&](std::size_t part) { traceRun(tracers[part], batch, part * run, std::min<std::size_t>(batch.count, (part + 1) * run)); };
        for (std::size_t part = 1; part < most; ++part) threads.emplace_back(trace, part);
        trace(0);
        for (std::thread& thread : threads) thread.join();
        for (const RayTracer& tracer : tracers) add(tracer);
        counters_.rays += batch.count;
        if (batch.done != 0) *reinterpret_cast<std::uint32_t*>(batch.done) = batch.tag;
        return COLONNADE_RAYS_OK;
    }

    int wait() {
        const bool isValid = !hasFailed_;
        hasFailed_ = false;
        return isValid ? COLONNADE_RAYS_OK : COLONNADE_RAYS_DEVICE;
    }

    static void traceRun(RayTracer& tracer, const colonnade_rays_batch& batch, std::size_t first, std::size_t last) {
        const auto* const rays = reinterpret_cast<const std::uint8_t*>(batch.rays);
        auto* const hits = reinterpret_cast<std::uint8_t*>(batch.hits);
        const std::uint32_t form = batch.mode & COLONNADE_RAYS_RESPONSE;
        std::uint64_t word = 0;
        for (std::size_t i = first; i < last; ++i) {
            colonnade_rays_record ray;
            if (batch.mode & forms) {
                std::memcpy(ray.origin, batch.origin, sizeof ray.origin);
                ray.tnear = batch.tnear;
                if (batch.mode & COLONNADE_RAYS_FAN) std::memcpy(ray.direction, rays + 16 * i, 16);
                else setSensorRay(ray, *reinterpret_cast<const colonnade_rays_sensor*>(rays), static_cast<std::uint32_t>(i), batch.tfar);
            } else std::memcpy(&ray, rays + sizeof ray * i, sizeof ray);
            const colonnade_rays_response response = tracer.response(ray, batch.mode);
            if (form == COLONNADE_RAYS_HITS) std::memcpy(hits + 16 * i, &response, 16);
            else if (form == COLONNADE_RAYS_RANGES) std::memcpy(hits + 8 * i, &response, 8);
            else {
                word |= static_cast<std::uint64_t>(response.id == 0) << i % 64;
                if (i % 64 != 63 && i + 1 != last) continue;
                std::memcpy(hits + i / 64 * 8, &word, 8);
                word = 0;
            }
        }
    }

    static void setSensorRay(colonnade_rays_record& ray, const colonnade_rays_sensor& sensor, std::uint32_t i, float tfar) {
        for (int a = 0; a < 3; ++a) {
            const std::uint32_t sum = sensor.corner[a] + i % sensor.width * sensor.right[a] + i / sensor.width * sensor.down[a];
            ray.direction[a] = std::ldexp(static_cast<float>(static_cast<std::int32_t>(sum)), -30);
        }
        ray.tfar = tfar;
    }

    void add(const RayTracer& from) {
        const Counters& c = from.counters;
        counters_.rays_refused += from.refused;
        counters_.rays_in_box += c.raysInBox;
        counters_.node_reads += c.nodeReads;
        counters_.box_tests += c.boxTests;
        counters_.triangle_tests += c.triangleTests;
        counters_.deepest_stack = std::max<std::uint64_t>(counters_.deepest_stack, c.deepestStack);
        hasFailed_ = hasFailed_ || from.errors.stackOverflow || from.errors.illegalRecord;
    }

    RayTracer tracer_;
    colonnade_rays_sums counters_{};
    bool hasFailed_ = false;
};

} // namespace colonnade::rays
