// Queries of the RTL specs about instances (docs/numbers.md, section 10).
//
//   instanceray  axis negative[3] origin[3] shear[2] tMax matrix[9] shift instanceOrigin[3] beyond
//                -> origin[3] direction[3] limit mantissa exponent enters tEntry t; the last two if it enters: t of
//                   the world where the object's is `beyond` after the entry
//   instancebox  axis negative[3] origin[3] shear[2] tMax low[3] high[3] -> whether the ray may enter the box
//   instanceface normals[9] geometricNormal[3] material normalMatrix[9] materialBase -> normals[9] geometricNormal[3]
//       material
#pragma once
#include "model/instances.hpp"
#include "queries.hpp"

namespace colonnade {

inline void replyInstanceRay(Query& query, const Numbers& n) {
    const Ray world = readTriangleRay(query);
    const std::int64_t tMax = query.number();
    Instance instance{};
    for (auto& row : instance.matrix) row = query.vector();
    instance.shift = static_cast<int>(query.number());
    instance.origin = query.vector();
    const Wide beyond = query.wide();
    const ObjectRay ray = instances::toObject(world, tMax, instance, n);
    const Ray prepared = prepareRay(ray.request, instances::cube(n), n);
    Reply reply;
    reply.all(ray.request.origin).all(ray.request.direction)
        << ray.request.tMax << static_cast<Wide>(ray.length.mantissa) << ray.length.exponent << prepared.enters;
    if (prepared.enters)
        reply << prepared.tEntry
              << instances::toWorld(floorShift<Wide>(prepared.tEntry, -n.gridFraction) + beyond, ray, n);
    reply.print();
}

inline void replyInstanceBox(Query& query, const Numbers& n) {
    const Ray world = readTriangleRay(query);
    const std::int64_t tMax = query.number();
    const Vector low = query.vector(), high = query.vector();
    Reply reply;
    (reply << instances::mayEnter(world, tMax, {low, high}, n)).print();
}

inline void replyInstanceFace(Query& query, const Numbers& n) {
    Face face{};
    for (auto& normal : face.normals) normal = query.vector();
    face.geometricNormal = query.vector();
    face.material = static_cast<int>(query.number());
    Instance instance{};
    for (auto& row : instance.normal) row = query.vector();
    instance.materialBase = static_cast<int>(query.number());
    const Face inWorld = instances::toWorld(face, instance, n);
    Reply reply;
    for (const Vector& normal : inWorld.normals) reply.all(normal);
    (reply.all(inWorld.geometricNormal) << inWorld.material).print();
}

} // namespace colonnade
