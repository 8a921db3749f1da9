// Queries of the RTL specs about rays of applications (docs/numbers.md, section 9); floats are their bits.
//
//   ray    mantissa exponent base[3] isLocal, record[8]  -> kind tMin tMax origin[3] direction[3], kind: legal,
//       refused, out of range
//   hit    mantissa exponent dominant entry t weights[3] -> t u v
//   image  low[3] high[3] mantissa exponent base[3], hexadecimal records: loads a scene; no reply
//   batch  mode count origin[3] tnear tfar, words of its rays or its sensor -> words of its hits
#pragma once
#include "queries.hpp"
#include "rays/tracer.hpp"

namespace colonnade {

inline float floatOf(std::int64_t word) {
    const auto bits = static_cast<std::uint32_t>(word);
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

inline std::uint32_t bitsOf(float value) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
}

inline rays::Placement readPlacement(Query& query) {
    return {static_cast<std::uint32_t>(query.number()), static_cast<int>(query.number()), {}};
}

inline colonnade_rays_record readRecord(Query& query) {
    colonnade_rays_record record;
    for (float& each : record.origin) each = floatOf(query.number());
    record.tnear = floatOf(query.number());
    for (float& each : record.direction) each = floatOf(query.number());
    record.tfar = floatOf(query.number());
    return record;
}

inline void replyRay(Query& query, const Numbers& n, int directionBits) {
    rays::Placement placement = readPlacement(query);
    placement.base = query.vector();
    const bool isLocal = query.number() != 0;
    const rays::ConvertedRay ray = rays::RayConverter(n, directionBits, placement).convert(readRecord(query), isLocal);
    Reply reply;
    reply << static_cast<int>(ray.kind) << ray.request.tMin << ray.request.tMax;
    reply.all(ray.request.origin).all(ray.request.direction).print();
}

inline void replyHit(Query& query, const Numbers& n, int directionBits) {
    const rays::Placement placement = readPlacement(query);
    const rays::Float dominant(floatOf(query.number()));
    const rays::RayConverter converter(n, directionBits, placement);
    rays::ConvertedRay converted{};
    converter.setStep(converted, dominant.mantissa, dominant.exponent);
    Ray ray{};
    ray.tEntry = query.number();
    Hit hit{true, query.number(), 0, {}, false};
    for (auto& weight : hit.weights) weight = query.number();
    const colonnade_rays_response response = converter.hitOf(converted, ray, hit);
    (Reply() << bitsOf(response.t) << bitsOf(response.u) << bitsOf(response.v)).print();
}

/// Batches of rays in a scene.
class RayBatches {
public:
    void load(Query& query, std::istream& words, const Numbers& numbers, int directionBits,
              const std::map<std::string, Layout>& layouts) {
        colonnade_rays_image image{};
        for (auto* bounds : {image.bounds_low, image.bounds_high})
            for (int a = 0; a < 3; ++a) bounds[a] = static_cast<std::int32_t>(query.number());
        image.scale_mantissa = static_cast<std::uint32_t>(query.number());
        image.scale_exponent = static_cast<std::int32_t>(query.number());
        for (std::int64_t& base : image.base) base = query.number();
        std::vector<std::uint8_t> records;
        std::tie(records, image.record_count) = readRecordBytes(words);
        image.records = records.data();
        image.record_bytes = records.size() / image.record_count;
        model_ = std::make_unique<rays::RayModel>(numbers, directionBits, layouts, image);
    }

    void reply(Query& query) {
        colonnade_rays_batch batch{};
        batch.mode = static_cast<std::uint32_t>(query.number());
        batch.count = static_cast<std::uint32_t>(query.number());
        for (float& each : batch.origin) each = floatOf(query.number());
        batch.tnear = floatOf(query.number());
        batch.tfar = floatOf(query.number());
        const std::uint32_t form = batch.mode & COLONNADE_RAYS_RESPONSE;
        const std::size_t words =
            batch.mode & COLONNADE_RAYS_SENSOR ? 16 : batch.count * (batch.mode & COLONNADE_RAYS_FAN ? 4 : 8);
        const std::size_t hitWords = form == COLONNADE_RAYS_OCCLUDED
                                         ? (batch.count + 63) / 64 * 2
                                         : batch.count * (form == COLONNADE_RAYS_HITS ? 4 : 2);
        std::vector<Line> rays(words / 16 + 1), hits(hitWords / 16 + 1);
        for (std::size_t i = 0; i < words; ++i) rays[i / 16].words[i % 16] = static_cast<std::uint32_t>(query.number());
        batch.rays = reinterpret_cast<std::uintptr_t>(rays.data());
        batch.hits = reinterpret_cast<std::uintptr_t>(hits.data());
        rays::Sums sums;
        if (model_->run(batch, sums) == COLONNADE_RAYS_BAD_BATCH)
            throw std::invalid_argument("the model refuses the batch");
        Reply reply;
        for (std::size_t i = 0; i < hitWords; ++i) reply << hits[i / 16].words[i % 16];
        reply.print();
    }

private:
    struct alignas(64) Line {
        std::uint32_t words[16];
    };

    std::unique_ptr<rays::RayModel> model_;
};

} // namespace colonnade
