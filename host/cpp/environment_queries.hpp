// Queries about an environment's maps. Lines that load the maps come first, in this order, and have no reply:
//
//   layout word name=offset,width,signed ...                (for each of the manifest's `attributes.layouts`)
//   sizes  name=value ...                                   (`attributes.sizes`)
//   words  memory bytes hexadecimal ...                     (for each memory: bytes per word, and the words)
//   albedo x y                                            -> r g b isIllegal
//   normal x y                                            -> x y z isIllegal
//   tile   x y                                            -> cellLog count ids[4] isIllegal
//   cell   x y                                            -> id isIllegal
//   plane  id                                             -> a b c exponent
//   boundingPlane index                                     -> a b c exponent albedo[3] normal[3]
//   march  matrix[9] offset[3] offsetShift exponent rotation[9] stepX stepY boundingPlanes tolerance isMapCamera
//          isSeen pixel[2] hitDistance origin[3] direction[3]
//                                                         -> kind x y entry isHidden travel travelExponent steps
//                                                            point[3] albedo[3] normal[3] hidesObject isIllegal
//          the point hit by the ray, or with isSeen the point visible in the pixel, whose ray it is; all 0 for a
//          miss. hidesObject: it is nearer than hitDistance
#pragma once
#include <map>
#include <optional>
#include <vector>

#include "model/environment_march.hpp"
#include "queries.hpp"

namespace colonnade {

/// Holds the maps and replies to queries about them.
class EnvironmentQueries {
public:
    void begin(const std::map<std::string, std::int64_t>& sizes, const std::map<std::string, Layout>& layouts) {
        image_.emplace(AttributeSizes(sizes), layouts);
    }

    void load(std::istream& words) {
        std::string memory;
        std::size_t stride, count = 0;
        words >> memory >> stride;
        std::vector<std::uint8_t> bytes;
        for (std::string digits; words >> digits; ++count) {
            digits.insert(0, 2 * stride - digits.size(), '0');
            for (std::size_t end = 2 * stride; end > 0; end -= 2)
                bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits.substr(end - 2, 2), nullptr, 16)));
        }
        image().load(memory, bytes.data(), count, stride);
    }

    /// The maps, after `begin`.
    const std::optional<AttributeImage>& maps() const { return image_; }

    bool knows(const std::string& kind) const {
        return kind == "albedo" || kind == "normal" || kind == "tile" || kind == "cell" || kind == "plane" ||
               kind == "boundingPlane" || kind == "march";
    }

    Reply reply(const std::string& kind, Query& query, const Numbers& numbers) {
        if (kind == "march") return march(query, numbers);
        const int first = static_cast<int>(query.number());
        Reply reply;
        if (kind == "plane") return put(reply, image().planeOf(first));
        if (kind == "boundingPlane") {
            const BoundingPlaneEntry& entry = image().boundingPlane(first);
            put(reply, entry.plane) << entry.albedo.r << entry.albedo.g << entry.albedo.b;
            return reply << entry.normal.x << entry.normal.y << entry.normal.z;
        }
        const int x = first, y = static_cast<int>(query.number());
        if (!image().sizes().covers(x, y)) throw std::invalid_argument("the pixel is outside the map");
        if (kind == "albedo") {
            const Rgb12 albedo = image().albedoAt(x, y);
            return reply << albedo.r << albedo.g << albedo.b << albedo.isIllegal;
        }
        if (kind == "normal") {
            const Normal12 normal = image().normalAt(x, y);
            return reply << normal.x << normal.y << normal.z << normal.isIllegal;
        }
        if (kind == "cell") {
            const CellPlane cell = image().cellAt(x, y);
            return reply << cell.id << cell.isIllegal;
        }
        const TileInfo tile = image().tileAt(x, y);
        return (reply << tile.cellLog2 << tile.count).all(tile.ids) << tile.isIllegal;
    }

private:
    static Reply& put(Reply& reply, const PlaneWord& plane) {
        return reply << plane.a << plane.b << plane.c << plane.e;
    }

    Reply march(Query& query, const Numbers& numbers) {
        EnvironmentView view{};
        for (auto& row : view.matrix) row = query.vector();
        view.offset = query.vector();
        view.offsetShift = static_cast<int>(query.number());
        view.exponent = static_cast<int>(query.number());
        for (auto& row : view.rotation) row = query.vector();
        for (auto& step : view.step) step = query.number();
        view.boundingPlanes = static_cast<int>(query.number());
        view.occlusionTolerance = query.number();
        view.isMapCamera = query.number() != 0;
        const bool isSeen = query.number() != 0;
        const std::int64_t x = query.number(), y = query.number();
        const Wide hitDistance = query.wide();
        const WideVector origin = query.wideVector();
        Vector direction;
        blockScale(query.wideVector(), numbers.shadeBits, direction);
        const EnvironmentMarch march(numbers, image());
        const EnvironmentPoint point = !isSeen            ? march.findHit(origin, direction, view)
                                       : view.isMapCamera ? march.directView(x, y, direction, view)
                                                          : march.cameraView(origin, direction, view);
        Reply reply;
        reply << static_cast<int>(point.kind) << point.x << point.y << point.entry << point.isHidden;
        reply << point.travel << point.travelExponent << point.steps;
        if (point.kind == HitKind::miss) return reply.all(std::array<int, 10>{}) << point.isIllegal;
        const EnvironmentTexel texel = march.texelOf(point, view);
        return reply.all(march.hitPosition(origin, direction, point)).all(texel.albedo).all(texel.normal)
               << march.hides(point, direction, hitDistance, isSeen, view) << (point.isIllegal || texel.isIllegal);
    }

    AttributeImage& image() {
        if (!image_) throw std::invalid_argument("no environment is loaded");
        return *image_;
    }

    std::optional<AttributeImage> image_;
};

} // namespace colonnade
