// What the cycle model knows of a design: fields of its configuration, and latencies that follow from its number
// formats as in src/main/scala.
#pragma once
#include <algorithm>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>

#include "bounce_program.hpp"
#include "model/formats.hpp"

namespace colonnade::cycles {

/// Records of a line of the caches.
constexpr std::uint32_t lineRecords = 2;

/// A column cache; 0 lines: there is none.
struct CacheDesign {
    int lines, ways, misses, sharedLines, sharedWays, sharedMisses, busBytes;
};

/// How DRAM answers: cycles to the first beat of a line, and from a beat to the next.
struct DramDesign {
    int latency = 100, interval = 1;
};

struct Design {
    int rows, columns, contexts, pathContexts;
    int boxLanes, triangleLanes, triangleRows, marches;
    int banks, recordBuffers, readLatency;
    bool snooping, bvh, isSequentialSetup, isSequentialShader, extraSlices, hasCache, hasEnvironment, hasBounces,
        hasGather, hasColours;
    CacheDesign cache;
    int tileSize, coordinateBits, lights, columnsPerCopy;
    int recordBytes;

    /// Stages of ray set-up; cycles from the entry of the shader to the light; steps of a triangle's division.
    int setupStages, shadeLight, divisionSteps;
    /// Of sequential ray set-up: cycles of the entry, of one that misses the box, and of the quotients.
    int entryCycles, missCycles, quotientCycles;
    /// Of the sequential shader: cycles of a hit in the geometry with one light, and from there to its light.
    int geometryCycles, cosineCycles;
    BounceCycles bounceCycles;

    explicit Design(const std::map<std::string, std::int64_t>& values) {
        const auto take = [&](const char* key) { return static_cast<int>(lookUp(values, key)); };
        const auto limit = [&](const char* key, std::int64_t most) {
            if (lookUp(values, key) > most)
                throw std::invalid_argument(std::string(key) + " = " + std::to_string(lookUp(values, key)) +
                                            ": the cycle model takes at most " + std::to_string(most));
        };
        limit("array.rows", 31), limit("array.columns", 32), limit("units.pathContexts", 256),
            limit("frame.instances", 0), limit("units.extraSlices", 0);
        rows = take("array.rows"), columns = take("array.columns"), contexts = take("array.contexts"),
        pathContexts = take("units.pathContexts");
        boxLanes = take("units.boxLanes"), triangleLanes = take("units.triangleLanes"), marches = take("units.marches");
        triangleRows = std::min(take("units.triangleRows"), rows);
        banks = take("columnBvhMemory.banks"), recordBuffers = take("columnBvhMemory.recordBuffers"),
        readLatency = take("columnBvhMemory.readLatency");
        snooping = take("columnBvhMemory.snooping") != 0, bvh = take("geometry.bvh") != 0,
        extraSlices = take("units.extraSlices") != 0;
        isSequentialSetup = take("units.rayInterval") >= 32, isSequentialShader = take("units.shadeInterval") >= 128;
        hasCache = values.count("columnBvhMemory.cache.lines") != 0;
        cache = {};
        if (hasCache) {
            const auto field = [&](const char* key) {
                return take((std::string("columnBvhMemory.cache.") + key).c_str());
            };
            cache = {field("lines"),      field("ways"),         field("misses"),  field("sharedLines"),
                     field("sharedWays"), field("sharedMisses"), field("busBytes")};
            if (cache.sharedLines == 0)
                throw std::invalid_argument(
                    "columnBvhMemory.cache.sharedLines = 0: the cycle model needs a shared cache");
        }
        hasEnvironment = values.count("physicalAttributeMemory.width") != 0;
        columnsPerCopy = hasEnvironment ? std::min(take("physicalAttributeMemory.columnsPerCopy"), columns) : 1;
        hasBounces = take("frame.maxBounces") > 0, hasGather = take("frame.gather") != 0;
        hasColours = take("geometry.cornerColours") != 0;
        tileSize = take("frame.tileSize"), lights = take("frame.lights"), coordinateBits = take("coordinateBits"),
        recordBytes = take("recordBytes");

        // ray/SetupStages.scala
        const auto dividerStages = [](int digits) { return (digits + 2) / 2; };
        const int reciprocals = 1 + dividerStages(take("reciprocalDigits")),
                  shearQuotients = 1 + dividerStages(take("shearDigits"));
        const int entry = reciprocals + 4, shears = std::max(shearQuotients, reciprocals - 2) + 1;
        setupStages = std::max(entry, shears) + 3;

        // shading/AngleStage.scala, BrightnessStage.scala
        const auto intervals = [](int digits) { return (std::max(digits, 1) - 1) / 9 + 1; };
        const int normal = hasGather ? 18 : 7, lengths = std::max(normal, 12) + 9;
        const int root = lengths + 1 + 3 * intervals((take("radicandBits") + 1) / 2),
                  cosine = root + 1 + 3 * intervals(take("cosineFraction")) + 1;
        shadeLight = cosine + (hasGather ? 11 : 0) + 7;

        // ray/EntryControl.scala, RaySetup.scala
        const int slices = (take("shearFraction") + take("reciprocalFraction") + 3) / (take("reciprocalFraction") + 2),
                  late = extraSlices ? 1 : 0;
        entryCycles = 10 + 2 * slices + 6 * late, missCycles = 12 + 5 * late;
        quotientCycles = std::max(take("shearDigits") / 4, take("reciprocalDigits") / 2) + 2;

        // shading/ShaderGeometry.scala, CosineUnit.scala, DirectUnit.scala. The shifts of the cosine and a light's
        // falloff take some cycles: 20 fit the counters of preset tiny
        const int shadeBits = take("shadeBits");
        geometryCycles = 37 + 2 * ((take("shearFraction") + 1 + shadeBits) / shadeBits) + 5 * late;
        cosineCycles = (take("radicandBits") + 1) / 2 + take("cosineFraction") / 2 + 20;

        bounceCycles =
            BounceProgram(take("gridBits"), take("rootBits"), take("radicandBits"), take("cosineFraction")).cycles();

        // traversal/WeightStage.scala: radix 4, two digits a cycle
        divisionSteps = take("distanceDigits") / 4 + 1;
    }

    int boxBeats() const { return nodeChildren / boxLanes; }
    bool sharesTriangles() const { return triangleRows > 1; }

    /// A choice among so many contexts takes a cycle of its own.
    bool isLarge() const { return pathContexts > 16 || extraSlices; }

    /// The bank of a record, and of a line its number in the bank.
    int bankOf(std::uint32_t address) const {
        return static_cast<int>((hasCache ? address / (2 * lineRecords) : address) &
                                static_cast<std::uint32_t>(banks - 1));
    }
    std::uint32_t lineOf(std::uint32_t address) const {
        const std::uint32_t pair = address / (2 * lineRecords);
        return pair / static_cast<std::uint32_t>(banks) * 2 + (address / lineRecords & 1);
    }
    std::uint32_t recordOf(std::uint32_t line, int bank) const {
        return ((line / 2 * static_cast<std::uint32_t>(banks) + static_cast<std::uint32_t>(bank)) * 2 + (line & 1)) *
               lineRecords;
    }
};

} // namespace colonnade::cycles
