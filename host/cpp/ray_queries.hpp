// Queries of the RTL specs about rays of applications (docs/numbers.md, section 9); floats are their bits.
//
//   ray    mantissa exponent base[3] isLocal, record[8]  -> kind tMin tMax origin[3] direction[3], kind: legal, refused, out of range
//   hit    mantissa exponent dominant entry t weights[3] -> t u v
#pragma once
#include "queries.hpp"
#include "rays/conversion.hpp"

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

} // namespace colonnade
