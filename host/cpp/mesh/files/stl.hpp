/// STL files, ASCII or binary. Their normals are those of the facets.
#pragma once

#include <cstring>

#include "mesh/files/reader.hpp"

namespace colonnade::mesh {

class StlReader : public MeshReader {
public:
    using MeshReader::MeshReader;

    bool begin(Text bytes) override {
        std::uint32_t count = 0;
        if (bytes.size() >= headerBytes) std::memcpy(&count, bytes.data() + headerBytes - 4, 4);
        const std::uint64_t stated = headerBytes + std::uint64_t{facetBytes} * count;
        const bool isBinary = bytes.size() >= headerBytes && bytes.size() == stated;
        return !isBinary && isAscii(bytes) ? readAscii(bytes) : readBinary(bytes, count);
    }

    bool finish(const std::vector<std::int32_t>&) override {
        for (std::size_t i = 0; i + 3 <= surface.vertices.size(); i += 3)
            surface.faces.push_back(
                {static_cast<std::int32_t>(i), static_cast<std::int32_t>(i + 1), static_cast<std::int32_t>(i + 2)});
        return true;
    }

private:
    static constexpr std::size_t headerBytes = 84, facetBytes = 50;

    /// Whether a file that is not whole as a binary one is text: some binary files begin with solid, too.
    static bool isAscii(Text bytes) {
        const std::string head = lowered(bytes.substr(0, 4096));
        return startsWith(trimmed(head), "solid") &&
               (head.find("facet") != std::string::npos || head.find("endsolid") != std::string::npos);
    }

    bool readAscii(Text bytes) {
        Words words(bytes);
        std::size_t facets = 0, ends = 0, corners = 0;
        bool isShort = false;
        for (Text word = words.next(); !word.empty(); word = words.next()) {
            const std::string name = lowered(word.substr(0, 9));
            ends += name == "endsolid";
            if (name == "facet") facets += lowered(Words(words.rest()).next()) == "normal";
            if (name != "vertex") continue;
            ++corners;
            Vector position{};
            for (double& value : position) {
                Words ahead = words;
                const Text number = ahead.next();
                const std::optional<double> found = numberOf(number);
                if (!found && (number.empty() || lowered(number) == "vertex" || lowered(number) == "endloop")) {
                    isShort = true;
                    break;
                }
                if (!found) return refuseValue(noNumber(number));
                value = *found;
                words = ahead;
            }
            surface.vertices.push_back(position);
        }
        if (corners != 3 * facets || ends == 0)
            return refuseTruncated("it begins " + grouped(facets) + " facets and has " + grouped(corners) +
                                   " of their vertices, and " + (ends ? "an" : "no") + " endsolid");
        if (facets == 0) return refuseAs("mesh " + where_ + " has no faces: its solids hold no facets");
        return !isShort || refuse("a vertex has fewer than 3 numbers");
    }

    bool readBinary(Text bytes, std::uint32_t count) {
        if (bytes.size() < headerBytes)
            return refuseTruncated("a binary STL file has " + std::to_string(headerBytes) + " bytes and its facets");
        const std::size_t present = (bytes.size() - headerBytes) / facetBytes;
        if (present < count)
            return refuseTruncated("its header states " + grouped(count) + " facets, it holds " + grouped(present));
        losses.add(lost::spareBytes, bytes.size() - headerBytes - facetBytes * count);
        std::size_t coloured = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const char* facet = bytes.data() + headerBytes + facetBytes * i;
            float corners[9];
            std::memcpy(corners, facet + 12, sizeof corners);
            for (int corner = 0; corner < 3; ++corner)
                surface.vertices.push_back({corners[3 * corner], corners[3 * corner + 1], corners[3 * corner + 2]});
            coloured += facet[48] != 0 || facet[49] != 0;
        }
        losses.add(lost::facetColours, coloured);
        return count > 0 || refuseAs("mesh " + where_ + " has no faces: its header states none");
    }
};

} // namespace colonnade::mesh
