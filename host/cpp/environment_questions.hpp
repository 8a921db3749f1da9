// Questions about the room's maps, after lines that fill them; those have no answer and come in this order:
//
//   layout word name=offset,width,signed ...                (once for each of the manifest's `attributes.layouts`)
//   sizes  name=value ...                                   (`attributes.sizes`)
//   words  memory bytes hexadecimal ...                     (once for each memory: bytes of a word, and the words)
//   albedo x y                                            -> r g b isIllegal
//   normal x y                                            -> x y z isIllegal
//   tile   x y                                            -> cellLog count ids[4] isIllegal
//   cell   x y                                            -> id isIllegal
//   plane  id                                             -> a b c exponent
//   shell  index                                          -> a b c exponent albedo[3] normal[3]
//   march  matrix[9] offset[3] offsetShift exponent rotation[9] stepX stepY boundingPlanes isSeen pixel[2] origin[3] direction[3]
//                                                         -> kind x y entry isHidden travel travelExponent steps point[3] albedo[3] normal[3] isIllegal
//          the point that the ray meets, or else (isSeen) that the pixel shows; all 0 of a point that there is not
#pragma once
#include <map>
#include <optional>
#include <vector>

#include "model/environment.hpp"
#include "questions.hpp"

namespace colonnade {

/// The maps that questions are about.
class Room {
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

    /// Once they are begun.
    const std::optional<AttributeImage>& maps() const { return image_; }

    bool knows(const std::string& kind) const {
        return kind == "albedo" || kind == "normal" || kind == "tile" || kind == "cell" || kind == "plane" || kind == "boundingPlane" || kind == "march";
    }

    Answer answer(const std::string& kind, Question& ask, const Numbers& numbers) {
        if (kind == "march") return march(ask, numbers);
        const int first = static_cast<int>(ask.number());
        Answer answer;
        if (kind == "plane") return put(answer, image().planeOf(first));
        if (kind == "boundingPlane") {
            const BoundingPlaneEntry& entry = image().boundingPlane(first);
            put(answer, entry.plane) << entry.albedo.r << entry.albedo.g << entry.albedo.b;
            return answer << entry.normal.x << entry.normal.y << entry.normal.z;
        }
        const int x = first, y = static_cast<int>(ask.number());
        if (!image().sizes().covers(x, y)) throw std::invalid_argument("a pixel outside the map");
        if (kind == "albedo") {
            const Rgb12 albedo = image().albedoAt(x, y);
            return answer << albedo.r << albedo.g << albedo.b << albedo.isIllegal;
        }
        if (kind == "normal") {
            const Normal12 normal = image().normalAt(x, y);
            return answer << normal.x << normal.y << normal.z << normal.isIllegal;
        }
        if (kind == "cell") {
            const CellPlane cell = image().cellAt(x, y);
            return answer << cell.id << cell.isIllegal;
        }
        const TileInfo tile = image().tileAt(x, y);
        return (answer << tile.cellLog2 << tile.count).all(tile.ids) << tile.isIllegal;
    }

private:
    static Answer& put(Answer& answer, const PlaneWord& plane) { return answer << plane.a << plane.b << plane.c << plane.e; }

    Answer march(Question& ask, const Numbers& numbers) {
        EnvironmentView view{};
        for (auto& row : view.matrix) row = ask.vector();
        view.offset = ask.vector();
        view.offsetShift = static_cast<int>(ask.number());
        view.exponent = static_cast<int>(ask.number());
        for (auto& row : view.rotation) row = ask.vector();
        for (auto& step : view.step) step = ask.number();
        view.boundingPlanes = static_cast<int>(ask.number());
        const bool isSeen = ask.number() != 0;
        const std::int64_t x = ask.number(), y = ask.number();
        const WideVector origin = ask.wideVector();
        Vector direction;
        blockScale(ask.wideVector(), numbers.shadeBits, direction);
        const Background background(numbers, image());
        const EnvironmentPoint point = isSeen ? background.seen(x, y, direction, view) : background.meet(origin, direction, view);
        Answer answer;
        answer << static_cast<int>(point.kind) << point.x << point.y << point.entry << point.isHidden;
        answer << point.travel << point.travelExponent << point.steps;
        if (point.kind == EnvironmentPoint::Kind::nothing) return answer.all(std::array<int, 9>{}) << point.isIllegal;
        const EnvironmentTexel texel = background.texelOf(point, view);
        return answer.all(background.reached(origin, direction, point)).all(texel.albedo).all(texel.normal) << (point.isIllegal || texel.isIllegal);
    }

    AttributeImage& image() {
        if (!image_) throw std::invalid_argument("there is no room yet");
        return *image_;
    }

    std::optional<AttributeImage> image_;
};

} // namespace colonnade
